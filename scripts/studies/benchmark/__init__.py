"""Solvers of the package timed against baselines; see scripts/benchmark.py."""
