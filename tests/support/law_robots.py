"""Robots that the laws of the statics are tested on, what is drawn for them, and their energy written without the solver."""

from __future__ import annotations

import re
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from hypothesis import strategies as st

import softrobots as sr
from tests.support.foreign import BRANCHED, SPRINGS
from tests.support.membrane import hinge_energy

PUSHES = {
    "arm": 100.0,
    "limp": 30.0,
    "slack": 60.0,
    "three_links": 60.0,
    "two_hinges": 60.0,
    "pcc": 2.0,
    "pulled": 2.0,
    "pcc_lumped": 2.0,
    "tendons": 0.3,
    "flexures": 2.0,
    "helix": 4.0,
    "helix_lumped": 4.0,
    "mounted": 2.0,
    "foreign": 30.0,
}
"""Robots of every kind, and a force that bends each of them by about a radian [N]."""

ROBOTS = tuple(PUSHES)


@cache
def model(kind: str) -> sr.SoftModel:
    """One of `ROBOTS`, with few joints."""
    tube = {"length": 0.3, "elastic_sections": 3, "hinges": 4}
    if kind == "foreign":  # a continuous motor, an elbow, a turning and a sliding spring, a side branch
        return sr.load_model(BRANCHED, springs=SPRINGS, tip="finger")
    if kind == "mounted":  # motors, springs, sections and muscles in one
        return sr.load_model(sr.mount(sr.InflatableArm(), "tip", sr.PccArm(segment_lengths=(0.4,), elastic_sections=2)))
    if kind == "flexures":  # motors, springs, and sections that keep their length
        rod = sr.PccArm(segment_lengths=(0.4,), muscle_azimuths=(), chain="flexures", hinges=2, extension=False)
        return sr.load_model(sr.mount(sr.InflatableArm(), "tip", rod))
    robot = {
        "arm": lambda: sr.InflatableArm(),
        "limp": lambda: sr.InflatableArm(max_moment=12.0),  # beyond it a link is on the plateau of its moment
        "slack": lambda: sr.InflatableArm(moment_law="slack_wall", rest_up=0.05),  # beyond 13 N m the wall of a link goes slack
        "three_links": lambda: sr.InflatableArm(
            link_lengths=(0.5, 0.4, 0.3), stiffness=(250.0, 120.0, 80.0), rest_side=(0.05, -0.02, 0.0), rest_up=-0.1
        ),
        "two_hinges": lambda: sr.InflatableArm(link_model="two_hinges", torsion=True, shear_modulus=3e7, rest_up=0.1),
        "pcc": lambda: sr.PccArm(elastic_sections=2),
        "pulled": lambda: sr.PccArm(elastic_sections=2),
        "pcc_lumped": lambda: sr.PccArm(chain="lumped", hinges=3, offset=np.pi),  # its hinges have two planes of symmetry
        "tendons": lambda: sr.TendonArm(
            segment_lengths=(0.06, 0.06), elastic_sections=2, tendon_pretension=100.0, tendon_force=400.0
        ),  # never slack
        "helix": lambda: sr.HelixTube(**tube),
        "helix_left": lambda: sr.HelixTube(**tube, handedness="left"),
        "helix_lumped": lambda: sr.HelixTube(**tube, chain="lumped"),
    }[kind]()
    return sr.load_model(robot, muscles="forces" if kind == "pulled" else None)


# --- What is drawn

axes = st.sampled_from([(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1), (1, 1e-9, 0), (1e-6, 0, -1)])
triples = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
directions = st.one_of(axes, triples.filter(lambda v: np.linalg.norm(v) > 0.1)).map(lambda v: np.array(v) / np.linalg.norm(v))
"""Unit vectors; axes and what is nearly one too."""


def sizes(largest: float) -> st.SearchStrategy[float]:
    """Nothing, next to nothing, or as large as asked."""
    return st.one_of(st.just(0.0), st.floats(-12.0, 0.0).map(lambda power: largest * 10.0**power), st.floats(0.0, largest))


shares = st.lists(st.one_of(st.just(0.0), st.floats(-1.0, 1.0)), min_size=6, max_size=6)
gravities = st.one_of(st.none(), st.just(sr.EARTH_GRAVITY), triples.map(lambda v: tuple(5.0 * np.array(v))))
turns = st.tuples(*[st.one_of(st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi]), st.floats(-3.1, 3.1))] * 3)


class Case(NamedTuple):
    """Motors and a load, for whatever robot."""

    shares: list[float]
    """Motors: 0 at rest, +-1 at 2 rad, 4 % of the length of a muscle, or 10 N."""
    size: float
    """Force over the one of `PUSHES`."""
    direction: np.ndarray
    """Its direction."""
    gravity: tuple[float, float, float] | None
    """Gravity [m/s^2]."""

    def motors(self, robot: sr.SoftModel) -> np.ndarray:
        """Motor coordinates of a robot."""
        joints = robot.n_motors - len(robot.muscles)
        each = np.full(robot.n_motors, 2.0)
        lengths = np.array(robot.actuators.units[joints:]) == "m"
        each[joints:] = np.where(lengths, 0.04 * robot.relaxed_motors[joints:], 10.0)
        return robot.relaxed_motors + each * self.shares[: robot.n_motors]

    def force(self, kind: str) -> np.ndarray:
        """Force at the tip of a robot [N]."""
        return PUSHES[kind] * self.size * self.direction


