"""Chains of the helical tube against the analytic helix; see scripts/helix_validation.py."""
