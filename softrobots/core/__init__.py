"""Argument checks, errors, and safe reading and writing of files; no robotics."""
