r"""Equilibrium in contact with Coulomb friction over one small step: the semismooth Newton of Alart and Curnier.

Unknown are the elastic coordinates `y`, and for each near contact the normal force :math:`\lambda_n` [N] and the friction
:math:`\lambda_t` [N] in its tangent plane. With the gap `g`, its gradient `G`, the sliding `s` since the last state and the
tangential Jacobian `T` of the touching material points, an equilibrium at the end of the step is a zero of

.. math:: r(y) - G^T \lambda_n - T^T \lambda_t, \qquad \lambda_n - \max(0, \lambda_n - \rho g), \qquad
   \lambda_t - \Pi_{\mu \lambda_n}(\lambda_t - \rho s),

where :math:`\Pi_a` is the nearest point of the disk of radius `a` (P. Alart, A. Curnier, A mixed formulation for frictional
contact problems prone to Newton like solution methods, Computer Methods in Applied Mechanics and Engineering 92, 1991, section
4; implicit in time: the friction at the end of the step opposes the sliding in it). Without friction only `y` and
:math:`\lambda_n` are left. The contacts that press (:math:`\lambda_n > \rho g`) stand in one dense system, which is not
symmetric; where it is singular (more contacts than the robot has coordinates) the smallest change of forces is taken,
and a contact whose sliding no motion of the springs can prevent (an elbow of rigid links that is turned) slips.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.contact.contact_laws import Balance, Laws, NearContacts, Step
from softrobots.statics.contact.newton_in_contact import newton_change

MOST_EVALUATIONS = 40
"""Evaluations within a step of a path."""

LARGEST_STEP = 0.5
"""Norm of the largest Newton step [rad]."""

GAP = 1e-11
"""Penetration, and sliding of a contact that sticks, that are none, relative to the reach."""

CONE = 1e-10
"""Violation of the law of friction that is none, relative to the largest normal force."""

_MOTIONLESS = 1e-6  # motion of a point that no spring can move, over the reach and a radian
_OPENING = 100.0  # weight of a gap against a force, over the stiffness of the springs, where contacts are taken as open
_FULL_STEPS = 12  # Newton steps before they are halved
_NO_NEARER = 1e-3  # change of the norm of all equations, relative to it, with which steps go nowhere
_HALVINGS = 5  # of a Newton step
_STILL = 1e-10  # [rad], Newton step after which no motion of the springs brings the equations any nearer


def solve_step(
    step: Step, start: FloatArray, coefficient: float, *, patient: bool = True, forced: float = GAP
) -> tuple[Balance | None, int]:
    """Solve a step from elastic coordinates, shape (n,).

    First by full Newton steps; where these do not converge, by steps that are halved while they do not lower the norm of all
    equations: full steps get over changes of contacts more quickly, and halved ones do not go round in circles. Either ends
    where dry friction of the robot's own would turn round: beyond that it sticks at first, and full steps would go to and fro.

    Args:
        step: The robot.
        start: Elastic coordinates to start from, shape (n,).
        coefficient: Friction coefficient.
        patient: Whether to go on by halved steps.
        forced: Largest sliding of contacts that stick where no motion of the springs can prevent it, relative to the reach.

    Returns:
        The equilibrium, None if there is none or it is not found; and the evaluations spent.
    """
    start_place, spent = step.mark(), 0
    for halvings, most in ((1, _FULL_STEPS), (_HALVINGS, MOST_EVALUATIONS))[: 2 if patient else 1]:
        step.return_to(start_place)
        here, first = _balance(step, start, np.zeros(0), np.zeros((0, 2)), coefficient, step.stiffness, True), spent
        spent += 1
        while here is not None and spent < first + most:
            if _converged(step, here):
                return here, spent
            change = _change(here, coefficient, GAP * step.reach, forced * step.reach, halvings == 1)
            if change is None:
                break
            if float(np.linalg.norm(change[0])) <= _STILL and _converged(step, here, forced):
                return here, spent
            scale = np.maximum(step.stiffness, here.tangent.diagonal())
            share = min(step.first_turn(here[0], change[0]), LARGEST_STEP / max(float(np.linalg.norm(change[0])), 1e-300))
            base, there = step.mark(), None
            for _ in range(halvings):
                y, normal, friction = (part + share * by for part, by in zip((here[0], *here[2:4]), change, strict=True))
                step.return_to(base)
                there, spent = _balance(step, y, normal, friction, coefficient, scale), spent + 1
                if there is not None and there.laws.merit < (1.0 - 0.1 * share) * here.laws.merit:
                    break
                share *= 0.5
            if there is not None and abs(there.laws.merit - here.laws.merit) <= _NO_NEARER * here.laws.merit:
                there = there if _converged(step, there, forced) else None
            here = there
    return None, spent


def _change(
    here: Balance, coefficient: float, none: float, forced: float, opens: bool
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Newton's change, in which no contact is to do what others and the robot do not let it.

    One whose gap would be left open by more than `none` [m] is taken as open: of contacts in nearly the same place, as on both
    sides of a joint, no motion closes all gaps. So is, if it `opens`, one that would pull: two near each other both press only
    where the robot bends hard between them. Where all close, one that sticks and would be left sliding by more than
    `forced` [m] slips, with its friction against that.
    """
    while True:
        change, near, laws = newton_change(here, coefficient), here.contacts, here.laws
        if change is None:
            return None
        left = np.where(laws.pressed, near.gaps + near.gradients @ change[0], 0.0)
        slid = np.where(laws.sticks[:, None], near.sliding + near.jacobian @ change[0], 0.0)
        ways, pulls = np.linalg.norm(slid, axis=1), np.where(laws.pressed, -here.normal - change[1], 0.0)
        worst = left if left.max(initial=0.0) > none else pulls
        if worst is left or (opens and pulls.max(initial=0.0) > CONE * float(here.normal.max(initial=0.0))):
            kept = np.arange(len(left)) != worst.argmax()
            laws = laws._replace(pressed=laws.pressed & kept, sticks=laws.sticks & kept, slips=laws.slips & kept)
        elif ways.max(initial=0.0) > forced:
            slips = np.arange(len(left)) == ways.argmax()
            way = np.where(slips[:, None], -slid / np.maximum(ways, 1e-300)[:, None], laws.way)
            broken = np.where(slips[:, None], here.friction - coefficient * here.normal[:, None] * way, laws.broken)
            held = np.where(slips, 0.0, laws.held)
            laws = laws._replace(sticks=laws.sticks & ~slips, slips=laws.slips | slips, way=way, held=held, broken=broken)
        else:
            return change
        here = here._replace(laws=laws)


