"""The kinematics of a URDF file in yourdfpy against Pinocchio's: where each link is, at random joint coordinates."""

from __future__ import annotations

import contextlib
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, positive_integer
from softrobots.core.errors import DescriptionError, SoftRobotsError
from softrobots.core.xml_input import parse_xml, read_xml
from softrobots.description.rigid_tree_urdf import link_at
from softrobots.description.sources import read_source
from softrobots.model.pinocchio_data import MAX_DOF
from softrobots.robots import Robot

COUNT = 20
"""Random configurations of a comparison."""
PRECISION = 1e-9
"""Largest error of a tool that computes in double precision [m and rad]; rounding is below 1e-14 a metre."""

_WIDEST = (2.0 * np.pi, 1.0)
"""Joints with wider limits are drawn within plus and minus these [rad, m]."""

Poses = Mapping[str, FloatArray]
"""Pose of each link in the world by its name, each (4, 4) [m]."""


class LoadedRobot(NamedTuple):
    """A robot in a tool."""

    joints: tuple[str, ...]
    """Movable joints that the tool knows and that can be set."""
    poses: Callable[[Mapping[str, float]], Poses]
    """Poses of all links that the tool keeps, for coordinates by joint name [rad or m]; other names are ignored."""
    close: Callable[[], object] = lambda: None
    """Gives back what the tool holds."""


def in_yourdfpy(file: Path) -> LoadedRobot:
    """Load a URDF file in yourdfpy."""
    import yourdfpy

    robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_collision_scene_graph=False)
    names = tuple(robot.actuated_joint_names)

    def poses(values: Mapping[str, float]) -> Poses:
        robot.update_cfg({name: values[name] for name in names if name in values})
        return poses_along_tree(file, robot.get_transform)  # from link to link: from the world it is quadratic in their number

    return LoadedRobot((*names, *mimicking(file)), poses)


def carriers(file: Path) -> dict[str, ElementTree.Element]:
    """Return the joint that carries each link of a URDF file, by the name of the link."""
    return {link_at(joint, "child"): joint for joint in ElementTree.parse(file).getroot().findall("joint")}


def mimicking(file: Path) -> tuple[str, ...]:
    """Return the joints that mimic others; yourdfpy and urchin move them by themselves."""
    return tuple(joint.get("name", "") for joint in carriers(file).values() if joint.find("mimic") is not None)


def poses_along_tree(file: Path, steps: Callable[[str, str], FloatArray]) -> dict[str, FloatArray]:
    """Return the poses of all links from the pose of each in its parent, `steps(child, parent)`."""
    joints = carriers(file)
    poses: dict[str, FloatArray] = {}
    for link in joints:
        path = [link]
        while path[-1] in joints and path[-1] not in poses:
            path.append(link_at(joints[path[-1]], "parent"))
        poses.setdefault(path[-1], np.eye(4))
        for child, parent in zip(path[-2::-1], path[:0:-1], strict=True):
            poses[child] = poses[parent] @ steps(child, parent)
    return poses


@dataclass(frozen=True)
class PlacedLinks:
    """How a tool places the links of a file."""

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
    problem: str = ""
    """Error of the tool if it refused the file, else empty."""

    def agrees_within(self, precision: float) -> bool:
        """Whether every link and joint is there, and every link where Pinocchio has it, up to an error [m and rad]."""
        complete = not self.problem and not self.lost_links and self.joints == self.joints_in_file
        return complete and max(self.position_error, self.rotation_error) <= precision


def compare_kinematics(
    source: Robot | Path | str, load: Callable[[Path], LoadedRobot] = in_yourdfpy, *, count: int = COUNT, seed: int = 20210312
) -> PlacedLinks:
    """Compare where a tool places the links of a URDF with where Pinocchio places them.

    Pinocchio reads the file itself, without this package. Joint coordinates are drawn within the limits of
    the file, those of mimicking joints follow.

    Args:
        source: What `read_source` takes.
        load: Loads a file in the tool.
        count: Number of random configurations.
        seed: Seed of the draw.

    Returns:
        The comparison.

    Raises:
        SoftRobotsError: Whatever `read_source` or `load` raises.
        DescriptionError: If Pinocchio refuses the file, or a joint is not revolute, continuous, prismatic or fixed.
        ParameterError: If `count` is not positive.
    """
    positive_integer("count", count)
    with as_file(source) as (file, label):
        return _compare(load, file, label, _pinocchio_poses(file, label, count, seed))


@dataclass(frozen=True)
class _Expected:
    """Movable joints of a file, and for each configuration their coordinates and Pinocchio's poses of the links."""

    joints: tuple[str, ...]
    values: tuple[Mapping[str, float], ...]
    poses: tuple[Poses, ...]


def _compare(load: Callable[[Path], LoadedRobot], file: Path, label: str, expected: _Expected) -> PlacedLinks:
    links, joints_in_file = tuple(expected.poses[0]), len(expected.joints)
    try:
        robot = load(file)
        with contextlib.closing(robot):
            placed = [robot.poses(values) for values in expected.values]
    except SoftRobotsError:
        raise
    except Exception as error:  # a tool may raise anything if it refuses a file
        problem = f"{type(error).__name__}: {str(error).strip().splitlines()[0] if str(error).strip() else 'no reason given'}"
        return PlacedLinks(label, 0, joints_in_file, 0, links, 0.0, 0.0, problem)
    kept = [link for link in links if link in placed[0]]
    pairs = [(here[link], there[link]) for here, there in zip(placed, expected.poses, strict=True) for link in kept]
    errors = np.array([pose_error(one, other) for one, other in pairs]).reshape(-1, 2)
    broken = not np.all(np.isfinite(errors))
    position, rotation = (0.0, 0.0) if broken or not len(errors) else errors.max(axis=0).tolist()
    lost = tuple(link for link in links if link not in kept)
    known, problem = len(set(robot.joints) & set(expected.joints)), "a pose that is not finite" if broken else ""
    return PlacedLinks(label, known, joints_in_file, len(kept), lost, position, rotation, problem)


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
