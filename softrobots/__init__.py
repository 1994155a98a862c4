"""Soft robots as rigid-body robot descriptions, with certified statics and inverse kinematics on Pinocchio."""

import importlib
from typing import TYPE_CHECKING, Any

import softrobots.compiled.run.motion_batch
import softrobots.dynamics.saved_motion
import softrobots.identification.saved_identification
import softrobots.statics.contact.saved_path  # noqa: F401  (adds the kinds of results that can be saved)
from softrobots import constant_curvature, export, helix, inflated_beam
from softrobots.core.errors import (
    ClusterError,
    DescriptionError,
    EquilibriumNotFound,
    FieldNotFound,
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
from softrobots.core.result_file import load_result, save_csv, save_result, to_dataframe
from softrobots.core.suspicion import SuspiciousInputWarning
from softrobots.description.composition import mount
from softrobots.dynamics.controllers import PD, ClosedLoop
from softrobots.dynamics.damping import damping_time_from_decrement
from softrobots.dynamics.input_shaping import InputShaper, ShapedTrajectory, input_shaper, residual_vibration, shape_input
from softrobots.dynamics.linear_model import LinearModel, linearize
from softrobots.dynamics.motion import Motion, MotionState
from softrobots.dynamics.ring_down import RingDown, ring_down
from softrobots.dynamics.simulation import simulate
from softrobots.dynamics.vibration import VibrationModes, vibration_modes
from softrobots.environment.capsule_error import capsule_error
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere
from softrobots.identification.cross_validation import CrossValidation, cross_validate
from softrobots.identification.identification import Identification
from softrobots.identification.identify import identify
from softrobots.identification.informative_poses import InformativePoses, informative_poses
from softrobots.identification.measurements import Measurements
from softrobots.identification.sensitivity import Sensitivity, sensitivity
from softrobots.model.link_limits import LinkLimits
from softrobots.model.loader import load_model, with_points, with_springs
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import SpringGroup
from softrobots.robots import ROBOTS, AssumedStiffnessWarning, HelixTube, InflatableArm, PccArm, Route, TendonArm
from softrobots.robots.growth import grown_coordinates
from softrobots.statics.buckling.critical_load import critical_load
from softrobots.statics.buckling.equilibrium_branch import EquilibriumBranch
from softrobots.statics.buckling.post_buckling import post_buckling_branches
from softrobots.statics.contact.contact_path import ContactPath
from softrobots.statics.contact.contact_sensitivity import contact_sensitivity
from softrobots.statics.contact.follow_contact import follow_contact
from softrobots.statics.contact.grasp import contact_wrench, is_force_closure, pull_out_force
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.imposed_displacement import ImposedDisplacement, solve_imposed_displacement
from softrobots.statics.inverse_kinematics import IkSolution, solve_ik
from softrobots.statics.load_estimation import LoadEstimate, estimate_load
from softrobots.statics.loads import EARTH_GRAVITY, distributed_force
from softrobots.statics.sensitivity import compliance, elastostatic_jacobian
from softrobots.statics.stability import Stability
from softrobots.statics.time_law import Path3D, quintic, read_waypoints, straight_line, waypoints
from softrobots.statics.tip_force.contact_place import locate_contact
from softrobots.statics.trajectory import Trajectory, follow_trajectory
from softrobots.statics.workspace import Workspace, sample_workspace
from softrobots.version import __version__
from softrobots.view.figures.picture import plot
from softrobots.view.interactive_page import interactive
from softrobots.view.viewer import Viewer, view

if TYPE_CHECKING:
    from softrobots.compiled.run.compiled_model import compile_model as compile  # noqa: F401  (in __all__ it would hide the builtin)

__all__ = [
    "EARTH_GRAVITY",
    "PD",
    "ROBOTS",
    "AssumedStiffnessWarning",
    "Box",
    "Capsule",
    "ClosedLoop",
    "ClusterError",
    "ContactPath",
    "CrossValidation",
    "Cylinder",
    "DescriptionError",
    "Environment",
    "Equilibrium",
    "EquilibriumBranch",
    "EquilibriumNotFound",
    "FieldNotFound",
    "FileFormatError",
    "HalfSpace",
    "HelixTube",
    "Identification",
    "IkSolution",
    "ImposedDisplacement",
    "InflatableArm",
    "InformativePoses",
    "InputShaper",
    "LinearModel",
    "LinkLimits",
    "LoadEstimate",
    "LoadNotFound",
    "Measurements",
    "Mesh",
    "MissingDependency",
    "Motion",
    "MotionState",
    "NameNotFound",
    "NeutralEquilibrium",
    "NoCriticalLoad",
    "NotConverged",
    "OutputError",
    "OutputExists",
    "ParameterError",
    "Path3D",
    "PccArm",
    "RingDown",
    "Route",
    "SelfIntersection",
    "Sensitivity",
    "ShapedTrajectory",
    "SoftModel",
    "SoftRobotsError",
    "Sphere",
    "SpringGroup",
    "Stability",
    "StraightTube",
    "SuspiciousInputWarning",
    "TargetUnreachable",
    "TendonArm",
    "Trajectory",
    "VibrationModes",
    "Viewer",
    "ViewerError",
    "Workspace",
    "__version__",
    "capsule_error",
    "compliance",
    "constant_curvature",
    "contact_sensitivity",
    "contact_wrench",
    "critical_load",
    "cross_validate",
    "damping_time_from_decrement",
    "distributed_force",
    "elastostatic_jacobian",
    "estimate_load",
    "export",
    "follow_contact",
    "follow_trajectory",
    "grown_coordinates",
    "helix",
    "identify",
    "inflated_beam",
    "informative_poses",
    "input_shaper",
    "interactive",
    "is_force_closure",
    "linearize",
    "load_model",
    "load_result",
    "locate_contact",
    "mount",
    "plot",
    "post_buckling_branches",
    "pull_out_force",
    "quintic",
    "read_waypoints",
    "residual_vibration",
    "ring_down",
    "sample_workspace",
    "save_csv",
    "save_result",
    "sensitivity",
    "shape_input",
    "simulate",
    "solve_equilibrium",
    "solve_ik",
    "solve_imposed_displacement",
    "straight_line",
    "to_dataframe",
    "vibration_modes",
    "view",
    "waypoints",
    "with_points",
    "with_springs",
]


def __getattr__(name: str) -> Any:
    """Import the compiled solvers, a fifth of all other imports, and functions of JAX and PyTorch when they are asked for."""
    if name in ("jax", "torch"):
        return importlib.import_module(f"softrobots.{name}")
    if name != "compile":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from softrobots.compiled.run.compiled_model import compile_model

    globals()["compile"] = compile_model
    return compile_model


def __dir__() -> list[str]:
    """What completion offers: public names, with those that are imported when they are asked for."""
    return [*__all__, "compile", "jax", "torch"]
