"""The kinematics of a URDF file in other tools, against Pinocchio's: where each link is, at random joint coordinates."""

from __future__ import annotations

import contextlib
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.cli.tools.known_tools import Tool, find_tool, installed_tools
from softrobots.cli.tools.placed_links import Poses, open_in
from softrobots.core.checks import FloatArray, positive_integer
from softrobots.core.errors import DescriptionError, SoftRobotsError
from softrobots.core.xml_input import parse_xml, read_xml
from softrobots.description.sources import read_source
from softrobots.model.pinocchio_data import MAX_DOF
from softrobots.robots import Robot

COUNT = 20
"""Random configurations of a comparison."""

_WIDEST = (2.0 * np.pi, 1.0)
"""Joints with wider limits are drawn within plus and minus these [rad, m]."""


@dataclass(frozen=True)
class KinematicsRow:
    """How a tool places the links of a file."""

    tool: str
    """Name of the tool."""
    version: str
    """Its version."""
    file: str
    """Name of the robot or its file."""
    joints: int
    """Movable joints of the file that the tool knows."""
    joints_in_file: int
    """Movable joints of the file."""
    links: int
    """Links of the file that the tool keeps; these are compared."""
    lost_links: tuple[str, ...]
    """Links of the file that the tool does not keep."""
    position_error: float
    """Largest distance of a link from where Pinocchio has it [m]; 0 if the tool refuses the file."""
    rotation_error: float
    """Largest angle between a link and itself in Pinocchio [rad]; 0 if the tool refuses the file."""
    precision: float
    """Largest error that the tool is allowed [m and rad]."""
    limits: str
    """What the tool cannot do with a URDF file."""
    problem: str = ""
    """Error of the tool if it refused the file, else empty."""

    @property
    def agrees(self) -> bool:
        """Whether every link and joint is there, and every link where Pinocchio has it."""
        complete = not self.problem and not self.lost_links and self.joints == self.joints_in_file
        return complete and max(self.position_error, self.rotation_error) <= self.precision


def compare_kinematics(
    source: Robot | Path | str, tools: Sequence[str] | None = None, *, count: int = COUNT, seed: int = 20210312
) -> tuple[KinematicsRow, ...]:
    """Compare where tools place the links of a URDF with where Pinocchio places them.

    Pinocchio reads the file itself, without this package. Joint coordinates are drawn within the limits of
    the file, those of mimicking joints follow.

    Args:
        source: What `read_source` takes.
        tools: Names of tools, of `softrobots.cli.tools.known_tools.TOOLS`; by default all that are installed.
        count: Number of random configurations.
        seed: Seed of the draw.

    Returns:
        A row for each tool.

    Raises:
        SoftRobotsError: Whatever `read_source` raises.
        DescriptionError: If Pinocchio refuses the file, or a joint is not revolute, continuous, prismatic or fixed.
        NameNotFound: If there is no such tool.
        MissingDependency: If a tool of `tools` is not installed.
        ParameterError: If `count` is not positive.
    """
    positive_integer("count", count)
    chosen = [find_tool(name) for name in (installed_tools() if tools is None else tools)]
    for tool in chosen:
        tool.load()
    with as_file(source) as (file, label):
        expected = _pinocchio_poses(file, label, count, seed)
        return tuple(_compare(tool, file, label, expected) for tool in chosen)


@dataclass(frozen=True)
class _Expected:
    """Movable joints of a file, and for each configuration their coordinates and Pinocchio's poses of the links."""

    joints: tuple[str, ...]
    values: tuple[Mapping[str, float], ...]
    poses: tuple[Poses, ...]


def _compare(tool: Tool, file: Path, label: str, expected: _Expected) -> KinematicsRow:
    facts: dict[str, Any] = {
        "tool": tool.name,
        "version": str(tool.version),
        "file": label,
        "joints_in_file": len(expected.joints),
        "precision": tool.precision,
        "limits": tool.limits,
    }
    try:
        with open_in(tool, file) as robot:
            placed = [robot.poses(values) for values in expected.values]
    except SoftRobotsError:
        raise
    except Exception as error:  # a tool may raise anything if it refuses a file
        facts |= {"joints": 0, "links": 0, "lost_links": tuple(expected.poses[0]), "position_error": 0.0, "rotation_error": 0.0}
        problem = f"{type(error).__name__}: {str(error).strip().splitlines()[0] if str(error).strip() else 'no reason given'}"
        return KinematicsRow(**facts, problem=problem)
    kept = [link for link in expected.poses[0] if link in placed[0]]
    pairs = [(here[link], there[link]) for here, there in zip(placed, expected.poses, strict=True) for link in kept]
    errors = np.array([pose_error(one, other) for one, other in pairs]).reshape(-1, 2)
    broken = not np.all(np.isfinite(errors))
    position, rotation = (0.0, 0.0) if broken or not len(errors) else errors.max(axis=0).tolist()
    return KinematicsRow(
        **facts,
        joints=len(set(robot.joints) & set(expected.joints)),
        links=len(kept),
        lost_links=tuple(link for link in expected.poses[0] if link not in kept),
        position_error=position,
        rotation_error=rotation,
        problem="a pose that is not finite" if broken else "",
    )


