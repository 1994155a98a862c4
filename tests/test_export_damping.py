"""Damping of exported joints: numbers by joint, and damping ratios, measured in MuJoCo as in a laboratory, by ringing down."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import softrobots as sr
from softrobots.cli import main as cli
from softrobots.export import to_mjcf, to_pybullet, to_sdf

Tool = Callable[[str], ModuleType]
MOTORS = (0.3, 0.6, -0.8)


def arm() -> sr.SoftModel:
    return sr.load_model(sr.InflatableArm(payload=1.0))


def ratio_by_ringing_down(mujoco: ModuleType, text: str, start: np.ndarray, direction: np.ndarray) -> float:
    """Damping ratio from the logarithmic decrement of four peaks, from a start that is displaced by 1e-4 rad along a mode."""
    robot = mujoco.MjModel.from_xml_string(text)
    robot.opt.timestep, robot.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4  # no numerical damping to see
    data = mujoco.MjData(robot)
    data.qpos[:] = start + 1e-4 * direction / np.abs(direction).max()
    swing = np.array([(mujoco.mj_step(robot, data), (data.qpos - start) @ direction)[1] for _ in range(3000)])
    peaks = [i for i in range(1, len(swing) - 1) if swing[i - 1] < swing[i] > swing[i + 1]][:4]
    assert len(peaks) == 4
    before, top, after = (swing[np.array(peaks) + shift] for shift in (-1, 0, 1))
    heights = top - (after - before) ** 2 / (8.0 * (after - 2.0 * top + before))  # of the parabolas through them
    decrement = np.log(heights[0] / heights[-1]) / 3.0
    return float(decrement / np.hypot(2.0 * np.pi, decrement))


@pytest.mark.parametrize("ratio", [0.02, 0.1])
def test_mujoco_rings_down_with_the_ratio_asked_for(tool: Tool, ratio: float) -> None:
    """About the straight, weightless arm damping does not couple modes: exact but for the parabola through a peak, 1e-4."""
    mujoco, model = tool("mujoco"), arm()
    rest = sr.solve_equilibrium(model, MOTORS)
    mode = sr.vibration_modes(model, rest).shapes[:, 0]
    text = to_mjcf(model, MOTORS, actuators="welded", damping_ratio=ratio)
    measured = ratio_by_ringing_down(mujoco, text, rest.q_springs, mode)
    assert abs(measured - ratio) < 3e-4 * ratio


def test_mujoco_rings_down_with_the_ratio_of_the_loaded_mode(tool: Tool) -> None:
    """The recipe of the documentation for a robot that its weight bends; coupling of the modes is of second order, 2e-3."""
    mujoco, model, ratio = tool("mujoco"), arm(), 0.05
    held = sr.solve_equilibrium(model, MOTORS, gravity=sr.EARTH_GRAVITY)
    modes = sr.vibration_modes(model, held, damping_time=1.0)
    time = ratio / modes.damping_ratios[0]
    text = to_mjcf(model, MOTORS, actuators="welded", damping=time, gravity=sr.EARTH_GRAVITY)
    measured = ratio_by_ringing_down(mujoco, text, held.q_springs, modes.shapes[:, 0])
    assert abs(measured - ratio) < 2e-3 * ratio


def springs_of(text: str) -> dict[str, float]:
    return {one.get("name", ""): float(one.get("damping", "0")) for one in ElementTree.fromstring(text).iter("joint")}


def test_the_ratio_one_is_critical_and_numbers_stay_with_their_joints(tmp_path: Path) -> None:
    model = arm()
    assert springs_of(to_mjcf(model, damping_ratio=1.0, actuators="welded")) == springs_of(
        to_mjcf(model, damping="critical", actuators="welded")
    )
    assert to_sdf(model, damping_ratio=1.0) == to_sdf(model, damping="critical")
    chosen = {"spring_1_up": 0.25, "spring_2_side": 0.0}
    assert springs_of(to_mjcf(model, damping=chosen)) == springs_of(to_mjcf(model)) | chosen
    for write in (to_mjcf, to_sdf, to_pybullet):
        assert "that of the description but for spring_1_up, spring_2_side" in " ".join(write(model, damping=chosen).split())
        with pytest.raises(sr.NameNotFound, match=r"no spring joint is called 'spring_1_upp'.*did you mean 'spring_1_up'"):
            write(model, damping={"spring_1_upp": 1.0})
        with pytest.raises(sr.ParameterError, match=r"damping\['spring_1_up'\]"):
            write(model, damping={"spring_1_up": -1.0})
        with pytest.raises(sr.ParameterError, match="damping_ratio must be a finite number"):
            write(model, damping_ratio=np.nan)
        with pytest.raises(sr.ParameterError, match="left out with damping="):
            write(model, damping=0.01, damping_ratio=0.1)


def test_the_command_takes_ratios_and_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["export", "inflatable_arm", "--set", "payload=1", "-o"]
    assert cli.main([*words, str(tmp_path / "a.xml"), "--damping-ratio", "0.05"]) == 0
    assert (tmp_path / "a.xml").read_text() == to_mjcf(arm(), damping_ratio=0.05)
    assert cli.main([*words, str(tmp_path / "b.xml"), "--damping", "spring_1_up=0.25,spring_2_side=0"]) == 0
    assert (tmp_path / "b.xml").read_text() == to_mjcf(arm(), damping={"spring_1_up": 0.25, "spring_2_side": 0.0})
    capsys.readouterr()
    assert cli.main([*words, str(tmp_path / "c.xml"), "--damping", "0.1", "--damping-ratio", "0.1"]) == 2
    assert "--damping-ratio must be left out with" in capsys.readouterr().err
