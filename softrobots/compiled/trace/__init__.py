"""Tracing: scalar expressions that are recorded instead of computed, and straight-line code made of them."""
