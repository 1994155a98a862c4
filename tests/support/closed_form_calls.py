"""Every function of the closed forms, with arguments that it takes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import softrobots as sr
from softrobots import constant_curvature as cc
from softrobots import helix, inflated_beam
from softrobots.compiled.sweeps import TargetGrid

ARC = cc.Arc(0.5, 0.8, 0.7)
SHAPE = helix.forward(0.66, 0.0873, 0.0331)
DESIGN = helix.design_antenna(0.07, 0.18, diameter=0.0331, turns=3)
PLAN = helix.pinch_pattern(helix.HelixDesign(0.66, 0.0873, 0.0331, 0.4), 0.02)
TABLE = helix.ActuatorTable([0.0, 5e4, 8e4], [0.6, 0.7, 0.8])
BENT = np.linspace(0.001, 0.25, 12)
WALL = {"length": 0.6, "radius": 0.055, "wall_thickness": 0.0005, "pressure": 3e4, "poisson_ratio": 0.3}
ACTUATOR = {"contraction": 0.66, "angle": 0.0873, "diameter": 0.0331}
CURVE = {"shape": SHAPE, "s": 1.0, "path": "inner", "handedness": "left"}
MUSCLES = {"lengths": [0.5, 0.51, 0.52], "distance": 0.04, "azimuths": [0.0, 2.0, 4.0]}
CHAIN = {"arcs": [ARC, ARC], "offsets": [0.0, 1.0], "frame": "torsion_free"}
DESIGNED = {"turn_height": 0.18, "diameter": 0.0331, "turns": 3.0, "handedness": "right", "on_unrealisable": "error"}


def _whole_arc(length: Any, bending: Any, azimuth: Any, s: Any) -> Any:
    arc = cc.Arc(length, bending, azimuth)
    strains = cc.strains_from_arc(arc)
    poses = [cc.transform(arc), cc.backbone(arc, s), cc.chain_transforms([arc, arc])]
    return (
        *poses,
        cc.arc_jacobian(arc),
        cc.chain_arc_jacobian([arc, arc]),
        cc.strain_jacobian(strains),
        cc.arc_from_strains(strains),
    )


def _whole_helix(outer_radius: Any, inner_radius: Any, pitch: Any, turns: Any, length: Any) -> Any:
    shape = helix.HelixShape(outer_radius, inner_radius, pitch)
    contact = helix.self_contact(shape, turns)
    found = helix.forward(*helix.inverse(shape)), helix.curvature_torsion(shape), helix.transform_base_to_axis(shape)
    return shape, contact, str(contact), helix.height(shape, 0.1, length), helix.turn_angle(shape, length), *found


def _whole_test(angle: Any, displacement: Any, force: Any, **geometry: Any) -> Any:
    test = inflated_beam.BendingTest(**geometry)
    found = test.displacement(angle), test.angle(displacement), test.contact(angle), test.moment(displacement, force)
    return test.arm, *found, test.small_angles(displacement, force)


def _whole_design(**arguments: Any) -> Any:
    design = helix.HelixDesign(**arguments)
    return design, design.summary()


def _wish(**arguments: Any) -> Any:
    return _whole_design(**ACTUATOR, turns=3.0, wish=helix.Wish(**arguments))


def _tabulated(moment: Any, radius: Any) -> Any:
    """Without the infinity that stands for moments beyond the table, in arrays."""
    found = inflated_beam.required_tabulated_pressure(moment, radius)
    return np.minimum(found, 1e9) if isinstance(found, np.ndarray) else found


CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "wrinkling_moment": (inflated_beam.wrinkling_moment, {"pressure": 3e4, "radius": 0.055}),
    "required_pressure": (inflated_beam.required_pressure, {"moment": 10.0, "radius": 0.055}),
    "required_tabulated_pressure": (_tabulated, {"moment": 10.0, "radius": 0.055}),
    "deflection": (inflated_beam.deflection, {"position": 0.3, "force": 1.0, "young_modulus": 1e8, **WALL}),
    "stiffness_from_young_modulus": (inflated_beam.stiffness_from_young_modulus, {"young_modulus": 1e8, **WALL}),
    "young_modulus_from_stiffness": (inflated_beam.young_modulus_from_stiffness, {"stiffness": 170.0, **WALL}),
    "beam_stiffness": (
        inflated_beam.beam_stiffness,
        {"young_modulus": 1e8, "shear_modulus": 3e7, **{name: WALL[name] for name in ("pressure", "radius", "wall_thickness")}},
    ),
    "two_hinges": (partial(inflated_beam.two_hinges, inflated_beam.BeamStiffness(36.0, 4000.0, 29.0)), {"length": 0.6}),
    "moment": (inflated_beam.moment, {"angle": 0.1, "stiffness": 170.0, "max_moment": 20.0}),
    "moment_limits": (inflated_beam.moment_limits, {"pressure": 3e4, "radius": 0.055, "axial_force": -50.0}),
    "slack_wall_moment": (inflated_beam.slack_wall_moment, {"angle": 0.1, "stiffness": 170.0, "slack_moment": 12.0}),
    "fit_characterisation": (
        inflated_beam.fit_characterisation,
        {"angle": BENT, "moment": np.minimum(170.0 * BENT, 20.0), "pressure": 3e4, "radius": 0.055},
    ),
    "BendingTest": (
        _whole_test,
        {"probe_distance": 0.5, "hinge_offset": 0.03, "offset": 0.06, "angle": 0.1, "displacement": 0.05, "force": 10.0},
    ),
    "Arc": (_whole_arc, {"length": 0.5, "bending": 0.8, "azimuth": 0.7, "s": [0.0, 0.5]}),
    "arc_from_strains": (cc.arc_from_strains, {"strains": [0.1, 0.2, 0.0, 0.5]}),
    "strain_jacobian": (cc.strain_jacobian, {"strains": [0.1, 0.2, 0.0, 0.5]}),
    "strains_from_arc": (cc.strains_from_arc, {"arc": ARC}),
    "arc_jacobian": (cc.arc_jacobian, {"arc": ARC, "frame": "bending_plane"}),
    "transform": (cc.transform, {"arc": ARC, "frame": "bending_plane"}),
    "backbone": (cc.backbone, {"arc": ARC, "s": [0.0, 0.5]}),
    "chain_transform": (cc.chain_transform, CHAIN),
    "chain_transforms": (cc.chain_transforms, CHAIN),
    "chain_arc_jacobian": (cc.chain_arc_jacobian, CHAIN),
    "muscles_from_arc": (cc.muscles_from_arc, {"arc": ARC, "distance": 0.04, "azimuths": cc.AZIMUTHS}),
    "arc_from_muscles": (cc.arc_from_muscles, {**MUSCLES, "tolerance": 1e-6}),
    "strains_from_muscles": (cc.strains_from_muscles, {**MUSCLES, "tolerance": 1e-6}),
    "muscle_residual": (cc.muscle_residual, MUSCLES),
    "muscle_jacobian": (cc.muscle_jacobian, {**MUSCLES, "frame": "bending_plane", "tolerance": 1e-6}),
    "chain_muscle_jacobian": (
        cc.chain_muscle_jacobian,
        {**MUSCLES, "lengths": [[0.5, 0.51, 0.52]] * 2, "offsets": [0.0, 1.0], "frame": "torsion_free", "tolerance": 1e-6},
    ),
    "forward": (helix.forward, ACTUATOR),
    "actuator_curvature_torsion": (helix.actuator_curvature_torsion, {**ACTUATOR, "path": "centre", "handedness": "right"}),
    "material_twist": (helix.material_twist, {**ACTUATOR, "handedness": "right"}),
    "actuator_tension": (helix.actuator_tension, {**ACTUATOR, "pressure": 1e4}),
    "volume": (helix.volume, {**ACTUATOR, "length": 1.0}),
    "centre_length": (helix.centre_length, {"contraction": 0.66, "angle": 0.0873, "length": 1.0}),
    "HelixShape": (_whole_helix, {"outer_radius": 0.08, "inner_radius": 0.05, "pitch": 0.02, "turns": 3.0, "length": 1.0}),
    "inverse": (helix.inverse, {"shape": SHAPE}),
    "measure": (helix.measure, {"outer_arc": 0.55, "inner_arc": 0.36, "diameter": 0.0331, "turns": 1.0}),
    "points": (helix.points, CURVE),
    "tangents": (helix.tangents, CURVE),
    "normals": (helix.normals, CURVE),
    "binormals": (helix.binormals, CURVE),
    "frames": (helix.frames, CURVE),
    "curvature_torsion": (helix.curvature_torsion, {"shape": SHAPE, "path": "inner", "handedness": "right"}),
    "transform_base_to_axis": (helix.transform_base_to_axis, {"shape": SHAPE, "handedness": "right"}),
    "turn_angle": (helix.turn_angle, {"shape": SHAPE, "arc_length": 1.0, "path": "inner"}),
    "turns": (helix.turns, {"shape": SHAPE, "angle": 0.0873, "length": 1.0}),
    "height": (helix.height, {"shape": SHAPE, "angle": 0.0873, "length": 1.0}),
    "length_for_turns": (helix.length_for_turns, {"shape": SHAPE, "angle": 0.0873, "turns": 1.0}),
    "check_self_contact": (helix.check_self_contact, {"shape": SHAPE, "turns": 3.0}),
    "contraction_limit": (helix.contraction_limit, {"angle": 0.0873, "diameter": 1.0}),
    "simple_contraction_limit": (helix.simple_contraction_limit, {"angle": 0.0873}),
    "grasp_force": (
        helix.grasp_force,
        {
            "pressure": 1e4,
            "object_radius": 0.02,
            "deflection": 0.002,
            "turn_height": 0.08,
            "turns": 1.5,
            "diameter": 0.0331,
            "gap": 0.003,
        },
    ),
    "GraspTest.force": (helix.PAPER_CYLINDER.force, {"pressure": 1e4, "deflection": 0.002}),
    "contraction_from_stoppers": (helix.contraction_from_stoppers, {"stopper": 0.01, "gap": 0.01}),
    "pinch_pattern": (helix.pinch_pattern, {"design": DESIGN, "spacing": 0.02, "method": "tape"}),
    "locate": (PLAN.locate, {"arc": 0.1}),
    "discrete_centre_line": (helix.discrete_centre_line, {"pattern": PLAN, "samples": 2}),
    "shape_error": (helix.shape_error, {"pattern": PLAN, "samples": 2}),
    "design_grasp": (helix.design_grasp, {"object_radius": 0.05, "squeeze": 0.0, **DESIGNED}),
    "design_antenna": (helix.design_antenna, {"radius": 0.07, **DESIGNED}),
    "HelixDesign": (_whole_design, {**ACTUATOR, "turns": 3.0, "wish": None}),
    "Wish": (_wish, {"purpose": "grasp", "path": "inner", "radius": 0.05, "turn_height": 0.1, "squeeze": 0.0}),
    "ActuatorTable": (
        helix.ActuatorTable,
        {"pressure": [0.0, 1e4, 2e4], "contraction": [0.5, 0.6, 0.7]},
    ),
    "contraction_at": (TABLE.contraction_at, {"pressure": 1e4}),
    "pressure_for": (TABLE.pressure_for, {"contraction": 0.65}),
    "bent_tube": (
        helix.bent_tube,
        {**ACTUATOR, "length": 0.1, "handedness": "right", "samples": 3},
    ),
    "quintic": (sr.quintic, {"share": 0.5}),
    "waypoints": (sr.waypoints, {"positions": [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], "times": [0.0, 1.0]}),
    "grown_coordinates": (sr.grown_coordinates, {"tube": sr.HelixTube(), "length": 0.5, "front": 0.1}),
    "TargetGrid": (TargetGrid, {"x": [1.0, 2.0], "y": [0.0], "z": [1.0]}),
    "TargetGrid.plane": (TargetGrid.plane, {"reach": 1.0, "cells": 3}),
    "TargetGrid.box": (TargetGrid.box, {"reach": 1.0, "cells": 3}),
}
"""What is called, and arguments that it takes."""
