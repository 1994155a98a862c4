"""Equilibrium in contact without friction: from a start, under a load that grows from zero, or from a robot bent aside."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.contact.certificate import null_space
from softrobots.statics.contact.descent import BALANCED, ContactSearch, Near
from softrobots.statics.contact.touch import TOUCHING, ForceTable, resting_forces
from softrobots.statics.elastic_state import ElasticProblem, ElasticState
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.stability import is_stable

_FIRST_GROWTH, _LEAST_GROWTH = 0.25, 1e-3  # parts of the load that are added at once
_ASIDE = (0.1, 0.2, 0.4, 0.8)  # motions of the tip, relative to the reach, of robots that are bent aside
_MOST_ASIDE = 4  # of them that are tried


def settle(problem: ElasticProblem, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """Find an equilibrium in contact, from a start, or if that fails under a load that grows from zero, or from aside.

    From aside: a start that is inside of obstacles may be repaired into a place without a way out. Then the robot starts bent
    as by a force on its tip, as little as frees it, in one direction after another.

    Args:
        problem: The robot under a load that has a potential, with an environment.
        start: Elastic coordinates, shape (n_springs,) [rad or m].
        most: Limit of evaluations, of each start aside once more.

    Returns:
        The last state, whether or not it is an equilibrium; the evaluations spent; and whether it is a stable equilibrium.
    """
    search = ContactSearch(problem, most)
    first = search.near(start)
    if first is None:
        return problem.state(start), 1, False
    first = search.repaired(first)
    found, stable = search.descend(first)
    if found.error > BALANCED and not search.blocked(found):
        grown, stable = _grown(search, first)
        found = grown if grown is not None and grown.error < found.error else found
        for begin in _aside(search, start) if found.error > BALANCED else ():
            search.most = search.spent + most
            aside, stable = search.descend(begin)
            if aside.error <= BALANCED:
                found = aside
                break
    if found.error > BALANCED:
        return found.state, search.spent, False
    least = _of_least_norm(search, found)
    if least is not None:
        return least.state, search.spent, is_stable(problem.model, problem.load, least.state, problem.tolerance)
    return found.state, search.spent, stable


def _aside(search: ContactSearch, start: FloatArray) -> Iterator[Near]:
    """Free robots that are bent from a start as by a force on the tip, the least bent first."""
    model = search.problem.model
    point = model.coordinates.at(search.problem.q_motors, start)
    jacobian = point.columns(frame_jacobian(model, model.embed(point.joints), model.tip)[:3])[1]
    found = 0
    for size, direction in itertools.product(_ASIDE, itertools.product((-1.0, 0.0, 1.0), repeat=3)):
        bent = (jacobian.T @ direction) / model.stiffness
        length = float(np.linalg.norm(jacobian @ bent))
        near = search.near(start + bent * (size * model.reach / length)) if length > 0.0 else None
        if near is not None and near.touch.penetration == 0.0:
            yield near
            found += 1
            if found == _MOST_ASIDE:
                return


def _of_least_norm(search: ContactSearch, found: Near) -> Near | None:
    """The equilibrium with the contact forces of least norm; None where the forces are unique."""
    reach = search.problem.model.reach
    if len(found.touch.rows) < 2:
        return None
    rows = found.touch.rows[found.touch.gaps.values <= TOUCHING * reach]
    if len(rows) < 2 or len(rows) == rows.shape[1] - null_space(rows).shape[1]:
        return None
    forces = resting_forces(found.touch, found.load, reach)
    least = search.near(found.state.q_springs, ForceTable.of(found.touch.gaps, forces))
    return least if least is not None and least.error <= max(BALANCED, found.error) else None


def _grown(search: ContactSearch, here: Near) -> tuple[Near | None, bool]:
    """Descend while the load grows from zero; the equilibrium under the whole load, or None; and whether it is stable."""
    whole, reached, growth = search.problem, 0.0, _FIRST_GROWTH
    part, stable = 0.0, False
    while reached < 1.0 and growth > _LEAST_GROWTH and search.spent < search.most:
        load = whole.load if part == 1.0 else whole.load.scaled(part)
        search.problem = ElasticProblem(whole.model, whole.q_motors, load, whole.tolerance)
        begin = search.near(here.state.q_springs, here.table)
        found, stable = (None, False) if begin is None else search.descend(begin)
        if found is not None and found.error <= BALANCED:
            here, reached, growth = found, part, 2.0 * growth if part else growth
        elif part == 0.0:
            break
        else:
            growth *= 0.25
        part = min(1.0, reached + growth)
    search.problem = whole
    return here if reached == 1.0 else None, stable
