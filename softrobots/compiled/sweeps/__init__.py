"""Sweeps over millions of targets and loads with the compiled solvers, in this process or on a Dask cluster."""

from softrobots.compiled.sweeps.mapping import map_workspace
from softrobots.statics.workspace_map import TargetGrid, WorkspaceMap

__all__ = ["TargetGrid", "WorkspaceMap", "map_workspace"]
