"""Scalar expressions that are recorded instead of computed, and the straight-line code made of them."""
