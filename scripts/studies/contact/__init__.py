"""Robots in contact; see scripts/contact.py and scripts/helix_grip.py."""
