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
from pathlib import Path

import pytest

import softrobots as sr
from softrobots.view.figures import canvas
from studies.shared.browser import open_browser
from tests.conftest import CHECKOUT

PACKAGE = CHECKOUT / "softrobots"


def test_importing_softrobots_imports_nothing_heavy() -> None:
    code = "import softrobots, sys; print(*sys.modules)"
    loaded = set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())
    assert "pinocchio" in loaded
    heavy = {"yourdfpy", "meshcat", "matplotlib", "numba", "scipy", "trimesh", "xacro", "tornado", "tqdm", "daqp"}
    heavy |= {"mujoco", "pydrake", "pybullet", "urchin", "ikpy", "roboticstoolbox", "viser", "distributed", "dask"}
    heavy |= {"playwright", "PIL", "shtab", "IPython", "example_robot_data", "control", "jax", "torch"}
    assert not loaded & (heavy | {"urllib.request"})  # brings http, ssl and email along, an eighth of the whole


PUBLIC = """
EARTH_GRAVITY PD ROBOTS AssumedStiffnessWarning Box Capsule ClosedLoop ClusterError ContactPath CrossValidation Cylinder
DescriptionError Environment Equilibrium EquilibriumBranch EquilibriumNotFound FieldNotFound FileFormatError HalfSpace HelixTube
Identification IkSolution ImposedDisplacement InflatableArm InformativePoses InputShaper LinearModel LinkLimits LoadEstimate
LoadNotFound Measurements Mesh MissingDependency Motion MotionState NameNotFound NeutralEquilibrium NoCriticalLoad NotConverged
OutputError OutputExists ParameterError Path3D PccArm RingDown Route SelfIntersection Sensitivity ShapedTrajectory SoftModel
SoftRobotsError Sphere SpringGroup Stability StraightTube SuspiciousInputWarning TargetUnreachable TendonArm Trajectory
VibrationModes Viewer ViewerError Workspace __version__ capsule_error compliance constant_curvature contact_sensitivity
contact_wrench critical_load cross_validate damping_time_from_decrement distributed_force elastostatic_jacobian estimate_load
export follow_contact follow_trajectory grown_coordinates helix identify inflated_beam informative_poses input_shaper
interactive is_force_closure linearize load_model load_result locate_contact mount plot post_buckling_branches
pull_out_force quintic read_waypoints residual_vibration ring_down sample_workspace save_csv save_result sensitivity
shape_input simulate solve_equilibrium solve_ik solve_imposed_displacement straight_line to_dataframe vibration_modes view
waypoints with_points with_springs
"""
"""What users import from `softrobots`: a name is added here on purpose, and none disappears unnoticed."""


def test_the_public_names_are_these_and_exist() -> None:
    assert sr.__all__ == PUBLIC.split()
    assert set(dir(sr)) == {*sr.__all__, "compile", "jax", "torch"}  # what completion offers
    for name in dir(sr):
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


# --- The rooms

ROOMS = {
    "core": "",
    "inflated_beam": "core",
    "constant_curvature": "core",
    "helix": "core constant_curvature",
    "description": "core",
    "robots": "core inflated_beam constant_curvature helix description",
    "model": "core inflated_beam constant_curvature description",
    "environment": "core constant_curvature description model",
    "statics": "core inflated_beam model environment",
    "dynamics": "core constant_curvature model environment statics",
    "identification": "core inflated_beam constant_curvature description robots model environment statics dynamics",
    "compiled": "core inflated_beam constant_curvature description model environment statics dynamics identification",
    "learning": "core inflated_beam description model environment statics identification compiled",
    "jax": "core learning",
    "torch": "core learning",
    "export": "core inflated_beam constant_curvature description robots model environment statics dynamics",
    "view": "core inflated_beam constant_curvature helix description robots model environment statics dynamics identification"
    " compiled",
    "cli": "core inflated_beam constant_curvature helix description robots model environment statics dynamics identification"
    " compiled export view",
}
"""Every folder of the package, and the rooms that it may import."""
TO_CODE = ("trace", "chain", "motion", "routes", "drivers", "program", "translate", "browser", "contact", "run", "sweeps")
"""Folders of `compiled/` in the order in which a robot becomes code; each imports only those before it."""
SOLVERS = "trajectory load_estimation imposed_displacement buckling.critical_load stability workspace buckling.post_buckling"
SOLVERS += " sensitivity"
LOADING = "softrobots.model.loader softrobots.description.tag_reader softrobots.description.sources"
SEPARATE = {
    " ".join(f"softrobots.statics.{name}" for name in SOLVERS.split()): LOADING,
    "softrobots.compiled.run": LOADING,
    "softrobots.view.figures": "softrobots.view.meshcat_page softrobots.view.viser_page softrobots.view.live"
    " softrobots.view.viewer",
    "softrobots.view.live": "softrobots.view.meshcat_page softrobots.view.viser_page softrobots.view.viewer",
    "softrobots.view.meshcat_page": "softrobots.view.viser_page softrobots.view.live softrobots.view.viewer",
    "softrobots.view.viewer": "softrobots.view.viser_page softrobots.view.slider_page softrobots.view.live",
    "softrobots.view.slider_page": "softrobots.view.viewer softrobots.view.live",
    "studies.papers.reproduction": "softrobots.view studies.papers.pictures",
}
"""Modules or folders, and what they import neither directly nor through others."""
EQUATIONS = ("studies.papers.dh_tables", "studies.papers.helix_equations", "studies.papers.pcc_equations")
"""Equations as the papers print them, with which the package is compared."""
XACRO = "softrobots.description.expansion"
BUILDER = "softrobots.model.loader"
COMPARING = {"softrobots.description.collision_shapes", "softrobots.cli.tools.kinematics", "softrobots.cli.tools.checks"}
"""Modules that read a file with Pinocchio as other tools do, to compare it or look at its shapes."""
WITH_PINOCCHIO = {
    f"softrobots.description.{name}" for name in ("rigid_tree", "rigid_tree_urdf", "composition", "collision_shapes")
}
"""Below `model` only these, which read and write foreign files, import Pinocchio."""


