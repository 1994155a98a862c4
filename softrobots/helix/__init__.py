"""Helical actuation of an inflated tube in closed form; [Blumenschein 2018]. Needs NumPy alone."""

from softrobots.helix.actuator_table import INTERPOLATIONS, ActuatorTable
from softrobots.helix.atlas import ShapeRow, ShapeTable, paper_grid, shape_table
from softrobots.helix.contact import (
    ON_CONTACT,
    SelfContact,
    SelfContactWarning,
    check_self_contact,
    contraction_limit,
    self_contact,
    simple_contraction_limit,
)
from softrobots.helix.grasping import PAPER_CYLINDER, GraspForce, GraspTest, grasp_force
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
from softrobots.helix.shapes import HANDEDNESS, PATHS, Actuator, HelixShape, forward, inverse, measure
from softrobots.helix.tube import actuator_tension, centre_length, height, length_for_turns, material_twist, turns, volume
from softrobots.helix.varying import BentTube, bent_tube

__all__ = [
    "HANDEDNESS",
    "INTERPOLATIONS",
    "ON_CONTACT",
    "PAPER_CYLINDER",
    "PATHS",
    "Actuator",
    "ActuatorTable",
    "BentTube",
    "GraspForce",
    "GraspTest",
    "HelixShape",
    "SelfContact",
    "SelfContactWarning",
    "ShapeRow",
    "ShapeTable",
    "actuator_curvature_torsion",
    "actuator_tension",
    "bent_tube",
    "binormals",
    "centre_length",
    "check_self_contact",
    "contraction_limit",
    "curvature_torsion",
    "forward",
    "frames",
    "grasp_force",
    "height",
    "inverse",
    "length_for_turns",
    "material_twist",
    "measure",
    "normals",
    "paper_grid",
    "points",
    "self_contact",
    "shape_table",
    "simple_contraction_limit",
    "tangents",
    "transform_base_to_axis",
    "turn_angle",
    "turns",
    "volume",
]
