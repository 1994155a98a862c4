"""Mapping what the loaded arm reaches, carries, and which pressure it needs: the blocks of a sweep put together."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from softrobots.compiled.run.compiled_model import compile_model
from softrobots.compiled.sweeps.block import BlockResult, solve_block
from softrobots.compiled.sweeps.load_case import SweepCase, package_version
from softrobots.compiled.sweeps.postures import check_arm
from softrobots.compiled.sweeps.scheduling import run_blocks
from softrobots.core.checkpoint import Checkpoint
from softrobots.core.checks import (
    FloatArray,
    finite_array,
    increasing,
    non_negative_array,
    positive_integer,
    positive_number,
    unit_vector,
)
from softrobots.core.errors import ParameterError
from softrobots.core.npz_file import LARGEST
from softrobots.core.progress import with_progress
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.loads import Load
from softrobots.statics.workspace_map import TargetGrid, WorkspaceMap

BLOCK = 512
"""Targets of a block."""

DOWN = (0.0, 0.0, -1.0)
"""Direction of a weight."""


def map_workspace(
    model: SoftModel,
    grid: TargetGrid,
    loads: Any,
    *,
    direction: Any = DOWN,
    gravity: Any = None,
    tolerance: float = 1e-9,
    backend: str | None = None,
    threads: int = 1,
    scheduler: str | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: bool | str = False,
) -> WorkspaceMap:
    """Find out, for every target and load, whether the loaded arm gets there, and the pressure that it needs.

    The targets are cut into blocks of `BLOCK`. A block is solved by the compiled solvers and by itself, so that threads and
    clusters give the same bytes as a single thread (on processors of one kind).

    Args:
        model: An arm with three motors, the first about the vertical through the base, and two inflated links.
        grid: Targets of the tip.
        loads: Sizes of the force on the tip, zero or above, increasing, shape (n_loads,) [N].
        direction: Direction of the force, world axes, shape (3,); a weight by default.
        gravity: Gravity that the arm itself feels, shape (3,) [m/s^2]; None: weightless.
        tolerance: Largest distance of the tip from a target that is reached [m].
        backend: Back end of `softrobots.compile`.
        threads: Threads of this process, without a scheduler.
        scheduler: Address of a Dask scheduler that has the work done; None: this process. Its workers need the same version of
            softrobots.
        checkpoint: Folder that keeps the finished blocks. After an interruption, even a killed process, the same call goes on
            from there, to the same bytes. Delete the folder when the maps are saved. None: nothing is kept.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The maps.

    Raises:
        ParameterError: If an argument is out of range, the robot is no such arm, or the blocks are those of another case.
        DescriptionError: If the robot is no serial chain with linear springs.
        FileFormatError, OutputExists: If the folder of blocks is no such folder.
        OutputError: If a block cannot be written; those before it stay.
        MissingDependency: If the back end or distributed is not installed.
        ClusterError: If the cluster does not do the work.
    """
    check_arm(check_model(model))
    if not isinstance(grid, TargetGrid):
        raise ParameterError("grid", grid, "a TargetGrid")
    sizes = increasing("loads", non_negative_array("loads", finite_array("loads", loads, (None,), "N"), "N"), "N")
    positive_integer("number of loads", len(sizes), 100_000)
    most = LARGEST // (10 + 8 * (model.n_motors + model.n_springs))  # as can be saved
    positive_integer("number of cases", math.prod(grid.shape) * len(sizes), most)
    along = unit_vector("direction", direction)
    weight = Load.of(model, gravity=gravity).gravity
    case = SweepCase.of(
        model,
        direction=along,
        loads=sizes,
        gravity=weight,
        tolerance=positive_number("tolerance", tolerance, "m"),
        backend=compile_model(model, backend=backend).backend,
        version=package_version(),
    )
    positive_integer("threads", threads)
    kept = None if checkpoint is None else Checkpoint(checkpoint, _identity(case, grid))
    targets, shape = grid.targets, grid.shape
    cases = (len(targets), len(sizes))
    reached, required, payload = np.zeros(cases, dtype=bool), np.zeros(cases), np.zeros(len(targets))
    motors, springs = np.zeros((*cases, model.n_motors)), np.zeros((*cases, model.n_springs))
    for number, answer in _answers(case, targets, kept, threads, scheduler, progress):
        rows = slice(number * BLOCK, number * BLOCK + len(answer.payload))
        reached[rows], required[rows], payload[rows] = answer.reached, answer.required_pressure, answer.payload
        motors[rows], springs[rows] = answer.q_motors, answer.q_springs
    return WorkspaceMap(
        model=model,
        grid=grid,
        direction=along,
        loads=sizes,
        gravity=weight,
        tolerance=case.tolerance,
        reached=reached.reshape(*shape, -1),
        required_pressure=required.reshape(*shape, -1),
        payload=payload.reshape(shape),
        q_motors=motors.reshape(*shape, len(sizes), -1),
        q_springs=springs.reshape(*shape, len(sizes), -1),
    )


def _identity(case: SweepCase, grid: TargetGrid) -> dict[str, Any]:
    """What the answers depend on."""
    axes = {axis: getattr(grid, axis).tolist() for axis in "xyz"}
    return {"job": "map_workspace", "targets of a block": BLOCK, **axes, **dataclasses.asdict(case)}


def _answers(
    case: SweepCase, targets: FloatArray, kept: Checkpoint | None, threads: int, scheduler: str | None, progress: bool | str
) -> Iterator[tuple[int, BlockResult]]:
    """Number and answer of every block: those that are kept, and then the others as they come."""
    blocks = [targets[first : first + BLOCK] for first in range(0, len(targets), BLOCK)]
    left = []
    for number, block in enumerate(blocks):
        found = None if kept is None else kept.block(number, BlockResult.arrays(case, len(block)))
        if found is None:
            left.append(number)
        else:
            yield number, BlockResult(**found)
    if not left:
        return
    answers = run_blocks(partial(solve_block, case), [blocks[number] for number in left], threads=threads, scheduler=scheduler)
    done = len(blocks) - len(left)
    for place, answer in with_progress(answers, progress, label="targets", unit="block", total=len(blocks), done=done):
        if kept is not None:
            kept.keep(left[place], answer._asdict())
        yield left[place], answer
