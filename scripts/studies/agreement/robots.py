"""The robots and loads of the comparison, each with its reference: a Kirchhoff rod by a boundary-value solve."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from tqdm import tqdm

import softrobots as sr
from studies.interop.cases import TOLERANCE
from studies.shared.checkout import test_support

FINE, COARSE = 1e-9, 1e-6
"""Tolerances of the boundary-value solves: of the answer, and of what it is compared with to know its own error."""
LENGTHS = ((0.50, 0.53, 0.55), (0.54, 0.51, 0.52))
"""Muscle lengths of the arm, by segment [m]."""
PCC_FORCE = (1.0, 2.0, -3.0)
"""Tip force of the arm [N]."""
TUBES: Mapping[str, tuple[float, tuple[float, float, float]]] = {
    "helix_tube_1_turn": (1.0, (0.36, -0.24, 0.30)),
    "helix_tube_2.7_turns": (2.7, (0.18, -0.12, 0.15)),
}
"""Turns and tip force [N] of the helical tubes."""
COUNTS: dict[str, tuple[int, ...]] = {
    "inflatable_link": (1, 2, 4, 8, 16, 32),
    "pcc_arm": (1, 2, 4, 8, 16, 32),
    "helix_tube_1_turn": (8, 16, 32, 64),
    "helix_tube_2.7_turns": (16, 24, 32, 40, 48, 64),
    "steel_rod": (8, 16, 32, 48),
}
"""Numbers of segments."""
LINK_FORCES = (10.0, 400.0)
"""Tip forces of the inflated link [N]; it wrinkles at 36 N."""
INEXTENSIBLE = 1e9
"""Axial stiffness of sections that must not stretch [N]."""
LUMPED: Mapping[str, Mapping[str, Any]] = {
    "lumped": {"chain": "lumped"},
    "lumped, midpoint": {"chain": "lumped", "hinge_rule": "midpoint"},
}
CHAINS = {"sections": {"chain": "sections"}, **LUMPED}
"""Forms of a continuum robot."""
IN_THE_MIDDLE, AT_THE_START = "pseudo-rigid, hinge in the middle", "pseudo-rigid, hinge at l1 = 5 %"
"""Forms of the inflated link."""
Poses = list[np.ndarray]


class Form(NamedTuple):
    """A robot as a chain, for any number of segments."""

    robot: Callable[[int], Any]
    """Makes it."""
    solve: Callable[[sr.SoftModel], list[sr.Equilibrium]]
    """Loads it; an equilibrium a case."""
    axes: np.ndarray = np.eye(4)
    """The rod's axes in the robot's world, shape (4, 4)."""


class Study(NamedTuple):
    """A robot and its loads."""

    title: str
    """In words."""
    counts: tuple[int, ...]
    """Numbers of segments."""
    forms: Mapping[str, Form]
    """By name."""
    rod: Callable[[float], Poses]
    """Poses of the tip by the boundary-value solve at a tolerance; one a case."""
    mujoco: str | None = None
    """The form that MuJoCo gets."""
    closed_form: np.ndarray | None = None
    """Pose of the tip, where there is a formula."""


def link_stiffness() -> float:
    """EI of the inflated link at 50 kPa, [Troise 2021] (1): (E + P/S) I, with the modulus of the mean stiffness [N m^2]."""
    return float(sr.InflatableArm(link_lengths=(0.6,)).beams.bending[0])


def inflatable_link(force: float) -> Study:
    """One inflated link in n pieces, each with one pair of hinges; and as a rod without muscles."""
    length, stiffness = 0.6, link_stiffness()
    rods = test_support("rods")
    rod = rods.Rod(length, stiffness, stiffness / 1.3)

    def pieces(n: int, share: float) -> Any:
        return sr.InflatableArm(
            link_lengths=(length / n,) * n, hinge_offset=share * length / n, stiffness=n * stiffness / length
        )

    def passive(form: Mapping[str, Any], n: int) -> Any:
        return passive_rod(rod, (length,), n, form if "lumped" not in form.values() else {**form, "extension": False})

    def answer(tol: float) -> Poses:
        return [pose(*rods.rod_tip(rod, (force, 0.0, 0.0, 0.0, 0.0, 0.0), tol=tol))]

    x, z, angle = rods.elastica_tip(stiffness, length, force)
    turned = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    axes = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])  # along +x, pushed down
    pushed = partial(solved, force=(0.0, 0.0, -force))
    forms = {
        IN_THE_MIDDLE: Form(lambda n: pieces(n, 0.5), pushed, axes),
        AT_THE_START: Form(lambda n: pieces(n, 0.05), pushed, axes),
    }
    for name in ("lumped", "sections"):
        forms[name] = Form(partial(passive, CHAINS[name]), partial(solved, force=(force, 0.0, 0.0)))
    title = f"Inflated link, tip force {force:g} N, F l^2 / EI = {force * length**2 / stiffness:.3g}"
    exact = pose(np.array([x, 0.0, z]), turned)
    return Study(title, COUNTS["inflatable_link"], forms, answer, IN_THE_MIDDLE, exact)


def pcc_arm() -> Study:
    """The default arm with muscles of given length.

    It hangs: MuJoCo gets the muscles as tensions, and given tensions would not hold it upright under this load.
    """
    arm: Any = sr.PccArm()
    gravity = (0.0, 0.0, 9.81)
    names = ("bending_stiffness", "torsional_stiffness", "axial_stiffness")
    segments = []
    for i, muscles in enumerate(LENGTHS):
        fields = {"length": arm.segment_lengths[i], "turn": arm.offset[i], "density": arm.linear_density[i]}
        fields |= {name: getattr(arm, name)[i] for name in names}
        segments.append(test_support("muscle_rods").MuscleSegment.of_three(muscles, arm.muscle_distance[i], **fields))

    def answer(tol: float) -> Poses:
        return [test_support("muscle_rods").solve_muscle_arm(segments, PCC_FORCE, gravity, tol=tol).pose]

    def robot(form: Mapping[str, Any], n: int) -> Any:
        return sr.PccArm(elastic_sections=n, hinges=n, **form)

    solve = partial(solved, q_motors=np.ravel(LENGTHS), force=PCC_FORCE, gravity=gravity)
    forms = {name: Form(partial(robot, form), solve) for name, form in CHAINS.items()}
    title = "Hanging arm of two segments, muscle lengths given, its weight and 3.7 N at the tip; n counts a segment's"
    return Study(title, COUNTS["pcc_arm"], forms, answer, "lumped")


def helix_tube(name: str) -> Study:
    """The default tube, cut to a number of turns, with its stiffness as numbers."""
    turns, force = TUBES[name]
    gravity, default = sr.EARTH_GRAVITY, sr.HelixTube()
    fields: dict[str, Any] = {
        "length": default.length * turns / default.turns,
        "bending_stiffness": 0.286, "torsional_stiffness": 0.203, "axial_stiffness": 2080.0,
    }  # fmt: skip
    rod = test_support("helix_rods").actuated_rod(default.contraction, default.angle, default.diameter, sign=1, **fields)
    wall = default.density * math.pi * default.diameter * default.wall_thickness * fields["length"]

    def answer(tol: float) -> Poses:
        spread = wall / rod.length * np.array(gravity)
        found = test_support("helix_rods").solve_helix_rod(rod, (*force, 0.0, 0.0, 0.0), spread, tol=tol)
        return [pose(*found[:2])]

    def robot(form: Mapping[str, Any], n: int) -> Any:
        return sr.HelixTube(elastic_sections=n, hinges=n, **fields, **form)

    solve = partial(solved, force=force, gravity=gravity)
    forms = {name: Form(partial(robot, form), solve) for name, form in CHAINS.items()}
    title = f"Helical tube, turns: {turns:.2g}, its weight and {np.linalg.norm(force):.2g} N at the tip"
    return Study(title, COUNTS[name], forms, answer, "lumped")


def steel_rod(cases: int, seed: int) -> Study:
    """A rod of spring steel in two segments: half of the sections before the middle, where a wrench acts."""
    rods = test_support("rods")
    rod = rods.steel_rod()
    wrenches = rods.random_wrenches(np.random.default_rng(seed), rod, cases)

    def answer(tol: float) -> Poses:
        return [
            pose(*test_support("rods").rod_tip(rod, tip, middle, tol=tol))
            for tip, middle in tqdm(wrenches, "steel rod", leave=False)
        ]

    def solve(model: sr.SoftModel) -> list[sr.Equilibrium]:
        return [sr.solve_equilibrium(model, (), wrench={"tip": tip, "segment_1": middle}) for tip, middle in wrenches]

    def robot(form: Mapping[str, Any], n: int) -> Any:
        form = form if form["chain"] == "sections" else {**form, "extension": False}
        return passive_rod(rod, (rod.length / 2, rod.length / 2), n // 2, form)

    forms = {name: Form(partial(robot, form), solve) for name, form in CHAINS.items()}
    title = f"Steel rod, {cases} random forces and moments: mean (largest) error; n counts those of two segments"
    return Study(title, COUNTS["steel_rod"], forms, answer)


def passive_rod(rod: Any, lengths: Sequence[float], each: int, form: Mapping[str, Any]) -> Any:
    """A rod without muscles, with `each` sections or hinges a segment."""
    return sr.PccArm(
        segment_lengths=lengths, offset=0.0, muscle_azimuths=(), bending_stiffness=rod.bending_stiffness,
        torsional_stiffness=rod.torsional_stiffness, axial_stiffness=rod.axial_stiffness or INEXTENSIBLE, linear_density=0.0158,
        radius=0.0008, elastic_sections=each, hinges=each, **form,
    )  # fmt: skip


def solved(model: sr.SoftModel, q_motors: Any = None, *, force: Any, gravity: Any = None) -> list[sr.Equilibrium]:
    """One equilibrium."""
    motors = np.zeros(model.n_motors) if q_motors is None else q_motors
    return [sr.solve_equilibrium(model, motors, force, gravity=gravity, tolerance=TOLERANCE)]


def pose(position: Any, rotation: Any) -> np.ndarray:
    """Return a pose, shape (4, 4) [m]."""
    return np.array(pin.SE3(np.asarray(rotation), np.asarray(position)).homogeneous)


STUDIES: Mapping[str, Callable[[int, int], dict[str, Study]]] = {
    "inflatable_link": lambda *_: {f"inflatable_link_{force:g}N": inflatable_link(force) for force in LINK_FORCES},
    "pcc_arm": lambda *_: {"pcc_arm": pcc_arm()},
    "helix_tube": lambda *_: {name: helix_tube(name) for name in TUBES},
    "steel_rod": lambda cases, seed: {"steel_rod": steel_rod(cases, seed)},
}
"""Makes the studies of a robot, by name."""
