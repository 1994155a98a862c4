"""Random loads, and maps compared bit for bit."""

from __future__ import annotations

import numpy as np

from softrobots.compiled.sweeps import WorkspaceMap


def directions(rng: np.random.Generator, count: int) -> np.ndarray:
    vectors = rng.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def cases(rng: np.random.Generator, count: int, low: float, high: float, motors: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Motors anywhere, forces of any direction."""
    return rng.uniform(-np.pi, np.pi, (count, motors)), directions(rng, count) * rng.uniform(low, high, (count, 1))


def fingerprint(made: WorkspaceMap) -> list[bytes]:
    names = ("loads", "direction", "reached", "required_pressure", "payload", "q_motors", "q_springs")
    return [getattr(made, name).tobytes() for name in names]
