"""Checks of input, errors, safe files and records; no robotics."""
