"""Errors of parameters identified from noisy measurements of synthetic robots."""
