"""Grips of robots around objects; see scripts/helix_grip.py."""
