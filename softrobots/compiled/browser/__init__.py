"""Equilibria in a page: a generated module as one script in JavaScript."""
