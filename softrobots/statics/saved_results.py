"""Serialisation of the results of statics: named arrays for result files.

A file holds the robot (URDF and springs), the load and the coordinates. Everything else is computed again on loading, and a
file whose residual is larger than it claims is refused.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice, finite_array, finite_number, increasing, read_only
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.json_text import parse_json
from softrobots.core.result_file import KINDS, TABLES, Kind, counts, label, text
from softrobots.model.friction_coordinates import packed_memories, with_memories
from softrobots.model.loader import load_again, load_arguments
from softrobots.model.soft_model import SoftModel
from softrobots.statics.buckling.equilibrium_branch import EquilibriumBranch
from softrobots.statics.contact.pressed_gaps import check_no_rubbing
from softrobots.statics.contact.touch import TOUCHING
from softrobots.statics.displacement_control import DisplacementControl, Probe
from softrobots.statics.elastic_state import TOLERANCE, elastic_state, largest_residual
from softrobots.statics.elastostatics import METHODS
from softrobots.statics.equilibrium import Equilibrium, equilibrium_from_state
from softrobots.statics.imposed_displacement import ImposedDisplacement, imposed_result
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.statics.load_estimation import METHODS as ESTIMATIONS
from softrobots.statics.load_estimation import LoadEstimate, estimate_at, packed_estimate
from softrobots.statics.loads import Load, load_of_data
from softrobots.statics.tables.columns import (
    branch_table,
    equilibrium_table,
    estimate_table,
    ik_table,
    imposed_table,
    map_table,
    trajectory_table,
    workspace_table,
)
from softrobots.statics.tip_goal import Goal, checked_orientation
from softrobots.statics.trajectory import Trajectory
from softrobots.statics.workspace import FIELDS, Workspace, workspace_at
from softrobots.statics.workspace_map import WorkspaceMap, packed, unpacked

_COLUMNS = ("q_motors", "q_springs", "residual", "tolerance", "iterations")
_SOLVERS = (*METHODS, *(name for name in ESTIMATIONS if name not in METHODS))


def pack_model(model: SoftModel, load: Load) -> dict[str, Any]:
    """Return the named texts that hold a robot and a load in a result file."""
    wrenches = {name: wrench.tolist() for name, wrench in load.wrenches.items()}
    obstacles = {} if load.environment is None else {"environment": load.environment.to_dict()}
    load_text = json.dumps({"wrenches": wrenches, "gravity": load.gravity} | obstacles)
    return {"urdf": model.urdf, "model": json.dumps(load_arguments(model)), "load": load_text}


def unpack_model(fields: Mapping[str, Any]) -> tuple[SoftModel, Load]:
    """Return the robot and the load of the texts of `pack_model`.

    Raises:
        FileFormatError: If they hold none; other exceptions of readers mean the same.
    """
    arguments, load = (parse_json(text(fields, name)) for name in ("model", "load"))
    urdf = text(fields, "urdf")
    if not urdf.startswith("<"):
        raise FileFormatError("its urdf is not URDF text")  # load_model would take it for a path
    springs = {str(name): (float(k), float(rest)) for name, (k, rest) in arguments["springs"].items()}
    muscles = arguments.get("muscles", "lengths")
    model = load_again(urdf, springs=springs, motors=arguments["motors"], tip=arguments["tip"], muscles=muscles)
    return model, load_of_data(model, load)


def _pack_rows(equilibria: tuple[Equilibrium, ...], *, one_load: bool = True) -> dict[str, Any]:
    first = equilibria[0]
    if one_load and any(not e.load.same_as(first.load) for e in equilibria):
        raise ParameterError("result", first.model, "equilibria under one load; these have several")
    for equilibrium in equilibria:
        check_no_rubbing(equilibrium, "its file (a ContactPath is saved with its friction)")
    columns = {name: [getattr(equilibrium, name) for equilibrium in equilibria] for name in _COLUMNS}
    columns |= packed_memories([equilibrium.model for equilibrium in equilibria])
    return pack_model(first.model, first.load) | columns | {"solver": [equilibrium.method for equilibrium in equilibria]}


def _unpack_rows(fields: Mapping[str, Any], forces: FloatArray | None = None, frame: str = "") -> tuple[Equilibrium, ...]:
    """Equilibria under one load, each with one more force, shape (n, 3) [N], at a frame."""
    model, load = unpack_model(fields)
    count = len(fields["q_motors"])
    if count == 0 or any(len(fields[name]) != count for name in (*_COLUMNS, "solver")):
        raise FileFormatError("its arrays must have one row for each of at least one configuration")
    motors = finite_array("q_motors", fields["q_motors"], (count, model.n_motors))
    springs = finite_array("q_springs", fields["q_springs"], (count, model.n_springs), "rad")
    residual, tolerance = (finite_array(name, fields[name], (count,), "N m") for name in ("residual", "tolerance"))
    iterations, solvers = counts(fields, "iterations"), fields["solver"].tolist()
    for solver in set(solvers):
        choice("solver", solver, _SOLVERS)
    equilibria = []
    for row, robot in enumerate(with_memories(fields, model, count)):
        model.actuators.checked(motors[row])
        at = load if forces is None else load.plus(frame, np.append(forces[row], np.zeros(3)))
        state = elastic_state(robot, motors[row], springs[row], at)
        found = equilibrium_from_state(robot, motors[row], at, state, method=solvers[row], iterations=iterations[row])
        # Rounding differs between machines; a coordinate shifted by 1e-9 rad exceeds this.
        if found.residual > 1.001 * residual[row] + largest_residual(model, state.scale, 1e-12):
            raise FileFormatError(
                f"its row {row} claims a residual of {residual[row]:.3g} N m, but it is {found.residual:.3g} N m"
            )
        deepest = min((contact.gap for contact in found.contacts), default=0.0)
        if deepest < -TOUCHING * model.reach:
            raise FileFormatError(f"its row {row} is {-deepest:.3g} m inside of an obstacle")
        equilibria.append(replace(found, tolerance=float(tolerance[row])))
    return tuple(equilibria)


def _pack_solution(solution: IkSolution) -> dict[str, Any]:
    return _pack_rows((solution.equilibrium,)) | {
        "target": solution.target,
        "orientation": solution.orientation,
        "error": solution.error,
        "steps": solution.iterations,
        "alternatives": np.array(solution.alternatives).reshape(-1, len(solution.q_motors)),
    }


def _unpack_solution(fields: Mapping[str, Any]) -> IkSolution:
    (equilibrium,) = _unpack_rows(fields)
    target = finite_array("target", fields["target"], (3,), "m")
    others = finite_array("alternatives", fields["alternatives"], (None, equilibrium.model.n_motors), "rad")
    for other in others:
        equilibrium.model.actuators.checked(other, "alternatives")
    orientation = checked_orientation(fields["orientation"]) if "orientation" in fields else None
    translation, turn = Goal(target, orientation).missing(equilibrium.model, equilibrium.q)
    if abs(float(fields["error"]) - float(np.linalg.norm(translation))) > 1e-9 * equilibrium.model.reach:
        raise FileFormatError(f"its tip is {np.linalg.norm(translation):.3g} m from the target, not {fields['error']:.3g} m")
    return IkSolution(
        target=read_only(target),
        orientation=None if orientation is None else read_only(orientation),
        equilibrium=equilibrium,
        error=float(np.linalg.norm(translation)),
        orientation_error=float(np.linalg.norm(turn)),
        iterations=counts(fields, "steps")[0],
        alternatives=tuple(map(read_only, others)),
    )


def _pack_imposed(result: ImposedDisplacement) -> dict[str, Any]:
    rows, load = _pack_rows((result.equilibrium,)), pack_model(result.model, result.load)
    return rows | load | vars(result.probe) | {"displacement": result.displacement, "reaction": result.reaction}


def _unpack_imposed(fields: Mapping[str, Any]) -> ImposedDisplacement:
    model, load = unpack_model(fields)
    point, direction, origin = (read_only(finite_array(name, fields[name], (3,))) for name in ("point", "direction", "origin"))
    normal = read_only(finite_array("normal", fields["normal"], (3,))) if "normal" in fields else None
    probe = Probe(text(fields, "frame"), point, direction, origin, normal)
    problem = DisplacementControl(model, model.actuators.checked(fields["q_motors"][0]), load, probe, TOLERANCE)
    springs = finite_array("q_springs", fields["q_springs"][0], (model.n_springs,), "rad")
    probed = problem.at(springs, finite_number("reaction", fields["reaction"], "N"))
    displacement = finite_number("displacement", fields["displacement"], "m")
    result = imposed_result(problem, probed, displacement, counts(fields, "iterations")[0])
    claimed = 1.001 * float(fields["residual"][0]) + 1e-2 * result.equilibrium.tolerance
    if not (result.residual <= claimed and result.gap <= 1e-11 * model.reach):
        raise FileFormatError(
            f"its residual is {result.residual:.3g} N m, and the probe is {result.gap:.3g} m from where it claims to be"
        )
    return replace(result, equilibrium=replace(result.equilibrium, tolerance=float(fields["tolerance"][0])))


def _pack_trajectory(trajectory: Trajectory) -> dict[str, Any]:
    path = trajectory.contact_path
    rows = _pack_rows(trajectory.equilibria) if path is None else KINDS["contact_path"].to_arrays(path)
    targets = {"targets": trajectory.targets, "orientations": trajectory.orientations}
    return rows | targets | {"times": trajectory.times, "following": trajectory.method}


def _unpack_trajectory(fields: Mapping[str, Any]) -> Trajectory:
    path = KINDS["contact_path"].from_arrays(fields) if "dissipation" in fields else None
    equilibria = _unpack_rows(fields) if path is None else path.equilibria
    orientations = None
    if "orientations" in fields:
        given = finite_array("orientations", fields["orientations"], (len(equilibria), 3, 3))
        orientations = read_only(np.array([checked_orientation(one) for one in given]))
    return Trajectory(
        orientations=orientations,
        times=read_only(increasing("times", finite_array("times", fields["times"], (len(equilibria),), "s"), "s")),
        targets=read_only(finite_array("targets", fields["targets"], (len(equilibria), 3), "m")),
        equilibria=equilibria,
        method=label(fields, "following"),
        contact_path=path,
    )


def _pack_workspace(workspace: Workspace) -> dict[str, Any]:
    arrays = {name: getattr(workspace, name) for name in FIELDS}
    return pack_model(workspace.model, workspace.load) | arrays | {"refused": workspace.refused}


def _unpack_workspace(fields: Mapping[str, Any]) -> Workspace:
    model, load = unpack_model(fields)
    return workspace_at(model, load, **{name: fields[name] for name in FIELDS}, refused=counts(fields, "refused")[0])


def _pack_map(result: WorkspaceMap) -> dict[str, Any]:
    return pack_model(result.model, Load.of(result.model, gravity=result.gravity)) | packed(result)


def _unpack_map(fields: Mapping[str, Any]) -> WorkspaceMap:
    model, load = unpack_model(fields)
    return unpacked(model, load.gravity, fields)


def _pack_branches(branches: tuple[EquilibriumBranch, ...]) -> dict[str, Any]:
    rows = tuple(equilibrium for branch in branches for equilibrium in branch.equilibria)
    forces = {name: np.array([row.load.wrenches[name][:3] for row in rows]) for name in rows[0].load.wrenches}
    frame = max(forces, key=lambda name: float(np.ptp(forces[name], axis=0).max()))  # the one that is pushed
    return _pack_rows(rows, one_load=False) | {
        "frame": frame,
        "pushes": forces[frame] - forces[frame][0],
        "labels": [branch.label for branch in branches],
        "ends": [branch.ended for branch in branches],
        "points": [len(branch.equilibria) for branch in branches],
        "forces": np.concatenate([branch.forces for branch in branches]),
        "amplitudes": np.concatenate([branch.amplitude for branch in branches]),
        "n_crossings": [len(branch.crossings) for branch in branches],
        "crossings": np.concatenate([branch.crossings for branch in branches]),
    }


def _unpack_branches(fields: Mapping[str, Any]) -> tuple[EquilibriumBranch, ...]:
    pushes = finite_array("pushes", fields["pushes"], (len(fields["q_motors"]), 3), "N")
    rows = _unpack_rows(fields, pushes, text(fields, "frame"))
    forces, amplitudes = (finite_array(name, fields[name], (len(rows),)) for name in ("forces", "amplitudes"))
    points, n_crossings = counts(fields, "points"), counts(fields, "n_crossings")
    crossings = finite_array("crossings", fields["crossings"], (sum(n_crossings),), "N")
    names = [[label({name: word}, name) for word in np.atleast_1d(fields[name])] for name in ("labels", "ends")]
    if sum(points) != len(rows) or 0 in points or {len(points)} != {len(n_crossings), *map(len, names)}:
        raise FileFormatError("its arrays must have one row for each branch, and one for each of their points")
    if np.abs(np.linalg.norm(pushes, axis=1) - np.abs(forces)).max() > 1e-9 * np.abs(forces).max():
        raise FileFormatError("its forces are not those of its loads")
    states = (elastic_state(row.model, row.q_motors, row.q_springs, row.load) for row in rows)
    energies = np.array([state.energy for state in states])
    ends = np.cumsum(points)[:-1]
    columns = [np.split(column, ends) for column in (np.arange(len(rows)), forces, amplitudes, energies)]
    others = np.split(crossings, np.cumsum(n_crossings)[:-1])
    return tuple(
        EquilibriumBranch(label, tuple(rows[place] for place in places), force, amplitude, energy, crossed, ended)
        for label, ended, places, force, amplitude, energy, crossed in zip(*names, *columns, others, strict=True)
    )


KINDS.update(
    equilibrium=Kind(
        Equilibrium,
        lambda result: _pack_rows((result,)),
        lambda fields: _unpack_rows(fields)[0],
        to_table=equilibrium_table,
    ),
    ik_solution=Kind(IkSolution, _pack_solution, _unpack_solution, to_table=ik_table),
    imposed_displacement=Kind(ImposedDisplacement, _pack_imposed, _unpack_imposed, to_table=imposed_table),
    load_estimate=Kind(
        LoadEstimate,
        lambda result: _pack_rows((result.equilibrium,)) | packed_estimate(result),
        lambda fields: estimate_at(_unpack_rows(fields)[0], fields),
        to_table=estimate_table,
    ),
    trajectory=Kind(Trajectory, _pack_trajectory, _unpack_trajectory, many=True, to_table=trajectory_table),
    workspace=Kind(Workspace, _pack_workspace, _unpack_workspace, many=True, to_table=workspace_table),
    workspace_map=Kind(WorkspaceMap, _pack_map, _unpack_map, many=True, to_table=map_table),
    branches=Kind(
        tuple,
        _pack_branches,
        _unpack_branches,
        many=True,
        items=EquilibriumBranch,
        to_table=lambda branches: branch_table(*branches),
    ),
)
TABLES[EquilibriumBranch] = branch_table
