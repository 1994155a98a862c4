"""The serial chain that compiled solvers read: kinematics and masses written out in NumPy and SciPy, against Pinocchio."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.description.tag_reader import read_tags
from softrobots.model.assembly import assemble
from softrobots.model.serial_chain import ChainBody, ChainJoint, ChainSection, SerialChain, strains_of
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import frame_placement
from tests.support.foreign import BRANCHED, INERTIAL, SPRINGS, joint
from tests.support.laws import law
from tests.support.serial_chains import HEAVY, ROBOTS, drawn, moved_by, odd, pcc, placed, section_frames
from tests.support.tables import each_row

# --- Oracle: the chain as its docstrings say, written out; nothing here calls the package or Pinocchio


def walk(chain: SerialChain, motors: np.ndarray, strains: np.ndarray) -> tuple[np.ndarray, list[tuple[np.ndarray, ChainBody]]]:
    """Pose of the tip, shape (4, 4), and every body with the frame that it moves with."""
    pose, bodies = np.eye(4), []
    for element in chain.elements:
        pose = pose @ placed(element.rotation, element.translation)
        if isinstance(element, ChainSection):
            frames = section_frames(np.pad(strains[list(strains_of(element))], (0, 4 - element.n_strains)), element.length)
            bodies += [(pose @ frame, body) for frame, body in zip(frames, element.bodies, strict=True)]
            pose = pose @ frames[-1]
        else:
            amount = strains[element.strain] if element.motor is None else motors[element.motor]
            pose = pose @ moved_by(element.slides, amount)
            bodies.append((pose, element.body))
    return pose @ placed(chain.tip_rotation, chain.tip_translation), bodies


def potential(bodies: list[tuple[np.ndarray, ChainBody]], gravity: np.ndarray) -> float:
    return -sum(float(gravity @ (body.mass * pose[:3, 3] + pose[:3, :3] @ body.first_moment)) for pose, body in bodies)


def inertia_about_base(bodies: list[tuple[np.ndarray, ChainBody]]) -> np.ndarray:
    """Rotational inertia of the robot about the origin of the world, from that of each body about its own frame."""
    total = np.zeros((3, 3))
    for pose, body in bodies:
        turn, origin = pose[:3, :3], pose[:3, 3]
        total += turn @ body.inertia @ turn.T
        moment = turn @ body.first_moment
        for one, other in ((origin, moment), (moment, origin), (body.mass * origin, origin)):  # parallel axes, any point
            total += one @ other * np.eye(3) - np.outer(one, other)
    return total


# --- Robots of every kind


def check_against_pinocchio(model: SoftModel, rng: np.random.Generator, times: int = 5) -> None:
    """Pose of the tip at random configurations, and potential energy up to what the base holds: a constant."""
    chain, gravity = model.chain(), rng.normal(size=3)
    whole, data = model.workspace(tuple(gravity.tolist()))
    offsets = []
    zero = np.zeros(model.pinocchio.nv)
    for _ in range(times):
        motors, springs = drawn(model, rng)
        q, strains = model.configuration(motors, springs), model.structure.strains(motors, springs)
        tip, bodies = walk(chain, motors, strains)
        expected = frame_placement(model, q, model.tip).homogeneous
        # Rounding of metres through at most 24 joints.
        assert np.abs(tip - expected).max() < 1e-13
        offsets.append(potential(bodies, gravity) - pin.computePotentialEnergy(whole, data, q))
        pin.ccrba(whole, data, q, zero)
        mass, centre = data.Ig.mass, np.array(data.com[0])
        inertia = np.array(data.Ig.inertia) + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        assert np.abs(inertia_about_base(bodies) - inertia).max() <= 1e-12 * max(1.0, np.abs(inertia).max())  # [kg m^2]
    total = sum(inertia.mass for inertia in model.pinocchio.inertias)
    assert np.ptp(offsets) <= 1e-12 * max(1.0, total * model.reach)  # [J]


@pytest.mark.study
@pytest.mark.parametrize("kind", ROBOTS)
def test_tip_and_energy_are_those_of_pinocchio(kind: str, rng: np.random.Generator) -> None:
    check_against_pinocchio(ROBOTS[kind](), rng)


def test_tip_and_energy_of_three_links_that_differ(odd_arm: SoftModel, rng: np.random.Generator) -> None:
    check_against_pinocchio(odd_arm, rng)


@pytest.mark.parametrize("robot", [sr.InflatableArm(), sr.PccArm(elastic_sections=1), sr.HelixTube(elastic_sections=6)])
def test_tip_and_energy_on_a_ur5(robot: sr.Robot, ur5: Path, rng: np.random.Generator) -> None:
    model = sr.load_model(sr.mount(ur5, "tool0", robot, xyz=(0.02, -0.03, 0.05), rpy=(0.3, -1.1, 0.7)))
    assert [getattr(e, "motor", None) for e in model.chain().elements[:6]] == list(range(6))
    check_against_pinocchio(model, rng)


AXES = st.one_of(
    st.sampled_from([(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1), (1, 0, 1), (0, -3, 4), (1, 2, 3)]),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 1e-3),
)
ANGLES = st.one_of(st.sampled_from([0.0, math.pi / 2, -math.pi / 2, math.pi]), st.floats(-3.0, 3.0))
KINDS = st.sampled_from(["revolute", "continuous", "prismatic", "fixed"])
LINKS = st.tuples(KINDS, AXES, st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.tuples(ANGLES, ANGLES, ANGLES))


@pytest.mark.study
@law("SoftModel.chain", "SoftModel.workspace", "load_model")
@given(st.lists(LINKS, min_size=1, max_size=6), st.sets(st.integers(0, 5)), st.integers(0, 2**31))
@settings(max_examples=80)
def test_tip_and_energy_of_any_chain(links: list, sprung: set[int], seed: int) -> None:
    """Whatever the axes, placements and kinds of joints."""

    def words(numbers: tuple) -> str:
        return " ".join(map(repr, numbers))

    parts = [
        joint(f"j{i}", f"l{i}", f"l{i + 1}", words(axis), kind, words(xyz), words(rpy))
        for i, (kind, axis, xyz, rpy) in enumerate([*links, ("revolute", (0, 0, 1), (0.1, 0, 0), (0, 0, 0))])
    ]
    text = f'<robot name="any"><link name="l0">{INERTIAL}</link>{"".join(parts)}</robot>'.replace(INERTIAL, HEAVY)
    springs = {f"j{i}": (10.0, 0.1) for i in sprung if i < len(links) and links[i][0] != "fixed"}
    check_against_pinocchio(sr.load_model(text, springs=springs), np.random.default_rng(seed), times=2)


# --- What constants fold to


def test_the_placements_of_the_arm_are_quarter_turns(arm: SoftModel) -> None:
    """Zeros and ones are exact, so that they fold away."""
    for element in arm.chain().elements:
        assert set(np.abs(element.rotation).ravel().tolist()) == {0.0, 1.0}
        assert np.linalg.det(element.rotation) == 1.0
        assert np.count_nonzero(element.translation) <= 1
    assert [element.name for element in arm.chain().elements] == list(arm.pinocchio.names)[1:]


def test_sections_follow_each_other_without_a_placement() -> None:
    """A helix is bent at rest: what its joint origins carry of that is gone from the chain."""
    for element in ROBOTS["helix"]().chain().elements[1:]:
        assert np.array_equal(element.rotation, np.eye(3))
        assert np.array_equal(element.translation, np.zeros(3))


def test_a_chain_is_made_once_and_cannot_be_changed(arm: SoftModel) -> None:
    chain = arm.chain()
    assert arm.chain() is chain
    first = chain.elements[0]
    assert isinstance(first, ChainJoint)
    arrays = [value for value in vars(chain).values() if isinstance(value, np.ndarray)]
    assert len(arrays) == 9
    for array in (*arrays, first.rotation, first.translation, first.body.first_moment, first.body.inertia):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


# --- Springs and muscles


def test_motors_springs_and_limits_are_those_of_the_model() -> None:
    model = odd()
    chain = model.chain()
    assert [(e.name, e.slides, e.motor, e.strain) for e in chain.elements] == [
        ("turn", False, 0, None),
        ("slide", True, None, 0),
        ("wheel", False, 1, None),
        ("nose", False, None, 1),
    ]
    assert chain.stiffness.tolist() == [900.0, 30.0]
    assert chain.rest.tolist() == [0.02, -0.1]
    assert chain.limits.tolist() == [[-2.0, 2.0], [-np.inf, np.inf]]
    assert (chain.n_motors, chain.reach, chain.constrained) == (2, model.reach, ())


@pytest.mark.parametrize("kind", ["pcc", "pcc_lumped", "uneven", "stacked", "four"])
def test_muscle_lengths_hold_sums_of_strains_without_twist(kind: str, rng: np.random.Generator) -> None:
    """For any lengths that fit together and any elastic coordinates, and with four muscles a segment too."""
    model = pcc(elastic_sections=3, muscle_azimuths=(0.0, 1.5, 3.0, 4.5)) if kind == "four" else ROBOTS[kind]()
    chain = model.chain()
    assert len(chain.constrained) == 6  # two bendings and the elongation of two segments
    assert (
        sorted({place for group in chain.constrained for place in group}) == np.flatnonzero(chain.spread.any(axis=1)).tolist()
    )
    for _ in range(3):
        motors, elastic = drawn(model, rng)
        change = motors[chain.n_motors :] - chain.muscle_paths.rest
        strains = chain.spread @ change + chain.free @ elastic
        sums = np.array([strains[list(group)].sum() for group in chain.constrained])
        assert np.abs(sums - chain.constrained_slope @ change).max() < 1e-13  # rad; rounding of a radian
        assert np.abs(chain.muscle_paths.matrix @ strains - change).max() < 1e-13  # m: those are the lengths
        assert np.abs(chain.elastic @ strains - elastic).max() < 1e-12


@pytest.mark.parametrize("kind", ["pcc", "uneven", "stacked"])
def test_elastic_coordinates_do_without_what_lengths_prescribe(kind: str) -> None:
    """`elastic = (N^T K N)^-1 N^T K`: it undoes `free`, and sees nothing of `spread`."""
    chain = ROBOTS[kind]().chain()
    weighted = chain.free.T * chain.stiffness
    assert np.allclose(chain.elastic, np.linalg.solve(weighted @ chain.free, weighted), rtol=0.0, atol=1e-14)
    assert np.abs(chain.elastic @ chain.free - np.eye(chain.free.shape[1])).max() < 1e-14
    assert np.abs(chain.elastic @ chain.spread).max() < 1e-13 * np.abs(chain.spread).max()


def test_tensions_hold_nothing() -> None:
    chain = ROBOTS["pcc_forces"]().chain()
    assert chain.muscle_input == "forces"
    assert (chain.constrained, chain.constrained_slope.shape, chain.muscle_paths.matrix.shape) == ((), (0, 6), (6, 16))
    assert np.array_equal(chain.elastic, np.eye(16))
    assert np.array_equal(chain.free, np.eye(16))
    assert not chain.spread.any()


# --- Size and refusals


def test_a_long_chain_needs_no_workspace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pinocchio's would take 8 s and 1.8 GB; loading and reading the chain make none."""
    count = 310
    links = (joint(f"j{i}", f"l{i}", f"l{i + 1}", "0 1 0", xyz="0.01 0 0", rpy="0 0 0") for i in range(count))
    text = f'<robot name="long"><link name="l0">{INERTIAL}</link>{"".join(links)}</robot>'

    def refuse(self: object) -> None:
        raise AssertionError(f"a workspace for {self}")

    monkeypatch.setattr(pin.Model, "createData", refuse)
    model = sr.load_model(text, springs={f"j{i}": 1.0 for i in range(1, count)})
    chain = model.chain()
    assert (len(chain.elements), len(chain.stiffness), chain.n_motors) == (count, count - 1, 1)
    tip, _ = walk(chain, np.full(1, 0.02), np.full(count - 1, -0.02))
    angles = np.array([0.02 - 0.02 * i for i in range(count)])
    # All axes are along -y, so the angles add up in a plane; rounding of 310 turns.
    expected = 0.01 * np.array([1.0 + np.cos(angles[:-1]).sum(), 0.0, -np.sin(angles[:-1]).sum()])
    assert np.abs(tip[:3, 3] - expected).max() < 1e-12
    with pytest.raises(sr.DescriptionError, match=r"310 coordinates; .* at most 300 .*softrobots\.compile"):
        sr.solve_equilibrium(model, [0.0])


