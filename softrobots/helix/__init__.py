"""Helical actuation of an inflated tube in closed form; [Blumenschein 2018]. NumPy alone; `bent_tube` needs SciPy too."""

from softrobots.helix.actuators import ActuatorTable, contraction_from_stoppers
from softrobots.helix.contact import (
    SelfContact,
    check_self_contact,
    contraction_limit,
    self_contact,
    simple_contraction_limit,
)
from softrobots.helix.design import DesignWarning, Deviation, HelixDesign, Wish
from softrobots.helix.grasping import PAPER_CYLINDER, GraspForce, GraspTest, grasp_force
from softrobots.helix.inverse_design import ON_UNREALISABLE, design_antenna, design_grasp
from softrobots.helix.paths import (
    actuator_curvature_torsion,
    binormals,
    curvature_torsion,
    frames,
    normals,
    points,
    tangents,
    transform_base_to_axis,
    turn_angle,
)
from softrobots.helix.pattern import METHODS, Pattern, SheetPoints, pinch_pattern
from softrobots.helix.pattern_error import DiscreteCentreLine, ShapeError, discrete_centre_line, shape_error
from softrobots.helix.shapes import HANDEDNESS, PATHS, Actuator, HelixShape, forward, inverse, measure
from softrobots.helix.template import write_template, write_template_table
from softrobots.helix.tube import actuator_tension, centre_length, height, length_for_turns, material_twist, turns, volume
from softrobots.helix.varying_actuator import BentTube, bent_tube

__all__ = [
    "HANDEDNESS",
    "METHODS",
    "ON_UNREALISABLE",
    "PAPER_CYLINDER",
    "PATHS",
    "Actuator",
    "ActuatorTable",
    "BentTube",
    "DesignWarning",
    "Deviation",
    "DiscreteCentreLine",
    "GraspForce",
    "GraspTest",
    "HelixDesign",
    "HelixShape",
    "Pattern",
    "SelfContact",
    "ShapeError",
    "SheetPoints",
    "Wish",
    "actuator_curvature_torsion",
    "actuator_tension",
    "bent_tube",
    "binormals",
    "centre_length",
    "check_self_contact",
    "contraction_from_stoppers",
    "contraction_limit",
    "curvature_torsion",
    "design_antenna",
    "design_grasp",
    "discrete_centre_line",
    "forward",
    "frames",
    "grasp_force",
    "height",
    "inverse",
    "length_for_turns",
    "material_twist",
    "measure",
    "normals",
    "pinch_pattern",
    "points",
    "self_contact",
    "shape_error",
    "simple_contraction_limit",
    "tangents",
    "transform_base_to_axis",
    "turn_angle",
    "turns",
    "volume",
    "write_template",
    "write_template_table",
]
