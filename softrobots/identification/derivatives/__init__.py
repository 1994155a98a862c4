"""Parts of the derivatives of equilibria: joints under loads, springs, actuators, frequencies."""
