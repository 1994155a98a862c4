"""The meshcat page of `softrobots.view.viewer`: its server, what is drawn on it, and pages as self-contained files."""
