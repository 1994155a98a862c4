"""Outward and inward passes of one element of a chain, traced.

`outward` computes the axes behind the element. `inward` moves the loads to its base and eliminates its coordinates. Unrolled
chains (`softrobots.compiled.chain.unrolled_chain`) trace them for all elements, looped ones
(`softrobots.compiled.chain.looped_chain`) once for each kind of element.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Load, Motion, Screw, constants, sliding_joint, turned, turning_joint, vector
from softrobots.compiled.chain.elimination import Eliminated, Outboard, eliminate, resized
from softrobots.compiled.chain.muscle_terms import pulls_on
from softrobots.compiled.chain.traced_elements import TracedElement
from softrobots.compiled.trace.expressions import Scalar, if_less, smaller
from softrobots.compiled.trace.stumpff_series import LARGEST


@dataclass
class OutwardPass:
    """Result of the outward pass of an element."""

    start: Any
    """Axes of its frame before its own motion, shape (3, 3)."""
    shift: Any
    """From the origin of the element before to its own at zero, shape (3,) [m]."""
    end: Any
    """Axes behind it, shape (3, 3)."""
    screw: Screw | None
    """Screw motion of a section."""
    members: Sequence[OutwardPass] = ()
    """Results of the joints of a hinge."""


@dataclass
class Balance:
    """Sums over the elements of the inward pass so far."""

    energy: Scalar = 0.0
    """Elastic energy [J]."""
    weight: Scalar = 0.0
    """Squared torque of the weight on all unknown coordinates."""
    range_margin: Scalar = 1.0
    """Negative if a section is beyond its range."""


@dataclass
class InwardPass:
    """Result of the inward pass of an element."""

    motion: Motion
    """Its motion: unknown coordinates only, for a motor its joint."""
    gradient: list[Scalar]
    """Derivative of the energy with respect to its unknown coordinates."""
    eliminated: Eliminated | None
    """Its factors; None for a motor."""
    loads: list[Load]
    """The loads, with levers from the origin of the element before."""
    beyond: Outboard
    """Sums including it."""
    twists: Any = None
    """Turn per unknown coordinate, with zeros for multipliers, shape (n, k)."""
    constrained: Any = None
    """Derivative of the constrained sums by its unknown coordinates, shape (n - 3, k)."""
    excess: Any = None
    """What twist adds to the constrained sums, shape (n - 3,)."""
    inner: bool = False
    """Whether its angle is a component of the turn of the next element, which has a spring with the same law."""

    def turned(self, nearer: Any, step: Any) -> Any:
        """Return the turn of all elements beyond from that of all nearer to the base and the step of its coordinates."""
        return (resized(nearer, len(self.twists)) + self.twists @ step)[: 4 if self.inner else 3]


def outward(element: TracedElement, axes: Any) -> OutwardPass:
    """Outward pass of an element; `axes` are those behind the element before."""
    if element.members:
        passes: list[OutwardPass] = []
        for member in element.members:
            passes.append(outward(member, passes[-1].end if passes else axes))
        return replace(passes[0], end=passes[-1].end, members=passes)
    start, shift = axes @ element.rotation, axes @ element.translation
    if element.kind == "section":
        screw = Screw(element.coordinates, element.length)
        return OutwardPass(start, shift, start @ screw.rotation, screw)
    end = turned(start, element.coordinates[0]) if element.kind == "turn" else start
    return OutwardPass(start, shift, end, None)


def inward(
    element: TracedElement,
    outward_pass: OutwardPass,
    loads: Sequence[Load],
    beyond: Outboard,
    balance: Balance,
    *,
    tip_columns: int = 0,
    given: tuple[Any, Any] | None = None,
    pivot_shift: Scalar = 0.0,
) -> InwardPass:
    """Inward pass of an element.

    Args:
        element: The element.
        outward_pass: Result of its outward pass.
        loads: The force on the tip, and the weight if there is gravity, with levers from the element's end.
        beyond: Sums of the outboard elements.
        balance: Sums over elements, added to in place.
        tip_columns: Number of further right-hand sides, for the motion of the tip: none, 3 for its position, 6 with its turn.
        given: Another right-hand side: a force on the tip, shape (3,), and loads on the unknown coordinates, (k,); None: none.
        pivot_shift: See `elimination.eliminate`.

    Returns:
        The result.
    """
    motion, at_start = _motion(element, outward_pass, loads)
    moving = list(element.moving)
    for place, row in enumerate(moving):
        stretch = element.coordinates[row] - element.rest[place]
        stored = stretch * stretch * (0.5 * element.stiffness[place]) if element.law is None else element.law.energy
        balance.energy = balance.energy + stored
        if len(loads) > 1:
            balance.weight = balance.weight + motion.weight[row] * motion.weight[row]
    if outward_pass.screw is not None:
        balance.range_margin = smaller(balance.range_margin, range_margin(element, outward_pass.screw))
    shifted = [Load(load.force, load.lever + outward_pass.shift * load.share, load.share) for load in at_start]
    if not moving:
        return InwardPass(motion, [], None, shifted, beyond)
    motion = Motion(
        motion.twists[:, moving],
        motion.bends[:, moving],
        motion.moves[:, moving],
        [motion.torque[row] for row in moving],
        [motion.weight[row] for row in moving],
        motion.curvature[np.ix_(moving, moving)],
    )
    law = element.law
    carried = [(element.coordinates[row] - element.rest[place]) * element.stiffness[place] for place, row in enumerate(moving)]
    if law is not None:
        carried = [law.torque]
        if law.coupling is not None:  # the inner spring follows: its angle is one more component of the turn
            beyond = beyond.resized(len(beyond.matrix) + 1)
    constrained = constants(np.zeros((len(beyond.matrix) - 3, len(moving))))
    for place, multiplier in enumerate(element.constraints):
        if multiplier is not None:
            constrained[multiplier, place] = 1.0
    pulls = pulls_on(element.muscles, element.coordinates, element.tensions, element.preload, len(constrained))
    balance.energy = balance.energy + pulls.energy
    if pulls.margin is not None:
        balance.range_margin = smaller(balance.range_margin, pulls.margin)
    constrained = constrained + pulls.constrained[:, moving]
    gradient = [torque - motion.torque[place] + pulls.load[moving[place]] for place, torque in enumerate(carried)]
    twists = np.concatenate([motion.twists, constrained * 0.0])
    if law is not None and law.coupling is not None:
        constrained[-1, 0] = law.coupling
    elif law is not None:
        twists[-1, 0] = 1.0
    stiffness = pulls.curvature[np.ix_(moving, moving)] - motion.curvature
    if element.routes is not None:
        stiffness, gradient = stiffness + element.routes.curvature, [*(vector(gradient) + element.routes.load)]
    if element.rubbing is not None:
        friction = element.rubbing.at([element.coordinates[row] for row in moving])
        balance.energy = balance.energy + friction.energy
        gradient, stiffness = [*(vector(gradient) + friction.torque)], stiffness + friction.stiffness
    for place, own in enumerate(element.stiffness):
        stiffness[place, place] = stiffness[place, place] + (own if law is None else law.stiffness)
    sides = [gradient, *(-np.concatenate([motion.moves, motion.twists])[:tip_columns]).tolist()]
    if given is not None:
        sides.append((-(given[0] @ motion.moves) - given[1]).tolist())
    eliminated, handed_on = eliminate(
        beyond,
        twists,
        np.concatenate([motion.bends, -constrained]),
        stiffness,
        sides,
        element.stiffness,
        pivot_shift=pivot_shift,
        routes=element.routes,
    )
    if law is not None and law.coupling is None:
        n = len(handed_on.matrix) - 1
        eliminated, handed_on = replace(eliminated, coupling=eliminated.coupling[:, :n]), handed_on.resized(n)
    inner = law is not None and law.coupling is None
    return InwardPass(motion, gradient, eliminated, shifted, handed_on, twists, constrained, pulls.excess, inner)


def _motion(element: TracedElement, outward_pass: OutwardPass, loads: Sequence[Load]) -> tuple[Motion, list[Load]]:
    """Return the motion of an element, and the loads with levers from its origin at zero."""
    if element.members:
        motions: list[Motion] = []
        here = list(loads)
        for member, passed in zip(element.members[::-1], outward_pass.members[::-1], strict=True):
            motion, here = _motion(member, passed, here)
            motions.insert(0, motion)
        return _joined(motions), here
    if outward_pass.screw is not None:
        motion, levers = outward_pass.screw.motion(loads, element.bodies, outward_pass.start)
        own = sum((mass for mass, _ in element.bodies), 0.0)
        shares = [1.0, element.mass_beyond + own]
        return motion, [
            Load(load.force, lever, share) for load, lever, share in zip(loads, levers, shares[: len(loads)], strict=True)
        ]
    ((mass, first_moment),) = element.bodies
    here = [loads[0]]
    if len(loads) > 1:
        lever = loads[1].lever + outward_pass.end @ first_moment
        here.append(Load(loads[1].force, lever, element.mass_beyond + mass))
    axis = outward_pass.start[:, 2]
    if element.kind == "turn":
        return turning_joint(axis, here), here
    slid = [Load(load.force, load.lever + axis * (load.share * element.coordinates[0]), load.share) for load in here]
    return sliding_joint(axis, here), slid


def _joined(motions: Sequence[Motion]) -> Motion:
    """Return the motion of joints, base to tip, as that of one element with all their coordinates."""
    twists, bends, moves = (
        np.concatenate([getattr(one, name) for one in motions], axis=1) for name in ("twists", "bends", "moves")
    )
    curvature = twists.T @ bends
    for row, one in enumerate(motions):
        curvature[row, row] = one.curvature[0, 0]
        curvature[row, :row] = curvature[:row, row]
    torque, weight = ([value for one in motions for value in getattr(one, name)] for name in ("torque", "weight"))
    return Motion(twists, bends, moves, torque, weight, curvature)


def range_margin(element: TracedElement, screw: Screw) -> Scalar:
    """Return a number that is positive for a section in range: bending and twist below half a turn, positive length."""
    direction = screw.position
    at_end = screw.rotation[:, 2] @ direction
    size = (direction @ direction) * 1e-6
    margins: list[Scalar] = [
        LARGEST
        - (element.coordinates[0] * element.coordinates[0] + element.coordinates[1] * element.coordinates[1])
        - element.coordinates[2] * element.coordinates[2],
        if_less(0.0, direction[2], direction[2] * direction[2] - size, -1.0),
        if_less(0.0, at_end, at_end * at_end - size, -1.0),
        np.pi**2 - element.coordinates[2] * element.coordinates[2],
        element.coordinates[3] + 0.999 * element.length,
    ]
    least: Scalar = margins[0]
    for one in margins[1:]:
        least = smaller(least, one)
    return least
