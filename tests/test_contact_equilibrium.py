"""Equilibria in contact without friction: against SciPy, by hand, and by enumeration of active sets."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

import softrobots as sr
from softrobots.environment.capsules import robot_capsules
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import HalfSpace, Sphere
from tests.support.oracles import arm_energy

MOTORS, FORCE = (0.3, 0.6, -0.8), np.array([0.0, 30.0, -80.0])
WALLS = {
    "floor": [HalfSpace((0, 0, 1), -0.1)],
    "sphere": [Sphere(0.3, (0.93, 0.32, -0.11))],
    "corner": [HalfSpace((0, 0, 1), -0.1), HalfSpace((0.2, -1, 0.1), -0.55)],
    "floor and sphere": [HalfSpace((0.3, 0, 1), -0.08), Sphere(0.2, (0.65, 0.45, 0.1))],
}


def distances(model: sr.SoftModel, obstacles: list, q: np.ndarray) -> np.ndarray:
    """Distance of each capsule of a robot from half-spaces and spheres, by elementary geometry."""
    data = model.pinocchio.createData()
    pin.forwardKinematics(model.pinocchio, data, q)
    found = []
    for one in robot_capsules(model):
        a, b = data.oMi[one.joint].act(one.start), data.oMi[one.joint].act(one.end)
        for obstacle in obstacles:
            if isinstance(obstacle, HalfSpace):
                normal = np.array(obstacle.normal) / np.linalg.norm(obstacle.normal)
                found.append(min(normal @ a, normal @ b) - obstacle.offset - one.radius)
            else:
                share = np.clip((np.array(obstacle.position) - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
                found.append(np.linalg.norm(a + share * (b - a) - obstacle.position) - obstacle.radius - one.radius)
    return np.array(found)


@pytest.mark.parametrize("obstacles", WALLS.values(), ids=WALLS)
def test_energy_is_minimal_by_scipy_among_obstacles(arm: sr.SoftModel, obstacles: list) -> None:
    """SLSQP on the energy of Table 2 and the distances of the test; it stops at 1e-12 J, so about sqrt(2e-12 / 170) rad."""
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, environment=Environment(obstacles))

    def gaps(y: np.ndarray) -> np.ndarray:
        return distances(arm, obstacles, arm.configuration(MOTORS, y))

    best = minimize(
        lambda y: arm_energy(np.array(MOTORS), y, FORCE, 172.71),
        np.zeros(4),
        method="SLSQP",
        constraints={"type": "ineq", "fun": gaps},
        options={"ftol": 1e-12, "maxiter": 200},
    )
    assert found.contacts
    assert np.abs(found.q_springs - best.x).max() < 1e-6
    assert gaps(found.q_springs).min() > -1e-12
    assert found.stable
    assert all(contact.normal_force > 0.0 and contact.strict for contact in found.contacts)


def test_torques_balance_with_contact_forces_at_their_points(arm: sr.SoftModel) -> None:
    """Springs and motors carry the load and the contact forces, each by the Jacobian of its point."""
    environment = Environment(WALLS["floor and sphere"])
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, gravity=sr.EARTH_GRAVITY, environment=environment)
    model, data = arm.pinocchio, arm.pinocchio.createData()
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    gravity = model.copy()
    gravity.gravity.linear = np.array(sr.EARTH_GRAVITY)
    torque = -pin.computeGeneralizedGravity(gravity, gravity.createData(), found.q)
    tip = pin.computeFrameJacobian(model, data, found.q, model.getFrameId("tip"), axes)
    torque += tip[:3].T @ FORCE
    for contact in found.contacts:
        frame = model.getFrameId(contact.link)
        jacobian = pin.computeFrameJacobian(model, data, found.q, frame, axes)
        lever = contact.point - pin.updateFramePlacement(model, data, frame).translation
        torque += jacobian[:3].T @ contact.force + jacobian[3:].T @ np.cross(lever, contact.force)
    rounding = 1e-12 * np.linalg.norm(FORCE) * 1.2
    assert len(found.contacts) == 2
    assert np.abs(torque[arm.spring_indices] - found.spring_torques).max() < found.tolerance
    assert np.abs(torque[arm.motor_indices] - found.motor_torques).max() < rounding + found.tolerance
