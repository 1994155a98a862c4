"""The code of the guide to compiled solvers runs and says what the guide says."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import subprocess
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.kernels import Status
from tests.conftest import CHECKOUT, missing

GUIDE = (CHECKOUT / "docs" / "compiled.md").read_text(encoding="utf-8")


def run_block(mark: str) -> dict[str, Any]:
    """Run the block of Python that holds a mark; return its names."""
    (code,) = (block for block in re.findall(r"```py\n(.*?)```", GUIDE, flags=re.DOTALL) if mark in block)
    names: dict[str, Any] = {}
    exec(compile(code.replace("sr.compile(arm)", 'sr.compile(arm, backend="python")'), "docs/compiled.md", "exec"), names)
    return names


def test_the_first_example_prints_what_the_guide_says(capsys: pytest.CaptureFixture[str]) -> None:
    run_block("fast.equilibria")
    printed = capsys.readouterr().out
    (told,) = re.findall(r"```text\n(.*?)```", GUIDE, flags=re.DOTALL)
    numbers = [np.array(re.findall(r"-?\d+\.\d+(?!e)", text)[:7], dtype=float) for text in (printed, told)]
    assert np.abs(numbers[0] - numbers[1]).max() < 1e-8  # as many digits as are printed
    assert printed.splitlines()[-1] == told.splitlines()[-1]


def test_every_status_is_explained() -> None:
    assert re.findall(r"^\| `([A-Z_]+)` \|", GUIDE, flags=re.MULTILINE) == [status.name for status in Status]


def test_the_c_program_prints_the_same_springs(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which("gcc") is None:
        missing("gcc is not installed")
    monkeypatch.chdir(tmp_path)
    run_block("c_source")
    (program,) = re.findall(r"```c\n(.*?)```", GUIDE, flags=re.DOTALL)
    (tmp_path / "main.c").write_text(program)
    subprocess.run(["gcc", "-std=c99", "-O1", "-Wall", "-Werror", "main.c", "-o", "main"], check=True)
    printed = subprocess.run(["./main"], check=True, capture_output=True, text=True).stdout
    (told,) = re.findall(r"```text\n(.*?)```", GUIDE, flags=re.DOTALL)
    springs = [float(number) for number in re.findall(r"-?\d+\.\d+", told)[:4]]
    assert np.abs(np.array(printed.split(), dtype=float) - springs).max() < 1e-8  # as many digits as are printed


def test_the_map_has_the_shapes_that_the_guide_says() -> None:
    maps = run_block("map_workspace")["maps"]
    assert maps.payload.size * 5 == maps.required_pressure.size
    assert maps.q_motors.shape[-1] == 3


def test_the_commands_are_options_of_the_script() -> None:
    (block,) = re.findall(r"```sh\n(.*?)```", GUIDE, flags=re.DOTALL)
    for line in block.strip().splitlines():
        words = shlex.split(line, comments=True)
        script = runpy.run_path(str(CHECKOUT / words[1]))
        script["parser"]().parse_args(words[2:])


def test_the_example_in_the_readme_gives_the_force_back() -> None:
    readme = (CHECKOUT / "README.md").read_text(encoding="utf-8")
    (code,) = (block for block in re.findall(r"```py\n(.*?)```", readme, flags=re.DOTALL) if "sr.compile(arm)" in block)
    arm, force = sr.load_model(sr.InflatableArm()), np.array([0.0, 10.0, -15.0])
    known = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), force)
    names: dict[str, Any] = {"sr": sr, "arm": arm, "motors": known.q_motors, "forces": force}
    names |= {"q_motors": known.q_motors, "motor_torques": known.motor_torques}
    exec(compile(code.replace("compile(arm)", 'compile(arm, backend="python")'), "README.md", "exec"), names)
    assert names["many"].counts() == {Status.CERTIFIED: 1}
    assert np.abs(names["force"] - force).max() < 1e-8  # torques of an equilibrium settled to 1e-10