def pose_error(one: FloatArray, other: FloatArray) -> tuple[float, float]:
    """Return distance [m] and angle [rad] between two poses, each of shape (4, 4) [m].

    The angle t of the rotation from one to the other follows from `|R1 - R2| = 2 sqrt(2) sin(t/2)` (Frobenius), which keeps
    its digits at small angles, where the arccosine of the trace loses half of them.
    """
    distance = np.linalg.norm(one[:3, 3] - other[:3, 3])
    chord = np.linalg.norm(one[:3, :3] - other[:3, :3]) / np.sqrt(8.0)
    return float(distance), float(2.0 * np.arcsin(np.minimum(chord, 1.0)))


@contextlib.contextmanager
def as_file(source: Robot | Path | str) -> Iterator[tuple[Path, str]]:
    """Give the URDF file of a source of `read_source`, and its name; all but a URDF file is written to a temporary one.

    Raises:
        SoftRobotsError: What `read_source` raises.
    """
    text, label = read_source(source)
    if label == str(source) and is_urdf_file(Path(label)):
        yield Path(label), Path(label).stem
        return
    with tempfile.TemporaryDirectory(prefix="softrobots-") as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(text, encoding="utf-8")
        yield file, parse_xml(text, label).get("name", label)


def is_urdf_file(path: Path) -> bool:
    """Whether the root tag of an XML file is that of URDF.

    Raises:
        DescriptionError: If it cannot be read, or is not XML.
    """
    return parse_xml(read_xml(path), str(path)).tag == "robot"


def _pinocchio_poses(file: Path, label: str, count: int, seed: int) -> _Expected:
    """Joint coordinates within the limits, and Pinocchio's poses of every link there."""
    text, _ = read_source(file)
    root = parse_xml(text, str(file))
    try:
        model = pin.buildModelFromUrdf(str(file))
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f"Pinocchio refuses {label}: {error} (its parser prints the reason on stderr)") from error
    links = [link.get("name", "") for link in root.findall("link")]
    joints = {name: model.joints[model.getJointId(name)] for name in model.names if name != "universe"}
    unsupported = [name for name, joint in joints.items() if joint.nv != 1]
    if unsupported:
        raise DescriptionError(f"{label} has joints that are not revolute, continuous or prismatic: {', '.join(unsupported)}")
    if not 0 < len(joints) <= MAX_DOF:
        raise DescriptionError(f"{label} has {len(joints)} movable joints; from 1 to {MAX_DOF} can be compared")
    data, rng = model.createData(), np.random.default_rng(seed)
    values, poses = [], []
    for _ in range(count):
        drawn = _follow(root, {name: _draw(model, joint, rng) for name, joint in joints.items()})
        q = pin.neutral(model)
        for name, joint in joints.items():
            angle = drawn[name]
            q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        pin.framesForwardKinematics(model, data, q)
        values.append(drawn)
        poses.append({link: data.oMf[model.getFrameId(link, pin.FrameType.BODY)].homogeneous.copy() for link in links})
    return _Expected(tuple(joints), tuple(values), tuple(poses))


def _draw(model: Any, joint: Any, rng: np.random.Generator) -> float:
    """A coordinate within the limits of a joint, and within `_WIDEST` if they leave a choice."""
    if joint.nq == 2:
        return float(rng.uniform(-np.pi, np.pi))
    widest = _WIDEST[joint.shortname().startswith("JointModelP")]
    low, high = float(model.lowerPositionLimit[joint.idx_q]), float(model.upperPositionLimit[joint.idx_q])
    return float(rng.uniform(max(low, min(high, -widest)), min(high, max(low, widest))))


def _follow(root: ElementTree.Element, drawn: Mapping[str, float]) -> dict[str, float]:
    """The coordinates with those of mimicking joints computed, `multiplier * master + offset`."""
    values = dict(drawn)
    rules = {joint.get("name", ""): mimic for joint in root.findall("joint") for mimic in joint.findall("mimic")}
    for _ in rules:  # as often as there are rules: a master may mimic another joint
        for name, mimic in rules.items():
            master = mimic.get("joint", "")
            if name in values and master in values:
                values[name] = float(mimic.get("multiplier", "1")) * values[master] + float(mimic.get("offset", "0"))
    return values
