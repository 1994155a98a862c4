"""Motor paths and controllers of the inflatable arm in motion; see scripts/controllers.py."""
