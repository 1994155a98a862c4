"""The force at the tip from motor torques: search, measured torques, errors of measurement."""