@functools.cache
def modules() -> dict[str, Path]:
    """Every module of the package and of the studies."""
    files = {file: file.relative_to(CHECKOUT) for file in PACKAGE.rglob("*.py")}
    files |= {file: file.relative_to(CHECKOUT / "scripts") for file in (CHECKOUT / "scripts" / "studies").rglob("*.py")}
    return {".".join(path.with_suffix("").parts).removesuffix(".__init__"): file for file, path in files.items()}


def in_package() -> dict[str, Path]:
    return {name: file for name, file in modules().items() if room_of(name)}


def room_of(name: str) -> str:
    """The room of a module; empty for a study and for the modules beside the rooms."""
    first, _, rest = name.partition(".")
    return rest.partition(".")[0] if first == "softrobots" and rest not in {"version", "__main__"} else ""


@functools.cache
def nodes_of(file: Path) -> tuple[ast.AST, ...]:
    """Every node of a module."""
    return tuple(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))


@functools.cache
def import_graph() -> dict[str, set[tuple[str, str]]]:
    """The modules that each module imports, also inside functions, with the name taken from each; not the face."""
    graph: dict[str, set[tuple[str, str]]] = {}
    for name, file in modules().items():
        taken = graph[name] = set()
        for node in nodes_of(file):
            if isinstance(node, ast.ImportFrom) and node.module is not None:
                full = {(f"{node.module}.{alias.name}", alias.name) for alias in node.names}
                taken |= {(whole if whole in modules() else node.module, part) for whole, part in full}
        graph[name] = {(source, part) for source, part in taken if source in modules() and source not in {name, "softrobots"}}
    return graph


def sources_of(name: str) -> set[str]:
    return {source for source, _ in import_graph()[name]}


def within(name: str, folder: str) -> bool:
    return name == folder or name.startswith(f"{folder}.")


def reached_from(*folders: str) -> set[str]:
    """Modules that the modules of some folders import, directly or through others; with themselves."""
    reached = {name for name in modules() if any(within(name, folder) for folder in folders)}
    while new := {source for name in reached for source in sources_of(name)} - reached:
        reached |= new
    return reached


def test_rooms_import_only_the_rooms_below_them() -> None:
    """One table; a private name stays in its room; nothing but the rooms, the face and the version in `softrobots/`."""
    found = {path.name for path in PACKAGE.iterdir()} - {"__pycache__"}
    assert found == {"__init__.py", "__main__.py", "version.py", "py.typed", *ROOMS}
    above: set[str] = set()
    for room in reversed(ROOMS):
        assert not above & set(ROOMS[room].split()), f"{room} imports a room that comes after it in the table"
        above.add(room)
        assert above - set(ROOMS) == set()
    for name in in_package():
        room = room_of(name)
        for source, part in import_graph()[name]:
            other = room_of(source)
            assert other in {"", room, *ROOMS[room].split()}, f"{name} imports {source}: not in the table"
            assert other == room or not part.startswith("_") or part == "__version__", f"{name} imports {part} of {source}"
            assert not source.startswith("studies"), f"{name} imports {source}, which is not in the wheel"


def test_a_robot_becomes_code_in_one_direction() -> None:
    assert {path.name for path in (PACKAGE / "compiled").iterdir() if path.is_dir()} - {"__pycache__"} == set(TO_CODE)
    for name in in_package():
        if within(name, "softrobots.compiled") and name.count(".") > 2:
            folder = name.split(".")[2]
            others = {source.split(".")[2] for source in sources_of(name) if within(source, "softrobots.compiled")}
            later = others & set(TO_CODE[TO_CODE.index(folder) + 1 :])
            assert not later, f"{name} imports {later}"


