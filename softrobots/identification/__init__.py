"""Parameters of a robot: derivatives by them, and identification from measurements."""
