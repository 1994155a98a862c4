"""Motors that let a tip press less on its obstacle, where friction jams it."""

from __future__ import annotations

import numpy as np

from softrobots.statics.contact.contact_walk import SMALLEST
from softrobots.statics.contact.newton_in_contact import followed
from softrobots.statics.contact.quasi_static import FAR, Rest, change, step

_LEFT = 0.1  # share of the forces that is left
_NO_FORCE = 1e-6  # by the motors, relative to the largest


def press_less(here: Rest) -> Rest | None:
    """Turn the motors so that all contacts press and rub less, in proportion, where they stick.

    So each stays within its cone, and the tip where it is.

    Args:
        here: A robot at rest in contact with friction.

    Returns:
        The robot with a tenth of the forces; None where small steps do not lead there.
    """
    model, work, left = here.robot.model, 0.0, 1.0
    basis = model.actuators.basis
    while left > _LEFT:
        found, pressed = here.found, here.robot.pressed(here.found)
        sticking = found._replace(laws=found.laws._replace(sticks=pressed, slips=np.zeros_like(pressed)))
        ways = followed(sticking, here.sliding.friction, here.robot.by_motors(found))
        if ways is None:
            return None
        _, follow, by_normal, by_friction = ways
        forces = np.concatenate([found.normal[pressed], found.friction[pressed].ravel()])
        rows = np.concatenate([by_normal[pressed], by_friction[pressed].reshape(-1, model.n_motors)])
        turn = basis @ np.linalg.lstsq(rows @ basis, -forces, rcond=_NO_FORCE)[0]
        far = change(model, follow @ turn, np.zeros(model.n_springs)) / FAR
        share = min(left - _LEFT, 0.5 / max(far, 1e-300))
        motors = model.actuators.go(here.q_motors, share * turn)
        there = step(here.robot.given._replace(q_motors=motors), here) if share >= SMALLEST else None
        if there is None:
            return None
        here, work, left = there, work + there.work, left - share
    return here._replace(work=work)
