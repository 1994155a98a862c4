"""Actuators on routes through a chain: their lengths, tensions and couplings, as code that loops over them."""
