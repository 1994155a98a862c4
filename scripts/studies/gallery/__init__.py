"""The scenes of the documentation; see scripts/make_pictures.py and scripts/make_pages.py."""
