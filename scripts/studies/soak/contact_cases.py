"""Random robots among random obstacles: the cases of a soak of contacts, and the laws that every answer must obey."""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import EquilibriumNotFound
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import InflatableArm, PccArm, TendonArm
from softrobots.statics.elastic_state import MOMENT_FLOOR, TOLERANCE, elastic_state
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY, Load
from studies.soak.jobs import SECONDS, UNSTABLE, Hang, limited
from studies.soak.plain_contact import PlainBody, distance, slope
from studies.soak.plain_statics import Case, PlainStatics, Push
from studies.soak.verdicts import AnyTally

CHUNK = 100
"""Cases that are drawn together."""

PENETRATION = 1e-9
"""Largest penetration, and largest gap of a contact, relative to the reach."""

BLOCKED = "no room"
"""Outcome: a part of the robot that no spring moves is inside of an obstacle, so that there is no equilibrium."""

NOT_FOUND = "not found"
"""Outcome: the solver found none, and says so."""

_MARGIN = 1.01  # residual over its tolerance, for the rounding of the second evaluation
_STEP = 1e-6  # [m], of differences of distances; at the border of an edge the normal turns by that over the distance
_DISTURBED = 20  # every so many cases the energy is compared with that of disturbed springs
_DISTURBANCES = 40
_SIZES = (1e-4, 1e-3)  # of a disturbance [rad or m]


@dataclass(frozen=True)
class Family:
    """Cases of one robot."""

    name: str
    """Name at the command line."""
    description: str
    """Description in the table."""
    share: float
    """Share of all cases."""
    robot: Callable[[], SoftModel]
    """The robot."""
    force: float
    """Largest force on the tip [N]."""


@cache
def _arm() -> SoftModel:
    return load_model(InflatableArm())


@cache
def _two_hinges() -> SoftModel:
    return load_model(InflatableArm(link_model="two_hinges"))


@cache
def _pcc() -> SoftModel:
    return load_model(PccArm())


@cache
def _lumped() -> SoftModel:
    return load_model(PccArm(chain="lumped", hinges=4))


@cache
def _tendons() -> SoftModel:
    return load_model(TendonArm())


FAMILIES = (
    Family("arm", "arm", 0.7, _arm, 40.0),
    Family("two_hinges", "arm of two hinges a link", 0.2, _two_hinges, 40.0),
    Family("pcc", "arm of muscles, lengths given", 0.03, _pcc, 5.0),
    Family("lumped", "the same, lumped", 0.03, _lumped, 5.0),
    Family("tendon", "arm of tendons", 0.04, _tendons, 1.0),
)
"""All of them."""


@dataclass
class Tally(AnyTally):
    """Outcomes of a family; an outcome is the number of pressed contacts of a certified equilibrium, or a word."""

    penetration: float = 0.0
    """Deepest penetration by plain distances, relative to the reach."""
    disturbed: int = 0
    """Cases whose energy was compared with that of disturbed springs."""

    def add(self, other: Tally) -> None:
        """Add another part of the same family."""
        self._add(other)
        self.penetration = max(self.penetration, other.penetration)
        self.disturbed += other.disturbed


def draw(family: Family, body: PlainBody, seed: int, number: int) -> tuple[Case, Environment]:
    """Draw one case: actuators, a force on the tip, weight in half of the cases, one to three obstacles."""
    model = body.statics.model
    random = np.random.default_rng([seed, zlib.crc32(family.name.encode()), number])
    motors = np.array(model.relaxed_motors)
    joints = len(model.structure.motor_joints)
    motors[:joints] = random.uniform(-1.5, 1.5, joints)
    if len(motors) > joints and random.random() < 0.5:
        drawn = model.actuators.draw(random)
        motors = motors if drawn is None else motors + 0.3 * (np.asarray(drawn) - motors)
    force = random.normal(size=3)
    force *= family.force * random.uniform() / np.linalg.norm(force)
    gravity = np.array(EARTH_GRAVITY) * (random.random() < 0.5)
    cores = body.cores(motors[None], np.array(model.rest)[None])[0]
    obstacles = [_obstacle(random, model.reach, cores) for _ in range(random.integers(1, 4))]
    return Case(*(one[None] for one in (motors, force, gravity, np.zeros(3)))), Environment(obstacles)


def _obstacle(random: np.random.Generator, reach: float, cores: FloatArray) -> Obstacle:
    """Draw an obstacle beside the relaxed robot, or anywhere around its base."""
    while True:
        direction = random.normal(size=3)
        direction /= np.linalg.norm(direction)
        place = direction * reach * random.uniform(0.2, 1.1)
        if random.random() < 0.7:
            start, end = cores[random.integers(len(cores))]
            place = start + random.uniform() * (end - start) + direction * reach * random.uniform(0.05, 0.25)
        turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
        turn = turn * np.sign(np.linalg.det(turn))
        size = reach * random.uniform(0.02, 0.3)
        kind = random.integers(5)
        found: Obstacle
        if kind == 0:
            found = HalfSpace(-direction, -float(direction @ place))
        elif kind == 1:
            found = Sphere(size, place)
        elif kind == 2:
            found = Box(size * random.uniform(0.5, 2.0, 3), place, turn)
        elif kind == 3:
            found = Cylinder(size, 2.0 * size, place, turn)
        else:
            found = Capsule(0.5 * size, 3.0 * size, place, turn)
        if float(distance(found, np.zeros(3))) > 0.15 * reach:  # what holds the base of the robot is another matter
            return found


