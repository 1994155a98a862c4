"""The module that is generated for one robot: traced functions and drivers put together."""
