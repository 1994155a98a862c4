"""The laws that every answer of a soak must obey, and the count of outcomes."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import MOMENT_FLOOR, TOLERANCE
from studies.soak.families import Family, draw_cases
from studies.soak.jobs import JOBS, STABLE, Answer
from studies.soak.plain_stability import CLOSE, growth, least_eigenvalue
from studies.soak.plain_statics import Case, PlainStatics

MOST_ITERATIONS = 200
"""Largest number of evaluations, or of steps of a search."""

MARGIN = 1.01
"""Largest residual over its tolerance; 1 % allows for the rounding of the second evaluation."""

WORST = 1e300
"""Value in place of a residual that is not a number."""

LARGEST_TANGENT = 200
"""Largest number of springs for which the tangent stiffness is computed again, by differences."""

MUSCLE_ERROR = 1e-9
"""Largest distance of a muscle from its given length [m]."""


@dataclass
class AnyTally:
    """Outcomes of a family, of any soak."""

    cases: int = 0
    """Number of cases."""
    outcomes: Counter[str] = field(default_factory=Counter)
    """Number of cases by outcome."""
    residual: float = 0.0
    """Largest residual over its tolerance, by plain statics."""
    slowest: float = 0.0
    """Longest time of a case [s]; in a batch, the mean."""
    seconds: float = 0.0
    """Total time in the solvers [s]."""
    broken: list[tuple[int, str]] = field(default_factory=list)
    """Cases that break a law: number and law."""

    def _add(self, other: AnyTally) -> None:
        """Add what every soak counts."""
        self.cases += other.cases
        self.outcomes.update(other.outcomes)
        self.residual = max(self.residual, other.residual)
        self.slowest = max(self.slowest, other.slowest)
        self.seconds += other.seconds
        self.broken += other.broken

    def as_json(self) -> dict[str, Any]:
        """Return the tally for JSON."""
        return {**vars(self), "outcomes": dict(sorted(self.outcomes.items()))}


@dataclass
class Tally(AnyTally):
    """Outcomes of a family."""

    tangents: int = 0
    """Number of tangent stiffnesses computed again."""
    iterations: int = 0
    """Largest number of iterations."""

    def add(self, other: Tally) -> None:
        """Add another part of the same family."""
        self._add(other)
        self.tangents += other.tangents
        self.iterations = max(self.iterations, other.iterations)


def judge(family: Family, seed: int, chunk: int, rows: Sequence[int]) -> tuple[Tally, list[Answer]]:
    """Draw the cases of a chunk, solve some of them, and check the answers.

    Args:
        family: The family.
        seed: Seed of all random numbers.
        chunk: Number of the chunk.
        rows: The rows to be solved.

    Returns:
        The count, and the answers.
    """
    random = family.random(seed, chunk)
    model = family.robot(random)
    case = draw_cases(family, model, random)
    statics = PlainStatics(model)
    begun = time.perf_counter()
    answers = JOBS[family.job](family, statics, case, rows)
    tally = Tally(cases=len(answers), seconds=time.perf_counter() - begun)
    for answer in answers:
        tally.outcomes[answer.outcome] += 1
        tally.iterations = max(tally.iterations, answer.iterations)
        tally.slowest = max(tally.slowest, answer.seconds)
        laws = [answer.broken] if answer.broken else []
        if answer.iterations > MOST_ITERATIONS:
            laws.append(f"{answer.iterations} iterations")
        tally.broken += [(family.chunk * chunk + answer.row, law) for law in laws]
    answered = [answer for answer in answers if answer.springs is not None]
    if answered:
        _check(tally, family, chunk, statics, case, answered)
    return tally, answers


def _check(tally: Tally, family: Family, chunk: int, statics: PlainStatics, case: Case, answers: list[Answer]) -> None:
    """Check answers against plain statics."""
    rows = [answer.row for answer in answers]
    answered = Case(*(array[rows] for array in case))
    for place, answer in enumerate(answers):
        for name, value in answer.changed.items():
            getattr(answered, name)[place] = value
    springs = np.array([answer.springs for answer in answers])
    balance = statics.balance(answered, springs)
    tolerance = np.maximum(TOLERANCE * np.maximum(balance.size, MOMENT_FLOOR), statics.model.rounding)
    residual = np.maximum(balance.imbalance - balance.rounding, 0.0) / tolerance
    residual = np.nan_to_num(residual, nan=WORST, posinf=WORST)
    tally.residual = max(tally.residual, float(residual.max()))
    for place, answer in enumerate(answers):
        broken = []
        if not residual[place] <= MARGIN:
            broken.append(f"reported as {answer.outcome}, {residual[place]:.3g} times the tolerance out of balance")
        if not balance.held[place] <= MUSCLE_ERROR:
            broken.append(f"a muscle is {balance.held[place]:.3g} m from its length")
        for name, claim in answer.claims.items():
            error = float(np.abs(getattr(balance, name)[place] - claim).max(initial=0.0))
            allowed = answer.within + (1e-12 * float(balance.size[place]) if name == "motor_torques" else 0.0)
            if not error <= allowed:
                broken.append(f"the {name.replace('_', ' ')} is off by {error:.3g}")
        if answer.row % family.tangents == 0 and springs.shape[1] <= LARGEST_TANGENT and residual[place] < WORST:
            tally.tangents += 1
            broken += _wrong_verdict(statics, answered.row(place), answer)
        tally.broken += [(family.chunk * chunk + answer.row, law) for law in broken]


def _wrong_verdict(statics: PlainStatics, case: Case, answer: Answer) -> list[str]:
    """What is wrong with what an answer says of its stability."""
    springs = np.asarray(answer.springs)
    if case.moments.any():
        rate = growth(statics, case, springs)
        wrong = rate is not None and (rate > CLOSE if answer.outcome == STABLE else rate == 0.0)
        return [f"reported as {answer.outcome}, vibrations grow by {rate:.3g} of their frequency"] if wrong else []
    eigenvalue, error = least_eigenvalue(statics, case, springs)
    wrong = (eigenvalue < -error) if answer.outcome == STABLE else (eigenvalue > error)
    return [f"reported as {answer.outcome}, least eigenvalue {eigenvalue:.3g} within {error:.1g}"] if wrong else []


def case_text(model: SoftModel, case: Case, answers: Sequence[Answer]) -> str:
    """Return cases, answers and the model as text."""
    lines = [repr(model)]
    for answer in answers:
        lines += [f"{name}: {array[answer.row].tolist()}" for name, array in case._asdict().items()]
        lines += [f"{name}: {value}" for name, value in vars(answer).items()]
    return "\n".join(lines)
