"""Columns of a trajectory in a CSV file."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.statics.trajectory import Trajectory


def trajectory_table(trajectory: Trajectory) -> dict[str, FloatArray]:
    """Columns of a CSV file of a trajectory; see `save_csv`."""
    model, angles = trajectory.model, trajectory.orientation_error
    moments = np.zeros((len(trajectory.times), 0)) if trajectory.link_moments is None else trajectory.link_moments
    last = {f"moment_{link}": column for link, column in enumerate(moments.T, start=1)}
    columns = {"t": trajectory.times} | dict(zip("xyz", trajectory.targets.T, strict=True))
    columns |= dict(zip(("tip_x", "tip_y", "tip_z"), trajectory.tip_positions.T, strict=True))
    columns["tip_error"] = trajectory.tip_error
    if trajectory.orientations is not None and angles is not None:
        turned = np.array([pin.rpy.matrixToRpy(one) for one in trajectory.orientations])
        columns |= dict(zip(("roll", "pitch", "yaw"), turned.T, strict=True)) | {"orientation_error": angles}
    joints = np.hstack([trajectory.q_motors, trajectory.q_springs])
    for name, column in zip((*model.motor_joints, *model.spring_joints), joints.T, strict=True):
        while name in columns or name in last:
            name = f"joint_{name}"
        columns[name] = column
    forces = {f"force on {name} [N]": force for name, force in trajectory.contact_forces.items()}
    return columns | last | forces
