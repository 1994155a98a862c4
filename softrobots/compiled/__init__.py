"""Compiled solvers of serial chains: equilibria, loads and inverse kinematics, single and in batches."""

from softrobots.compiled.statuses import Status

__all__ = ["Status"]
