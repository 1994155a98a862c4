"""Maps of reach, payload and required pressure of the loaded arm, computed block by block."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from softrobots.compiled.run.compiled_model import compile_model
from softrobots.compiled.sweeps.arm_solver import SweepCase
from softrobots.compiled.sweeps.block import BlockResult, solve_block
from softrobots.compiled.sweeps.postures import check_arm
from softrobots.compiled.sweeps.scheduling import run_blocks
from softrobots.core.checkpoint import Checkpoint
from softrobots.core.checks import (
    FloatArray,
    finite_array,
    increasing,
    instance_of,
    non_negative_array,
    positive_integer,
    positive_number,
    unit_vector,
)
from softrobots.core.npz_file import LARGEST
from softrobots.core.progress import with_progress
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.loads import Load
from softrobots.statics.workspace_map import TargetGrid, WorkspaceMap

BLOCK = 512
"""Targets of a block."""

DOWN = (0.0, 0.0, -1.0)
"""Direction of a weight, world axes."""


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
    """Map reach, payload and required pressure of the loaded arm over a grid of targets and loads.

    The targets are cut into blocks of `BLOCK`, each solved by itself with the compiled solvers, so that threads and clusters
    give the same bytes as a single thread (on processors of one kind).

    Args:
        model: An arm with three motors, the first about the vertical through the base, and two inflated links.
        grid: Targets of the tip.
        loads: Sizes of the force on the tip, zero or above, increasing, shape (n_loads,) [N].
        direction: Direction of the force, world axes, shape (3,); a weight by default.
        gravity: Gravity that the arm itself feels, shape (3,) [m/s^2]; None: weightless.
        tolerance: Largest distance of the tip from a target that is reached [m].
        backend: Back end of `softrobots.compile`.
        threads: Threads of this process, without a scheduler.
        scheduler: Address of a Dask scheduler, whose workers need the same version of softrobots; None: this process.
        checkpoint: Folder for finished blocks. After an interruption, even a killed process, the same call resumes from
            there, with the same bytes as result. Delete the folder when the maps are saved. None: blocks are not kept.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The maps.

    Raises:
        ParameterError: If an argument is out of range, the robot is not such an arm, or the blocks belong to another case.
        DescriptionError: If the robot is not a serial chain with linear springs.
        FileFormatError, OutputExists: If `checkpoint` is not a folder of blocks.
        OutputError: If a block cannot be written; earlier blocks are kept.
        MissingDependency: If the back end or distributed is not installed.
        ClusterError: If the cluster fails.
    """
    check_arm(check_model(model))
    instance_of("grid", grid, TargetGrid, "a TargetGrid")
    sizes = increasing("loads", non_negative_array("loads", finite_array("loads", loads, (None,), "N"), "N"), "N")
    positive_integer("number of loads", len(sizes), 100_000)
    most = LARGEST // (10 + 8 * (model.n_motors + model.n_springs))  # that can be saved
    positive_integer("number of cases", math.prod(grid.shape) * len(sizes), most)
    along = unit_vector("direction", direction)
    weight = Load.of(model, gravity=gravity).gravity
    case = SweepCase.of(
        model,
        along,
        sizes,
        gravity=weight,
        tolerance=positive_number("tolerance", tolerance, "m"),
        backend=compile_model(model, backend=backend).backend,
    )
    positive_integer("threads", threads)
    kept = None if checkpoint is None else Checkpoint(checkpoint, _identity(case, grid))
    targets = grid.targets
    kinds = BlockResult.arrays(case, len(targets))
    arrays: dict[str, Any] = {name: np.zeros(shape, kind) for name, (kind, shape) in kinds.items()}
    for number, block in _results(case, targets, kept, threads, scheduler, progress):
        for name, values in block._asdict().items():
            arrays[name][number * BLOCK : number * BLOCK + len(values)] = values
    return WorkspaceMap(
        model=model,
        grid=grid,
        direction=along,
        loads=sizes,
        gravity=weight,
        tolerance=case.tolerance,
        **{name: values.reshape(*grid.shape, *values.shape[1:]) for name, values in arrays.items()},
    )


def _identity(case: SweepCase, grid: TargetGrid) -> dict[str, Any]:
    """Return all inputs of the results."""
    axes = {axis: getattr(grid, axis).tolist() for axis in "xyz"}
    return {"job": "map_workspace", "targets of a block": BLOCK, **axes, **dataclasses.asdict(case)}


def _results(
    case: SweepCase, targets: FloatArray, kept: Checkpoint | None, threads: int, scheduler: str | None, progress: bool | str
) -> Iterator[tuple[int, BlockResult]]:
    """Yield number and result of every block: first those in the checkpoint, then the others as they are finished."""
    blocks = [targets[first : first + BLOCK] for first in range(0, len(targets), BLOCK)]
    left = []
    for number, block in enumerate(blocks):
        stored = None if kept is None else kept.block(number, BlockResult.arrays(case, len(block)))
        if stored is None:
            left.append(number)
        else:
            yield number, BlockResult(**stored)
    if not left:
        return
    results = run_blocks(partial(solve_block, case), [blocks[number] for number in left], threads=threads, scheduler=scheduler)
    done = len(blocks) - len(left)
    for place, result in with_progress(results, progress, label="targets", unit="block", total=len(blocks), done=done):
        if kept is not None:
            kept.keep(left[place], result._asdict())
        yield left[place], result
