"""The solver calls of a soak, and their answers."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from softrobots.compiled.run.compiled_model import CompiledModel, compile_model
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray
from softrobots.core.errors import NotConverged, SoftRobotsError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.inverse_kinematics import IkSolution, solve_ik
from softrobots.statics.load_estimation import LoadEstimate, estimate_load
from studies.soak.families import Family
from studies.soak.plain_statics import Case, PlainStatics

SECONDS = 30.0
"""A call that takes longer counts as a hang [s]."""

STABLE, UNSTABLE = "stable", "not stable"
"""Outcomes: certified stable, or in equilibrium and reported as not stable."""

STARTS = 4
"""Number of starts of an inverse kinematics."""

_BATCH_SECONDS = 900.0  # [s], for a batch, with the compilation by numba
_ODD = 10  # every tenth case has torques that no force may explain, or a target that may be out of reach


@dataclass(frozen=True)
class Answer:
    """Answer of a solver to a case."""

    row: int
    """Row of the case in its chunk."""
    outcome: str
    """`STABLE`, `UNSTABLE`, or the name of an error or a status."""
    springs: FloatArray | None = None
    """Elastic coordinates; None without an answer."""
    changed: dict[str, FloatArray] = field(default_factory=dict)
    """Unknowns of the case that the solver found: "motors" or "forces"."""
    claims: dict[str, FloatArray] = field(default_factory=dict)
    """Values to be confirmed: "motor_torques" and "tip", within `within`."""
    within: float = 1e-9
    """Largest error of the claims [m or N m]."""
    iterations: int = 0
    """Number of iterations."""
    seconds: float = 0.0
    """Time [s]."""
    broken: str = ""
    """Law that the answer itself breaks; empty if none."""


class Hang(BaseException):
    """A call that takes too long; derived from `BaseException` so that no solver catches it."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Interrupt a block that takes too long; main thread only."""

    def stop(number: int, frame: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _answer(row: int, solve_case: Callable[[int], dict[str, Any]]) -> Answer:
    """Solve one case; an error becomes part of the answer."""
    begun = time.perf_counter()
    try:
        with limited(SECONDS):
            fields = solve_case(row)
    except Hang:
        fields = {"outcome": "hang", "broken": f"no answer after {SECONDS:g} s"}
    except SoftRobotsError as error:
        fields = {"outcome": type(error).__name__, "broken": _wrong_error(error)}
        if isinstance(error, NotConverged):
            fields["iterations"] = error.iterations
    except Exception as error:
        fields = {"outcome": type(error).__name__, "broken": f"{type(error).__name__} is no error of softrobots: {error}"}
    return Answer(row, seconds=time.perf_counter() - begun, **fields)


def _wrong_error(error: SoftRobotsError) -> str:
    """Return what is wrong with an error; an empty text if nothing is."""
    if not isinstance(error, NotConverged):
        return ""
    best = error.best
    if isinstance(best, IkSolution | LoadEstimate):
        best = best.equilibrium
    if not isinstance(best, Equilibrium):
        return "the error has no best iterate"
    numbers = (best.q_springs, best.q_motors, best.tip_position, best.residual, error.residual)
    return "" if all(np.all(np.isfinite(one)) for one in numbers) else "the best iterate of the error is not finite"


def _gravity(case: Case, row: int) -> FloatArray | None:
    return case.gravity[row] if case.gravity[row].any() else None


def _wrench(case: Case, row: int) -> FloatArray:
    return np.concatenate([case.forces[row], case.moments[row]])


def _fields(found: Equilibrium, iterations: int) -> dict[str, Any]:
    numbers = (found.q_springs, found.q, found.spring_torques, found.motor_torques, found.tangent_stiffness, found.tip_position)
    broken = "" if all(np.isfinite(one).all() for one in numbers) else "a number that is not finite"
    torques = found.motor_torques[: len(found.model.structure.motor_joints)]
    return {
        "outcome": STABLE if found.stable else UNSTABLE,
        "springs": found.q_springs,
        "claims": {"motor_torques": torques, "tip": found.tip_position},
        "iterations": iterations,
        "broken": broken if found.converged else "an answer above the tolerance",
    }


def solve(family: Family, statics: PlainStatics, case: Case, rows: Sequence[int]) -> list[Answer]:
    """Equilibria one by one."""

    def solve_case(row: int) -> dict[str, Any]:
        found = solve_equilibrium(statics.model, case.motors[row], wrench=_wrench(case, row), gravity=_gravity(case, row))
        return _fields(found, found.iterations)

    return [_answer(row, solve_case) for row in rows]


def estimate(family: Family, statics: PlainStatics, case: Case, rows: Sequence[int]) -> list[Answer]:
    """Loads from motor torques: those of an equilibrium, or random ones."""

    def solve_case(row: int) -> dict[str, Any]:
        motors, gravity = case.motors[row], _gravity(case, row)
        torques = solve_equilibrium(statics.model, motors, case.forces[row], gravity=gravity, tolerance=1e-13).motor_torques
        if row % _ODD == 0:
            torques = torques + np.random.default_rng(row).normal(size=len(torques)) * 10.0
        found = estimate_load(statics.model, motors, torques, gravity=gravity, restart=False)
        size = 1e-10 * max(float(np.linalg.norm(torques)), 1e-3)
        hidden = len(found.unobservable_directions) > 0
        fields = _fields(found.equilibrium, found.iterations)
        fields["claims"] = {"tip": found.equilibrium.tip_position} | ({} if hidden else {"motor_torques": torques})
        return fields | {"changed": {"forces": found.force}, "within": 1e-9 + 2.0 * size}

    return [_answer(row, solve_case) for row in rows]


def _target(statics: PlainStatics, case: Case, row: int) -> FloatArray:
    """A point that the tip can reach at an equilibrium, or a random one."""
    found = solve_equilibrium(statics.model, case.motors[row], case.forces[row], gravity=_gravity(case, row))
    away = np.random.default_rng(row).normal(size=3) if row % _ODD == 0 else np.zeros(3)
    return found.tip_position + away


def reach(family: Family, statics: PlainStatics, case: Case, rows: Sequence[int]) -> list[Answer]:
    """Inverse kinematics one by one."""

    def solve_case(row: int) -> dict[str, Any]:
        target = _target(statics, case, row)
        found = solve_ik(statics.model, target, case.forces[row], gravity=_gravity(case, row), starts=STARTS)
        fields = _fields(found.equilibrium, found.iterations)
        fields["claims"]["tip"] = target
        low, high = statics.model.motor_limits.T
        if np.any((found.q_motors < low) | (found.q_motors > high)):
            fields["broken"] = "a motor beyond its limits"
        return fields | {"changed": {"motors": found.q_motors}, "within": 2e-9}

    return [_answer(row, solve_case) for row in rows]


@lru_cache(maxsize=8)
def _compiled(model: SoftModel, compiler: bool) -> CompiledModel:
    return compile_model(model, backend=None if compiler else "python")


SolveBatch = Callable[[CompiledModel, Any, FloatArray | None], Any]


def _batch_answers(
    family: Family,
    statics: PlainStatics,
    case: Case,
    rows: Sequence[int],
    solve_batch: SolveBatch,
    fields: Callable[..., dict[str, Any]],
) -> list[Answer]:
    """Solve a batch of the cases with gravity, and one of those without."""
    result: list[Answer] = []
    chosen = np.array(rows)
    heavy = case.gravity[chosen].any(axis=1)
    for weight in (False, True):
        part = chosen[heavy == weight]
        if not len(part):
            continue
        begun = time.perf_counter()
        try:
            with limited(_BATCH_SECONDS):
                batch = solve_batch(_compiled(statics.model, family.compiler), part, case.gravity[part[0]] if weight else None)
        except (Exception, Hang) as error:
            result += [Answer(row, type(error).__name__, broken=f"a batch raises {error!r}") for row in part.tolist()]
            continue
        seconds = (time.perf_counter() - begun) / len(part)
        errors = ("residual", "unexplained", "tip_error")  # infinite if there is no answer
        for place, row in enumerate(part.tolist()):
            certified = bool(batch.certified[place])
            columns = [column for name, column in vars(batch).items() if certified or name not in errors]
            numbers = [np.asarray(column)[place] for column in columns if column is not None]  # None: nothing was asked of it
            fine = all(np.isfinite(one).all() for one in numbers)
            found = {"springs": batch.q_springs[place], **fields(batch, place)} if certified else {}
            outcome = STABLE if certified else Status(int(batch.status[place])).name
            result.append(Answer(row, outcome, seconds=seconds, broken="" if fine else "a number that is not finite", **found))
    return result


def batch(family: Family, statics: PlainStatics, case: Case, rows: Sequence[int]) -> list[Answer]:
    """Equilibria in a batch, compiled."""
    return _batch_answers(
        family,
        statics,
        case,
        rows,
        lambda fast, part, gravity: fast.equilibria(case.motors[part], case.forces[part], gravity=gravity),
        lambda found, place: {"claims": {"tip": found.tip_positions[place]}},
    )


def _equilibrium_balance(fast: CompiledModel, statics: PlainStatics, case: Case, part: Any, gravity: FloatArray | None) -> Any:
    """Balance at the equilibria of a batch, by plain statics."""
    found = fast.equilibria(case.motors[part], case.forces[part], gravity=gravity)
    return statics.balance(Case(*(array[part] for array in case)), found.q_springs)


def estimate_batch(family: Family, statics: PlainStatics, case: Case, rows: Sequence[int]) -> list[Answer]:
    """Loads from motor torques in a batch, compiled."""
    measured = np.zeros((len(case.motors), statics.model.n_motors))
    batch_rows: list[int] = []

    def solve_batch(fast: CompiledModel, part: Any, gravity: FloatArray | None) -> Any:
        measured[part] = _equilibrium_balance(fast, statics, case, part, gravity).motor_torques
        for row in part[part % _ODD == 0].tolist():
            measured[row] += np.random.default_rng(row).normal(size=measured.shape[1]) * 10.0
        batch_rows[:] = part.tolist()
        return fast.estimate_loads(case.motors[part], measured[part], gravity=gravity)

    def fields(found: Any, place: int) -> dict[str, Any]:
        torques = measured[batch_rows[place]]
        size = 1e-10 * max(float(np.linalg.norm(torques)), 1e-3)
        return {"claims": {"motor_torques": torques}, "changed": {"forces": found.forces[place]}, "within": 1e-9 + 2.0 * size}

    return _batch_answers(family, statics, case, rows, solve_batch, fields)


def reach_batch(family: Family, statics: PlainStatics, case: Case, rows: Sequence[int]) -> list[Answer]:
    """Inverse kinematics in a batch, compiled."""
    targets: dict[int, FloatArray] = {}
    batch_rows: list[int] = []

    def solve_batch(fast: CompiledModel, part: Any, gravity: FloatArray | None) -> Any:
        tips = _equilibrium_balance(fast, statics, case, part, gravity).tip
        for row, tip in zip(part.tolist(), tips, strict=True):
            targets[row] = tip + (np.random.default_rng(row).normal(size=3) if row % _ODD == 0 else 0.0)
        batch_rows[:] = part.tolist()
        wanted = np.array([targets[row] for row in batch_rows])
        start = np.clip(case.motors[part] + 0.2, *statics.model.motor_limits.T)
        return fast.inverse_kinematics(wanted, case.forces[part], q_motors0=start, gravity=gravity)

    return _batch_answers(
        family,
        statics,
        case,
        rows,
        solve_batch,
        lambda found, place: {
            "claims": {"tip": targets[batch_rows[place]]},
            "changed": {"motors": found.q_motors[place]},
            "within": 2e-9,
        },
    )


Job = Callable[[Family, PlainStatics, Case, Sequence[int]], list[Answer]]

JOBS: dict[str, Job] = {job.__name__: job for job in (solve, batch, estimate, estimate_batch, reach, reach_batch)}
"""The jobs by name."""
