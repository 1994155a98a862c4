"""Saving and loading of results: NPZ files without pickle (`softrobots.result_fields`), and CSV tables of trajectories."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from softrobots.errors import FileFormatError, ParameterError
from softrobots.files import as_path, csv_text, new_file, write_atomically, write_text
from softrobots.result_fields import KINDS, Result
from softrobots.trajectory import Trajectory

_FORMAT = 1


def save_result(result: Result, path: str | Path, *, overwrite: bool = False) -> Path:
    """Save a result as an NPZ file, without pickle.

    The file appears whole or not at all: it is written beside its place and moved there.

    Args:
        result: An equilibrium, imposed displacement, load estimate, IK solution, trajectory, workspace or
            workspace map.
        path: File to write; `.npz` is added if it has no ending.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If the result is something else, or the path is none.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    kind = next((name for name, (cls, _, _) in KINDS.items() if isinstance(result, cls)), None)
    if kind is None:
        raise ParameterError(
            "result",
            result,
            "an Equilibrium, IkSolution, ImposedDisplacement, LoadEstimate, Trajectory, Workspace or WorkspaceMap",
        )
    path = as_path("path", path)
    named = path if path.suffix or path.is_dir() else path.with_suffix(".npz")
    target = new_file(named, overwrite=overwrite)
    fields = {"format": np.array(_FORMAT), "kind": np.array(kind), **KINDS[kind][1](result)}
    write_atomically(target, lambda file: np.savez_compressed(file, **fields))
    return target


def load_result(path: str | Path) -> Result:
    """Load a result saved by `save_result`.

    Args:
        path: The NPZ file.

    Returns:
        The result, with its model.

    Raises:
        ParameterError: If the path is none.
        FileFormatError: If the file cannot be read, is not one of ours, or does not hold what it claims.
    """
    path = as_path("path", path)
    try:
        with path.open("rb") as handle:
            if not zipfile.is_zipfile(handle):  # NumPy would advise to allow pickle
                raise FileFormatError("it is no NPZ archive")
            handle.seek(0)
            with np.load(handle, allow_pickle=False) as file:
                fields = {name: file[name] for name in file.files}
        kind = str(fields["kind"])
        if int(fields["format"]) != _FORMAT or kind not in KINDS:
            raise FileFormatError(
                f"it holds {kind!r} in format {fields['format']}; known: {', '.join(KINDS)} in format {_FORMAT}"
            )
        return KINDS[kind][2](fields)
    except Exception as error:  # a damaged archive raises whatever zipfile, zlib, NumPy or JSON come upon
        raise FileFormatError(f"cannot read a result from {path}: {error}") from error


def save_csv(trajectory: Trajectory, path: str | Path, *, overwrite: bool = False) -> Path:
    """Save a trajectory as a CSV table, one line a waypoint, full precision.

    Columns: `t` [s], `x, y, z` (target, so that the file can be read as waypoints) [m], `tip_x, tip_y, tip_z` [m],
    `tip_error` [m], one for each motor and spring [rad] (`joint_x` where a joint is
    called `x`), `moment_<i>` [N m] for each inflated link.

    Args:
        trajectory: The trajectory.
        path: File to write.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If it is no trajectory, or the path is none.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    if not isinstance(trajectory, Trajectory):
        raise ParameterError("trajectory", trajectory, "a Trajectory")
    model, moments = trajectory.model, trajectory.link_moments
    names = ["t", "x", "y", "z", "tip_x", "tip_y", "tip_z", "tip_error"]
    names += [f"joint_{name}" if name in names else name for name in (*model.motor_joints, *model.spring_joints)]
    columns = [trajectory.times[:, None], trajectory.targets, trajectory.tip_positions, trajectory.tip_error[:, None]]
    columns += [trajectory.q_motors, trajectory.q_springs]
    if moments is not None:
        names += [f"moment_{i + 1}" for i in range(moments.shape[1])]
        columns.append(moments)

    return write_text(path, csv_text(names, np.hstack(columns).tolist()), overwrite=overwrite)
