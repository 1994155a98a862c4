"""Contact forces in MuJoCo and Drake against ours; see scripts/contact_forces.py."""