def cases(largest: float = 0.3, gravity: st.SearchStrategy[Any] = gravities) -> st.SearchStrategy[Case]:
    """Motors anywhere, and forces up to `largest` times that of `PUSHES`."""
    return st.builds(Case, shares, sizes(largest), directions, gravity)


# --- Robots made of others


def scaled(robot: sr.SoftModel, factor: float) -> sr.SoftModel:
    """The robot of a material, pressure and muscles so many times as stiff and strong, by its text."""
    names = "EI|GJ|EA|stiffness|pretension|max_moment|pressure|max_pressure|weakest|strongest"
    text = re.sub(rf'\b({names})="([^"]+)"', lambda at: f'{at[1]}="{float(at[2]) * factor!r}"', robot.urdf)
    springs = {name: (factor * stiffness, rest) for name, (stiffness, rest) in robot.spring_table.items()}
    return sr.load_model(text, springs=springs, motors=robot.structure.motor_joints, tip=robot.tip, muscles=robot.muscle_input)


def turned(robot: sr.SoftModel, rpy: tuple[float, float, float]) -> sr.SoftModel:
    """The robot on a turned base."""
    root = next(frame.name for frame in robot.pinocchio.frames if frame.type == pin.FrameType.BODY)
    table = (
        f'<link name="table"/><joint name="turn" type="fixed"><origin rpy="{rpy[0]!r} {rpy[1]!r} {rpy[2]!r}"/>'
        f'<parent link="table"/><child link="{root}"/></joint></robot>'
    )
    text = robot.urdf.replace("</robot>", table)
    options = {"motors": robot.structure.motor_joints, "tip": robot.tip, "muscles": robot.muscle_input}
    return sr.load_model(text, springs=robot.spring_table, **options)


# --- Energy


def tip_pose(robot: sr.SoftModel, motors: np.ndarray, springs: np.ndarray) -> pin.SE3:
    """Pose of the tip at any coordinates."""
    data = robot.pinocchio.createData()
    pin.framesForwardKinematics(robot.pinocchio, data, robot.configuration(motors, springs))
    return data.oMf[robot.frame_id(robot.tip)]


def stored_energy(robot: sr.SoftModel, motors: np.ndarray, springs: np.ndarray) -> float:
    """Elastic energy of springs and sections [J]; that of linear springs, or of links with a plateau, written out.

    Sections: EI, GJ and EA of the description and the strains, those that muscle lengths prescribe included.
    """
    structure = robot.structure
    strains = np.asarray(structure.strains(motors, springs))
    law = structure.strain_springs
    energies = 0.5 * law.stiffness * (strains - law.rest) ** 2
    for group in robot.spring_groups:
        if group.max_moment is not None:
            stiffness = law.stiffness[list(group.springs)]
            bend = float(np.linalg.norm((strains - law.rest)[list(group.springs)]))
            if stiffness[0] * bend > group.max_moment:
                energies[list(group.springs)] = 0.0
                energies[group.springs[0]] = group.max_moment * (bend - 0.5 * group.max_moment / stiffness[0])
        elif group.slack_wall:
            for hinge in group.hinges:
                places, stiffness = list(hinge), float(law.stiffness[hinge[0]])
                bend = float(np.linalg.norm((strains - law.rest)[places]))
                energies[places] = 0.0
                tension = group.pressure * np.pi * group.radius**2
                energies[places[0]] = hinge_energy(bend, stiffness, group.radius, tension)
    return float(energies.sum())


def load_energy(robot: sr.SoftModel, motors: np.ndarray, springs: np.ndarray, force: np.ndarray, gravity: Any) -> float:
    """Potential of a force on the tip, of weight and of given tensions or elastic tendons [J]."""
    pinocchio = robot.pinocchio
    data = pinocchio.createData()
    pin.framesForwardKinematics(pinocchio, data, robot.configuration(motors, springs))
    energy = -float(force @ data.oMf[robot.frame_id(robot.tip)].translation)
    if gravity is not None:
        for joint in range(1, pinocchio.njoints):
            body = pinocchio.inertias[joint]
            energy -= body.mass * float(np.dot(gravity, data.oMi[joint].act(body.lever)))
    if robot.muscles and robot.muscle_input == "forces":
        inputs = motors[-len(robot.muscles) :]
        for tag, u, length in zip(robot.muscles, inputs, muscle_lengths(robot, springs), strict=True):
            if tag.kind == "elastic":
                energy += max(tag.pretension + tag.stiffness * (length - u), 0.0) ** 2 / (2.0 * tag.stiffness)
            else:
                energy += u * length
    return energy


def muscle_lengths(robot: sr.SoftModel, strains: np.ndarray) -> np.ndarray:
    """Lengths of the muscles: a helix around each section; beside a hinge the square of its twist over twice its length."""
    made = []
    for tag in robot.muscles:
        length, (x, y) = tag.rest_length, tag.distance * np.array([np.sin(tag.azimuth), -np.cos(tag.azimuth)])
        for row in robot.structure.section_table:
            if row.segment in tag.segments:
                z = {name: strains[place] for name, place in row.places.items()}
                change = x * z["bend_x"] + y * z["bend_y"] + z.get("stretch", 0.0)
                twist = tag.distance * z.get("twist", 0.0)
                if row.hinge > 0.0:
                    length += change + twist**2 / (2.0 * row.length)
                else:
                    length += np.hypot(row.length + change, twist) - row.length
        made.append(length)
    return np.array(made)
