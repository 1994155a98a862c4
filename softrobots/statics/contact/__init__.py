"""Equilibrium in contact with obstacles: contacts and their forces, the solver, and which contacts are pressed."""
