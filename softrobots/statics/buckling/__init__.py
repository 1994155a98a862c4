"""Buckling: paths of equilibria under a growing force, where they lose their stability, and the branches from there."""
