"""Laws of robots as parameters, of what is made of them for other tools, and of the files that results are kept in."""

from __future__ import annotations

import argparse
import contextlib
import json
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots import export
from softrobots.cli.options import command_line
from studies.shared.command_line import add_resume, serve
from tests.support.foreign import BRANCHED, INERTIAL, SPRINGS, joint
from tests.support.laws import law

triples_ = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3)
lengths_ = st.lists(st.floats(0.2, 1.0), min_size=1, max_size=4)


# --- Parameters


@law("InflatableArm", "ROBOTS")
@settings(max_examples=25)
@given(lengths_, st.floats(0.02, 0.1), st.floats(0.01, 0.1), st.floats(1e3, 1e6), st.floats(2.0, 100.0), st.floats(0.0, 1e6))
def test_one_number_is_that_number_for_every_link(
    lengths: list[float], radius: float, thin: float, p: float, full: float, ambient: float
) -> None:
    """An arm is the sum of its links, and its tank that of them all; names lead to the same robots."""
    one = {"radius": radius, "wall_thickness": thin * radius, "pressure": p}
    arm = sr.InflatableArm(link_lengths=lengths, **one)
    each = sr.InflatableArm(link_lengths=tuple(lengths), **{name: [value] * len(lengths) for name, value in one.items()})
    assert arm.xacro_arguments() == each.xacro_arguments()
    assert arm.n_links == len(lengths)
    alone = [sr.InflatableArm(link_lengths=(length,), **one) for length in lengths]
    assert arm.volume == pytest.approx(sum(link.volume for link in alone), rel=1e-14)
    tank = arm.tank_volume(full * p, ambient_pressure=ambient)
    assert tank == pytest.approx(sum(link.tank_volume(full * p, ambient_pressure=ambient) for link in alone), rel=1e-13)
    assert (full * p + ambient) * tank == pytest.approx((p + ambient) * (tank + arm.volume), rel=1e-13)  # the gas is kept
    assert arm.tank_pressure(tank, ambient_pressure=ambient) == pytest.approx(full * p, rel=1e-13)
    assert sr.ROBOTS["inflatable_arm"] is sr.InflatableArm


@law("PccArm")
@settings(max_examples=25)
@given(lengths_, *[st.floats(0.1, 100.0)] * 3, st.integers(1, 4), st.booleans())
def test_segments_are_as_stiff_as_the_bench_says(
    lengths: list[float], bending: float, torsion: float, axial: float, count: int, twists: bool
) -> None:
    """`EI / l` is the moment per angle of a whole segment; and what a chain has of joints and muscles is counted by segment."""
    sizes = {"segment_lengths": lengths, "elastic_sections": count, "hinges": count}
    arm = sr.PccArm.measured(bending=bending, torsion=torsion, axial=[axial] * len(lengths), **sizes)
    assert isinstance(arm, sr.PccArm)
    for name, whole in (("bending", bending), ("torsional", torsion), ("axial", axial)):
        found = np.ravel(getattr(arm, f"{name}_stiffness")) / lengths
        assert np.allclose(found, whole, rtol=1e-15, atol=0.0)
    assert arm.n_actuators == 3 * arm.n_segments == 3 * len(lengths)
    assert arm.n_joints == 6 * count * len(lengths)
    lumped = sr.PccArm(segment_lengths=lengths, hinges=count, chain="lumped", torsion=twists, extension=not twists)
    assert lumped.n_joints == 3 * count * len(lengths)


