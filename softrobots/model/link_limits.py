r"""What inflated links carry, and how far that is from a slack and from a wrinkled wall.

The wall of a section carries the cap force :math:`P = p \pi r^2` and the axial force `N` together, so both limits of its moment
are proportional to `P + N` (`inflated_beam.moment_limits`). `N` is the force on all that lies beyond the section, weight
included, along the axis of the link, less the tensions of the muscles beside it. At a hinge the axis is halfway between those
of the pieces before and behind it. In a section of constant strain `N` is what stretches it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots import inflated_beam
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.field_help import with_field_help
from softrobots.core.summary import Table, html_of, text_of
from softrobots.model.soft_model import SoftModel

_NEAR_PLATEAU, _NEAR_COLLAPSE = 0.99, 0.95  # shares of the largest moment at which a link explains why there is no equilibrium


@with_field_help
class LinkLimits(NamedTuple):
    """Inflated links and the limits of their walls, each at the hinge that is nearest to them; arrays of shape (n_links,).

    The limits of a helical tube are upper bounds: the wall along its actuator is slack before any load.
    """

    moments: FloatArray
    """Moment [N m]."""
    axial_forces: FloatArray
    """Axial force, positive in tension [N]."""
    slack_moments: FloatArray
    """Moment at which the first fibre of the wall goes slack under this axial force [N m]; 0 without tension in the wall."""
    wrinkling_moments: FloatArray
    """Wrinkling moment, [Troise 2021] (3), under this axial force [N m]: half of the circumference is slack; 0 likewise."""
    required_pressures: FloatArray
    """Smallest gauge pressure at which no hinge carries more than its wrinkling moment [Pa]."""

    @property
    def slack_margins(self) -> FloatArray:
        """Share of `slack_moments` that is left [-]; negative: fibres are slack; minus infinity without tension in the wall."""
        return _left(self.moments, self.slack_moments)

    @property
    def wrinkling_margins(self) -> FloatArray:
        """Share of `wrinkling_moments` that is left [-]; negative: more than half is slack; minus infinity likewise."""
        return _left(self.moments, self.wrinkling_moments)

    def table(self) -> Table:
        """Return moment, axial force and limits of each link as a table."""
        rows = [("link", "moment", "axial", "slack from", "left", "wrinkles", "left")]
        left = [known_margins(margins) for margins in (self.slack_margins, self.wrinkling_margins)]
        for number, (values, *margins) in enumerate(zip(zip(*self[:4], strict=True), *left, strict=True), start=1):
            moment, force, slack, wrinkling = (f"{value:#.4g}" for value in values)
            shares = ["-" if margin is None else f"{100.0 * margin:.1f} %" for margin in margins]
            cells = (f"{moment} N m", f"{force} N", f"{slack} N m", shares[0], f"{wrinkling} N m", shares[1])
            rows.append((str(number), *cells))
        return Table(rows, right=(1, 2, 3, 4, 5, 6))

    def summary(self) -> str:
        """Return `table` as text; `print` shows the same."""
        return text_of([self.table()])

    def _repr_html_(self) -> str:
        """Show the table in a notebook."""
        return html_of([self.table()])

    def __str__(self) -> str:
        """Return the summary."""
        return self.summary()

    def __repr__(self) -> str:
        """Number of links and the least margin in a line, instead of arrays."""
        least = f", {100.0 * self.wrinkling_margins.min():.3g} % of the wrinkling moment left" if len(self.moments) else ""
        return f"LinkLimits({len(self.moments)} links{least})"


def known_margins(margins: FloatArray) -> list[float | None]:
    """Return margins of inflated links as a list [-]; None for a link whose wall has no tension."""
    return [margin if math.isfinite(margin) else None for margin in margins.tolist()]


def slack_words(margin: float, share: str = "at least") -> str:
    """Return whether the wall of a link is slack, from the least margin to its first slack fibre [-]."""
    return f"no, {share} {100.0 * margin:.1f} % of its moment is left" if margin > 0.0 else "YES: by membrane theory"


def link_moments(model: SoftModel, torques: FloatArray) -> list[FloatArray]:
    """Return the moment at each hinge of each inflated link, both springs combined (Euclidean norm) [N m].

    The springs of a section carry the moment at its middle; its entry is the largest along it, with the moment linear between
    the middles of the sections of a segment, and beyond them.

    Args:
        model: The robot.
        torques: Load carried by each spring, shape (n_springs,) [N m].
    """
    groups = model.spring_groups
    moments = [group.moments(torques) for group in groups]
    for segment in {group.segment for group in groups} - {None}:
        rows = [row for row, group in enumerate(groups) if group.segment == segment]
        largest = _largest_along(np.array([moments[row].max() for row in rows]))
        for row, moment in zip(rows, largest, strict=True):
            moments[row] = np.array([moment] * groups[row].n_hinges)
    return moments


def link_limits(
    model: SoftModel,
    wrenches: Mapping[str, FloatArray],
    gravity: tuple[float, float, float] | None,
    *,
    q: FloatArray,
    torques: FloatArray,
    tensions: FloatArray,
) -> LinkLimits:
    """Return what the inflated links of a robot carry, and the limits of their walls.

    Args:
        model: The robot.
        wrenches: Wrench by frame name, shape (6,) [N, N m], world axes.
        gravity: Gravity, world axes [m/s^2]; None: weightless.
        q: Pinocchio's configuration, shape (nq,).
        torques: Load carried by each spring, shape (n_springs,) [N m].
        tensions: Tension of each muscle, shape (n_muscles,) [N].
    """
    groups = model.spring_groups
    if not groups:
        return LinkLimits(*[read_only(np.zeros(0))] * 5)
    counts = [group.n_hinges for group in groups]
    firsts = [0, *accumulate(counts[:-1])]
    pressures, radii = (np.repeat([getattr(group, name) for group in groups], counts) for name in ("pressure", "radius"))
    moments = np.concatenate(link_moments(model, torques))
    forces = _axial_forces(model, wrenches, np.array(gravity or (0.0, 0.0, 0.0)), q, torques, tensions)
    slack, wrinkling, _ = inflated_beam.moment_limits(pressures, radii, forces)
    left = _left(moments, wrinkling)
    worst = [first + int(np.argmin(left[first : first + count])) for first, count in zip(firsts, counts, strict=True)]
    needed = np.maximum.reduceat(inflated_beam.required_pressure(moments, radii, forces), firsts)
    moments, forces, slack, wrinkling = (read_only(each[worst]) for each in (moments, forces, slack, wrinkling))
    return LinkLimits(moments, forces, slack, wrinkling, read_only(needed))


def _left(moments: FloatArray, limits: FloatArray) -> FloatArray:
    """Share of limits that is left; minus infinity of a limit of zero."""
    return np.where(limits > 0.0, 1.0 - moments / np.where(limits > 0.0, limits, 1.0), -np.inf)


def _axial_forces(
    model: SoftModel,
    wrenches: Mapping[str, FloatArray],
    gravity: FloatArray,
    q: FloatArray,
    torques: FloatArray,
    tensions: FloatArray,
) -> FloatArray:
    """Axial force at each hinge, link after link [N]."""
    rigid, data = model.workspace(None)
    jacobian = pin.computeJointJacobians(rigid, data, q)
    pin.computeSubtreeMasses(rigid, data)
    forces = [
        (frozenset(rigid.supports[rigid.frames[model.frame_id(frame)].parentJoint]), wrench[:3])
        for frame, wrench in wrenches.items()
    ]
    stretches = dict(zip(model.spring_joints, torques.tolist(), strict=True))
    sections = model.structure.section_of if model.structure.constant_strain else {}
    axial = []
    for group in model.spring_groups:
        section = sections.get(model.spring_joints[group.springs[0]])
        if section is not None:
            axial.append(stretches[f"{section.name}_stretch"])
            continue
        muscles = zip(model.muscles, tensions.tolist(), strict=True)
        pull = sum(tension for muscle, tension in muscles if group.segment in muscle.segments)
        for hinge in group.hinges:
            joint, axis = _axis(rigid, data, jacobian, [rigid.getJointId(model.spring_joints[place]) for place in hinge])
            beyond = data.mass[joint] * gravity + sum((force for inside, force in forces if joint in inside), np.zeros(3))
            axial.append(float(axis @ beyond) - pull)
    return np.array(axial)


def _axis(rigid: Any, data: Any, jacobian: FloatArray, joints: list[int]) -> tuple[int, FloatArray]:
    """The joint that carries all beyond a hinge, and the axis of the link there, outwards; zeros if nothing tells that.

    Between its two springs the axis is normal to both; outwards is from the joint before the hinge.
    """
    inner, outer = min(joints), max(joints)
    first, last = (jacobian[3:, rigid.joints[joint].idx_v] for joint in (inner, outer))
    by_inner, by_outer = (_turn(rigid, data, joint) for joint in (inner, outer))
    outwards = data.oMi[inner].translation - data.oMi[rigid.parents[inner]].translation
    if np.linalg.norm(outwards) < 1e-9:
        outwards = data.oMi[outer].rotation @ rigid.inertias[outer].lever
    between = np.cross(first, last)
    if np.linalg.norm(between) < 1e-9:  # it bends in one plane only
        between = by_inner @ (outwards - (first @ outwards) * first)
    axis = by_inner.T @ between + by_outer @ between
    size = float(np.linalg.norm(axis))
    return outer, (axis / size * (-1.0 if axis @ outwards < 0.0 else 1.0) if size > 1e-12 else np.zeros(3))


def _turn(rigid: Any, data: Any, joint: int) -> FloatArray:
    """Rotation by a joint from its zero, in world axes, shape (3, 3)."""
    at_zero = data.oMi[rigid.parents[joint]].rotation @ rigid.jointPlacements[joint].rotation
    return np.asarray(data.oMi[joint].rotation @ at_zero.T)


def _largest_along(moments: FloatArray) -> FloatArray:
    """Largest moment along each section of a segment, shape (n,), from the moments in their middles, base to tip."""
    if len(moments) < 2:
        return moments
    between = 0.5 * (moments[1:] + moments[:-1])
    ends = np.concatenate([[1.5 * moments[0] - 0.5 * moments[1]], between, [1.5 * moments[-1] - 0.5 * moments[-2]]])
    return np.asarray(np.maximum(np.maximum(ends[1:], ends[:-1]), moments))


def near_largest_moment(model: SoftModel, moments: FloatArray) -> str:
    """Return what keeps a link from carrying more, in words; empty if none is near its largest moment.

    Args:
        model: The robot.
        moments: Moment at each inflated link, shape (n_links,) [N m].
    """
    for moment, group in zip(moments, model.spring_groups, strict=True):
        most = group.largest_moment
        if most is not None and moment >= (_NEAR_COLLAPSE if group.slack_wall else _NEAR_PLATEAU) * most:
            springs = ", ".join(model.spring_joints[place] for place in group.springs)
            state = "near the collapse of its slack wall" if group.slack_wall else "on the plateau of its moment"
            return f"the link of {springs} is {state}, {most:g} N m, and cannot carry a dead moment beyond it"
    return ""
