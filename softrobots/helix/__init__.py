"""Helical actuation of an inflated tube in closed form; [Blumenschein 2018]. Needs NumPy alone."""

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

__all__ = [
    "HANDEDNESS",
    "PATHS",
    "Actuator",
    "HelixShape",
    "actuator_curvature_torsion",
    "actuator_tension",
    "binormals",
    "centre_length",
    "curvature_torsion",
    "forward",
    "frames",
    "height",
    "inverse",
    "length_for_turns",
    "material_twist",
    "measure",
    "normals",
    "points",
    "tangents",
    "transform_base_to_axis",
    "turn_angle",
    "turns",
    "volume",
]