@law("HelixTube")
@settings(max_examples=25)
@given(st.floats(0.3, 0.95), st.floats(0.05, 0.6), st.floats(0.02, 0.1), st.floats(0.3, 3.0), st.floats(0.1, 1.0))
def test_a_tube_of_a_design_is_that_design(share: float, angle: float, diameter: float, turns: float, grown: float) -> None:
    design = sr.helix.HelixDesign(share, angle, diameter, turns, "left")
    tube = sr.HelixTube.from_design(design, allow_self_contact=True)
    assert (tube.contraction, tube.angle, tube.diameter, tube.handedness) == (share, angle, diameter, "left")
    assert tube.length == design.tube_length
    assert tube.turns == pytest.approx(turns, rel=1e-13)
    assert tube.centre_length == pytest.approx(design.centre_length, rel=1e-14)
    shorter = tube.grown(grown * tube.length)
    assert isinstance(shorter, sr.HelixTube)
    assert shorter.turns == pytest.approx(grown * turns, rel=1e-13)


# --- Other tools


@cache
def foreign() -> sr.SoftModel:
    return sr.load_model(BRANCHED, springs=SPRINGS, tip="finger")


@cache
def paper_arm() -> sr.SoftModel:
    return sr.load_model(sr.InflatableArm())


@law("export.to_mjcf", "export.to_sdf", "export.to_pinocchio", "export.to_json", "load_model")
@settings(max_examples=5)
@given(triples_, triples_.map(lambda force: 5.0 * np.array(force)))
def test_what_is_written_for_other_tools_is_the_same_robot(motors: list[float], force: np.ndarray) -> None:
    """MJCF and SDF read back, the Python file run, the numbers of the JSON: one equilibrium."""
    robot = foreign()
    found = sr.solve_equilibrium(robot, motors, force, gravity=sr.EARTH_GRAVITY)
    for text in (export.to_mjcf(robot, motors), export.to_sdf(robot, motors)):
        again = sr.load_model(text, tip="finger")
        other = sr.solve_equilibrium(again, motors, force, gravity=sr.EARTH_GRAVITY)
        # Placements go through Euler angles or quaternions: some roundings of a metre, over the springs.
        assert np.allclose(other.q_springs, found.q_springs, rtol=0.0, atol=1e-10)
        assert np.allclose(other.tip_position, found.tip_position, rtol=0.0, atol=1e-10)
    program: dict[str, Any] = {"__name__": "written"}
    exec(compile(export.to_pinocchio(robot, motors), "written.py", "exec"), program)
    joints = program["solve"](motors, force=force, gravity=sr.EARTH_GRAVITY)
    assert np.allclose(joints[robot.spring_indices], found.q_springs, rtol=0.0, atol=1e-9)  # its own tolerance
    rows = {row["name"]: row for row in json.loads(export.to_json(robot))["joints"]}
    for name, (stiffness, rest) in robot.spring_table.items():
        assert (rows[name]["stiffness"]["value"], rows[name]["rest"]["value"]) == (stiffness, rest)


