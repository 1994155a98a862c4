"""Loops around the traced functions, in the kernel language: Newton's method, energy descent, searches, paths, batches."""
