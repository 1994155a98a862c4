"""Statics of a chain in traced expressions: passes over its elements, elimination, Newton step, response of the tip."""
