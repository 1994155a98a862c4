"""The robots and loads of the soak: random and deliberately hard ones."""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.description.composition import mount
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import HelixTube, InflatableArm, PccArm
from softrobots.statics.loads import EARTH_GRAVITY
from studies.soak.plain_statics import Case

LARGEST_FORCE = 1000.0
"""Largest force [N]."""

RATIOS = (1e-3, 1e6)
"""Stiffness of a spring over that of the paper's arm or of the rod."""

COUNTS = (1, 2, 5, 10, 20, 50, 100, 200)
"""Sections of a long chain."""

Random = np.random.Generator
Maker = Callable[[Random], SoftModel]


@dataclass(frozen=True)
class Family:
    """Cases of one kind."""

    name: str
    """Name at the command line."""
    description: str
    """Description in the table."""
    job: str
    """Solver call, one of `studies.soak.jobs.JOBS`."""
    share: float
    """Share of all cases; the shares add up to 1."""
    chunk: int
    """Number of cases of one robot."""
    robot: Maker
    """Makes the robot of a chunk."""
    tangents: int = 1
    """The tangent stiffness of one case in this number is computed again."""
    moments: bool = False
    """Whether a moment acts on the tip, too."""
    largest: float = LARGEST_FORCE
    """Largest force [N]."""
    compiler: bool = True
    """Whether compiled solvers may use numba; compilation takes too long for robots that change."""

    def random(self, seed: int, chunk: int) -> Random:
        """Return the generator of a chunk, the same in every run."""
        return np.random.default_rng([seed, zlib.crc32(self.name.encode()), chunk])


def draw_cases(family: Family, model: SoftModel, random: Random) -> Case:
    """Draw the cases of a chunk.

    Args:
        family: The family.
        model: The robot of the chunk.
        random: The generator, after the robot was drawn.

    Returns:
        The cases of a chunk.
    """
    n = family.chunk
    motors = np.array([draw_motors(model, random) for _ in range(n)]).reshape(n, model.n_motors)
    forces = np.array([_size(random, family.largest) * _direction(random) for _ in range(n)])
    weight = random.random(n) < 0.4
    moments = np.zeros((n, 3))
    if family.moments:
        moments = np.array([_size(random, 0.1 * family.largest) * _direction(random) for _ in range(n)])
    return Case(motors, forces, weight[:, None] * np.array(EARTH_GRAVITY), moments)


def draw_motors(model: SoftModel, random: Random) -> FloatArray:
    """Draw actuator coordinates: anywhere, at rest, elbow straight or folded, or tip on the axis of the first motor."""
    joints = len(model.structure.motor_joints)
    result = np.array(model.relaxed_motors)
    kind = random.integers(6)
    if kind:
        result[:joints] = random.uniform(-math.pi, math.pi, joints)
        muscles = len(result) - joints
        if model.muscle_input == "forces":
            result[joints:] = _size(random, 400.0) * random.uniform(-1.0, 1.0, muscles)
        elif muscles:
            drawn = model.actuators.draw(random)
            result[joints:] = result[joints:] if drawn is None else drawn[joints:] * (1.0 + random.choice([0.0, 1e-9]))
    if kind == 2:
        result[min(2, joints) : joints] = 0.0
    if kind == 3 and joints:
        result[joints - 1] = random.choice([-1.0, 1.0]) * (math.pi - random.choice([0.0, 1e-9, 1e-3]))
    if kind == 4 and joints > 1:  # upright: the tip is on the axis of motor 1
        result[1], result[2:joints] = random.choice([-0.5, 0.5]) * math.pi, 0.0
    if kind == 5 and joints == 3:  # bent, with the tip on the axis: links of equal length
        result[2] = (math.pi - 2.0 * result[1] + math.pi) % (2.0 * math.pi) - math.pi
    return result


def _size(random: Random, largest: float) -> float:
    """Draw a size: zero, tiny, or anything up to the largest."""
    kind = random.integers(8)
    if kind == 0:
        return 0.0
    return float(largest * (10.0 ** random.uniform(-9.0, 0.0) if kind < 5 else random.uniform()))


def _direction(random: Random) -> FloatArray:
    """Draw a direction: anywhere, along an axis, or close to one."""
    kind = random.integers(6)
    result = random.normal(size=3)
    if kind < 2:
        result = random.choice([-1.0, 1.0]) * np.eye(3)[random.integers(3)] + 10.0 ** random.uniform(-15, -2) * kind * result
    return np.asarray(result / np.linalg.norm(result))


@cache
def _arm() -> SoftModel:
    return load_model(InflatableArm())


@cache
def _limp() -> SoftModel:
    return load_model(InflatableArm(max_moment=12.0))


@cache
def _pcc(sections: int = 4) -> SoftModel:
    return load_model(PccArm(elastic_sections=sections))


@cache
def _pulled() -> SoftModel:
    return load_model(PccArm(elastic_sections=2), muscles="forces")


@cache
def _lumped() -> SoftModel:
    return load_model(PccArm(chain="lumped", hinges=4))


