"""Random and hard cases for every solver, checked by independent statics; see scripts/soak.py."""
