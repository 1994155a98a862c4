"""Tip errors of every model over the number of segments, their order of convergence, and MuJoCo's answer."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import softrobots as sr
from softrobots.cli.tools.kinematics import pose_error
from softrobots.export.mjcf import to_mjcf
from softrobots.model.pinocchio_data import MAX_DOF
from studies.agreement.robots import COARSE, FINE, Poses, Study
from studies.interop.cases import WELDED
from studies.interop.mujoco_statics import static_equilibrium, tip_pose
from studies.interop.outcomes import Question


def compare(study: Study, progress: Callable[[Sequence[Any]], Any], *, mujoco: bool) -> dict[str, Any]:
    """Tip errors of every form for every number of segments, of the rod itself, and of MuJoCo's answer to the lumped chain."""
    exact, coarse = study.rod(FINE), study.rod(COARSE)
    result: dict[str, Any] = {"title": study.title, "counts": list(study.counts), "rod": errors(coarse, exact), "forms": {}}
    if study.closed_form is not None:
        result["closed_form"] = errors([study.closed_form], exact)
    jobs = [(name, n) for name, form in study.forms.items() for n in study.counts if fits(form.robot(n))]
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in study.forms}
    in_mujoco, apart = [], []
    for name, n in progress(jobs):
        form = study.forms[name]
        robot = form.robot(n)
        model = sr.load_model(robot)
        model.workspace(None)  # takes longer than a solve
        began = time.process_time()
        found = form.solve(model)
        spent = (time.process_time() - began) / len(found)
        # Moments that keep their direction let a round rod flutter if nothing damps it; none may be beyond buckling.
        stable = sum(one.stability.kind in ("stable", "flutter") for one in found)
        ours = [one.transform_tip_to_world.homogeneous for one in found]
        rows[name].append(
            {"n": n, **errors([form.axes.T @ one @ form.axes for one in ours], exact), "stable": stable, "solve_s": spent}
        )
        if mujoco and name == study.mujoco:
            theirs = [mujoco_pose(one, robot) for one in found]
            in_mujoco.append({"n": n, **errors([form.axes.T @ one @ form.axes for one in theirs], exact)})
            apart.append({"n": n, **errors(theirs, ours)})
    result["forms"] = {name: with_orders(row) for name, row in rows.items()}
    if apart:
        result["mujoco"] = {"of": study.mujoco, **with_orders(in_mujoco), "apart": apart}
    return result


def fits(robot: Any) -> bool:
    """Whether Pinocchio supports the number of joints."""
    return isinstance(robot, sr.InflatableArm) or robot.n_joints <= MAX_DOF


def errors(found: Poses, exact: Poses) -> dict[str, float]:
    """Mean and largest distance [m] and angle [rad]."""
    both = np.array([pose_error(one, other) for one, other in zip(found, exact, strict=True)])
    (mean, angle), (largest, largest_angle) = both.mean(axis=0).tolist(), both.max(axis=0).tolist()
    return {"error_m": mean, "largest_m": largest, "error_rad": angle, "largest_rad": largest_angle}


def with_orders(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return rows with the order of convergence between the last two."""
    orders = {}
    if len(rows) > 1:
        last, ratio = rows[-2:], math.log(rows[-1]["n"] / rows[-2]["n"])
        orders = {
            name: math.log(last[0][key] / last[1][key]) / ratio
            for name, key in (("order", "error_m"), ("angle_order", "error_rad"))
        }
    return {"rows": rows, **orders}


def mujoco_pose(found: sr.Equilibrium, robot: Any) -> np.ndarray:
    """Pose of the tip where MuJoCo's own forces balance, in the file of our exporter; it gets muscles as their tensions."""
    model, motors = found.model, found.q_motors
    if model.muscles and model.muscle_input == "lengths":
        model, motors = sr.load_model(robot, muscles="forces"), found.muscle_forces
    load = found.load
    text = to_mjcf(model, motors, actuators=WELDED, gravity=load.gravity)
    fx, fy, fz = load.wrenches[model.tip][:3].tolist()
    question = Question(text, model.tip, (fx, fy, fz), load.gravity)
    return tip_pose(question, static_equilibrium(question).joints)
