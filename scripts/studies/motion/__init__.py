"""Motions of the documentation and of `scripts/motion.py`."""
