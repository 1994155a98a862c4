"""[Troise 2021], the inflatable arm as a robot: Denavit-Hartenberg tables, statics, the recursions and the movement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.load_estimation import estimate_load
from studies.papers import dh_tables
from studies.papers.arm_path import DURATION, END, FORCE, GAIN, START, arm, movement
from studies.papers.dh_tables import MOTORS, SPRINGS, TABLE_1, TABLE_2
from studies.papers.inflatable_arm import HINGE, LENGTH, MEAN_STIFFNESS
from studies.papers.rows import UNPUBLISHED, Row, absent, equation, largest, mended, own, rounded, taken

_LENGTHS = {
    "L": 1e-3 * float(LENGTH),
    "l1": 1e-3 * float(HINGE),
    "l2": 1e-3 * (float(LENGTH) - float(HINGE)),
}
_POSTURES = 200
_POSTURE = (0.3, 0.6, -0.8)
_MOVED = ("shoulder", "link_1_root", "hinge_1", "link_1", "link_2_root", "hinge_2", "link_2")
_ENDS = (*_MOVED[1:], "tip")  # where the tables put the frame that moves with a joint: at the next joint
_TOLD = f"{_POSTURES} random postures; axes may be drawn differently, by a constant turn"


def kinematics() -> list[Row]:
    """Tables 1 and 2, the degrees of freedom, and the Jacobian (4)."""
    model, random = arm(), np.random.default_rng(2021)
    rows = [
        taken(rounded("section 2.2", "degrees of freedom", "7", float(model.n_motors + model.n_springs))),
        taken(rounded("section 2.2", "of which motors", "3", float(model.n_motors))),
    ]
    postures = random.uniform(-np.pi / 2, np.pi / 2, (_POSTURES, 7))
    rigid = np.where(np.isin(np.arange(7), MOTORS), postures, 0.0)
    apart = max(
        float(np.abs(_tip(at) - dh_tables.frames(TABLE_1, at[list(MOTORS)], _LENGTHS)[-1][:3, 3]).max()) for at in rigid
    )
    rows.append(equation("Table 1", "place of the tip, springs at zero", apart, "m", f"{_POSTURES} random postures"))
    places, turns = _apart(postures)
    rows.append(equation("Table 2", "places of all links and of the tip", places, "m", _TOLD))
    rows.append(equation("Table 2", "orientations of all links and of the tip", turns, "", _TOLD))
    apart = 0.0
    for angles in postures:
        printed = dh_tables.jacobian(dh_tables.frames(TABLE_2, angles, _LENGTHS))
        apart = max(apart, float(np.abs(frame_jacobian(model, _configuration(angles), model.tip) - printed).max()))
    rows.append(equation("(4)", "Jacobian on Table 2, all entries", apart, "m", _TOLD.partition(";")[0]))
    return rows


def statics() -> list[Row]:
    """Equations (5) and (6) in equilibrium."""
    found = solve_equilibrium(arm(), _POSTURE, FORCE)
    torques = _jacobian(found).T @ np.array([*FORCE, 0.0, 0.0, 0.0])
    springs = float(np.abs(found.spring_torques - torques[list(SPRINGS)]).max())
    motors = float(np.abs(found.motor_torques - torques[list(MOTORS)]).max())
    note = "J of (4) on Table 2; f = (0, 10, -15) N, q_m = (0.3, 0.6, -0.8) rad; springs settle to 1e-9 N m"
    return [
        equation("(5)", "torques of the springs, tau_k = J_k^T gamma", springs, "N m", note, 5e-9),
        equation("(6)", "torques of the motors, tau_m = J_m^T gamma", motors, "N m", note, 5e-9),
    ]


def recursions() -> list[Row]:
    """The recursions of Figures 5 and 6, with equations (8) and (9)."""
    model = arm()
    true = solve_equilibrium(model, _POSTURE, FORCE)
    found = estimate_load(model, _POSTURE, true.motor_torques, method="alternation")
    note = "the same model makes the motor torques from this force and explains them; the paper shows no example"
    forces, tips = largest(found.force - FORCE), largest(found.equilibrium.tip_position - true.tip_position)
    rows = [
        taken(equation("Figure 5", "force that the recursion finds, against the true one", forces, "N", note, 1e-8)),
        taken(equation("Figure 5", "its estimate of the tip", tips, "m", note, 1e-10)),
    ]
    settled = solve_equilibrium(model, _POSTURE, FORCE, method="fixed_point")
    note = "100 rounds of q_k <- J_k^T gamma / k on Table 2"
    apart = largest(settled.q_springs - _fixed_point(np.array(_POSTURE)))
    rows.append(equation("Figure 6", "inner recursion: angles of the springs", apart, "rad", note, 1e-10))
    followed, smallest, step_error = movement().closed_loop, np.inf, 0.0
    for number in range(len(followed.times) - 1):
        interval = float(followed.times[number + 1] - followed.times[number])
        jacobian = _jacobian(followed.equilibria[number])
        smallest = min(smallest, float(np.linalg.svd(jacobian, compute_uv=False)[-1]))
        position = jacobian[:3]
        inverse = position.T @ np.linalg.inv(position @ position.T)  # (8)
        velocity = (followed.targets[number + 1] - followed.targets[number]) / interval
        error = followed.targets[number] - followed.tip_positions[number]
        moved = interval * inverse[list(MOTORS)] @ (velocity + GAIN * error)  # (9)
        step_error = max(step_error, largest(followed.q_motors[number + 1] - followed.q_motors[number] - moved))
    note = "(9) with the motor rows of the pseudo-inverse (8) of the three position rows of J; "
    note += f"Euler steps of 10 ms, gain {GAIN:g} 1/s (ours); our own path"
    rows.append(mended(equation("(8), (9), mended", "steps of the motors along a movement", step_error, "rad", note)))
    note = "on our path: with all six rows the closed loop leaves the path, as three motors hold no orientation"
    rows.append(own("(8)", "smallest singular value of the 6 x 7 Jacobian", smallest, "", note))
    lag = 1e3 * float(followed.tip_error.max())
    note = f"gain {GAIN:g} 1/s; it lags behind, less with more gain"
    rows.append(own("Figure 6", "largest distance from our path", lag, "mm", note))
    return rows


def figures_10_and_11() -> list[Row]:
    """What Figures 10 and 11 show, along our own path."""
    ours = movement()
    note = "x_start, x_d, duration and gain are not published: Figures 10 and 11 cannot be repeated, only their kind"
    rows = [absent(UNPUBLISHED, "Figures 10, 11", "path of the tip and angles of the motors", note=note)]
    path = f"our path {START} to {END} m, {DURATION:g} s, load (0, 10, -15) N"
    lag = 1e3 * float(ours.closed_loop.tip_error.max())
    note = f"our path, our tolerance, and Newton's method at every waypoint; there the paper's own loop lags by {lag:.0f} mm"
    reached = 1e9 * max(float(ours.loaded.tip_error.max()), 2e-9)
    quantity = "largest distance of the loaded tip from our path, at most"
    rows.append(own("Figure 10", quantity, reached, "nm", note, '"effectively follows"'))
    sag = 1e3 * float(ours.sagging.tip_error.max())
    rows.append(own("Figure 10", "largest sag without compensation", sag, "mm", path))
    turned = np.abs(ours.loaded.q_motors - ours.rigid.q_motors).max(axis=0)
    for number, angle in zip((1, 2, 5), turned, strict=True):
        rows.append(own("Figure 11", f"largest correction of joint {number}", float(angle), "rad", path))
    moments = ours.loaded.link_moments
    if moments is not None:
        for number, moment in enumerate(moments.max(axis=0), start=1):
            note = path if number == 2 else f"{path}; chosen near the paper's value, it does not confirm it"
            printed = "17.51" if number == 1 else ""
            rows.append(own("section 4", f"largest moment on link {number}", float(moment), "N m", note, printed))
    pressure = ours.loaded.required_pressure
    if pressure is not None:
        rows.append(own("section 4", "pressure that our path demands, exact", 1e-3 * pressure, "kPa", path, ">= 50"))
    return rows


def _configuration(angles: FloatArray) -> FloatArray:
    """Pinocchio's configuration at the seven angles of Table 2."""
    return arm().configuration(angles[list(MOTORS)], angles[list(SPRINGS)])


