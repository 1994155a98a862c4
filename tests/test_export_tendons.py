"""Actuators along the body as spatial tendons of MuJoCo: the same robot, with the same inputs, stands in the same place.

Oracles are MuJoCo's own statics and simulation, and closed forms of the laws of the actuators.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.export import to_mjcf, to_pinocchio, to_pybullet, to_sdf
from tests.support.mujoco_balance import mujoco_equilibrium
from tests.support.routed_arms import actuator, curve_length

Tool = Callable[[str], ModuleType]

THIN = (0.06, 0.0625)
"""Segments of an arm with tendons [m]; their tendons have these rest lengths from the base on: 60 and 122.5 mm."""
MOTORS = (0.0588, 0.061, 0.06, 0.1215, 0.1255, 0.1223)
HELICES = (
    *(sr.Route(at=(0.0, 0.1225), azimuth=(start, start + 1.5), distance=0.0045) for start in (0.0, 2.1, 4.2)),
    *(sr.Route(at=(0.0, 0.06), azimuth=(start, start - 1.0), distance=(0.0045, 0.003)) for start in (0.5, 2.6, 4.7)),
)


@dataclass(frozen=True)
class Case:
    """An arm, inputs of its actuators, and a tip force [N]; all under gravity."""

    robot: type
    options: Mapping[str, Any]
    inputs: tuple[float, ...]
    force: tuple[float, float, float]

    def load(self, **chain: Any) -> sr.SoftModel:
        """The arm with a chain."""
        return sr.load_model(self.robot(**self.options, **chain))


CASES = {
    "turned": Case(
        sr.TendonArm,
        {"segment_lengths": THIN, "kind": "tension", "offset": (0.3, -1.0)},
        (3.0, 1.0, 1.0, 2.0, 0.5, 1.5),
        (0.03, -0.02, 0.02),
    ),
    "helical": Case(
        sr.TendonArm,
        {"segment_lengths": THIN, "kind": "tension", "routing": HELICES},
        (3.0, 1.0, 1.0, 2.0, 0.5, 1.5),
        (0.03, -0.02, 0.02),
    ),
    "elastic": Case(sr.TendonArm, {"segment_lengths": THIN}, MOTORS, (0.05, -0.03, 0.02)),
    "loaded": Case(
        sr.PccArm, {"segment_lengths": (0.5, 0.4), "kind": "tension"}, (40.0, 40.0, 40.0, 40.0, 40.0, 40.0), (8.0, 0.0, -3.0)
    ),
    "length": Case(sr.PccArm, {"segment_lengths": (0.5, 0.4)}, (0.47, 0.51, 0.5, 0.4, 0.42, 0.38), (5.0, -3.0, 2.0)),
    "mckibben": Case(
        sr.PccArm, {"segment_lengths": (0.5, 0.4), "kind": "mckibben"}, (9e4, 5e4, 7e4, 4e4, 6e4, 5e4), (1.0, -1.0, 0.5)
    ),
}


def written(case: Case, hinges: int, **options: Any) -> str:
    """The arm with so many hinges a segment for MuJoCo, inputs held in the file where MuJoCo has no such actuator."""
    held = {"actuators": "welded"} if case.options.get("kind") == "mckibben" else {}
    model = case.load(chain="lumped", hinges=hinges)
    return to_mjcf(model, case.inputs, gravity=sr.EARTH_GRAVITY, limits=False, **held, **options)


def stand(mujoco: ModuleType, case: Case, hinges: int) -> Any:
    """Where MuJoCo says that the arm stands; its search begins where we say so, which saves time."""
    text, model = written(case, hinges), case.load(chain="lumped", hinges=hinges)
    start = sr.solve_equilibrium(model, case.inputs, case.force, gravity=sr.EARTH_GRAVITY).q
    if model.muscles[0].kind == "length":
        start = np.append(start, case.inputs)  # the winches
    return mujoco_equilibrium(mujoco, text, case.inputs if "<actuator>" in text else (), case.force, start)


@cache
def exact_tip(name: str) -> np.ndarray:
    """Tip of the arm of sections of constant strain, whose errors of second order two of them leave out."""
    case = CASES[name]
    coarse, fine = (
        sr.solve_equilibrium(case.load(elastic_sections=n), case.inputs, case.force, gravity=sr.EARTH_GRAVITY).tip_position
        for n in (5, 10)
    )
    return np.asarray(fine + (fine - coarse) / 3.0)


def misses(mujoco: ModuleType, name: str, counts: tuple[int, ...]) -> list[float]:
    """Distance of MuJoCo's tip from ours with so many hinges a segment, relative to the length."""
    if name == "mckibben" and mujoco.__version__ < "4":
        pytest.skip("springs of MuJoCo 3 are linear")
    length = sum(CASES[name].options["segment_lengths"])
    tips = [stand(mujoco, CASES[name], count).body("tip").xpos for count in counts]
    return [float(np.linalg.norm(tip - exact_tip(name))) / length for tip in tips]


