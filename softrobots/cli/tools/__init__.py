"""Installed packages, and the kinematics of URDF files in other tools: what `doctor` and `urdf --check` look at."""