def test_no_room_and_no_module_is_too_large() -> None:
    """At most 25 modules a folder; at most 300 lines a module; every folder says in one line what is in it."""
    for name, file in in_package().items():
        assert len(list(file.parent.glob("*.py"))) <= 25, file.parent
        assert len(file.read_text(encoding="utf-8").splitlines()) <= 300, name
        if file.name == "__init__.py":
            text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
            assert text, f"{name} has no docstring"


def test_imports_have_no_circle() -> None:
    """Not even through an import inside a function."""
    graph = {name: sources_of(name) for name in modules()}
    while graph:
        leaves = {name for name, sources in graph.items() if not sources & graph.keys()}
        assert leaves, f"a circle among {sorted(graph)}"
        graph = {name: sources for name, sources in graph.items() if name not in leaves}


def test_parts_do_not_know_each_other() -> None:
    for part, others in SEPARATE.items():
        reached = reached_from(*part.split())
        for other in others.split():
            assert any(within(name, other) for name in modules()), f"{other} does not exist"
            assert not [name for name in reached if within(name, other)], f"{part} imports {other}"
    assert reached_from(*EQUATIONS) == {*EQUATIONS, "softrobots.core.checks", "softrobots.core.errors"}


def test_only_papers_import_papers() -> None:
    shared = {"studies.papers", "studies.papers.arm_path"}  # the path is followed by the benchmark, too
    for name in modules():
        if not within(name, "studies.papers"):
            assert not {source for source in sources_of(name) - shared if within(source, "studies.papers")}, name


def test_closed_forms_and_descriptions_know_nothing_of_pinocchio() -> None:
    below = list(ROOMS)[: list(ROOMS).index("model")]
    users = {
        name
        for name, file in in_package().items()
        if room_of(name) in below
        and any(
            (isinstance(node, ast.Import) and any(alias.name.partition(".")[0] == "pinocchio" for alias in node.names))
            or (isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "pinocchio")
            for node in nodes_of(file)
        )
    }
    assert users <= WITH_PINOCCHIO
    for room in ("inflated_beam", "constant_curvature", "helix"):
        assert not reached_from(f"softrobots.{room}") & WITH_PINOCCHIO, room


def test_only_one_module_imports_xacro_and_one_builds_models() -> None:
    texts = {name: file.read_text(encoding="utf-8") for name, file in in_package().items()}
    assert {name for name, text in texts.items() if re.search(r"^\s*import xacro$", text, re.M)} == {XACRO}
    assert {name for name, text in texts.items() if "buildModelFrom" in text} == {BUILDER} | COMPARING


def test_test_modules_do_not_import_each_other() -> None:
    """What several of them use lies in `tests/support/`."""
    for file in (CHECKOUT / "tests").rglob("*.py"):
        assert not re.search(r"^\s*(from|import) tests\.test_", file.read_text(encoding="utf-8"), re.M), file


# --- What is in the distribution


def test_the_wheel_holds_the_package_and_no_studies() -> None:
    text = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    wheel = text[text.index("[tool.hatch.build.targets.wheel]") :].partition("\n\n")[0]
    assert re.findall(r"^only-include = (.*)$", wheel, re.M) == ['["softrobots", "xacro", "urdf"]']
    assert not [name for name in in_package() if "studies" in name]


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
        canvas.require_matplotlib()
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
    """Every `MissingDependency(package, extra)`, and `of_imports` of it, in the source with words for both."""
    known, seen = extras(), 0
    for file in PACKAGE.rglob("*.py"):
        for node in nodes_of(file):
            if isinstance(node, ast.Call) and ast.unparse(node.func).removesuffix(".of_imports") == "MissingDependency":
                words = [argument.value for argument in node.args if isinstance(argument, ast.Constant)]
                if len(words) == 2:
                    seen += 1
                    packages = {word for word in words[0].split() if word != "with"}
                    assert {"dask" if word == "distributed" else word for word in packages} <= known[words[1]], (file, words)
    assert seen >= 8


def test_dev_holds_every_extra() -> None:
    text = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    named = re.search(r'"softrobots\[([\w,-]+)\]"', text)
    assert named is not None
    assert set(named[1].split(",")) == set(extras()) - {"dev", "torch"}  # PyTorch of PyPI has gigabytes


def test_dev_installs_the_tools_of_the_gate() -> None:
    gate = CHECKOUT / ".ci" / "run"
    if not gate.is_file():
        pytest.skip("a source distribution has no gate")
    tools = set(re.findall(r"\.venv/bin/(?:python -m )?(?!python\b)(\w+)", gate.read_text(encoding="utf-8")))
    assert {"pytest", "ruff", "mypy", "build", "twine"} <= tools <= extras()["dev"] | extras()["test"] | {"pip"}


def test_the_version_stands_in_one_place() -> None:
    """The package says it; the citation and the newest entry of the changelog are that version."""
    assert 'path = "softrobots/version.py"' in (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    citation = (CHECKOUT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", citation, flags=re.MULTILINE) == [sr.__version__]
    changelog = (CHECKOUT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## \[(.*?)\]", changelog, flags=re.MULTILINE)[0] == sr.__version__
