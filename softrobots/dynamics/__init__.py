"""Motion of robots: vibration modes, time stepping, linear models, input shaping."""