def by_hand(kind: object) -> SoftModel:
    """A robot with a joint that no URDF has."""
    made = pin.Model()
    made.name = "hand"
    made.addJoint(0, kind, pin.SE3.Identity(), "screw")
    made.addFrame(pin.Frame("tip", 1, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    return assemble(
        made, "", read_tags('<robot name="hand"><link name="base"/></robot>'), springs={}, motors=["screw"], tip="tip"
    )


@each_row(
    ("model", "message"),
    [
        (
            lambda: sr.load_model(BRANCHED, springs=SPRINGS, tip="finger"),
            r"foreign has joints that are not between base and tip \(finger\): gripper; .*one serial chain from base to tip",
        ),
        (
            lambda: sr.load_model(sr.InflatableArm(), tip="link_1"),
            r"between base and tip \(link_1\): motor_3, spring_2_side, spring_2_up;",
        ),
        (
            lambda: sr.load_model(sr.InflatableArm(max_moment=15.0)),
            r"has max_moment; .*linear.* \(solve_equilibrium accepts",
        ),
        (lambda: by_hand(pin.JointModelHX(0.3)), "joint screw of hand is a JointModelHX; .*revolute, continuous and prismatic"),
        (lambda: by_hand(pin.JointModelSpherical()), "joint screw of hand is a JointModelSpherical"),
    ],
)
def test_what_is_no_serial_chain_is_refused(model: Callable[[], SoftModel], message: str) -> None:
    loaded = model()
    with pytest.raises(sr.DescriptionError, match=message):
        loaded.chain()


def test_a_branch_that_is_locked_does_no_harm(rng: np.random.Generator) -> None:
    model = sr.load_model(BRANCHED, springs=SPRINGS, motors=["shoulder", "elbow"], tip="finger")
    check_against_pinocchio(model, rng)
