"""Workspace by random sampling: actuator coordinates within their limits, tip positions and manipulability."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checkpoint import Checkpoint
from softrobots.core.checks import FloatArray, finite_array, positive_integer, read_only
from softrobots.core.errors import NeutralEquilibrium, ParameterError
from softrobots.core.npz_file import LARGEST
from softrobots.core.progress import with_progress
from softrobots.core.summary import Part, Summarised, Table, facts, field_facts
from softrobots.environment.environment import Environment
from softrobots.model.assembly import with_given_forces
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.contact.pressed_gaps import pressed_gaps
from softrobots.statics.elastic_state import ElasticState, elastic_state, largest_residual
from softrobots.statics.elastostatics import balanced_state
from softrobots.statics.equilibrium_summary import loaded_robot
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.loads import Load
from softrobots.statics.sensitivity import tip_motion
from softrobots.statics.stability import is_stable
from softrobots.version import __version__

_SLACK = 1e-8  # of the limits of tensions, relative to the tension that is worth a radian: rounding of given lengths
_BLOCK = 250  # samples in one block of a checkpoint

FIELDS = ("q_motors", "q_springs", "tip_positions", "manipulability")
"""Names of the arrays of a `Workspace`, one row a sample."""


@dataclass(frozen=True, eq=False, repr=False)
class Workspace(Summarised):
    """Sampled reach of a robot under a load; can be saved with `softrobots.save_result`."""

    model: SoftModel
    """The robot."""
    load: Load
    """The load."""
    q_motors: FloatArray
    """Sampled actuator coordinates, shape (n, n_motors) [rad, m or N]."""
    q_springs: FloatArray
    """Elastic coordinates in equilibrium there, shape (n, n_springs) [rad or m]."""
    tip_positions: FloatArray
    """Position of the loaded tip, shape (n, 3) [m]."""
    manipulability: FloatArray
    r"""Manipulability of the loaded tip, shape (n,) [m^3/rad^3].

    :math:`\sqrt{\det(J J^T)}` with the elastostatic Jacobian `J` of the position, each actuator scaled by
    `SoftModel.motor_scale` (for muscles: their distance from the backbone). 0: the tip cannot move in some direction.
    """
    refused: int
    """Number of samples without a shape (inconsistent muscle lengths), without a stable equilibrium, or beyond tensions."""

    def __repr__(self) -> str:
        """The robot, and how many samples have an equilibrium."""
        return f"Workspace({self.model.pinocchio.name!r}, {len(self.q_motors)} samples, {self.refused} refused)"

    def summary_parts(self) -> list[Part]:
        """Return robot and load, what the tip reached, and the samples of the motors."""
        model, rows = self.model, [("", "least", "largest", "")]
        names, units = (*("tip x", "tip y", "tip z"), *model.motor_joints), ("m", "m", "m", *model.actuators.units)
        columns = np.hstack([self.tip_positions, self.q_motors]).T
        rows += [(n, f"{each.min():.6g}", f"{each.max():.6g}", u) for n, each, u in zip(names, columns, units, strict=True)]
        counts = [("samples", f"{len(self.q_motors)}, {self.refused} refused"), *field_facts(self, "manipulability")]
        return [loaded_robot(model, self.load), Table(rows, right=(1, 2)), facts(counts)]


def sample_workspace(
    model: SoftModel,
    samples: int = 2000,
    *,
    force: Any = None,
    wrench: Any = None,
    frame: str | None = None,
    gravity: Any = None,
    environment: Environment | None = None,
    seed: int = 0,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: bool | str = False,
) -> Workspace:
    """Sample the positions that the tip can reach.

    Actuator coordinates are uniform within their limits (muscle lengths of a segment are projected to consistent ones), with
    the robot in equilibrium under the load at each. Where muscles cannot both pull and push, only samples within the limits
    of all tensions count, as for `solve_ik`; with lengths given, tensions are drawn, which hardly any of the lengths has. With
    tensions given, limits of lengths do not count.

    Args:
        model: The robot, with at least one actuator.
        samples: Number of samples to draw.
        force: Force at `frame`, shape (3,) [N], world axes.
        wrench: Wrench at `frame`, shape (6,) [N, N m], or `{frame: (6,)}` for several.
        frame: Frame of `force` and `wrench`; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        environment: Obstacles that the robot may lean on without friction; None: free space. Samples whose motors leave the
            robot no room are refused.
        seed: Seed of the samples.
        checkpoint: Folder for finished samples. After an interruption, even a killed process, the same call continues from
            there, with identical results. Delete the folder when the workspace is saved. None: no checkpoint.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The samples that are stable equilibria, within the limits of tensions.

    Raises:
        ParameterError: If an argument has the wrong shape or is out of range, the robot has no actuators, no sample is a
            stable equilibrium, or the checkpoint belongs to another case.
        NameNotFound: If a frame does not exist.
        FileFormatError, OutputExists: If the checkpoint folder is not one.
        OutputError: If samples cannot be written; earlier ones remain.
    """
    check_model(model)
    if model.n_motors == 0:
        raise ParameterError("model", model, "a robot with at least one motor or muscle")
    load = Load.of(model, force, wrench=wrench, frame=frame, gravity=gravity, environment=environment)
    most = LARGEST // (8 * (model.n_motors + model.n_springs + 5))  # so that `save_result` accepts them
    count = positive_integer("samples", samples, most)
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ParameterError("seed", seed, "a whole number, zero or above")
    kept = None if checkpoint is None else Checkpoint(checkpoint, _identity(model, load, count, int(seed)))
    samples_drawn = _draw(model, load, count, int(seed), kept, progress)
    stable = samples_drawn["stable"]
    if not stable.any():
        raise ParameterError("samples", samples, "such that one is a stable equilibrium; none is")
    motors, springs, tips, measures = (read_only(samples_drawn[name][stable]) for name in FIELDS)
    return Workspace(model, load, motors, springs, tips, measures, count - int(stable.sum()))


def _identity(model: SoftModel, load: Load, count: int, seed: int) -> dict[str, Any]:
    """Everything that the samples depend on."""
    obstacles = {} if load.environment is None else {"environment": load.environment.to_dict()}
    return obstacles | {
        "job": "sample_workspace",
        "version": __version__,
        "urdf": model.urdf,
        "springs": model.spring_table,
        "motors": model.motor_joints,
        "muscles": model.muscle_input,
        "tip": model.tip,
        "wrenches": {frame: wrench.tolist() for frame, wrench in load.wrenches.items()},
        "gravity": load.gravity,
        "samples": count,
        "seed": seed,
    }


def _draw(model: SoftModel, load: Load, count: int, seed: int, kept: Checkpoint | None, progress: bool | str) -> dict[str, Any]:
    """All samples, from the blocks of the checkpoint or new; rows that are not stable are zero."""
    samples: dict[str, Any] = {name: np.zeros(shape, kind) for name, (kind, shape) in _arrays(model, count).items()}
    only_pull = model.structure.muscle_lengths is not None and model.actuators.least_tension
    pulled = with_given_forces(model) if only_pull else model  # that is drawn
    blocks = [slice(first, min(first + _BLOCK, count)) for first in range(0, count, _BLOCK)]
    missing = np.ones(count, dtype=bool)
    for number, rows in enumerate(blocks):
        block = None if kept is None else kept.block(number, _arrays(model, rows.stop - rows.start))
        if block is not None:
            missing[rows] = False
            for name, array in samples.items():
                array[rows] = block[name]

    def drawn() -> Iterator[tuple[int, FloatArray | None]]:
        """Row and motors of the missing samples; the others are drawn, too, to keep the random sequence."""
        random = np.random.default_rng(seed)
        for row in range(count):
            motors = pulled.actuators.draw(random)
            if missing[row]:
                yield row, motors

    done = count - int(missing.sum())
    for row, motors in with_progress(drawn(), progress, label="samples", unit="sample", total=count, done=done):
        sample = None if motors is None else _sample(model, load, pulled, motors)
        if sample is not None:
            for name, value in zip(("stable", *FIELDS), (True, *sample), strict=True):
                samples[name][row] = value
        number = row // _BLOCK
        if kept is not None and row == blocks[number].stop - 1:
            kept.keep(number, {name: array[blocks[number]] for name, array in samples.items()})
    return samples


def _arrays(model: SoftModel, count: int) -> dict[str, tuple[type, tuple[int, ...]]]:
    """Type of numbers and shape of each array of a block."""
    return {
        "stable": (np.bool_, (count,)),
        "q_motors": (np.float64, (count, model.n_motors)),
        "q_springs": (np.float64, (count, model.n_springs)),
        "tip_positions": (np.float64, (count, 3)),
        "manipulability": (np.float64, (count,)),
    }


def _sample(
    model: SoftModel, load: Load, pulled: SoftModel, motors: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, float] | None:
    """Motors, springs, tip and manipulability of a sample of the robot that is drawn; None without a stable equilibrium."""
    state = balanced_state(pulled, motors, load, pulled.rest)
    if state is not None and pulled is not model and model.structure.muscle_lengths is not None:
        motors, start = model.structure.muscle_lengths.held(motors[: -len(model.muscles)], state.q_springs)
        low, high = model.motor_limits.T
        allowed = model.actuators.admit(motors) and bool(np.all((motors >= low) & (motors <= high)))
        state = balanced_state(model, motors, load, start) if allowed else None
    if state is None or not is_stable(model, load, state) or _overdrawn(model, state):
        return None
    by_motors, by_springs = state.point.columns(frame_jacobian(model, state.q, model.tip)[:3])
    try:
        matrices = state.tangent, state.load.coupling, pressed_gaps(state)
        slope = tip_motion(model, by_motors, by_springs, *matrices)[0] @ model.actuators.basis
    except NeutralEquilibrium:
        return None
    tip = np.array(frame_placement(model, state.q, model.tip).translation)
    values = np.linalg.svd(slope, compute_uv=False)
    return motors, state.q_springs, tip, float(np.prod(values)) if len(values) == 3 else 0.0


def _overdrawn(model: SoftModel, state: ElasticState) -> bool:
    """Whether a tension is beyond its limits; never of muscles that both pull and push."""
    low, high = model.actuators.muscle_forces.T
    tensions, slack = state.load.motors[model.n_motors - len(low) :], _SLACK * model.actuators.tension_scale
    return model.actuators.least_tension and bool(np.any((tensions < low - slack) | (tensions > high + slack)))


def workspace_at(
    model: SoftModel, load: Load, q_motors: Any, q_springs: Any, tip_positions: Any, manipulability: Any, refused: int
) -> Workspace:
    """Check the arrays of a workspace, as saved in a file.

    Raises:
        ParameterError: If shapes do not fit, or one of a hundred samples, computed again, differs.
    """
    motors = finite_array("q_motors", q_motors, (None, model.n_motors))
    count = len(motors)
    springs = finite_array("q_springs", q_springs, (count, model.n_springs))
    tips = finite_array("tip_positions", tip_positions, (count, 3), "m")
    measures = finite_array("manipulability", manipulability, (count,))
    if count == 0 or int(refused) < 0 or measures.min() < 0.0:
        raise ParameterError("manipulability", measures, "given for at least one sample, zero or above")
    for row in np.unique(np.linspace(0, count - 1, min(count, 100)).astype(int)):
        state = elastic_state(model, model.actuators.checked(motors[row]), springs[row], load)
        if state.error > largest_residual(model, state.scale, 1e-9):
            raise ParameterError("q_springs", springs[row], f"in balance; its row {row} is not")
        tip = frame_placement(model, state.q, model.tip).translation
        if np.abs(tip - tips[row]).max() > 1e-9 * max(model.reach, 1.0):
            raise ParameterError("tip_positions", tips[row], f"the tip of its row {row}, {tip.tolist()}")
    return Workspace(model, load, read_only(motors), read_only(springs), read_only(tips), read_only(measures), int(refused))
