"""Rigid bodies and joints of a description as plain data, independent of the file format.

Pinocchio merges bodies behind fixed joints and keeps no shapes; translation between formats needs every link as written.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, read_only
from softrobots.description.urdf_tags import CapsuleTag, SpringTag

SOLIDS = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
"""Shapes without a file, with the attributes of their sizes in URDF."""

_NO_ROTATION = read_only(np.eye(3))
_ORIGIN = read_only(np.zeros(3))


@dataclass(frozen=True, eq=False)
class Placement:
    """Pose of a frame in another one."""

    position: FloatArray = field(default_factory=lambda: _ORIGIN)
    """Position of its origin, shape (3,) [m]."""
    rotation: FloatArray = field(default_factory=lambda: _NO_ROTATION)
    """Its axes as columns, shape (3, 3)."""

    @staticmethod
    def turned(position: FloatArray, quaternion: FloatArray) -> Placement:
        """Placement from a position, shape (3,) [m], and a quaternion w, x, y, z, shape (4,)."""
        w, x, y, z = (float(value) for value in quaternion)
        rotation = np.asarray(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix())
        return Placement(read_only(np.array(position, dtype=np.float64)), read_only(rotation))

    @staticmethod
    def moved(kind: str, axis: FloatArray, position: float) -> Placement:
        """Motion of a joint: a translation along its unit axis, shape (3,), if `kind` is "prismatic", else a rotation about it.

        `position` is the coordinate of the joint [m or rad].
        """
        if kind == "prismatic":
            return Placement(read_only(position * axis))
        return Placement(rotation=read_only(np.asarray(pin.exp3(position * axis))))

    @property
    def inverse(self) -> Placement:
        """Inverse pose."""
        return Placement(read_only(-self.rotation.T @ self.position), read_only(self.rotation.T.copy()))

    @property
    def rpy(self) -> FloatArray:
        """Roll, pitch, yaw of URDF, shape (3,) [rad]."""
        return np.asarray(pin.rpy.matrixToRpy(self.rotation))

    @property
    def quaternion(self) -> FloatArray:
        """The rotation as a unit quaternion w, x, y, z, shape (4,)."""
        x, y, z, w = pin.Quaternion(self.rotation).coeffs()
        return np.array([w, x, y, z])

    def __matmul__(self, inner: Placement) -> Placement:
        """Composition of poses."""
        return Placement(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)


@dataclass(frozen=True, eq=False)
class Shape:
    """A geometric shape of a body."""

    kind: str
    """"box", "cylinder" (along z), "sphere" or "mesh"; of a collision shape in other formats also "capsule" (along z), "plane"
    (with the normal z), or the name of a kind that is not read."""
    size: tuple[float, ...]
    """Edges of a box, radius and length of a cylinder or of the straight part of a capsule, radius of a sphere [m]; scale of a
    mesh along x, y, z; empty for others."""
    placement: Placement
    """Pose of its centre in the body."""
    rgba: tuple[float, ...] | None = None
    """Red, green, blue, opacity in [0, 1]; None if not given."""
    filename: str = ""
    """File of a mesh, as written in the description."""
    name: str = ""
    """Name; empty if it has none."""


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body: a link."""

    name: str
    """Name."""
    mass: float
    """Mass [kg]; 0 if the description gives none."""
    centre: Placement
    """Centre of mass, and the axes in which `inertia` is written."""
    inertia: FloatArray
    """Inertia about the centre of mass in those axes, shape (3, 3) [kg m^2]."""
    visuals: tuple[Shape, ...] = ()
    """Visual shapes."""
    collisions: tuple[Shape, ...] = ()
    """Collision shapes."""

    @property
    def capsules(self) -> tuple[CapsuleTag, ...]:
        """Its round collision shapes as capsules; cylinders get round ends beyond their flat ones."""
        tags = []
        for shape in self.collisions:
            if shape.kind in ("sphere", "cylinder", "capsule"):
                along = (0.5 * shape.size[1] if shape.kind != "sphere" else 0.0) * shape.placement.rotation[:, 2]
                (x, y, z), (u, v, w) = ((shape.placement.position + sign * along + 0.0).tolist() for sign in (-1.0, 1.0))
                tags.append(CapsuleTag(self.name, (x, y, z), (u, v, w), shape.size[0]))
        return tuple(dict.fromkeys(tags))

    @property
    def inertia_in_body(self) -> FloatArray:
        """Inertia about the centre of mass in the axes of the body itself, shape (3, 3) [kg m^2]."""
        return self.centre.rotation @ self.inertia @ self.centre.rotation.T


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint, movable or fixed."""

    name: str
    """Name."""
    kind: str
    """Type: "revolute", "continuous", "prismatic", "fixed", or another one as written in the description."""
    parent: str
    """Name of the parent body."""
    child: str
    """Name of the child body, whose frame is that of the joint."""
    placement: Placement
    """Pose of the child in the parent with the joint at zero."""
    axis: FloatArray
    """Unit axis in the child, shape (3,)."""
    limits: tuple[float, float]
    """Lowest and highest coordinate [rad or m]; infinite where there is none."""
    effort: float
    """Largest torque or force [N m or N]."""
    velocity: float
    """Largest speed [rad/s or m/s]."""
    damping: float
    """Viscous damping [N m s/rad or N s/m]."""
    friction: float = 0.0
    """Dry friction [N m or N]."""
    rotor_inertia: float = 0.0
    """Inertia of the rotor of a motor at the joint [kg m^2 or kg]."""

    @property
    def movable(self) -> bool:
        """Whether it is not fixed."""
        return self.kind != "fixed"

    def placement_at(self, position: float) -> Placement:
        """Pose of the child in the parent with the joint at a position [rad or m]."""
        return self.placement @ Placement.moved(self.kind, self.axis, position)


@dataclass(frozen=True, eq=False)
class RigidTree:
    """Bodies and joints of one robot."""

    name: str
    """Name of the robot."""
    bodies: tuple[Body, ...]
    """Bodies, each before its children."""
    joints: tuple[Joint, ...]
    """Joints, each before those of its child."""
    springs: Mapping[str, SpringTag]
    """Joint springs by joint name."""
    tip: str | None = None
    """Body that is the tip by default; None if the description names none."""
    capsules: tuple[CapsuleTag, ...] = ()
    """Capsules that hold the bodies."""

    @property
    def root(self) -> str:
        """Name of the root body."""
        return self.bodies[0].name

    def body(self, name: str) -> Body:
        """Return the body of that name."""
        return next(body for body in self.bodies if body.name == name)

    def joints_of(self, body: str) -> tuple[Joint, ...]:
        """Return the joints whose parent is that body."""
        return tuple(joint for joint in self.joints if joint.parent == body)


def capsule_shape(tag: CapsuleTag) -> Shape:
    """Return a capsule as a shape of its link; one whose core is a point as a sphere."""
    start, end = np.array(tag.start), np.array(tag.end)
    turn = np.asarray(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start).toRotationMatrix())
    length = float(np.linalg.norm(end - start))
    placement = Placement(read_only(0.5 * (start + end)), read_only(turn) if length else _NO_ROTATION)
    return Shape("capsule" if length else "sphere", (tag.radius, length) if length else (tag.radius,), placement)


def number_text(values: Iterable[float]) -> str:
    """Return numbers separated by spaces, with all digits."""
    return " ".join(repr(float(value) + 0.0) for value in values)  # without -0.0
