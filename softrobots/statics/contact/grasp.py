r"""A grasp: the contacts that hold one object, of one robot or of several, and what they hold.

The grasp matrix :math:`G` turns the forces :math:`f_i` of the contacts on the object into their wrench about a point,
:math:`G f = \sum_i (f_i, (p_i - p) \times f_i)` [Murray 1994, section 5.2]. A contact pushes along its inward normal and rubs
within Coulomb's cone, :math:`|f_{t,i}| \le \mu_i f_{n,i}` (a point contact with friction there).

*Force closure* [Murray 1994, section 5.4; Nguyen 1988; Bicchi 2000]: forces within the cones balance any wrench on the object
if, and only if, :math:`G` has full rank and some forces strictly inside of all cones balance each other. So one convex program
decides:

.. math:: \max_f\ \min_i \left( f_{n,i} - |f_{t,i}| / \mu_i \right), \qquad G f = 0, \quad \sum_i f_{n,i} \le k

Its largest value, the *margin*, is positive if the grasp is closed, and one at most, where all contacts push equally without
friction. It depends neither on units nor on where the grasp stands.

*Pull-out*: the largest force :math:`s` along :math:`d` at a point :math:`p` of the object that the contacts hold beyond what
they carry now, :math:`f_0`:

.. math:: \max_f\ s, \qquad G (f - f_0) + s\,(d, p \times d) = 0, \quad |f_{t,i}| \le \mu_i f_{n,i}, \quad f_n = f_{n,0}

At given normal forces friction follows the normality rule of plasticity, and by the theorems of limit analysis this is the
force at which the object begins to slide, whatever the elasticity of the fingers. Where the motion changes the normal forces
(a pull against one finger, a helix that tightens) only a quasi-static path tells. With :math:`0 \le f_{n,i} \le N` instead it
is the largest force of fingers that press as holds most: no path exceeds it while no finger presses with more than :math:`N`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, finite_array, one_each, read_only, refuse_where, unit_vector
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Summarised
from softrobots.statics.contact.cone_program import CLOSE, ConeProgram

_RANK = 1e-9  # of the largest singular value
_OUTSIDE = 0.1 * CLOSE  # of the sum of the normal forces: what the friction that is told may lie outside of a cone
_ON_CONE = 1e-6  # of the normal force: what the friction of a contact may lie outside by, and slips from


@dataclass(frozen=True, eq=False, repr=False)
class ForceClosure(Summarised):
    """Result of `is_force_closure`; it counts as true if the grasp is closed."""

    closed: bool
    """Whether the contacts can balance every wrench on the object: full rank, and a positive margin."""
    rank: int
    """Rank of the grasp matrix, without the friction of frictionless contacts; a closed grasp has 6 (in a plane 3)."""
    margin: float
    """Least `f_n - |f_t| / mu` of a contact in the best balanced squeeze, whose mean normal force is one, from 0 to 1 [-]."""
    largest_margin: float
    """Upper bound of the margin, by the last linear program [-]."""
    forces: FloatArray
    """That squeeze: force of each contact on the object, world axes, shape (k, 3) [-]; without a margin it means nothing."""

    def __bool__(self) -> bool:
        """Whether the grasp is closed."""
        return self.closed


@dataclass(frozen=True, eq=False, repr=False)
class PullOut(Summarised):
    """Result of `pull_out_force`."""

    force: float
    """Largest force along the direction that the contacts hold [N]: `contact_forces` hold it."""
    largest_force: float
    """Upper bound of it, by the last linear program [N]."""
    contact_forces: FloatArray
    """Force of each contact on the object at that force, world axes, shape (k, 3) [N]."""
    slips: tuple[bool, ...]
    """Which contacts rub there as hard as they can."""


def contact_wrench(contacts: Any, point: Any = (0.0, 0.0, 0.0)) -> FloatArray:
    """Wrench of contacts on what they touch: the opposite of their forces on the robot.

    Args:
        contacts: Contacts, as `Equilibrium.contacts`, of one robot or of several put together.
        point: Point of the moment, shape (3,) [m], world axes.

    Returns:
        Force, then moment about the point, shape (6,) [N, N m], world axes.

    Raises:
        ParameterError: If something else than contacts is given, or a vector has the wrong shape or is not finite.
    """
    arms = _vectors(contacts, "point", "m") - finite_array("point", point, (3,), "m")
    forces = -_vectors(contacts, "force", "N")
    return np.concatenate([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)])


def is_force_closure(contacts: Any, friction: Any, *, plane: Any = None) -> ForceClosure:
    """Whether contacts can balance every force and moment on the object that they hold, by pushing harder where needed.

    A convex program decides, with a bound from either side; the module has its equation and sources. Two points never close a
    grasp in space, as nothing resists a turn about the line between them; in a plane they do if that line lies within both
    cones of friction [Nguyen 1988].

    Args:
        contacts: Contacts with the object, as `Equilibrium.contacts`, of one robot or of several put together; the `point` of
            each and its `normal` (from the object) count, not its force.
        friction: Coefficient of friction, one for all or one for each contact, zero or positive [-].
        plane: Normal of the plane of a planar grasp, shape (3,): two forces and a moment. None: space.

    Returns:
        The answer, which counts as true or false, with its margin.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, or a contact pushes out of the plane.
    """
    grasp = _Grasp.of(contacts, friction, plane)
    count, (wrenches, variables) = len(grasp.friction), grasp.matrix.shape
    if count == 0:
        return ForceClosure(False, 0, 0.0, 0.0, read_only(np.zeros((0, 3))))
    rank, squeezes = _rank_and_null_space(grasp.matrix)
    unknowns = squeezes.shape[1] + 1  # the last one is the margin
    forces = np.hstack([squeezes, np.zeros((variables, 1))])
    margin = np.zeros((count, unknowns))
    margin[:, -1] = 1.0
    normal = forces[:count]

    def inside(found: FloatArray) -> tuple[float, FloatArray]:
        """The squeeze of an answer, with the margin that it has."""
        return float(np.min(normal @ found - grasp.rubbing(forces @ found))), forces @ found

    sides = np.vstack([normal.sum(axis=0), margin - normal])
    limits = np.append(float(count), np.zeros(count))
    rubs, start = grasp.tangents @ forces, np.zeros((count, 2))
    cones = ConeProgram(rubs, start, normal - margin, np.zeros(count), sides, limits)
    least, squeeze, most = cones.largest(np.eye(unknowns)[-1], inside)
    return ForceClosure(rank == wrenches and least > CLOSE, rank, least, most, read_only(grasp.forces(squeeze)))


def pull_out_force(
    contacts: Any, friction: Any, direction: Any, *, point: Any = None, largest_normal_force: Any = None
) -> PullOut:
    """Largest force on the object along a direction that the contacts hold, beyond what they carry now.

    By default the contacts press as they do now, and only their friction answers: that is exact while the normal forces stay
    as they are, whatever the elasticity of the fingers. With `largest_normal_force` each may press with anything up to that,
    in the way that holds most: an upper bound for any fingers. The module has the equations. What elastic fingers do on
    the way out is a path: move the object with `follow_contact`.

    Args:
        contacts: Contacts with the object and their forces, as `Equilibrium.contacts`, of one robot or of several put together.
        friction: Coefficient of friction, one for all or one for each contact, zero or positive [-].
        direction: Direction of the pull, shape (3,), any length but zero, world axes.
        point: Point at which the object is pulled, shape (3,) [m]; the mean of the contact points by default.
        largest_normal_force: Largest normal force, one for all or one for each contact, zero or positive [N]; None: they press
            as they do now.

    Returns:
        The force, with an upper bound and the forces of the contacts that hold it.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, or the forces of the contacts are not
            within their cones and limits.
    """
    grasp = _Grasp.of(contacts, friction, None)
    count = len(grasp.friction)
    way = unit_vector("direction", direction)
    now, excess = grasp.components(contacts)
    limits = now[:count] if largest_normal_force is None else one_each("largest_normal_force", largest_normal_force, count, "N")
    beyond = now[:count] > (1.0 + _ON_CONE) * limits
    refuse_where("largest_normal_force", limits, beyond, "at least what the contact presses with now, {:.6g} N", now[:count])
    limits = np.maximum(limits, now[:count])
    unit = float(limits.sum())
    if not np.any(limits if largest_normal_force is not None else grasp.friction * limits):
        return PullOut(0.0, 0.0, read_only(grasp.forces(now)), (True,) * count)
    at = grasp.centre if point is None else finite_array("point", point, (3,), "m")
    first = count if largest_normal_force is None else 0  # of the components that may change
    # forces by friction alone are smaller than the normal forces by the mean coefficient
    share = float(grasp.friction @ limits) / unit if first else 1.0
    pull = share * np.append(way, np.cross(at - grasp.centre, way) / grasp.size)
    balanced = _rank_and_null_space(np.column_stack([grasp.matrix[:, first:], pull]))[1]
    changes = np.vstack([np.zeros((first, balanced.shape[1])), balanced[:-1]])
    rubs, start = grasp.tangents @ changes, grasp.tangents @ now / unit
    room, room_now = changes[:count], (now[:count] + excess) / unit

    def inside(found: FloatArray) -> tuple[float, FloatArray]:
        """An answer on its way from the forces now, as far as all cones are kept."""
        rub, more = rubs @ found, room @ found
        leaves = np.linalg.norm(start + rub, axis=1) > room_now + more + _OUTSIDE
        # the share of the way at which the square of the friction reaches that of its room
        square, slope = np.sum(rub**2, axis=1) - more**2, np.sum(start * rub, axis=1) - room_now * more
        spare = np.maximum(room_now**2 - np.sum(start**2, axis=1), 0.0)
        root = np.sqrt(np.maximum(slope**2 + square * spare, 0.0))
        above, below = np.where(slope > 0.0, (spare, slope + root), (root - slope, square))
        kept = float(np.clip(np.divide(above, below, out=np.ones(count), where=leaves), 0.0, 1.0).min())
        return kept * float(balanced[-1] @ found), now + unit * kept * (changes @ found)

    sides = np.vstack([-changes[:count], changes[:count]])
    cones = ConeProgram(rubs, start, room, room_now, sides, np.append(now[:count], limits - now[:count]) / unit)
    least, held, most = cones.largest(balanced[-1], inside)
    slips = grasp.rubbing(held) >= held[:count] * (1.0 - _ON_CONE)
    return PullOut(share * unit * least, share * unit * most, read_only(grasp.forces(held)), tuple(slips.tolist()))


class _Grasp(NamedTuple):
    """Contacts with friction, their forces as components along all normals, then along the tangents of those with friction.

    Components along tangents are friction over its coefficient, so that the cones are round: they are within the normal one.
    """

    directions: FloatArray
    """Force of each component: a unit into the object, or the coefficient along it, shape (m, 3)."""
    owners: NDArray[np.intp]
    """Contact of each component, shape (m,)."""
    tangents: FloatArray
    """Components along the tangents of each contact, shape (k, 2, m)."""
    friction: FloatArray
    """Coefficient of each contact, shape (k,)."""
    centre: FloatArray
    """Mean of the points, about which moments are, shape (3,) [m]."""
    size: float
    """Root of the mean square of their distances from there, over which moments are [m]."""
    matrix: FloatArray
    """Wrench of each component on the object, shape (6 or 3, m)."""

    @classmethod
    def of(cls, contacts: Any, friction: Any, plane: Any) -> _Grasp:
        """Check and assemble a grasp."""
        points, normals = _vectors(contacts, "point", "m"), -_vectors(contacts, "normal", "")
        count = len(points)
        coefficients = one_each("friction", friction, count, "-")
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        refuse_where("contacts", lengths.ravel(), lengths.ravel() == 0.0, "of normals different from zero")
        normals = normals / lengths
        if plane is None:
            least = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
            first = np.cross(normals, least)
        else:
            across = unit_vector("plane", plane)
            out = normals @ across
            refuse_where("plane", out, np.abs(out) > _ON_CONE, "perpendicular to every normal; a cosine is {:.3g}", out)
            first = np.cross(across, normals)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        tangents = (first, np.cross(normals, first)) if plane is None else (first,)
        rough = np.flatnonzero(coefficients)
        directions = np.vstack([normals, *(coefficients[rough, np.newaxis] * tangent[rough] for tangent in tangents)])
        owners = np.concatenate([np.arange(count), *(rough for _ in tangents)])
        shares = np.zeros((count, 2, len(owners)))
        for axis in range(len(tangents)):
            columns = count + axis * len(rough) + np.arange(len(rough))
            shares[rough, axis, columns] = 1.0
        centre = points.sum(axis=0) / max(count, 1)
        size = float(np.linalg.norm(points - centre)) / max(count, 1) ** 0.5
        size = size if size > _RANK * np.max(np.abs(points), initial=0.0) else 1.0  # all in one point
        moments = np.cross(points[owners] - centre, directions) / size
        wrenches = np.hstack([directions, moments]).T
        if plane is not None:
            wrenches = np.vstack([_rank_and_null_space(across[np.newaxis])[1].T @ directions.T, moments @ across])
        return cls(directions, owners, shares, coefficients, centre, size, wrenches)

    def components(self, contacts: Any) -> tuple[FloatArray, FloatArray]:
        """Components of the forces that contacts have now, and how far each contact is beyond its cone [N]."""
        forces, normals = -_vectors(contacts, "force", "N"), self.directions[: len(self.friction)]
        pressed = np.sum(normals * forces, axis=1)
        rounding = _ON_CONE * np.max(np.abs(pressed), initial=0.0)
        refuse_where("contacts", pressed, pressed < -rounding, "pressing on the object")
        rubbing = np.linalg.norm(forces - pressed[:, np.newaxis] * normals, axis=1)
        pressed = np.maximum(pressed, 0.0)
        needed = np.divide(rubbing, pressed, out=np.full(len(pressed), np.inf), where=pressed > 0.0)
        beyond = rubbing > self.friction * pressed + rounding
        refuse_where("friction", self.friction, beyond, "at least {:.6g}, by the forces of the contacts", needed)
        found = np.sum(self.directions * forces[self.owners], axis=1) / np.sum(self.directions**2, axis=1)
        found[: len(pressed)] = pressed
        return found, np.maximum(self.rubbing(found) - pressed, 0.0)

    def rubbing(self, components: FloatArray) -> FloatArray:
        """Friction over its coefficient, shape (k,)."""
        return np.asarray(np.linalg.norm(self.tangents @ components, axis=1))

    def forces(self, components: FloatArray) -> FloatArray:
        """Force of each contact on the object, shape (k, 3)."""
        total = np.zeros((len(self.friction), 3))
        np.add.at(total, self.owners, components[:, np.newaxis] * self.directions)
        return total


def _rank_and_null_space(matrix: FloatArray) -> tuple[int, FloatArray]:
    """Rank of a matrix, by the directions of its columns, and an orthonormal base of what it maps to zero, in columns."""
    lengths = np.linalg.norm(matrix, axis=0)
    values = np.linalg.svd(matrix / np.where(lengths > 0.0, lengths, 1.0), compute_uv=False)
    rank = int(np.sum(values > _RANK * np.max(values, initial=0.0)))
    return rank, np.linalg.svd(matrix)[2][rank:].T


def _vectors(contacts: Any, name: str, unit: str) -> FloatArray:
    """One vector of each contact, shape (k, 3)."""
    try:
        vectors = [getattr(contact, name) for contact in contacts]
    except (TypeError, AttributeError) as error:
        raise ParameterError("contacts", contacts, f"contacts, each with its {name}, as Equilibrium.contacts") from error
    return np.array([finite_array(f"contacts[{i}].{name}", one, (3,), unit) for i, one in enumerate(vectors)]).reshape(-1, 3)
