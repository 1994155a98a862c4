"""Pseudo-rigid links of the inflatable arm against inflated beams; see scripts/beam_validity.py."""