@pytest.mark.study
@pytest.mark.parametrize("name", ["turned", "elastic", "mckibben"])
def test_the_arm_stands_in_mujoco_where_it_stands_here(tool: Tool, name: str) -> None:
    """Twice as many hinges err by a quarter; with few of them, half of that is left for terms of higher order."""
    coarse, fine = misses(tool("mujoco"), name, (3, 6))
    assert coarse < 5e-3
    assert fine < 0.5 * coarse


@pytest.mark.study
@pytest.mark.parametrize("name", ["helical", "elastic", "length", "loaded", "mckibben"])
def test_thirty_hinges_a_segment_are_within_a_ten_thousandth_of_the_length(tool: Tool, name: str) -> None:
    """From 8 to 30 hinges an error of second order becomes 14 times smaller."""
    coarse, fine = misses(tool("mujoco"), name, (8, 30))
    assert fine < 1e-4
    assert fine < 0.1 * coarse


def mujoco_data(mujoco: ModuleType, text: str) -> Any:
    """The arm at home."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def lengths(data: Any, arm: sr.SoftModel) -> np.ndarray:
    """Lengths of the actuators, those at rest and what MuJoCo's tendons have gained."""
    gained = (data.ten_length - data.model.tendon_length0)[: len(arm.muscles)]
    return np.asarray([tag.rest_length for tag in arm.muscles] + gained)


def test_tendons_change_their_lengths_as_straight_actuators_do(tool: Tool) -> None:
    """Per joint: arms d sin(phi), -d cos(phi), 0 and 1 at rest, second derivatives 0, 0, d^2 / h and 0.

    Steps of 1e-4 err by 1e-8 in the first and by 1e-6 in the second.
    """
    mujoco, distance, hinges = tool("mujoco"), (0.0045, 0.003), 3
    options: dict[str, Any] = {"tendon_distance": distance, "offset": (0.0, 0.7), "chain": "lumped", "hinges": hinges}
    arm = sr.load_model(sr.TendonArm(segment_lengths=THIN, **options))
    data, step = mujoco_data(mujoco, to_mjcf(arm)), 1e-4

    def changed(place: int, change: float) -> np.ndarray:
        data.qpos[:] = 0.0
        data.qpos[place] = change
        mujoco.mj_forward(data.model, data)
        return lengths(data, arm)

    rest = changed(0, 0.0)
    for place, joint in enumerate(arm.spring_joints):
        segment, kind = int(joint.split("_")[1]), joint.split("_", 3)[3]
        ahead, behind = changed(place, step), changed(place, -step)
        first, second = (ahead - behind) / (2.0 * step), (ahead - 2.0 * rest + behind) / step**2
        for number, (owner, azimuth) in enumerate((owner, m * 2.0 * np.pi / 3.0) for owner in (1, 2) for m in range(3)):
            d = distance[owner - 1] * (owner >= segment)
            phi = azimuth + 0.7 * (owner - segment)
            arms = {"bend_x": d * np.sin(phi), "bend_y": -d * np.cos(phi), "twist": 0.0, "stretch": float(owner >= segment)}
            assert abs(first[number] - arms[kind]) < 1e-8
            stiffening = d**2 * hinges / THIN[segment - 1] if kind == "twist" else 0.0
            assert abs(second[number] - stiffening) < 3e-6


PIECES = ((1, (0.0, 0.1, 0.3), (0.04, 0.03, 0.03), (0.2, 1.0, 2.5)), (1, (0.07, 0.23), (0.03, 0.03), (1.0, 1.0)))
"""A winding table and a straight piece, that end within sections."""


