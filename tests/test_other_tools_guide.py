"""The code of the guide to other tools runs and says what the guide says."""

from __future__ import annotations

import re
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

import softrobots as sr
from softrobots.cli import main
from tests.conftest import CHECKOUT, missing

GUIDE = (CHECKOUT / "docs" / "other_tools.md").read_text(encoding="utf-8")


def run_block(mark: str) -> dict[str, Any]:
    """Run the block of Python that holds a mark; return its names."""
    (code,) = (block for block in re.findall(r"```py\n(.*?)```", GUIDE, flags=re.DOTALL) if mark in block)
    names: dict[str, Any] = {}
    exec(compile(code, "docs/other_tools.md", "exec"), names)
    return names


def test_mujoco_comes_to_rest_where_the_guide_says(tool: Callable[[str], ModuleType]) -> None:
    tool("mujoco")
    names = run_block("to_mjcf")
    assert abs(names["data"].qpos - names["ours"].q_springs).max() < 1e-9  # as its last line says


def test_a_cable_of_somebody_is_read(tool: Callable[[str], ModuleType]) -> None:
    tool("mujoco")
    model = run_block("<mujoco>")["model"]
    assert model.spring_table == {"ja": (2.0, 0.0), "jb": (2.0, pytest.approx(0.17453292519943295, rel=1e-15))}


def test_a_ur5_carries_an_arm_of_muscles() -> None:
    try:
        names = run_block("robot_file")
    except sr.MissingDependency as error:
        missing(str(error))
    assert names["held"].stable
    assert names["whole"].n_motors == 6
    assert names["whole"].tip == "soft_tip"


def test_the_commands_are_those_of_the_command_line(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_arm.urdf").write_text(sr.InflatableArm().urdf())
    (block,) = re.findall(r"```sh\n(.*?)```", GUIDE, flags=re.DOTALL)
    written = []
    for line in block.strip().splitlines():
        words = line.partition("#")[0].split()
        assert words[0] == "softrobots"
        assert main(words[1:]) == 0
        written.append(words[words.index("-o") + 1])
    assert all((tmp_path / name).stat().st_size > 1000 for name in written)


@pytest.mark.parametrize("name", re.findall(r"\(images/(.*?)\)", GUIDE))
def test_pictures_exist(name: str) -> None:
    assert (CHECKOUT / "docs" / "images" / name).stat().st_size > 10_000
