"""Equilibria in contact in functions that numba compiles: chain, surfaces of obstacles, and search."""
