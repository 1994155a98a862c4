"""Columns of the tables of results of statics, by name with unit, for CSV files and data frames."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.core.result_file import named_columns, vector_columns
from softrobots.model.actuators import load_units
from softrobots.model.soft_model import SoftModel
from softrobots.statics.buckling.equilibrium_branch import EquilibriumBranch
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.imposed_displacement import ImposedDisplacement
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.statics.load_estimation import LoadEstimate
from softrobots.statics.trajectory import Trajectory
from softrobots.statics.workspace import Workspace
from softrobots.statics.workspace_map import WorkspaceMap

Columns = dict[str, Any]


def joint_columns(model: SoftModel, q_motors: FloatArray, q_springs: FloatArray) -> Columns:
    """Return the columns of actuators and elastic coordinates, shapes (n, n_motors) and (n, n_springs)."""
    motors = named_columns(model.actuator_names, model.actuator_units, q_motors)
    return motors | named_columns(model.spring_joints, model.springs.units, q_springs)


def equilibrium_table(*rows: Equilibrium) -> Columns:
    """Return columns of equilibria of a robot: coordinates, loads on the actuators, tip, and whether they are stable."""
    model = rows[0].model
    motors, springs, loads, tips = (
        np.array([getattr(row, name) for row in rows]) for name in ("q_motors", "q_springs", "motor_torques", "tip_position")
    )
    carried = named_columns(model.actuator_names, load_units(model.actuator_units), loads, " load")
    table = joint_columns(model, motors, springs) | carried | vector_columns("tip", "m", tips)
    return table | {"stable": np.array([int(row.stable) for row in rows])}


def ik_table(solution: IkSolution) -> Columns:
    """Return the row of a solution: target, distance from it, equilibrium."""
    missed = {"tip error [m]": np.array([solution.error])}
    return vector_columns("target", "m", solution.target[None]) | missed | equilibrium_table(solution.equilibrium)


def estimate_table(estimate: LoadEstimate) -> Columns:
    """Return the row of an estimate: force, equilibrium."""
    return vector_columns("force", "N", estimate.force[None]) | equilibrium_table(estimate.equilibrium)


def imposed_table(result: ImposedDisplacement) -> Columns:
    """Return the row of a displacement: its size, the reaction, equilibrium."""
    pushed = {"displacement [m]": np.array([result.displacement]), "reaction [N]": np.array([result.reaction])}
    return pushed | equilibrium_table(result.equilibrium)


def branch_table(*branches: EquilibriumBranch) -> Columns:
    """Return a row for each equilibrium of some branches: label, force, amplitude, energy, equilibrium."""
    rows = [row for branch in branches for row in branch.equilibria]
    forces, amplitudes, energies = (
        np.concatenate([getattr(branch, name) for branch in branches]) for name in ("forces", "amplitude", "energy")
    )
    labels = [branch.label for branch in branches for _ in branch.equilibria]
    table = {"branch": labels, "force [N]": forces, "amplitude [rad or m]": amplitudes, "energy [J]": energies}
    return table | equilibrium_table(*rows)


def workspace_table(workspace: Workspace) -> Columns:
    """Return a row for each sample: coordinates, tip, manipulability."""
    table = joint_columns(workspace.model, workspace.q_motors, workspace.q_springs)
    table |= vector_columns("tip", "m", workspace.tip_positions)
    return table | {"manipulability [m^3/rad^3]": workspace.manipulability}


def map_table(found: WorkspaceMap) -> Columns:
    """Return a row for each target and load: both, what is reached there, and the posture."""
    targets, each = found.grid.targets, len(found.loads)
    table = vector_columns("target", "m", np.repeat(targets, each, axis=0)) | {"load [N]": np.tile(found.loads, len(targets))}
    table |= {"reached": found.reached.ravel().astype(int), "required pressure [Pa]": found.required_pressure.ravel()}
    table["payload [N]"] = np.repeat(found.payload.ravel(), each)
    springs = found.q_springs.reshape(-1, found.model.n_springs)
    return table | joint_columns(found.model, found.q_motors.reshape(len(springs), -1), springs)


def trajectory_table(trajectory: Trajectory) -> Columns:
    """Return a row for each waypoint; see `softrobots.save_csv`."""
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
    path = trajectory.contact_path
    return columns | last | forces | ({} if path is None else {"work of friction [J]": path.dissipation})
