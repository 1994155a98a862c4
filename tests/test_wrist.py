"""The wrist of the inflatable arm: its kinematics, masses and limits, and full poses of the loaded tip."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.statics.kinematics import frame_placement

WRIST = (0.08, 0.12)


@pytest.fixture(scope="module")
def wristed() -> sr.SoftModel:
    """The arm of the paper with a wrist."""
    return sr.load_model(sr.InflatableArm(wrist=WRIST))


def turn(axis: str, angle: float) -> np.ndarray:
    """Rotation about an axis of the world, written out."""
    c, s = np.cos(angle), np.sin(angle)
    return {
        "-y": np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]),
        "z": np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
        "x": np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]),
    }[axis]


# --- The robot


def test_the_tip_is_a_product_of_ten_rotations(wristed: sr.SoftModel) -> None:
    """Base to tip: z, -y, and the springs z, -y; -y, z, -y; then pitch -y, yaw z, roll x. Rounding of ten products: 1e-14."""
    random = np.random.default_rng(1)
    for _ in range(20):
        m, k = random.uniform(-1.9, 1.9, 6), random.uniform(-1.0, 1.0, 4)
        along = [
            ("z", m[0], 0.0), ("-y", m[1], 0.03), ("z", k[0], 0.0), ("-y", k[1], 0.57), ("-y", m[2], 0.03),
            ("z", k[2], 0.0), ("-y", k[3], 0.57 + WRIST[0]), ("-y", m[3], 0.0), ("z", m[4], 0.0), ("x", m[5], WRIST[1]),
        ]  # fmt: skip
        rotation, position = np.eye(3), np.zeros(3)
        for axis, angle, length in along:
            rotation = rotation @ turn(axis, angle)
            position = position + length * rotation[:, 0]
        pose = frame_placement(wristed, wristed.configuration(m, k), "tip")
        assert np.abs(pose.translation - position).max() < 1e-14
        assert np.abs(pose.rotation - rotation).max() < 1e-14


def test_without_a_wrist_nothing_changes_and_with_one_names_and_limits_go_on() -> None:
    robot = sr.InflatableArm(link_lengths=(0.5, 0.4, 0.3), wrist=(0.0, 0.1), wrist_limits=(1.0, 1.2, 2.5))
    model = sr.load_model(robot)
    assert model.motor_joints == tuple(f"motor_{i}" for i in range(1, 8))
    assert model.pinocchio.nv == robot.n_joints == 13
    assert model.motor_limits[-3:].tolist() == [[-1.0, 1.0], [-1.2, 1.2], [-2.5, 2.5]]
    assert model.reach == pytest.approx(1.3, abs=1e-12)
    assert "wrist" not in sr.InflatableArm().urdf()


def test_mass_and_centre_are_those_of_the_arm_and_of_a_tube() -> None:
    """At zero; the tube of the wrist has its centre in the middle. Sums of a dozen masses: 1e-14."""
    for wrist in (WRIST, (0.0, 0.1)):
        both = []
        for robot in (sr.InflatableArm(), sr.InflatableArm(wrist=wrist, wrist_mass=0.4)):
            model = sr.load_model(robot).pinocchio
            data = model.createData()
            pin.centerOfMass(model, data, pin.neutral(model))
            both.append((float(data.mass[0]), np.array(data.com[0])))
        (arm, centre), (mass, whole) = both
        assert mass == pytest.approx(arm + 0.4, abs=1e-14)
        assert whole == pytest.approx((arm * centre + 0.4 * np.array([1.2 + sum(wrist) / 2, 0, 0])) / (arm + 0.4), abs=1e-14)


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"wrist": 0.1}, "wrist"),
        ({"wrist": (0.1,)}, "wrist"),
        ({"wrist": (-0.1, 0.1)}, "wrist"),
        ({"wrist": (0.1, 0.0)}, "wrist"),
        ({"wrist": WRIST, "wrist_mass": 0.0}, "wrist_mass"),
        ({"wrist": WRIST, "wrist_limits": (1.0, 1.0)}, "wrist_limits"),
        ({"wrist": WRIST, "wrist_limits": (1.0, 0.0, 1.0)}, "wrist_limits"),
    ],
)
def test_bad_wrists_are_refused_by_name(fields: dict, named: str) -> None:
    with pytest.raises(sr.ParameterError) as caught:
        sr.InflatableArm(**fields)
    assert caught.value.field == named


def test_a_wrist_too_light_for_its_tiny_links_is_refused() -> None:
    with pytest.raises(sr.DescriptionError, match="wrist_mass"):
        sr.InflatableArm(wrist=WRIST, wrist_mass=1e-5).urdf()
