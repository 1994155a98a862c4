"""The compiled solvers as the benchmark calls them: made once for each robot."""

from __future__ import annotations

from functools import lru_cache

from softrobots.compiled.run.compiled_model import CompiledModel, compile_model
from softrobots.model.soft_model import SoftModel

BACKENDS = ("numba", "python")
"""Back ends: compiled by numba (extra `fast`), and plain Python for one case with NumPy for many."""

BENDING = ("twist", "stretch")
"""Strains that are locked in a rod that only bends."""


@lru_cache(maxsize=32)
def compiled(model: SoftModel, backend: str, locked_strains: tuple[str, ...] = ()) -> CompiledModel:
    """`softrobots.compile`, once for each robot, back end and set of locked strains.

    Raises:
        MissingDependency: If the back end is not installed.
    """
    return compile_model(model, backend=backend, locked_strains=locked_strains)
