"""The same robots in other tools, against Pinocchio; see scripts/interoperability.py."""
