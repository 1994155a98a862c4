"""The generated module of a robot: constants, traced functions and drivers as one text."""
