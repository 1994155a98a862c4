"""Recordings of a tendon-driven arm against predictions with nominal parameters; see scripts/measured_arm.py."""
