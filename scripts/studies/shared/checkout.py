"""The checkout of the project, and the independent solvers of its tests."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

from softrobots.core.errors import MissingDependency

CHECKOUT = Path(__file__).resolve().parents[3]
"""Folder of the checkout."""


def test_support(name: str) -> ModuleType:
    """Import a module of `tests/support`.

    Args:
        name: Its name, e.g. "rods".

    Raises:
        MissingDependency: If a package that it needs is not installed.
    """
    if str(CHECKOUT) not in sys.path:
        sys.path.insert(0, str(CHECKOUT))
    try:
        return importlib.import_module(f"tests.support.{name}")
    except ImportError as error:
        package = (error.name or "tests").partition(".")[0]
        raise MissingDependency("scipy" if package == "tests" else package, "dev") from error
