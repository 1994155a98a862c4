"""Small changes of the package, and whether a test notices each; see scripts/mutation.py."""