def judge(family: Family, seed: int, numbers: range) -> Tally:
    """Solve some cases of a family, and check the answers."""
    statics = PlainStatics(family.robot())
    body, tally = PlainBody(statics), Tally()
    for number in numbers:
        case, environment = draw(family, body, seed, number)
        begun, found, law = time.perf_counter(), None, ""
        gravity = tuple(case.gravity[0]) if case.gravity.any() else None
        try:
            with limited(SECONDS):
                found = solve_equilibrium(
                    statics.model, case.motors[0], case.forces[0], gravity=gravity, environment=environment
                )
            outcome = f"{sum(contact.strict for contact in found.contacts)}" if found.stable else UNSTABLE
        except EquilibriumNotFound as error:
            outcome = BLOCKED if _blocked(body, case, environment) else NOT_FOUND
            law = "" if np.isfinite(error.residual) and len(str(error)) > 40 else "an error without a residual or a hint"
        except Hang:
            outcome, law = "hang", f"no answer after {SECONDS:g} s"
        except Exception as error:
            outcome, law = type(error).__name__, f"{type(error).__name__} is no EquilibriumNotFound: {error}"
        seconds = time.perf_counter() - begun
        tally.cases, tally.seconds, tally.slowest = tally.cases + 1, tally.seconds + seconds, max(tally.slowest, seconds)
        tally.outcomes[outcome] += 1
        laws = [law] if law else []
        if found is not None:
            laws += _broken(tally, statics, body, case, environment, found)
            if number % _DISTURBED == 0 and found.stable:
                tally.disturbed += 1
                laws += _not_lowest(body, case, environment, found, np.random.default_rng(number))
        tally.broken += [(number, one) for one in laws]
    return tally


def _blocked(body: PlainBody, case: Case, environment: Environment) -> bool:
    """Whether an end of a core that no spring moves is inside of an obstacle."""
    rest = np.array(body.statics.model.rest)
    cores = body.cores(case.motors.repeat(2, axis=0), np.stack([rest, rest + 0.01]))
    still = np.linalg.norm(cores[1] - cores[0], axis=-1) < 1e-12
    inside = np.stack([distance(obstacle, cores[0]) < body.radii[:, None] for obstacle in environment.obstacles])
    return bool((inside & still).any())


def _broken(
    tally: Tally, statics: PlainStatics, body: PlainBody, case: Case, environment: Environment, found: Equilibrium
) -> list[str]:
    """Balance, penetration, signs and complementarity by plain statics and distances."""
    reach, springs = statics.model.reach, found.q_springs[None]
    pushes = [Push(body.bodies[one.link], one.force, one.point) for one in found.contacts]
    balance = statics.balance(case, springs, pushes)
    size = float(balance.size[0]) + reach * sum(one.normal_force for one in found.contacts)
    tolerance = max(TOLERANCE * max(size, MOMENT_FLOOR), statics.model.rounding)
    residual = max(float(balance.imbalance[0] - balance.rounding[0]), 0.0) / tolerance
    gaps = body.nearest(environment, body.cores(case.motors, springs)[0]).gap
    penetration = max(-float(gaps.min()), 0.0) / reach
    tally.residual, tally.penetration = max(tally.residual, residual), max(tally.penetration, penetration)
    laws = []
    if not residual <= _MARGIN:
        laws.append(f"{residual:.3g} times the tolerance out of balance with its contacts")
    if not penetration <= PENETRATION:
        laws.append(f"a penetration of {penetration:.3g} of the reach")
    for one in found.contacts:
        obstacle = environment[one.obstacle]
        away = abs(float(distance(obstacle, one.obstacle_point))) / reach
        if one.normal_force < 0.0 or abs(one.gap) > PENETRATION * reach or away > PENETRATION:
            laws.append(f"a contact with force {one.normal_force:.3g} N, gap {one.gap:.3g} m, {away:.3g} off the surface")
        core = one.point + one.normal * min(body.radii[[link == one.link for link in body.links]])
        off = float(np.abs(slope(obstacle, core, _STEP) - one.normal).max())
        if off > _STEP / float(distance(obstacle, core)):
            laws.append(f"a normal that is off by {off:.3g}")
    return laws


def _not_lowest(
    body: PlainBody, case: Case, environment: Environment, found: Equilibrium, random: np.random.Generator
) -> list[str]:
    """Whether springs disturbed at random, where that is free of penetration, have less energy than a certified minimum."""
    model = found.model
    load = Load.of(model, case.forces[0], gravity=found.load.gravity)
    stored = elastic_state(model, found.q_motors, found.q_springs, load).energy
    rounding = 1e-12 * (abs(stored) + model.stiffest)
    for _ in range(_DISTURBANCES):
        direction: FloatArray = random.normal(size=model.n_springs) / np.sqrt(model.stiffness)
        there = found.q_springs + random.choice(_SIZES) * direction / np.linalg.norm(direction)
        if body.nearest(environment, body.cores(case.motors, there[None])[0]).gap.min() < 0.0:
            continue
        lower = stored - elastic_state(model, found.q_motors, there, load).energy
        if lower > rounding:
            return [f"a certified minimum, but {lower:.3g} J less at {np.linalg.norm(there - found.q_springs):.2g} from it"]
    return []
