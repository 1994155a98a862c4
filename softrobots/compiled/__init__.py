"""Fast solvers of serial chains as generated code (trace -> chain -> drivers -> program -> c or run), and sweeps."""

from softrobots.compiled.statuses import Status

__all__ = ["Status"]