@law("export.to_urdf", "export.to_ros2_yaml", "export.write_mcap")
@settings(max_examples=3)
@given(triples_, triples_.map(lambda force: 5.0 * np.array(force)))
def test_a_pose_for_ros_is_that_of_the_robot(motors: list[float], force: np.ndarray) -> None:
    """The description and the positions of its joints, as another program gets them, place the tip."""
    found = sr.solve_equilibrium(paper_arm(), motors, force)
    positions = yaml.safe_load(export.to_ros2_yaml(found))
    chain = pin.buildModelFromXML(export.to_urdf(paper_arm()))
    data, q = chain.createData(), pin.neutral(chain)
    for name, value in zip(positions["name"], positions["position"], strict=True):
        q[chain.joints[chain.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(chain, data, q)
    assert np.abs(data.oMf[chain.getFrameId("tip")].translation - found.tip_position).max() < 1e-12
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(sr.MissingDependency):
        file = export.write_mcap(found, Path(folder) / "pose.mcap")
        from mcap_ros2.reader import read_ros2_messages

        ((at,),) = ([one.ros_msg.pose.position] for one in read_ros2_messages(str(file), topics=["/tip_pose"]))
        assert np.abs(found.tip_position - (at.x, at.y, at.z)).max() < 1e-12


@law("export.export_model", "export.to_pybullet")
@settings(max_examples=4)
@given(triples_)
def test_a_file_holds_what_the_function_returns(motors: list[float]) -> None:
    robot = foreign()
    made = {
        "arm.xml": export.to_mjcf(robot, motors),
        "arm.sdf": export.to_sdf(robot, motors),
        "arm.json": export.to_json(robot),
    }
    programs = {"pybullet": export.to_pybullet(robot, motors), "pinocchio": export.to_pinocchio(robot, motors)}
    with tempfile.TemporaryDirectory() as folder:
        for name, text in made.items():
            options = {} if name.endswith("json") else {"q_motors": motors}
            assert export.export_model(robot, Path(folder) / name, **options).read_text(encoding="utf-8") == text
        for form, text in programs.items():
            written = export.export_model(robot, Path(folder) / f"{form}.py", form, q_motors=motors)
            assert written.read_text(encoding="utf-8") == text
            compile(text, str(written), "exec")
        with pytest.raises(sr.OutputExists):
            export.export_model(robot, Path(folder) / "arm.json")


def _arm(axis: str, xyz: list[float], rpy: list[float]) -> str:
    """Two links and a joint somewhere between them."""
    places = {"xyz": " ".join(map(repr, xyz)), "rpy": " ".join(map(repr, rpy))}
    return f'<robot name="theirs"><link name="base">{INERTIAL}</link>{joint("turn", "base", "end", axis, **places)}</robot>'


@law("mount")
@settings(max_examples=6)
@given(triples_, triples_, triples_, triples_, st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_a_mounted_robot_stands_where_it_was_put(
    there: list[float], askew: list[float], xyz: list[float], rpy: list[float], one: float, two: float
) -> None:
    """Carrier, then the place, then the robot itself."""
    carrier, child = _arm("0 0 1", there, askew), _arm("0 1 0", askew, there)

    def end(text: str, *positions: float) -> np.ndarray:
        model = pin.buildModelFromXML(text)
        data = model.createData()
        pin.framesForwardKinematics(model, data, np.array(positions))
        last = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY][-1]
        return np.asarray(data.oMf[model.getFrameId(last)].homogeneous)

    place = pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz)).homogeneous
    expected = end(carrier, one) @ place @ end(child, two)
    close = {"rtol": 0.0, "atol": 1e-13}
    assert np.allclose(end(sr.mount(carrier, "end", child, xyz=xyz, rpy=rpy), one, two), expected, **close)


# --- Files of results


@law("save_result", "load_result")
@settings(max_examples=5)
@given(triples_, triples_.map(lambda force: 10.0 * np.array(force)))
def test_a_result_comes_back_from_its_file(motors: list[float], force: np.ndarray) -> None:
    """To the last digit, and as the same kind of result."""
    robot = foreign()
    equilibrium = sr.solve_equilibrium(robot, motors, force)
    with tempfile.TemporaryDirectory() as folder:
        read = sr.load_result(sr.save_result(equilibrium, Path(folder) / "one"))
    assert isinstance(read, sr.Equilibrium)
    for name in ("q_springs", "q_motors", "motor_torques", "tangent_stiffness"):
        assert np.array_equal(getattr(read, name), getattr(equilibrium, name))
    assert (read.stable, read.residual, read.model) == (equilibrium.stable, equilibrium.residual, robot)


