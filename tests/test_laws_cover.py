"""Every public function and class, and the methods of those that users call, have a law: a hypothesis test that uses them."""

from __future__ import annotations

import ast
import importlib
import inspect
from functools import cache
from types import ModuleType

import pytest
from hypothesis import is_hypothesis_test

import softrobots as sr
from softrobots.kernels.compiled_model import CompiledModel
from tests.conftest import CHECKOUT
from tests.laws import REGISTERED

SUBMODULES = ("constant_curvature", "export", "helix", "inflated_beam")
CLASSES = (CompiledModel, sr.SoftModel, sr.Viewer)

WITHOUT = {"Viewer.wait": "it returns when the server ends, or on Ctrl-C; test_view_command ends it so"}
"""Methods without a law, and why."""

for _file in sorted((CHECKOUT / "tests").glob("test_*.py")):  # they register their laws
    if "\n@law(" in _file.read_text(encoding="utf-8"):
        importlib.import_module(f"tests.{_file.stem}")


def public_names() -> set[str]:
    """Every callable that `softrobots` and its submodules offer, and the methods of `CLASSES`."""
    found = {name for name in sr.__all__ if callable(getattr(sr, name))} | {"compile"}
    for module in SUBMODULES:
        inside = getattr(sr, module)
        found |= {f"{module}.{name}" for name in inside.__all__ if callable(getattr(inside, name))}
    for kind in CLASSES:
        functions = inspect.getmembers(kind, inspect.isfunction)
        found |= {f"{kind.__name__}.{name}" for name, _ in functions if not name.startswith("_")}
    return found - set(WITHOUT)


@cache
def words_of(module: ModuleType) -> dict[str, set[str]]:
    """Names and attributes in the source of what a module defines, by its name; texts, as in `@law("name")`, are none."""
    found: dict[str, set[str]] = {}
    for node in ast.parse(inspect.getsource(module)).body:
        targets = getattr(node, "targets", [getattr(node, "target", node)])
        names = [getattr(target, "name", getattr(target, "id", None)) for target in targets]
        words = {
            part.id if isinstance(part, ast.Name) else part.attr
            for part in ast.walk(node)
            if isinstance(part, ast.Name | ast.Attribute)
        }
        found |= {name: words for name in names if isinstance(name, str)}
    return found


def words_used(module: ModuleType, test: str) -> set[str]:
    """What a test says, and what it uses of its module says."""
    known, used, waiting = words_of(module), set[str](), {test}
    while waiting:
        new = known[waiting.pop()] - used
        used |= new
        waiting |= new & known.keys()
    return used


def test_every_public_name_has_a_law() -> None:
    assert sorted(public_names() - REGISTERED.keys()) == []


def test_what_has_no_law_is_there_and_says_why() -> None:
    methods = {f"{kind.__name__}.{name}": value for kind in CLASSES for name, value in inspect.getmembers(kind)}
    for name, reason in WITHOUT.items():
        assert callable(methods[name])
        assert name not in REGISTERED
        assert reason


@pytest.mark.parametrize("name", sorted(REGISTERED))
def test_a_law_is_a_hypothesis_test_that_uses_the_name(name: str) -> None:
    """By itself or by what it uses of its module; under a name by which pytest finds it."""
    for test in REGISTERED[name]:
        module = inspect.getmodule(test)
        assert module is not None
        assert test.__name__.startswith("test_")
        assert is_hypothesis_test(getattr(module, test.__name__))
        assert name.split(".")[-1] in words_used(module, test.__name__), f"{test.__name__} does not use {name}"


def test_the_check_of_words_sees_helpers_and_no_texts() -> None:
    module = inspect.getmodule(public_names)
    assert isinstance(module, ModuleType)
    used = words_used(module, "test_every_public_name_has_a_law")
    assert {"public_names", "SUBMODULES", "getmembers", "REGISTERED"} <= used
    assert "constant_curvature" not in used
