"""Robots that stand where a fit says, with markers: loads and positions in the axes of the measurements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.cli.identify import placement_of
from softrobots.robots.parameter_file import read_robot, write_parameters
from softrobots.robots.placed_robot import Marker, RobotPlacement, read_placed_robot
from softrobots.statics.kinematics import frame_placement

PLACEMENT = RobotPlacement((0.1, -0.2, 0.3), (0.3, 0.2, 0.5), (Marker("ball", "tip", (0.015, 0.01, 0.04)),))
ROBOTS = {"inflatable_arm": sr.InflatableArm(stiffness=180.0), "pcc_arm": sr.PccArm(segment_lengths=(0.3,), elastic_sections=2)}


@pytest.mark.study
@pytest.mark.parametrize("name", ROBOTS)
def test_a_file_moves_the_robot_and_not_what_is_told_of_it(name: str, tmp_path: Path) -> None:
    """The same equilibrium, seen from elsewhere: loads turned into the axes of the base, the tip and the marker out of them."""
    file = write_parameters(tmp_path / "robot.yaml", name, vars(ROBOTS[name]) | PLACEMENT.values())
    assert read_robot(file) == ROBOTS[name]
    plain, placed = sr.load_model(ROBOTS[name]), sr.load_model(read_placed_robot(file))
    assert placed.tip == plain.tip
    turn, force, gravity = pin.exp3(np.array(PLACEMENT.rotation)), np.array([1.0, 2.0, -8.0]), np.array([0.0, 0.0, -9.81])
    motors = plain.relaxed_motors + np.linspace(0.0, 0.02, plain.n_motors)
    if name == "pcc_arm":
        motors = plain.relaxed_motors + [0.0, 0.02, -0.02]
    seen = sr.solve_equilibrium(placed, motors, force, gravity=gravity)
    own = sr.solve_equilibrium(plain, motors, turn.T @ force, gravity=turn.T @ gravity)
    assert seen.q_springs == pytest.approx(own.q_springs, abs=1e-12)
    assert seen.tip_position == pytest.approx(turn @ own.tip_position + PLACEMENT.position, abs=1e-12)
    pose = seen.transform_tip_to_world
    jacobian = seen.frame_jacobian("ball")[:3] - seen.frame_jacobian(placed.tip)[:3]
    arm = pose.rotation @ PLACEMENT.markers[0].offset  # of the marker from the tip: it turns with the tip
    turning = seen.frame_jacobian(placed.tip)[3:]
    assert jacobian == pytest.approx(np.cross(turning, arm, axisa=0).T, abs=1e-12)


@pytest.mark.study
@pytest.mark.parametrize(("marker", "link"), [("ball", "ball"), ("tip", "tip_marker"), ("the ball", "the_ball")])
def test_a_fit_tells_where_the_robot_stands(marker: str, link: str) -> None:
    """Base and marker of a fit to rows of the placed robot, without noise; a robot whatever the marker is called."""
    plain = ROBOTS["inflatable_arm"]
    placed = sr.load_model(PLACEMENT.place(plain))
    random = np.random.default_rng(2)
    motors = random.uniform(-0.8, 0.8, (12, 3))
    solved = [sr.solve_equilibrium(placed, q, gravity=sr.EARTH_GRAVITY) for q in motors]
    poses = [one.transform_tip_to_world for one in solved]
    rows = sr.Measurements(
        motors,
        gravity=sr.EARTH_GRAVITY,
        poses={"link_2": np.array([frame_placement(placed, one.q, "link_2").homogeneous for one in solved])},
        positions={marker: np.array([pose.translation + pose.rotation @ PLACEMENT.markers[0].offset for pose in poses])},
        markers={marker: "tip"},
    )
    found = sr.identify(plain, rows, ("base.position", "base.rotation", f"marker.{marker}.offset"))
    read = placement_of(found)
    assert [one.name for one in read.markers] == [link]
    assert sr.load_model(read.place(plain)).tip == "tip"
    for one, other in ((read.position, PLACEMENT.position), (read.rotation, PLACEMENT.rotation)):
        assert one == pytest.approx(other, abs=1e-8)
    assert read.markers[0].offset == pytest.approx(PLACEMENT.markers[0].offset, abs=1e-8)


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"base_position": (0.0, 1.0)}, sr.ParameterError, "base_position"),
        ({"base_rotation": "up"}, sr.ParameterError, "base_rotation"),
        ({"markers": 1.0}, sr.ParameterError, "a list of mappings"),
        ({"markers": ({"name": "ball", "frame": "tip"},)}, sr.ParameterError, "a list of mappings"),
        ({"markers": ({"name": "a b", "frame": "tip", "offset": (0.0, 0.0, 0.0)},)}, sr.ParameterError, "a list of mappings"),
        ({"markers": ({"name": "ball", "frame": "hand", "offset": (0.0, 0.0, 0.0)},)}, sr.NameNotFound, "hand"),
        ({"markers": ({"name": "tip", "frame": "tip", "offset": (0.0, 0.0, 0.0)},)}, sr.DescriptionError, "tip"),
    ],
)
def test_what_is_no_placement_is_refused(values: dict, error: type[Exception], message: str, tmp_path: Path) -> None:
    file = write_parameters(tmp_path / "robot.yaml", "inflatable_arm", values)
    with pytest.raises(error, match=message):
        read_placed_robot(file)
