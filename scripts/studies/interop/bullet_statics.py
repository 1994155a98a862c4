"""Equilibria in PyBullet, which has no joint springs, by the Python file of `softrobots.export.to_pybullet`, which has them."""

from __future__ import annotations

import sys
import time
from types import ModuleType

import numpy as np

from softrobots.core.errors import NotConverged
from studies.interop.outcomes import SECONDS, Outcome, Question
from studies.interop.tools import find_tool


def simulate(question: Question, seconds: float = SECONDS) -> Outcome:
    """Run the file until its robot is at rest, at PyBullet's default time step of 1/240 s.

    Args:
        question: The text of the file, and the load.
        seconds: How long at most [s].

    Returns:
        Where it ends.

    Raises:
        MissingDependency: If PyBullet is not installed.
        NotConverged: If the robot still moves then; `best` is None.
    """
    pybullet = find_tool("PyBullet").load()
    file = _imported(question.text)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(*(question.gravity or (0.0, 0.0, 0.0)), physicsClientId=client)
        robot = file.load(client)
        began = time.perf_counter()
        try:
            joints = file.settle(robot, question.force, question.tip, seconds)
        except RuntimeError as error:
            raise NotConverged(f"PyBullet: {error}", best=None, residual=float("inf"), iterations=0) from error
        elapsed = time.perf_counter() - began
        speed = float(np.abs(file.state(robot)[1]).max(initial=0.0))
        contacts = len(pybullet.getContactPoints(robot.body, physicsClientId=client) or ())
        forces = {}
        for name, body in robot.obstacles.items():
            rows = pybullet.getContactPoints(robot.body, body, physicsClientId=client) or ()
            pushes = [
                np.multiply(row[9], row[7]) + np.multiply(row[10], row[11]) + np.multiply(row[12], row[13]) for row in rows
            ]
            if any(row[9] for row in rows):
                forces[name] = np.sum(pushes, axis=0)
        return Outcome(joints, speed, contacts, 0, elapsed, forces)
    finally:
        pybullet.disconnect(client)


def _imported(text: str) -> ModuleType:
    """The file as a module; a data class looks its module up while it is made."""
    result = ModuleType("robot_for_pybullet")
    sys.modules[result.__name__] = result
    try:
        exec(compile(text, f"{result.__name__}.py", "exec"), result.__dict__)
    finally:
        del sys.modules[result.__name__]
    return result
