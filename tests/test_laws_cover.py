"""Every public function and class, and the methods of those that users call, have a law: a hypothesis test that uses them."""

from __future__ import annotations

import ast
import importlib.util
import inspect
from fnmatch import fnmatchcase
from functools import cache
from types import ModuleType

import pytest
from hypothesis import is_hypothesis_test

import softrobots as sr
from softrobots.compiled.run.compiled_model import CompiledModel
from tests.conftest import CHECKOUT, load_script
from tests.support.laws import REGISTERED

SUBMODULES = ("constant_curvature", "export", "helix", "inflated_beam", "compiled.sweeps")
CLASSES = (CompiledModel, sr.SoftModel, sr.Viewer)

_RESULT = "a result: what is in it is in the laws of what returns it"
_SCREEN = "it writes to a terminal or reads its words; tests of the commands run it"
WITHOUT = {
    "Viewer.wait": "it returns when the server ends, or on Ctrl-C; test_view_command ends it so",
    "robots.Robot": "a protocol: nothing of it is called",
    "description.third_party.robot_file": "a table of a package of data: test_model loads what is in it",
    "compiled.run.compiled_model.CompiledModel": "its methods have laws, under the name of the class",
    "compiled.run.compiled_statics.CompiledStatics": "its methods have laws, under the name of CompiledModel",
    "compiled.run.compiled_code.CompiledCode": "its methods have laws, under the name of CompiledModel",
    "compiled.statuses.Status": "numbers with names",
    "CompiledModel.given_run": "generated code for derivatives: test_chain_responses compares what it finds with differences",
    **dict.fromkeys((f"compiled.run.results.Compiled{name}" for name in ("Equilibrium", "LoadEstimate")), _RESULT),
    **dict.fromkeys((f"compiled.run.results.{name}Batch" for name in ("Equilibrium", "Load", "Motor")), _RESULT),
    **dict.fromkeys((f"compiled.run.contact_batches.Contact{name}" for name in ("Batch", "Equilibrium")), _RESULT),
    **dict.fromkeys(
        (f"{name}.{function}" for name in ("jax", "torch") for function in ("equilibrium", "load_estimate")),
        "functions of an optional package: test_jax and test_torch compare their derivatives with differences",
    ),
    "dynamics.motion.MotionEnergy": _RESULT,
    "MotionState": _RESULT,
    **dict.fromkeys((f"statics.contact.contact_path.Contact{name}" for name in ("Event", "Jump")), _RESULT),
    "statics.contact.clearance.Clearance": _RESULT,
    **dict.fromkeys((f"statics.contact.grasp.{name}" for name in ("ForceClosure", "PullOut")), _RESULT),
    "view.live.commands.Wanted": _RESULT,
    "view.meshcat_page.page_text.InlinePage": "a page of somebody else's notebook: test_view_command shows it in a browser",
    "view.identification_page.IdentificationPage": "a page in a browser: test_identification_figures reads what it shows",
    "view.served_page.ServedPage": "its methods have laws, under the name of Viewer",
    "view.slider_page.SliderPage": "a page in a browser: test_slider_page moves its sliders",
    "interactive": "a page in a browser: test_interactive_page compares what it solves and draws",
    "view.figures.*": "pictures: tests look at what is drawn, and hypothesis has no eyes",
    "cli.main.main": "hypothesis tries words for each command in test_cli_bad_words, within a test for each",
    "cli.main.parser": _SCREEN,
    "cli.options.command_line.*": _SCREEN,
}
"""Public names without a law, also by a pattern, and why."""

for _file in sorted((CHECKOUT / "tests").glob("test_*.py")):  # they register their laws
    if "\n@law(" in _file.read_text(encoding="utf-8"):
        importlib.import_module(f"tests.{_file.stem}")


def public_names() -> set[str]:
    """Every callable that `softrobots` and its submodules offer, and the methods of `CLASSES`."""
    found = {name for name in sr.__all__ if callable(getattr(sr, name))} | {"compile"}
    for module in SUBMODULES:
        inside = importlib.import_module(f"softrobots.{module}")
        found |= {f"{module}.{name}" for name in inside.__all__ if callable(getattr(inside, name))}
    for kind in CLASSES:
        functions = inspect.getmembers(kind, inspect.isfunction)
        found |= {f"{kind.__name__}.{name}" for name, _ in functions if not name.startswith("_")}
    return found | documented()


@cache
def documented() -> set[str]:
    """Every other callable of the API reference: things by their name in `softrobots`, and all that is public in a module."""
    pages = load_script("api_pages", "docs/site")
    known = {
        getattr(sr, name) for name in sr.__all__ if inspect.isroutine(getattr(sr, name)) or inspect.isclass(getattr(sr, name))
    }
    found: dict[str, object] = {}
    for name in (name for page in pages.PAGES.values() for name in page.names if name not in pages.PACKAGES):
        above, _, last = name.rpartition(".")
        thing = getattr(importlib.import_module(above), last, None) or importlib.import_module(name)
        if isinstance(thing, ModuleType):
            found |= {f"{name}.{key}": one for key, one in vars(thing).items() if getattr(one, "__module__", "") == name}
        else:
            found[name] = thing
    kept = (name for name, thing in found.items() if callable(thing) and thing not in known and thing is not sr.compile)
    return {name.removeprefix("softrobots.") for name in kept if not name.rpartition(".")[2].startswith("_")}


def excused(name: str) -> bool:
    """Whether a name has no law, for a reason."""
    return any(fnmatchcase(name, pattern) for pattern in WITHOUT)


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
    assert {
        "compiled.sweeps.map_workspace",
        "robots.parameter_file.read_robot",
        "view.figures.motions.strobe",
        "view.live.loop.LiveView",
    } <= public_names()
    assert sorted(name for name in public_names() - REGISTERED.keys() if not excused(name)) == []


def test_what_has_no_law_is_there_and_says_why() -> None:
    for pattern, reason in WITHOUT.items():
        assert any(fnmatchcase(name, pattern) for name in public_names() - REGISTERED.keys()), pattern
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