def balance_of(step: Step, y: FloatArray, near: NearContacts, normal: FloatArray, friction: FloatArray, sticks: Any) -> Balance:
    """Return a state whose forces are known, at the coordinates that the step was asked last.

    Args:
        step: The robot.
        y: Elastic coordinates, shape (n,).
        near: The contacts there.
        normal: Normal forces, shape (m,) [N].
        friction: Friction, shape (m, 2) [N].
        sticks: Which contacts stick, shape (m,), bool.
    """
    residual, tangent, allowed = step.residual(normal, friction)
    size, none = np.linalg.norm(friction, axis=1), np.zeros(len(normal))
    way = friction / np.maximum(size, 1e-300)[:, None]
    slips = (size > 0.0) & ~sticks
    laws = Laws(normal > 0.0, sticks, slips, way, none, np.zeros_like(friction), np.sqrt(step.stiffness), none, none, 0.0)
    return Balance(y, near, normal, friction, residual, tangent, allowed, laws)


def _balance(
    step: Step,
    y: FloatArray,
    normal: FloatArray,
    friction: FloatArray,
    coefficient: float,
    scale: FloatArray,
    first: bool = False,
) -> Balance | None:
    """Evaluate all equations; None out of the range of a section. At `first` no contact of the last state is taken as open."""
    near = step.contacts(y)
    if near is None:
        return None
    normal, friction = step.carried(normal, friction)
    root = np.sqrt(scale)
    unit_normal = _unit_force(near.gradients, root, step.reach)
    unit_friction = np.minimum(_unit_force(near.jacobian, root, step.reach).min(axis=1, initial=np.inf), unit_normal)
    gaps = np.minimum(near.gaps, 0.0) if first else near.gaps
    pressed = normal > _OPENING * unit_normal**2 * gaps
    rubs = pressed & (coefficient > 0.0)
    tried = friction - (unit_friction**2)[:, None] * near.sliding
    size, radius = np.linalg.norm(tried, axis=1), coefficient * np.maximum(normal, 0.0)
    sticks = rubs & (size <= radius)
    size = np.maximum(size, 1e-300)
    way = tried / size[:, None]
    slips = rubs & ~sticks
    broken = friction - np.where(slips[:, None], radius[:, None] * way, 0.0)
    residual, tangent, allowed = step.residual(normal, friction)
    parts = (
        residual / root,
        np.where(pressed, near.gaps * unit_normal, normal / unit_normal),
        (np.where(sticks[:, None], near.sliding * unit_friction[:, None] ** 2, broken) / unit_friction[:, None]).ravel(),
    )
    merit = float(np.linalg.norm(np.concatenate(parts)))
    laws = Laws(pressed, sticks, slips, way, radius / size, broken, root, unit_normal, unit_friction, merit)
    return Balance(y, near, normal, friction, residual, tangent, allowed, laws)


def _converged(step: Step, here: Balance, sliding: float = GAP) -> bool:
    """Whether balance, gaps, sliding (relative to the reach) and friction are within their tolerances."""
    near, laws, normal = here.contacts, here.laws, here.normal
    force = max(CONE * float(normal.max(initial=0.0)), here.allowed / step.reach)
    open_gaps = np.where(laws.pressed, np.abs(near.gaps), -near.gaps)
    return bool(
        np.linalg.norm(here.residual) <= here.allowed
        and open_gaps.max(initial=0.0) <= GAP * step.reach
        and np.abs(near.sliding[laws.sticks]).max(initial=0.0) <= sliding * step.reach
        and np.abs(laws.broken[~laws.sticks]).max(initial=0.0) <= force
        and np.abs(normal[~laws.pressed]).max(initial=0.0) <= force
        and normal.min(initial=0.0) >= -force
    )


def _unit_force(rows: FloatArray, root: FloatArray, reach: float) -> FloatArray:
    """Force along each row that stores half a joule in the springs alone, shape of the rows without their last axis [N]."""
    return np.asarray(1.0 / np.maximum(np.linalg.norm(rows / root, axis=-1), _MOTIONLESS * reach / root.max()))
