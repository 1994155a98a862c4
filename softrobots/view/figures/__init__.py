"""Figures of robots and results. Needs matplotlib (extra `plot`)."""
