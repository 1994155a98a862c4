"""Running a generated module in plain Python or compiled by numba, for one case or many: `CompiledModel`."""