@law("save_csv", "to_dataframe", "read_waypoints", "follow_trajectory")
@settings(max_examples=3)
@given(st.floats(-0.5, 0.5), st.floats(0.2, 0.5), st.integers(1, 3))
def test_a_table_of_a_trajectory_is_its_way(side: float, height: float, steps: int) -> None:
    """The file can be followed again; every digit of motors, springs and tip is in it."""
    path = sr.straight_line((0.9, side, height), (0.8, 0.0, 0.3), 2.0, steps)
    found = sr.follow_trajectory(paper_arm(), path.positions, (0.0, 3.0, -5.0), times=path.times)
    with tempfile.TemporaryDirectory() as folder:
        file = sr.save_csv(found, Path(folder) / "way.csv")
        again, table = sr.read_waypoints(file), np.genfromtxt(file, delimiter=",", names=True)
    with contextlib.suppress(sr.MissingDependency):
        frame = sr.to_dataframe(found)
        assert [name.replace(" ", "_") for name in frame] == list(table.dtype.names)
        assert np.array_equal(frame.to_numpy(), np.stack([np.atleast_1d(table[name]) for name in table.dtype.names], axis=1))
    assert np.array_equal(again.positions, path.positions)
    assert np.array_equal(again.times, path.times)
    columns = {name: np.atleast_1d(table[name]) for name in table.dtype.names}
    assert np.array_equal(np.stack([columns[f"tip_{axis}"] for axis in "xyz"], axis=1), found.tip_positions)
    for names, values in ((found.model.motor_joints, found.q_motors), (found.model.spring_joints, found.q_springs)):
        assert np.array_equal(np.stack([columns[name] for name in names], axis=1), values)


# --- The command line


@law(
    "cli.options.command_line.add_load",
    "cli.options.command_line.add_gravity",
    "cli.options.command_line.gravity_of",
)
@settings(max_examples=30)
@given(
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=3),
    st.sampled_from([None, "none", "numbers"]),
    st.booleans(),
)
def test_options_give_back_the_numbers_that_were_typed(numbers: list[float], gravity: str | None, resume: bool) -> None:
    parser = argparse.ArgumentParser()
    command_line.add_load(parser, (0.0, 0.0, -1.0))
    add_resume(parser)
    other = argparse.ArgumentParser()
    command_line.add_gravity(other)
    typed = [f"{number!r}" for number in numbers]
    assert parser.parse_args([]).force == (0.0, 0.0, -1.0)
    pulled = [] if gravity is None else ["--gravity", *(typed if gravity == "numbers" else [])]
    words = ["--force", *typed, *pulled] + ["--resume"] * resume
    found = parser.parse_args(words)
    assert (found.force, found.resume) == (numbers, resume)
    for given_ in (found, other.parse_args(pulled)):
        assert command_line.gravity_of(given_) == {None: None, "none": sr.EARTH_GRAVITY, "numbers": numbers}[gravity]


class _Page:
    """Somebody's page."""

    def __init__(self, port: int) -> None:
        self.port, self.url, self.tunnel = port, f"http://127.0.0.1:{port}/", f"ssh -L {port}:127.0.0.1:{port} HOST"

    def wait(self) -> None:
        """At once."""


@law(
    "cli.options.command_line.exit_status",
    "cli.options.command_line.refuse_too_large",
    "cli.options.command_line.address_lines",
)
@settings(max_examples=30)
@given(st.text(st.characters(categories=["L", "N", "P"]), min_size=1), st.integers(1, 10_000), st.integers(1, 65_535))
def test_the_exit_status_tells_what_kind_of_end_it_was(text: str, joints: int, port: int) -> None:
    def fail(error: BaseException) -> object:
        raise error

    unsolved = sr.NotConverged(text, best=None, residual=1.0, iterations=3)
    ends = {0: None, 1: unsolved, 2: sr.DescriptionError(text), 130: KeyboardInterrupt()}
    for status, error in ends.items():
        assert command_line.exit_status(lambda error=error: text if error is None else fail(error)) == status
    assert command_line.exit_status(lambda: False) == 1
    with pytest.raises(ZeroDivisionError):  # an error of the program is no answer
        command_line.exit_status(lambda: 1 / 0)

    class Robot:
        n_joints = joints

    large = command_line.exit_status(lambda: command_line.refuse_too_large(Robot(), "--sections", joints))
    assert large == (0 if joints <= 300 else 2)  # Pinocchio's workspace
    page = _Page(port)
    lines = command_line.address_lines(page.url, page.tunnel)
    assert page.url in lines[0]
    assert page.tunnel in lines[1]
    assert command_line.exit_status(lambda: serve(page)) == 0
