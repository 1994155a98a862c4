"""What the package promises of itself: light imports, honest names, one direction of imports, folders without Python."""

from __future__ import annotations

import ast
import builtins
import functools
import pickle
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

import softrobots as sr
from softrobots.view.browser import open_browser
from softrobots.view.figures import plots
from tests.conftest import CHECKOUT

PACKAGE = CHECKOUT / "softrobots"


def test_importing_softrobots_imports_nothing_heavy() -> None:
    code = "import softrobots, sys; print(*sys.modules)"
    loaded = set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())
    assert "pinocchio" in loaded
    heavy = {"yourdfpy", "meshcat", "matplotlib", "numba", "scipy", "trimesh", "xacro", "tornado", "tqdm"}
    heavy |= {"mujoco", "pydrake", "pybullet", "urchin", "ikpy", "roboticstoolbox", "viser", "distributed", "dask"}
    heavy |= {"playwright", "PIL", "shtab", "IPython", "example_robot_data"}
    assert not loaded & (heavy | {"urllib.request"})  # brings http, ssl and email along, an eighth of the whole


def test_every_public_name_exists() -> None:
    assert sorted(sr.__all__) == sorted(set(sr.__all__))
    for name in sr.__all__:
        assert getattr(sr, name) is not None


def test_every_error_has_one_root() -> None:
    from softrobots.core import errors

    for thing in vars(errors).values():
        if isinstance(thing, type) and issubclass(thing, Exception):
            assert issubclass(thing, sr.SoftRobotsError)


def test_every_error_crosses_to_another_process(arm: sr.SoftModel) -> None:
    caught: list[sr.SoftRobotsError] = [
        sr.ParameterError("radius", -1.0, "positive"),
        sr.NameNotFound("frame", "tipp", ["tip"]),
        sr.NoCriticalLoad("stable", max_force=3.0),
        sr.MissingDependency("matplotlib", "plot"),
        sr.OutputExists("a.npz exists"),
        sr.DescriptionError("bad"),
    ]
    try:
        sr.solve_ik(arm, (3, 0, 0), starts=2)
    except sr.TargetUnreachable as error:
        caught.append(error)
    assert len(caught) == 7
    for error in caught:
        twin = pickle.loads(pickle.dumps(error))
        assert type(twin) is type(error)
        assert str(twin) == str(error)
        assert twin.__dict__.keys() == error.__dict__.keys()


@functools.cache
def nodes_of(file: Path) -> tuple[ast.AST, ...]:
    """Every node of a module."""
    return tuple(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))


def imports_of(file: Path) -> set[str]:
    found = set()
    for node in nodes_of(file):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("softrobots"):
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@functools.cache
def import_graph() -> dict[str, set[str]]:
    """Which modules each module of the package imports, also inside functions."""
    files = {
        ".".join(f.relative_to(CHECKOUT).with_suffix("").parts).removesuffix(".__init__"): f for f in PACKAGE.rglob("*.py")
    }
    return {
        name: (imports_of(file) & files.keys()) - {name, "softrobots"} for name, file in files.items() if name != "softrobots"
    }


def test_imports_point_one_way() -> None:
    """No cycle among the modules, not even through an import inside a function."""
    graph = import_graph()
    while graph:
        leaves = {name for name, needs in graph.items() if not needs & graph.keys()}
        assert leaves, f"a cycle among {sorted(graph)}"
        graph = {name: needs for name, needs in graph.items() if name not in leaves}


def test_the_statics_knows_nothing_of_descriptions_arms_and_other_tools() -> None:
    reached = reached_from(["trajectory", "load_estimation", "imposed_displacement", "stability", "workspace"])
    assert "elastostatics" in reached
    roots = {name.split(".")[0] for name in reached}
    assert not roots & {"robots", "helix", "constant_curvature", "export", "readers", "interop", "commands", "composition"}
    assert not roots & {"description", "tag_reader", "rigid_tree", "rigid_tree_urdf", "sources", "loader", "scene", "viewer"}
    assert not roots & {"papers", "live", "meshcat_view", "viser_view", "slider_page", "browser", "plots", "gallery"}


def reached_from(names: Iterable[str]) -> set[str]:
    """Modules that some modules, or all modules of a folder, import, directly or through others; with themselves."""
    graph = import_graph()
    starts = tuple(f"softrobots.{name}" for name in names)
    reached = {name for name in graph if name in starts or name.startswith(tuple(f"{start}." for start in starts))}
    assert all(any(name == start or name.startswith(f"{start}.") for name in reached) for start in starts)
    while new := {needed for name in reached for needed in graph[name]} - reached:
        reached |= new
    return {name.removeprefix("softrobots.") for name in reached}


@pytest.mark.parametrize(
    ("names", "unknown"),
    [
        # Equations as the papers print them are what ours are compared with: they share nothing but the checks of input.
        (["papers.dh_tables", "papers.helix_equations", "papers.pcc_equations"], None),
        (["live"], ["viewer", "meshcat_view", "viser_view", "slider_page", "commands", "browser"]),
        (["meshcat_view"], ["viewer", "viser_view", "slider_page", "live", "commands", "papers", "browser"]),
        (["viewer"], ["viser_view", "slider_page", "live", "commands", "papers", "browser"]),
        (["viser_view", "slider_page"], ["viewer", "live", "commands", "papers", "browser"]),
        (["papers.reproduction"], ["plots", "commands", "viewer", "helix_sheet"]),
        (["plots", "browser", "marked_text"], ["commands", "papers", "live", "viewer", "meshcat_view", "viser_view"]),
    ],
)
def test_what_people_meet_is_made_of_parts_that_do_not_know_each_other(names: list[str], unknown: list[str] | None) -> None:
    reached = reached_from(names)
    if unknown is None:
        assert reached == {*names, "checks", "errors"}
    else:
        assert all(reached_from([name]) for name in unknown)  # none of them is a name of old
        assert not {name for name in reached if name in unknown or name.split(".")[0] in unknown}


