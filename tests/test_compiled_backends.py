"""Generated modules and how they are run: their language, their files, and the same answers from every back end."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.generated_module import Program, make_program
from softrobots.compiled.run import backends
from softrobots.compiled.run.backends import NumbaRun, PythonRun, available_backend, cache_folder, make_run
from softrobots.compiled.run.batches import solve_batch
from softrobots.compiled.translate.c import to_c
from softrobots.compiled.translate.kernel_language import read_module
from softrobots.model.soft_model import SoftModel
from tests.support.serial_chains import ROBOTS
from tests.support.tables import each_row

GRAVITY = np.array([0.5, -1.0, -9.6])


def program_of(model: SoftModel, *, weight: bool = False) -> Program:
    return make_program(Unknowns(model.chain()), weight=weight)


# --- The text


@pytest.mark.study
@pytest.mark.parametrize(("kind", "weight"), [("arm", False), ("arm", True), ("pcc", False), ("pcc_lumped", True)])
def test_generated_text_is_in_the_kernel_language(kind: str, weight: bool) -> None:
    """Read, and with every function and place that a caller needs; the statements are read by the translation to C."""
    program = program_of(ROBOTS[kind](), weight=weight)
    module = read_module(program.text)
    assert module.docstring.splitlines()[0].endswith(f"{'with gravity' if weight else 'weightless'}: generated code.")
    assert all(name in module.functions or name in module.constants for name in program.entry_points)
    assert all(function.docstring for function in module.functions.values())
    assert module.constants["WORKSPACE_SIZE"] == program.size
    assert module.constants["N"] == program.layout.unknowns
    if kind == "arm" and weight:
        assert "settle" in to_c(program.text, prefix="robot", exported=program.entry_points)


@pytest.mark.parametrize("kind", ["arm", "pcc", "helix"])
def test_the_places_of_the_workspace_do_not_overlap(kind: str) -> None:
    """Every constant that names a place; each holds as many numbers as its docstring says."""
    model = ROBOTS[kind]()
    layout = program_of(model).layout
    motors, unknowns = layout.motors, layout.unknowns
    varied = max(motors, 3) + unknowns
    sizes = dict(
        MOTORS=motors,
        FORCE=3,
        GRAVITY=3,
        ACTUATORS=layout.muscles,
        HELD=layout.constraints,
        START=unknowns,
        UNKNOWN=unknowns,
        STEP=unknowns,
    )
    sizes |= dict(LINE_ORIGIN=unknowns, LINE_DIRECTION=unknowns, TIP=3, TORQUES=motors, TARGET=3, NEXT_TARGET=3)
    sizes |= dict(NEXT_POINT=varied, PREVIOUS=varied, PREDICTED=varied, CORRECTION=varied)
    places = layout.constants()
    taken: list[int] = []
    for name, place in places.items():
        if name not in ("N", "N_MOTORS"):
            taken += range(place, place + sizes.get(name, 1))
    assert len(taken) == len(set(taken))
    assert max(taken) < layout.prepared


SCRIPT = """
import hashlib, sys
import softrobots as sr
from softrobots.compiled.run.backends import cache_folder
for robot in (sr.InflatableArm(), sr.PccArm(segment_lengths=(0.5, 0.4), bending_stiffness=(1.9, 1.2), elastic_sections=2)):
    text = sr.compile(sr.load_model(robot), backend="python").source(lanes=True)
    print(hashlib.sha256(text.encode()).hexdigest())
