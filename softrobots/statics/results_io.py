"""Saving and loading of results: NPZ files without pickle (`result_fields`), and CSV tables of trajectories."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softrobots.core import npz_file
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.files import as_path, csv_text, new_file, write_atomically, write_text
from softrobots.core.npz_file import check_size, read_arrays
from softrobots.statics.result_fields import KINDS, Result
from softrobots.statics.trajectory import Trajectory

_FORMAT = 1
_MANY = ("trajectory", "workspace", "workspace_map")  # kinds that hold any number of configurations
_LARGEST_OF_ONE = 2**26  # bytes of arrays of the others, most of it the URDF text


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
        ParameterError: If the result is something else, or has more arrays than `load_result` reads, or the path is none.
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
    check_size("result", fields, _largest(kind))
    write_atomically(target, lambda file: np.savez_compressed(file, **fields), overwrite=overwrite)
    return target


def load_result(path: str | Path) -> Result:
    """Load a result saved by `save_result`.

    The file may come from anybody: nothing in it is run, it names no other file, and it is not unpacked before it is known that
    its arrays are as large as it says, and have at most a GiB (64 MiB for a result of a single configuration).

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
        head = read_arrays(path, only=("kind", "format"))
        kind = str(head["kind"])
        if int(head["format"]) != _FORMAT or kind not in KINDS:
            raise FileFormatError(
                f"it holds {kind[:60]!r} in format {head['format']}; known: {', '.join(KINDS)} in format {_FORMAT}"
            )
        return KINDS[kind][2](read_arrays(path, largest=_largest(kind)))
    except Exception as error:  # arrays of another kind or shape raise whatever NumPy comes upon
        reason = f"it has no {error}" if isinstance(error, KeyError) else error
        raise FileFormatError(f"cannot read a result from {path}: {reason}") from error


def _largest(kind: str) -> int:
    """How many bytes of arrays a result of a kind may have."""
    return npz_file.LARGEST if kind in _MANY else _LARGEST_OF_ONE


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
