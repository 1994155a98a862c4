"""Damaged files for every reader of the package; see scripts/fuzz_readers.py."""