@pytest.mark.parametrize("robot", [sr.PccArm, sr.HelixTube])
def test_a_tendon_begins_to_change_its_length_as_its_curve_does(tool: Tool, robot: type) -> None:
    """Per joint at rest, along straight sections and bent ones, against the curve's length by complex steps.

    Central differences of 1e-5 err by 1e-10 of the third derivatives, and by 1e-11 as the lengths are rounded.
    """
    mujoco, step = tool("mujoco"), 1e-5
    straight = {"segment_lengths": (0.3,), "muscle_azimuths": ()} if robot is sr.PccArm else {}
    tags = "".join(
        actuator(f"line_{place}", piece, kind="tension", strongest=10.0) for place, piece in enumerate(PIECES, start=1)
    )
    urdf = robot(**straight, chain="lumped", hinges=3).urdf().replace("</robot>", tags + "</robot>")
    arm = sr.load_model(urdf)
    rows = arm.structure.section_table
    spans, rest = [(row.segment, row.length) for row in rows], np.array([row.rest for row in rows])
    data = mujoco_data(mujoco, to_mjcf(arm))
    assert np.abs(rest).max() > 0.1 or robot is sr.PccArm
    for place, joint in enumerate(arm.spring_joints):
        sides = []
        for change in (step, -step):
            data.qpos[:] = change * (np.arange(data.model.nq) == place)
            mujoco.mj_forward(data.model, data)
            sides.append(data.ten_length.copy())
        z = rest.astype(complex)
        z[int(joint.split("_")[2]) - 1, ("x", "y", "twist", "stretch").index(joint.split("_")[-1])] += 1e-20j
        slopes = [curve_length([piece], spans, z).imag / 1e-20 for piece in PIECES]
        assert np.abs((sides[0] - sides[1]) / (2.0 * step) - slopes).max() < 1e-9


def test_the_springs_of_mckibben_muscles_pull_by_their_law(tool: Tool) -> None:
    """Along a straight arm that stretches by so much a hinge each muscle pulls with p pi D^2/4 (a (l / l0)^2 - b), or not."""
    mujoco = tool("mujoco")
    if mujoco.__version__ < "4":
        pytest.skip("springs of MuJoCo 3 are linear")
    options: dict[str, Any] = {"muscle_diameter": 0.02, "muscle_braid_angle": 0.4, "chain": "lumped", "hinges": 2}
    arm = sr.load_model(sr.PccArm(segment_lengths=(0.5,), kind="mckibben", **options))
    square, least = 3.0 / np.tan(0.4) ** 2, 1.0 / np.sin(0.4) ** 2
    relaxed, pressed = (mujoco_data(mujoco, to_mjcf(arm, 3 * [p], actuators="welded", limits=False)) for p in (0.0, 1e5))
    for stretch in (0.01, -0.02, -0.1):
        for data in (relaxed, pressed):
            data.qpos[:] = [stretch if "stretch" in name else 0.0 for name in arm.spring_joints]
            mujoco.mj_forward(data.model, data)
        pull = 1e5 * np.pi * 1e-4 * max(0.0, square * (1.0 + 2.0 * stretch / 0.5) ** 2 - least)
        assert (pull == 0.0) == (stretch == -0.1)
        changes = pressed.qfrc_passive - relaxed.qfrc_passive
        expected = [-3.0 * pull if "stretch" in name else 0.0 for name in arm.spring_joints]
        assert np.abs(changes - expected).max() < 1e-9


def test_the_force_of_an_actuator_is_its_tension(tool: Tool, rng: np.random.Generator) -> None:
    """Whatever the shape and the input: the laws of the kinds, slack ones included; 1e-9: lengths are rounded, times 8 kN/m."""
    mujoco, slack = tool("mujoco"), 0
    for kind in (("elastic", "tension"), ("tension", "elastic")):
        arm = sr.load_model(sr.TendonArm(segment_lengths=THIN, kind=kind, chain="lumped", hinges=2))
        data = mujoco_data(mujoco, to_mjcf(arm))
        for _ in range(5):
            sizes = np.array([1e-3 if "stretch" in name else 0.1 for name in arm.spring_joints])
            data.qpos[:] = sizes * rng.uniform(-1, 1, len(sizes))
            elastic = np.repeat([one == "elastic" for one in kind], 3)
            rest = np.repeat([THIN[0], sum(THIN)], 3)
            inputs = np.where(elastic, rest + 1e-3 * rng.uniform(-1, 1, 6), rng.uniform(0, 9, 6))
            data.ctrl[:] = inputs
            mujoco.mj_forward(data.model, data)
            pull = np.where(elastic, np.maximum(2.0 + 8e3 * (lengths(data, arm) - inputs), 0.0), inputs)
            slack += int((pull == 0.0).sum())
            assert np.abs(data.actuator_force - pull).max() < 1e-9
    assert slack > 3
    arm = sr.load_model(sr.PccArm(segment_lengths=(0.5,), kind="pressure", muscle_area=2e-3, chain="lumped", hinges=2))
    data = mujoco_data(mujoco, to_mjcf(arm, (1e4, 2e4, 0.0)))
    assert np.array_equal(data.actuator_force, [-20.0, -40.0, 0.0])