def test_nothing_but_the_command_line_imports_the_commands_and_only_papers_the_papers() -> None:
    for name, needs in import_graph().items():
        home = name.removeprefix("softrobots.")
        if not home.startswith(("commands", "cli", "__main__")):
            assert not {needed for needed in needs if needed.startswith(("softrobots.cli", "softrobots.cli.main"))}, name
        if not home.startswith("papers"):
            shared = {"studies.papers", "studies.papers.arm_path"}  # a path that scripts and benchmarks follow, too
            assert not {needed for needed in needs - shared if needed.startswith("studies.papers")}, name


def test_closed_forms_and_descriptions_know_nothing_of_pinocchio() -> None:
    names = [
        "errors",
        "checks",
        "paths",
        "description",
        "urdf_tags",
        "tag_reader",
        "mesh_files",
        "renaming",
        "argument_notes",
        "springs",
        "time_law",
        "stumpff",
        "screws",
        "strain_chain",
        "serial_chain",
        "growth",
        "files",
        "checkpoint",
    ]
    files = [
        PACKAGE / f"{name}.py" for name in (*names, "coordinates", "joint_loads", "muscles", "muscle_lengths", "actuators")
    ]
    for folder in ("inflated_beam", "constant_curvature", "helix", "robots"):
        files += (PACKAGE / folder).glob("*.py")
    assert len(files) > 20
    for file in files:
        assert "pinocchio" not in file.read_text(encoding="utf-8").replace("Pinocchio", ""), file


def test_only_one_module_imports_xacro_and_one_builds_models() -> None:
    users = [f.name for f in PACKAGE.rglob("*.py") if re.search(r"^\s*import xacro$", f.read_text(encoding="utf-8"), re.M)]
    core = [f for f in PACKAGE.rglob("*.py") if f.parent.name != "interop"]  # there Pinocchio is compared with other tools
    builders = [f.name for f in core if "buildModelFrom" in f.read_text(encoding="utf-8")]
    assert (users, builders) == (["description.py"], ["loader.py"])


def test_xacro_and_urdf_hold_no_python() -> None:
    """A Python file in xacro/ would shadow the package xacro in a checkout."""
    for folder in ("xacro", "urdf"):
        names = list((CHECKOUT / folder).rglob("*"))
        assert names
        assert not [name for name in names if name.suffix == ".py"]


def test_no_assert_guards_input() -> None:
    for file in PACKAGE.rglob("*.py"):
        assert not [node for node in nodes_of(file) if isinstance(node, ast.Assert)], file


def test_a_missing_extra_says_what_to_type(monkeypatch: pytest.MonkeyPatch) -> None:
    original = builtins.__import__

    def without(name: str, *rest: object, **options: object) -> object:
        if name.startswith(("matplotlib", "playwright")):
            raise ImportError(name)
        return original(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(sr.MissingDependency, match=r"matplotlib is not installed.*pip install 'softrobots\[plot\]'"):
        plots.require_matplotlib()
    if shutil.which("chromium"):
        with pytest.raises(sr.MissingDependency, match=r"playwright is not installed.*softrobots\[pictures\]"), open_browser():
            pass


def extras() -> dict[str, set[str]]:
    """Packages of each extra in pyproject.toml; no tomllib in Python 3.10."""
    text = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    part = text[text.index("[project.optional-dependencies]") : text.index("[project.scripts]")]
    found: dict[str, set[str]] = {}
    for line in part.splitlines():
        head = re.match(r"([\w-]+) = \[", line)
        if head:
            found[name := head[1]] = set()
        for package in re.findall(r'"([\w-]+)(?:\[[\w,-]+\])?(?:[>"])', line):
            found[name].add(package)
    return found


def test_the_extra_that_an_error_names_holds_the_package() -> None:
    """Every `MissingDependency(package, extra)` of the source with words for both."""
    known, seen = extras(), 0
    for file in PACKAGE.rglob("*.py"):
        for node in nodes_of(file):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "MissingDependency":
                words = [argument.value for argument in node.args if isinstance(argument, ast.Constant)]
                if len(words) == 2:
                    seen += 1
                    packages = {word for word in words[0].split() if word != "with"}
                    assert {"dask" if word == "distributed" else word for word in packages} <= known[words[1]], (file, words)
    assert seen >= 10


def test_dev_holds_every_extra() -> None:
    text = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    named = re.search(r'"softrobots\[([\w,-]+)\]"', text)
    assert named is not None
    assert set(named[1].split(",")) == set(extras()) - {"dev"}


def test_dev_installs_the_tools_of_the_gate() -> None:
    gate = CHECKOUT / ".ci" / "run"
    if not gate.is_file():
        pytest.skip("a source distribution has no gate")
    tools = set(re.findall(r"\.venv/bin/(?:python -m )?(?!python\b)(\w+)", gate.read_text(encoding="utf-8")))
    assert {"ruff", "mypy", "build", "twine"} <= tools <= extras()["dev"]


def test_the_version_stands_in_one_place() -> None:
    """The package says it; the citation and the newest entry of the changelog are that version."""
    assert 'path = "softrobots/__init__.py"' in (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    citation = (CHECKOUT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", citation, flags=re.MULTILINE) == [sr.__version__]
    changelog = (CHECKOUT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## \[(.*?)\]", changelog, flags=re.MULTILINE)[0] == sr.__version__
