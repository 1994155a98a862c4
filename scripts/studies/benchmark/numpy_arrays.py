r"""Equilibria of many cases at once, written plainly in NumPy: one array operation does one thing to all cases.

Rotations, joint axes and joint origins are arrays with a row a case; products are `einsum` and `@`, the Newton step is one
`np.linalg.solve` of a stack of matrices. Every iteration goes over all cases, until the last one has converged. This is what
one writes without blocks that fit a cache, without generated code, and without regard to which numbers are zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NotConverged, ParameterError
from softrobots.model.soft_model import SoftModel
from studies.benchmark.aligned_joints import aligned_joints
from studies.benchmark.pinocchio_solvers import TOLERANCE

_MOST = 50


class ArrayArm:
    """A serial robot of revolute joints with linear springs on some of them, for many cases at once."""

    def __init__(self, model: SoftModel) -> None:
        """Read the constant placements of the joints.

        Args:
            model: The robot.

        Raises:
            ParameterError: If it has branches, or joints that slide.
        """
        self.joints = aligned_joints(model)
        if any(self.joints.slides):
            raise ParameterError("model", model, "a robot of revolute joints")
        self.motors, self.springs = model.motor_indices, model.spring_indices
        self.stiffness, self.rest, self.reach = model.stiffness, model.rest, model.reach

    def equilibria(self, q_motors: FloatArray, forces: FloatArray) -> FloatArray:
        """Solve all cases, weightless, by Newton from the relaxed springs.

        Args:
            q_motors: Motor angles, shape (n, n_motors) [rad].
            forces: Forces on the tip, world axes, shape (n, 3) [N].

        Returns:
            Spring angles, shape (n, n_springs) [rad].

        Raises:
            NotConverged: If a case does not converge.
        """
        q = np.zeros((len(q_motors), len(self.joints.slides)))
        q[:, self.motors], q[:, self.springs] = q_motors, self.rest
        limits = TOLERANCE * np.linalg.norm(forces, axis=1) * self.reach
        for _ in range(_MOST):
            linear, angular = self.jacobians(q)
            residuals = self.stiffness * (q[:, self.springs] - self.rest) - np.einsum("nik,ni->nk", linear, forces)
            errors = np.linalg.norm(residuals, axis=1)
            if np.all(errors <= limits):
                return np.asarray(q[:, self.springs])
            moments = np.cross(forces[:, :, None], angular, axis=1)
            upper = np.triu(np.einsum("nij,nik->njk", moments, linear))  # (f x w_j) . v_k for j <= k
            slopes = upper + np.swapaxes(np.triu(upper, 1), 1, 2)
            q[:, self.springs] -= np.linalg.solve(np.diag(self.stiffness) - slopes, residuals[:, :, None])[:, :, 0]
        message = f"{np.count_nonzero(errors > limits)} of {len(q)} cases did not converge in {_MOST} iterations"
        raise NotConverged(message, best=q[:, self.springs], residual=float(errors.max()), iterations=_MOST)

    def jacobians(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Linear and angular Jacobian of the tip by the springs, world axes, shape (n, 3, n_springs) each."""
        rotation: Any = np.broadcast_to(np.eye(3), (len(q), 3, 3))
        position: Any = np.zeros((len(q), 3))
        axes, origins = [], []
        for number, (placed, moved) in enumerate(zip(self.joints.rotations, self.joints.translations, strict=True)):
            position = position + rotation @ moved
            rotation = rotation @ placed @ _about_z(q[:, number])
            axes.append(rotation[:, :, 2])
            origins.append(position)
        tip = position + rotation @ self.joints.tip
        angular = np.stack(axes, axis=2)[:, :, self.springs]
        arms = tip[:, :, None] - np.stack(origins, axis=2)[:, :, self.springs]
        return np.cross(angular, arms, axis=1), angular


def _about_z(angles: FloatArray) -> FloatArray:
    """Rotations about z, shape (n, 3, 3)."""
    result = np.zeros((len(angles), 3, 3))
    result[:, 0, 0] = result[:, 1, 1] = np.cos(angles)
    result[:, 1, 0] = np.sin(angles)
    result[:, 0, 1] = -result[:, 1, 0]
    result[:, 2, 2] = 1.0
    return result
