"""What `softrobots.jax` and `softrobots.torch` share: solvers as functions with derivatives, in NumPy."""
