r"""Where something touches a robot, from motor torques: the place along the body that explains them best.

A contact without friction presses across the axis of the body, or on a free end, from any side. At each candidate place the
components of such a force are fitted; with independent errors of the torques of known size the likelihood of a place is
:math:`\exp(-\chi^2 / 2)`, with the squares that the fit leaves. Three motors tell a force on a link beyond them all, and its
place; of one on a nearer link they tell less, and many places are as likely.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, one_each, positive_integer, read_only, unit_vector
from softrobots.core.errors import LoadNotFound, NeutralEquilibrium, ParameterError
from softrobots.core.summary import Summarised
from softrobots.environment.capsules import capsule_tags
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.loader import with_points
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.load_estimation import LoadEstimate, estimate_load

_ROUNDS = 20  # of the direction of the force, which turns with the body that bends under it
_SAME = 1e-9  # change of a direction that is none [-]
_APART = 1e-6  # distance of ends of cores that are no joint, relative to the reach


@dataclass(frozen=True, eq=False, repr=False)
class ContactPlace(Summarised):
    """A place where something may touch a robot; made by `locate_contact`."""

    link: str
    """The link."""
    point: FloatArray
    """The point in its axes, shape (3,) [m]: on the axis of the body, which a force without friction passes through."""
    estimate: LoadEstimate
    """The force there that fits the torques best, with its covariance."""
    misfit: float
    """Sum of the squares of the torques that it does not explain, over their variances [-]."""
    probability: float
    """Share of the likelihood of all candidates [-]."""


def locate_contact(
    model: SoftModel,
    q_motors: Any,
    motor_torques: Any,
    *,
    torque_std: Any,
    gravity: Any = None,
    places: Mapping[str, Any] | None = None,
    count: int = 8,
) -> tuple[ContactPlace, ...]:
    """Find where something presses on a robot, and how hard, from motor torques.

    Args:
        model: The robot, with at least two motors.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        motor_torques: Load on each motor, shape (n_motors,) [N m or N], as for `softrobots.estimate_load`.
        torque_std: Standard deviation of the torque noise, one number or shape (n_motors,) [N m].
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        places: Candidates by link: points in its axes, shape (n, 3) [m], and the axis across which the force is, shape (3,), or
            None for any force, as `{link: (points, axis)}`. By default points along the axis of every capsule of the robot that
            moves, and the middles of its free ends, where forces that push are fitted.
        count: Number of candidates on each capsule.

    Returns:
        All candidates, the most probable first; each capsule weighs by its length, an end by a quarter of its circumference,
        given points alike. Add probabilities of neighbours for that of a stretch of the body.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, the robot has fewer than two motors
            or dry friction, or no candidate has an equilibrium.
        NameNotFound: If a link does not exist.
        DescriptionError: If the robot has no capsules, and no candidates are given.
    """
    if check_frictionless(model, "places of contacts").n_motors < 2:
        raise ParameterError("model", model, "a robot with at least two motors")
    noise = one_each("torque_std", torque_std, model.n_motors, "N m", positive=True)
    rows = _on_body(model, positive_integer("count", count, 1000)) if places is None else _given(places)
    marked = with_points(model, {f"place {number}": (row.link, row.point) for number, row in enumerate(rows)})
    found = []
    for number, (link, point, axis, outward, weight) in enumerate(rows):
        options = {"frame": f"place {number}", "gravity": gravity, "torque_std": noise, "restart": False}
        try:
            estimate = _fitted(marked, link, axis, q_motors, motor_torques, options)
        except NeutralEquilibrium:
            continue
        if (
            outward is not None
            and estimate.force @ frame_placement(marked, estimate.equilibrium.q, link).rotation @ outward > 0.0
        ):
            continue  # it would have to pull at the end
        felt = model.actuators.feels
        missing = (estimate.measured_torques - estimate.equilibrium.motor_torques)[felt] / noise[felt]
        found.append((link, read_only(np.array(point)), estimate, float(missing @ missing), weight))
    if not found:
        raise ParameterError(
            "places", [(row.link, row.point.tolist()) for row in rows], "places at which a force has an equilibrium"
        )
    misfits, weights = (np.array([row[place] for row in found]) for place in (3, 4))
    likely = weights * np.exp(0.5 * (misfits.min() - misfits))
    shares = (likely / likely.sum()).tolist()
    located = (ContactPlace(*row[:4], share) for row, share in zip(found, shares, strict=True))
    return tuple(sorted(located, key=lambda one: (-one.probability, one.misfit)))


class _Candidate(NamedTuple):
    """A place where something may touch."""

    link: str
    point: FloatArray
    axis: FloatArray | None
    """The force is across it, shape (3,), in the axes of the link; None: any force."""
    outward: FloatArray | None
    """Out of a free end, along which no contact pulls; None elsewhere."""
    weight: float


def _fitted(
    marked: SoftModel, link: str, axis: FloatArray | None, q_motors: Any, torques: Any, options: dict[str, Any]
) -> LoadEstimate:
    """Fit a force, across an axis of a link if there is one; the axis turns with the link under the force."""
    q, last, across = marked.configuration(q_motors), np.zeros((3, 3)), None
    if axis is not None:
        across = np.linalg.svd(axis[None])[2][1:]
    for _ in range(_ROUNDS):
        directions = None if across is None else across @ frame_placement(marked, q, link).rotation.T
        try:
            estimate = estimate_load(marked, q_motors, torques, directions=directions, **options)
        except LoadNotFound as error:  # this place explains the torques badly
            estimate = error.best
        if directions is None:
            break
        q, plane = estimate.equilibrium.q, directions.T @ directions
        if np.abs(plane - last).max() <= _SAME:
            break
        last = plane
    return estimate


def _on_body(model: SoftModel, count: int) -> list[_Candidate]:
    """The middles of equal pieces of each capsule that moves, and the ends of cores at which no other core ends."""
    rows, capsules, q = list[_Candidate](), capsule_tags(model), model.configuration(model.relaxed_motors)
    cores = [np.array([one.start, one.end]) for one in capsules]
    poses = [frame_placement(model, q, one.link) for one in capsules]
    ends = np.array([pose.act(end) for pose, core in zip(poses, cores, strict=True) for end in core])
    for number, (one, (start, end)) in enumerate(zip(capsules, cores, strict=True)):
        length = float(np.linalg.norm(end - start))
        if model.pinocchio.frames[model.frame_id(one.link)].parentJoint == 0 or length == 0.0:
            continue
        axis = (end - start) / length
        for share in (np.arange(count) + 0.5) / count:
            rows.append(_Candidate(one.link, start + share * (end - start), axis, None, length / count))
        for place, (point, outward) in enumerate(((start, -axis), (end, axis))):
            others = np.delete(ends, 2 * number + place, axis=0)
            if np.linalg.norm(others - ends[2 * number + place], axis=1).min() > _APART * model.reach:
                rows.append(_Candidate(one.link, point, None, outward, 0.5 * np.pi * one.radius))
    return rows


def _given(places: Any) -> list[_Candidate]:
    """The same of given places, of equal weight."""
    if not isinstance(places, Mapping) or not places:
        raise ParameterError("places", places, "a mapping {link: (points, axis)}")
    rows = list[_Candidate]()
    for link, value in places.items():
        if not isinstance(value, tuple) or len(value) != 2:
            raise ParameterError(f"places[{link!r}]", value, "(points, axis), shapes (n, 3) and (3,)")
        points = finite_array(f"places[{link!r}]", value[0], (None, 3), "m")
        axis = None if value[1] is None else unit_vector(f"places[{link!r}]", value[1])
        rows += [_Candidate(str(link), point, axis, None, 1.0) for point in points]
    return rows
