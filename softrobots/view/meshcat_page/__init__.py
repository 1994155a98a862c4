"""The meshcat page of `softrobots.view.viewer`: server, drawing, and self-contained files."""