@cache
def _tube(chain: str) -> SoftModel:
    return load_model(HelixTube(chain=chain, elastic_sections=8, hinges=12, length=0.5))


@cache
def _mounted() -> SoftModel:
    return load_model(mount(InflatableArm(), "tip", PccArm(segment_lengths=(0.4,), elastic_sections=2)))


def _ratio(random: Random) -> float:
    low, high = np.log10(RATIOS)
    return float(10.0 ** random.uniform(low, high))


_ARMS = ((0.6,), (0.3, 0.7), (0.5, 0.4, 0.3), (0.2, 0.8, 0.4, 0.6))
"""Link lengths of arms with odd springs [m]."""


@cache
def _described(robot: InflatableArm | PccArm) -> str:
    """Text of a robot; xacro takes a tenth of a second, and half a minute for the longest rods."""
    return robot.urdf()


def _odd_arm(random: Random) -> SoftModel:
    """One to four links with springs of any stiffness, relaxed or not."""
    text = _described(InflatableArm(link_lengths=_ARMS[random.integers(len(_ARMS))], stiffness=172.71))
    rest = random.uniform(0.0, 1.5) * random.integers(2)
    names = re.findall(r'<joint name="(spring_[^"]*)"', text)
    return load_model(text, springs={name: (172.71 * _ratio(random), rest * random.uniform(-1.0, 1.0)) for name in names})


def _odd_rod(random: Random) -> SoftModel:
    """Two segments of any stiffness in bending, twist and stretch."""
    azimuths = () if random.integers(2) else PccArm().muscle_azimuths
    text = _described(PccArm(elastic_sections=3, muscle_azimuths=azimuths))
    for name in ("EI", "GJ", "EA"):
        factor = _ratio(random)
        text = re.sub(rf'\b{name}="([^"]+)"', lambda found: f'{name}="{factor * float(found[1])!r}"', text)  # noqa: B023
    return load_model(text)


@cache
def _long_model(chain: str, count: int) -> SoftModel:
    rod = PccArm(segment_lengths=(1.0,), chain=chain, elastic_sections=count, hinges=count, muscle_azimuths=())
    return load_model(_described(rod))


def _long_rod(random: Random) -> SoftModel:
    """A rod of 1 to 200 sections or pairs of hinges."""
    return _long_model(str(random.choice(["sections", "lumped"])), int(random.choice(COUNTS)))


FAMILIES = (
    Family("arm_batch", "arm, compiled, in batches", "batch", 0.58, 2000, lambda _: _arm(), tangents=20),
    Family("arm", "arm", "solve", 0.11, 500, lambda _: _arm(), tangents=4),
    Family("arm_moments", "arm, moments on the tip", "solve", 0.03, 200, lambda _: _arm(), tangents=2, moments=True),
    Family("odd_arm", "1 to 4 links, springs of 1e-3 to 1e6", "solve", 0.04, 20, _odd_arm, tangents=2),
    Family("odd_arm_batch", "the same, compiled", "batch", 0.06, 500, _odd_arm, tangents=20, compiler=False),
    Family("limp", "arm with a plateau of its moment", "solve", 0.03, 200, lambda _: _limp(), tangents=2),
    Family("pcc", "arm of muscles, lengths given", "solve", 0.01, 50, lambda _: _pcc(), tangents=5),
    Family("pcc_batch", "the same, compiled", "batch", 0.02, 500, lambda _: _pcc(), tangents=50),
    Family("pulled", "arm of muscles, tensions given", "solve", 0.01, 50, lambda _: _pulled(), tangents=5),
    Family("lumped", "arm of muscles, lumped", "solve", 0.01, 50, lambda _: _lumped(), tangents=5),
    Family("helix", "helical tube", "solve", 0.005, 50, lambda _: _tube("sections"), tangents=5),
    Family("helix_lumped", "helical tube, lumped", "solve", 0.005, 50, lambda _: _tube("lumped"), tangents=5),
    Family("mounted", "arm of muscles on the arm", "solve", 0.01, 50, lambda _: _mounted(), tangents=5, largest=100.0),
    Family("odd_rod", "rods, stiffness of 1e-3 to 1e6", "solve", 0.01, 10, _odd_rod, tangents=5),
    Family(
        "long_rod",
        "rods of 1 to 200 sections, compiled",
        "batch",
        0.005,
        20,
        _long_rod,
        tangents=20,
        largest=100.0,
        compiler=False,
    ),
    Family("estimate", "load of the arm from its motors", "estimate", 0.01, 50, lambda _: _arm(), largest=100.0),
    Family("estimate_batch", "the same, compiled", "estimate_batch", 0.03, 500, lambda _: _arm(), largest=100.0, tangents=10),
    Family("reach", "inverse kinematics of the arm", "reach", 0.005, 20, lambda _: _arm(), largest=50.0),
    Family("reach_batch", "the same, compiled", "reach_batch", 0.02, 500, lambda _: _arm(), largest=50.0, tangents=10),
)
"""All of them."""
