"""A soak: random and hard cases for every solver, each answer checked by statics that shares nothing with them.

`scripts/soak.py` runs it and records the table of `docs/validation.md`.
"""
