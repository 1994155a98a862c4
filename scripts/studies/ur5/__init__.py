"""A UR5 with a soft arm on its flange, and a UR5 that pushes a clamped inflated link; see scripts/ur5_*.py."""
