"""The meshcat page of `softrobots.viewer`: its server, what is drawn on it, and pages as self-contained files."""