assert "numba" not in sys.modules
print(cache_folder())
"""


@pytest.mark.study
def test_the_text_is_the_same_in_every_process(tmp_path: Path) -> None:
    """Also with other hashes of strings, which decide the order of sets; else nothing on disk is found again.

    And a process that has to make a folder of its own takes it away.
    """
    expected = []
    for kind in ("arm", "pcc"):
        program = program_of(ROBOTS[kind]())
        assert program == program_of(ROBOTS[kind]())
        expected.append(hashlib.sha256(f"{program.text}\n\n{program.lane_text}".encode()).hexdigest())
    (tmp_path / "file").touch()
    environment = os.environ | {"PYTHONHASHSEED": "1", "SOFTROBOTS_CACHE": str(tmp_path / "file"), "TMPDIR": str(tmp_path)}
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True, timeout=120
    )
    *found, folder = run.stdout.split()
    assert found == expected
    assert Path(folder).parent == tmp_path
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_other_robots_have_another_text(arm: SoftModel, odd_arm: SoftModel) -> None:
    softer = sr.load_model(sr.InflatableArm(stiffness=100.0))
    texts = [program_of(model).text for model in (arm, odd_arm, softer)]
    assert len({*texts, program_of(arm, weight=True).text}) == 4


# --- The folder of generated modules


@pytest.fixture
def no_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A home of its own, and no variable that names a folder."""
    monkeypatch.delenv("SOFTROBOTS_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    return tmp_path


def test_the_folder_is_the_one_of_the_user(no_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    assert cache_folder() == no_folder / "home" / ".cache" / "softrobots"
    monkeypatch.setattr(sys, "platform", "darwin")
    assert cache_folder() == no_folder / "home" / "Library" / "Caches" / "softrobots"
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(no_folder / "xdg"))
    assert cache_folder() == no_folder / "xdg" / "softrobots"
    monkeypatch.setenv("SOFTROBOTS_CACHE", str(no_folder / "deep" / "here"))
    assert cache_folder() == no_folder / "deep" / "here"
    assert cache_folder().is_dir()
    assert not any(cache_folder().iterdir())


@pytest.mark.parametrize("place", ["file", "file/below"])
def test_where_nothing_can_be_written_a_temporary_folder_serves(
    no_folder: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """One for the whole process, in the folder for temporary files."""
    (no_folder / "file").write_text("no folder", encoding="utf-8")
    monkeypatch.setenv("SOFTROBOTS_CACHE", str(no_folder / place))
    folder = cache_folder()
    assert folder.parent == Path(tempfile.gettempdir())
    assert folder.name.startswith("softrobots-")
    assert cache_folder() == folder
    (folder / "probe").write_text("", encoding="utf-8")
    (folder / "probe").unlink()


def test_a_user_without_a_home_has_a_temporary_folder(no_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a container with a user that nobody knows: there Python raises."""

    def nowhere() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", nowhere)
    assert cache_folder().name.startswith("softrobots-")


def module_text(number: int) -> str:
    return f'"""A module."""\n\nNUMBER = {number}\n' + "# as long as generated code\n" * 2000


def test_a_text_becomes_a_module_in_a_file_of_its_own(no_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOFTROBOTS_CACHE", str(no_folder / "cache"))
    text = module_text(1_000_001)
    module = backends._module(text)
    assert module.NUMBER == 1_000_001
    assert sys.modules[module.__name__] is module
    file = no_folder / "cache" / f"{module.__name__}.py"
    assert file.read_text(encoding="utf-8") == text
    assert backends._module(text) is module
    assert backends._module(module_text(1_000_002)).NUMBER == 1_000_002
    assert sorted(one.suffix for one in (no_folder / "cache").iterdir() if one.is_file()) == [".py", ".py"]


@pytest.mark.parametrize("damage", ["", "NUMBER = 1\n"])
def test_a_damaged_file_is_written_anew(no_folder: Path, monkeypatch: pytest.MonkeyPatch, damage: str) -> None:
    monkeypatch.setenv("SOFTROBOTS_CACHE", str(no_folder))
    text = module_text(2_000_000 + len(damage))
    file = no_folder / f"softrobots_{hashlib.sha256(text.encode()).hexdigest()[:24]}.py"
    file.write_text(damage, encoding="utf-8")
    module = backends._module(text)
    assert len(damage) + 2_000_000 == module.NUMBER
    assert file.read_text(encoding="utf-8") == text


RACE = """
import sys, time
from pathlib import Path
from softrobots.compiled.run.backends import _module
here = Path(sys.argv[1])
(here / sys.argv[2]).touch()
while len(list(here.glob("ready*"))) < 2:
    time.sleep(0.001)
for number in range(60):
    assert _module(sys.argv[3].replace("1000", str(number))).NUMBER == number
"""


@pytest.mark.study
def test_two_processes_write_the_same_files(tmp_path: Path) -> None:
    """Both at once, in the same order: what either imports is whole, and nothing is left lying about."""
    environment = os.environ | {"SOFTROBOTS_CACHE": str(tmp_path / "cache")}
    arguments = [sys.executable, "-c", RACE, str(tmp_path)]
    runs = [
        subprocess.Popen([*arguments, name, module_text(1000)], env=environment, stderr=subprocess.PIPE)
        for name in ("ready1", "ready2")
    ]
    for run in runs:
        _, errors = run.communicate(timeout=120)
        assert run.returncode == 0, errors.decode()
    files = [one for one in (tmp_path / "cache").iterdir() if one.is_file()]
    assert len(files) == 60
    texts = {one.read_text(encoding="utf-8") for one in files}
    assert texts == {module_text(number) for number in range(60)}


# --- Back ends


def test_numba_is_taken_if_it_is_there(monkeypatch: pytest.MonkeyPatch, arm: SoftModel) -> None:
    found = importlib.util.find_spec("numba") is not None
    assert available_backend() == ("numba" if found else "python")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert available_backend() == "python"
    assert isinstance(make_run(program_of(arm), "python"), PythonRun)
    with pytest.raises(sr.MissingDependency, match="fast"):
        sr.compile(arm, backend="numba")


@pytest.fixture(scope="session")
def compiled_arm(arm: SoftModel) -> Iterator[Any]:
    """The default arm by numba, kept in the cache folder of the user."""
    if importlib.util.find_spec("numba") is None:
        yield None
    else:
        yield make_run(program_of(arm), "numba")


@pytest.fixture
def numba_arm(tool: Callable[[str], ModuleType], compiled_arm: Any) -> Any:
    tool("numba")
    assert isinstance(compiled_arm, NumbaRun)
    return compiled_arm


def settle(run: Any, motors: np.ndarray, force: np.ndarray) -> tuple[int, np.ndarray]:
    w = run.workspace()
    w[: len(motors)] = motors
    w[run.layout.force : run.layout.force + 3] = force
    status = run.settle(w)
    return int(status), np.array(w[run.layout.unknown : run.layout.unknown + run.layout.unknowns])


def batch(run: Any, motors: np.ndarray, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    layout = run.layout
    inputs, results = [(0, motors), (layout.force, forces)], [(layout.unknown, layout.unknowns)]
    (found,), statuses = solve_batch(run.settle_batch, inputs, results, len(motors), 1)
    return statuses, found


def cases(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Of all sizes: some need the descent."""
    forces = rng.normal(size=(count, 3))
    forces *= rng.uniform(1.0, 200.0, (count, 1)) / np.linalg.norm(forces, axis=1, keepdims=True)
    return rng.uniform(-np.pi, np.pi, (count, 3)), forces


@pytest.mark.study
def test_numba_and_python_find_the_same(numba_arm: Any, arm: SoftModel, rng: np.random.Generator) -> None:
    """Single cases and batches of both: polynomials for sine and cosine, and fused products, change the last digits only."""
    python = make_run(program_of(arm), "python")
    motors, forces = cases(rng, 300)
    results = [batch(run, motors, forces) for run in (python, numba_arm)]
    assert all(np.all(statuses == 0) for statuses, _ in results)
    # Newton stops at 1e-12 of up to 200 N on 1.2 m; the softest direction may have a hundredth of the springs' stiffness.
    close = np.abs(results[0][1] - results[1][1]).max(axis=1) < 1e-9
    assert np.mean(close) > 0.99  # where several equilibria are near, the last digits decide between them
    for row in range(0, 300, 10):
        for run, (_, found) in zip((python, numba_arm), results, strict=True):
            status, alone = settle(run, motors[row], forces[row])
            assert status == 0
            assert np.abs(alone - found[row]).max() < 1e-9 or not close[row]


@pytest.mark.study
@each_row("direction", [(1.0, 0.5, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 1e-9)])
@each_row("size", [np.nan, np.inf, 1e154, 1e200, 1e308])
def test_what_is_no_number_has_a_status(numba_arm: Any, arm: SoftModel, size: float, direction: tuple[float, ...]) -> None:
    """In every back end: nothing raises, and nothing is certified; of a load whose square is infinite all would be small."""
    force = size * np.array(direction) if np.isfinite(size) else np.array([size, *direction[1:]])
    for run in (make_run(program_of(arm), "python"), numba_arm):
        assert settle(run, np.zeros(3), force)[0] not in (0, 1)
        statuses, found = batch(run, np.zeros((3, 3)), np.array([[0.0, 0.0, -5.0], force, [0.0, 3.0, 0.0]]))
        assert statuses.tolist()[::2] == [0, 0]
        assert statuses[1] not in (0, 1)
        assert np.all(np.isfinite(found[::2]))


def test_plain_floats_and_lanes_are_read_from_one_text(arm: SoftModel) -> None:
    """Lanes add functions and take none away: what is written for one case is there for many under another name."""
    program = program_of(arm)
    names = re.findall(r"^def (\w+)\(", program.text, re.MULTILINE)
    lanes = re.findall(r"^def (\w+)\(", program.lane_text, re.MULTILINE)
    assert len(set(names + lanes)) == len(names) + len(lanes)
    assert {name.removesuffix("_lanes") for name in lanes if name.endswith("_lanes")} <= set(names)
    assert {"settle_batch", "newton_pass_lanes", "first_pass_lanes"} <= set(lanes)
    assert {"settle", "settle_from", "newton_pass", "first_pass", "evaluate", "prepare"} <= set(names)