def _tip(angles: FloatArray) -> FloatArray:
    """Place of the tip at the seven angles of Table 2 [m]."""
    return np.asarray(frame_placement(arm(), _configuration(angles), arm().tip).translation)


def _angles(q_motors: FloatArray, q_springs: FloatArray) -> FloatArray:
    """The seven angles of Table 2."""
    angles = np.zeros(7)
    angles[list(MOTORS)], angles[list(SPRINGS)] = q_motors, q_springs
    return angles


def _jacobian(found: Equilibrium) -> FloatArray:
    """(4) on Table 2 at an equilibrium."""
    return dh_tables.jacobian(dh_tables.frames(TABLE_2, _angles(found.q_motors, found.q_springs), _LENGTHS))


def _fixed_point(q_motors: FloatArray) -> FloatArray:
    """Angles of the springs by the inner recursion of Figure 6, written on Table 2 [rad]."""
    springs = np.zeros(4)
    for _ in range(100):
        jacobian = dh_tables.jacobian(dh_tables.frames(TABLE_2, _angles(q_motors, springs), _LENGTHS))
        springs = jacobian[:3, list(SPRINGS)].T @ FORCE / float(MEAN_STIFFNESS)
    return springs


def _apart(postures: FloatArray) -> tuple[float, float]:
    """Largest differences of places [m] and of entries of rotations between Table 2 and the links, over postures."""
    model = arm()

    def drawn(angles: FloatArray, names: Sequence[str]) -> list[FloatArray]:
        q = _configuration(angles)
        return [np.asarray(frame_placement(model, q, name).homogeneous) for name in names]

    straight = zip(dh_tables.frames(TABLE_2, np.zeros(7), _LENGTHS)[1:], drawn(np.zeros(7), _MOVED), strict=True)
    constant = [table[:3, :3].T @ ours[:3, :3] for table, ours in straight]
    places = turns = 0.0
    for angles in postures:
        table = dh_tables.frames(TABLE_2, angles, _LENGTHS)[1:]
        for printed, turn, moved, end in zip(table, constant, drawn(angles, _MOVED), drawn(angles, _ENDS), strict=True):
            places = max(places, largest(end[:3, 3] - printed[:3, 3]))
            turns = max(turns, largest(moved[:3, :3] - printed[:3, :3] @ turn))
    return places, turns


JOBS = (kinematics, statics, recursions, figures_10_and_11)
"""What makes the rows on the robot."""
