"""Constant-curvature kinematics in closed form: muscles, arcs, poses, chains and their Jacobians; [PCC paper]."""

from softrobots.constant_curvature.arcs import Arc, arc_from_strains, strains_from_arc
from softrobots.constant_curvature.jacobians import (
    arc_jacobian,
    chain_arc_jacobian,
    chain_muscle_jacobian,
    muscle_jacobian,
    strain_jacobian,
)
from softrobots.constant_curvature.muscles import (
    AZIMUTHS,
    arc_from_muscles,
    muscle_residual,
    muscles_from_arc,
    strains_from_muscles,
)
from softrobots.constant_curvature.poses import backbone, chain_transform, chain_transforms, transform

__all__ = [
    "AZIMUTHS",
    "Arc",
    "arc_from_muscles",
    "arc_from_strains",
    "arc_jacobian",
    "backbone",
    "chain_arc_jacobian",
    "chain_muscle_jacobian",
    "chain_transform",
    "chain_transforms",
    "muscle_jacobian",
    "muscle_residual",
    "muscles_from_arc",
    "strain_jacobian",
    "strains_from_arc",
    "strains_from_muscles",
    "transform",
]
