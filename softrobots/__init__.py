"""Soft robots as rigid-body robot descriptions, with certified statics and inverse kinematics on Pinocchio."""

from typing import TYPE_CHECKING, Any

from softrobots import constant_curvature, export, helix, inflated_beam
from softrobots.composition import mount
from softrobots.equilibrium import Equilibrium, solve_equilibrium
from softrobots.errors import (
    ClusterError,
    DescriptionError,
    EquilibriumNotFound,
    FileFormatError,
    LoadNotFound,
    MissingDependency,
    NameNotFound,
    NeutralEquilibrium,
    NoCriticalLoad,
    NotConverged,
    OutputError,
    OutputExists,
    ParameterError,
    SelfIntersection,
    SoftRobotsError,
    StraightTube,
    TargetUnreachable,
    ViewerError,
)
from softrobots.growth import grown_coordinates
from softrobots.imposed_displacement import ImposedDisplacement, solve_imposed_displacement
from softrobots.inverse_kinematics import IkSolution, solve_ik
from softrobots.load_estimation import LoadEstimate, estimate_load
from softrobots.loader import load_model
from softrobots.loads import EARTH_GRAVITY, distributed_force
from softrobots.model import SoftModel, SpringGroup
from softrobots.post_buckling import EquilibriumBranch, post_buckling_branches
from softrobots.results_io import load_result, save_csv, save_result
from softrobots.robots import ROBOTS, HelixTube, InflatableArm, PccArm
from softrobots.sensitivity import compliance, elastostatic_jacobian
from softrobots.stability import critical_load
from softrobots.time_law import Path3D, quintic, read_waypoints, straight_line, waypoints
from softrobots.trajectory import Trajectory, follow_trajectory
from softrobots.viewer import Viewer, view
from softrobots.workspace import Workspace, sample_workspace

if TYPE_CHECKING:
    from softrobots.kernels.compiled_model import compile_model as compile  # noqa: F401  (in __all__ it would hide the builtin)

__version__ = "0.1.0"

__all__ = [
    "EARTH_GRAVITY",
    "ROBOTS",
    "ClusterError",
    "DescriptionError",
    "Equilibrium",
    "EquilibriumBranch",
    "EquilibriumNotFound",
    "FileFormatError",
    "HelixTube",
    "IkSolution",
    "ImposedDisplacement",
    "InflatableArm",
    "LoadEstimate",
    "LoadNotFound",
    "MissingDependency",
    "NameNotFound",
    "NeutralEquilibrium",
    "NoCriticalLoad",
    "NotConverged",
    "OutputError",
    "OutputExists",
    "ParameterError",
    "Path3D",
    "PccArm",
    "SelfIntersection",
    "SoftModel",
    "SoftRobotsError",
    "SpringGroup",
    "StraightTube",
    "TargetUnreachable",
    "Trajectory",
    "Viewer",
    "ViewerError",
    "Workspace",
    "__version__",
    "compliance",
    "constant_curvature",
    "critical_load",
    "distributed_force",
    "elastostatic_jacobian",
    "estimate_load",
    "export",
    "follow_trajectory",
    "grown_coordinates",
    "helix",
    "inflated_beam",
    "load_model",
    "load_result",
    "mount",
    "post_buckling_branches",
    "quintic",
    "read_waypoints",
    "sample_workspace",
    "save_csv",
    "save_result",
    "solve_equilibrium",
    "solve_ik",
    "solve_imposed_displacement",
    "straight_line",
    "view",
    "waypoints",
]


def __getattr__(name: str) -> Any:
    """Import the compiled solvers when they are asked for: a fifth of all other imports."""
    if name != "compile":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from softrobots.kernels.compiled_model import compile_model

    globals()["compile"] = compile_model
    return compile_model
