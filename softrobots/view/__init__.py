"""Looking at a robot: meshcat, viser, live views, self-contained pages and figures."""
