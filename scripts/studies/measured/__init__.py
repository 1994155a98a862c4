"""Models beside measurements that others have published: `scripts/measured.py`."""