def test_a_simulation_with_a_slack_tendon_comes_to_rest(tool: Tool) -> None:
    """It stands still, at MuJoCo's own balance, and what is slack is shorter than its motor asks for."""
    mujoco, case = tool("mujoco"), CASES["elastic"]
    arm = case.load(chain="lumped", hinges=3)
    text = to_mjcf(arm, case.inputs, gravity=sr.EARTH_GRAVITY)
    data = mujoco_data(mujoco, text)
    assert data.ctrl.tolist() == list(case.inputs)
    mujoco.mj_step(data.model, data, 1500)
    assert np.abs(data.qvel).max() < 1e-9
    assert np.abs(data.qpos - mujoco_equilibrium(mujoco, text, case.inputs, np.zeros(3)).qpos).max() < 1e-9
    taut = data.actuator_force > 0.0
    assert taut.tolist() == [True, True, True, True, False, True]
    assert data.actuator_force[4] == 0.0
    assert lengths(data, arm)[4] < case.inputs[4] - 2.0 / 8e3


def winches(data: Any) -> np.ndarray:
    """Positions of the slide joints, which MuJoCo has last."""
    return np.asarray(data.qpos[-data.model.nu :])


@pytest.mark.study
def test_winches_hold_given_lengths_where_our_statics_says(tool: Tool) -> None:
    """Lengths are met to 1e-4 of some 5 cm, tip and tensions are ours, with an error of second order."""
    mujoco, case = tool("mujoco"), CASES["length"]
    ours, errors = sr.solve_equilibrium(case.load(elastic_sections=10), case.inputs, gravity=sr.EARTH_GRAVITY), []
    for hinges in (3, 6):
        arm = case.load(chain="lumped", hinges=hinges)
        model = mujoco.MjModel.from_xml_string(to_mjcf(arm, gravity=sr.EARTH_GRAVITY))
        data = mujoco.MjData(model)
        assert np.array_equal(winches(data), arm.relaxed_motors)
        data.ctrl[:] = case.inputs  # at once
        mujoco.mj_step(model, data, 1500)
        assert np.abs(data.qvel).max() < 1e-6
        assert np.abs(winches(data) - case.inputs).max() < 5e-7
        assert np.abs(lengths(data, arm) + winches(data) - arm.relaxed_motors - case.inputs).max() < 5e-6
        errors.append(float(np.linalg.norm(data.body("tip").xpos - ours.tip_position)))
    assert errors[1] < 0.5 * errors[0] < 2e-3
    assert ours.muscle_forces.min() < -10.0
    assert np.abs(data.actuator_force - ours.muscle_forces).max() < 0.02 * np.abs(ours.muscle_forces).max()


def test_a_robot_at_home_on_winches_stays_there(tool: Tool) -> None:
    """Lumped lengths of ours and MuJoCo's differ at second order, by micrometres here."""
    mujoco, case = tool("mujoco"), CASES["length"]
    data = mujoco_data(mujoco, to_mjcf(case.load(chain="lumped", hinges=6), case.inputs))
    assert np.array_equal(data.ctrl, case.inputs)
    assert np.array_equal(winches(data), case.inputs)
    tip = data.body("tip").xpos.copy()
    mujoco.mj_step(data.model, data, 1500)
    assert np.linalg.norm(data.body("tip").xpos - tip) < 2e-3


@pytest.mark.parametrize(("time_step", "stays"), [(0.0005, True), (0.009, True), (0.011, False)])
def test_winches_are_stable_up_to_twice_their_lag(tool: Tool, time_step: float, stays: bool) -> None:
    """The lag is 5 ms; all the motors jump by up to 6 % of their lengths at once."""
    mujoco, arm = tool("mujoco"), sr.load_model(sr.TendonArm(segment_lengths=THIN, kind="length", chain="lumped", hinges=3))
    data = mujoco_data(mujoco, to_mjcf(arm, gravity=sr.EARTH_GRAVITY))
    data.model.opt.timestep = time_step
    inputs = arm.relaxed_motors * (0.94, 1.03, 1.03, 0.94, 1.03, 1.03)
    data.ctrl[:] = inputs
    mujoco.mj_step(data.model, data, 1000)
    assert bool(np.abs(winches(data) - inputs).max() < 1e-5) == stays


def test_pressures_drive_mckibben_muscles_as_they_do_here(tool: Tool) -> None:
    """The simulation comes to rest where our statics says, with an error of second order, and so do the tensions."""
    mujoco, case, errors = tool("mujoco"), CASES["mckibben"], []
    ours = sr.solve_equilibrium(case.load(elastic_sections=10), case.inputs, gravity=sr.EARTH_GRAVITY)
    for hinges in (3, 6):
        arm = case.load(chain="lumped", hinges=hinges)
        data = mujoco_data(mujoco, to_mjcf(arm, gravity=sr.EARTH_GRAVITY, limits=False, damping=0.1))
        data.ctrl[:] = case.inputs
        mujoco.mj_step(data.model, data, 1500)
        assert np.abs(data.qvel).max() < 1e-3
        errors.append(float(np.linalg.norm(data.body("tip").xpos - ours.tip_position)))
    assert errors[1] < 0.5 * errors[0] < 3e-3
    square, least, braid = 3.0 / np.tan(0.4363) ** 2, 1.0 / np.sin(0.4363) ** 2, arm.muscles[0].braid_angle
    assert abs(braid - 0.4363) < 1e-4
    contraction = (square * (lengths(data, arm) / arm.structure.muscle_paths.rest) ** 2 - least) / (square - least)
    assert np.abs(data.actuator_force * contraction / ours.muscle_forces - 1.0).max() < 0.01


@pytest.mark.study
def test_what_a_simulator_does_not_have_is_refused_by_name() -> None:
    elastic, helical, mckibben = (CASES[name].load(chain="lumped", hinges=2) for name in ("elastic", "helical", "mckibben"))
    coupled = {"a tension that follows": elastic, "a winding route": helical, "that follows the length": mckibben}
    for told, model in coupled.items():
        for write in (to_sdf, to_pybullet):
            with pytest.raises(sr.ParameterError, match=rf"_1_1, .*{told}"):
                write(model, actuators="welded")
        with pytest.raises(sr.ParameterError, match=rf"_1_1, .*{told}"):
            to_pinocchio(model)
    with pytest.raises(sr.ParameterError, match="a winding route"):
        to_mjcf(helical, actuators="welded")
    with pytest.raises(sr.ParameterError, match="within the limits of tendon_1_1"):
        to_mjcf(elastic, (0.5, *MOTORS[1:]))
    loose = sr.load_model(sr.TendonArm(segment_lengths=THIN, tendon_stiffness=10.0, chain="lumped", hinges=2))
    with pytest.raises(sr.ParameterError, match="taut at any length"):
        to_mjcf(loose, actuators="welded")


def test_pressures_are_welded_into_the_springs_as_the_tensions_that_they_are() -> None:
    options: dict[str, Any] = {"segment_lengths": (0.5,), "chain": "lumped", "hinges": 2}
    chambers = sr.load_model(sr.PccArm(kind="pressure", muscle_area=2e-3, **options))
    muscles = sr.load_model(sr.PccArm(kind="tension", **options))
    pressed = to_sdf(chambers, (1e4, 2e4, 5e3), actuators="welded")
    pulled = to_sdf(muscles, (-20.0, -40.0, -10.0), actuators="welded")
    assert re.sub("<!--.*?-->", "", pressed, flags=re.DOTALL) == re.sub("<!--.*?-->", "", pulled, flags=re.DOTALL)


def test_welded_elastic_tendons_hold_the_arm_as_the_driven_ones_do(tool: Tool) -> None:
    """Springs of tendons in place of actuators: the same forces at any shape, and in the file no actuator."""
    mujoco, case = tool("mujoco"), CASES["elastic"]
    arm = case.load(chain="lumped", hinges=2)
    driven, welded = (mujoco_data(mujoco, to_mjcf(arm, case.inputs, actuators=how)) for how in ("driven", "welded"))
    springs = driven.qfrc_passive.copy()
    assert welded.model.nu == 0
    assert np.abs(driven.qfrc_actuator).max() > 1.0
    assert np.abs(springs + driven.qfrc_actuator - welded.qfrc_passive).max() < 1e-9
    tendons = ElementTree.fromstring(to_mjcf(arm, case.inputs, damping=0.01)).iter("general")
    assert {float(element.get("biasprm", "").split()[2]) for element in tendons} == {-80.0}  # 0.01 s times 8 kN/m
