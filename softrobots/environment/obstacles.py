"""Obstacles: rigid convex bodies, fixed in the world or moved by a given pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from softrobots.core.checks import (
    FloatArray,
    finite_array,
    finite_number,
    positive_array,
    positive_number,
    read_only,
    unit_vector,
)
from softrobots.core.errors import ParameterError
from softrobots.core.vectors import axes_along

Pose = Callable[[float], Any]
"""A pose `transform_obstacle_to_world` of a parameter (time, stroke, ...): a `pinocchio.SE3` or an array, shape (4, 4)."""
Kind = TypeVar("Kind", bound="Obstacle")

NO_TURN = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_ROTATION_ERROR = 1e-9
_ROWS_SHOWN = 4  # of an array, in a line


def rotation_matrix(name: str, value: Any) -> FloatArray:
    """Return `value` as a rotation matrix, shape (3, 3), or raise ParameterError."""
    matrix = finite_array(name, value, (3, 3))
    error = float(np.abs(matrix.T @ matrix - np.eye(3)).max())
    if error > _ROTATION_ERROR or np.linalg.det(matrix) < 0.0:
        raise ParameterError(name, value, f"a rotation matrix, shape (3, 3) (R^T R differs from the identity by {error:.2g})")
    return matrix


def rigid_transform(name: str, value: Any) -> FloatArray:
    """Return a `pinocchio.SE3` or a rigid transform, shape (4, 4), as a read-only array, or raise ParameterError."""
    matrix = finite_array(name, getattr(value, "homogeneous", value), (4, 4))
    rotation_matrix(f"rotation of {name}", matrix[:3, :3])
    if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise ParameterError(name, value, "a rigid transform, shape (4, 4), whose last row is (0, 0, 0, 1)")
    return read_only(matrix)


def _transform(rotation: FloatArray, position: FloatArray) -> FloatArray:
    matrix: FloatArray = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, position
    return matrix


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Obstacle:
    """A rigid obstacle; equal, with the same hash, if everything that describes it is equal, and `pose` is the same function.

    `pose` acts on top of position and rotation (of the plane, for a half-space). It pickles if `pose` does: a function of a
    module, not a lambda.
    """

    name: str | None = None
    """Name; by default the kind and a number, such as `box_1`."""
    pose: Pose | Any | None = None
    """Motion of the obstacle, on top of where it is: a function of a parameter, or a fixed transform, shape (4, 4)."""

    kind: ClassVar[str] = "obstacle"

    def __post_init__(self) -> None:
        """Check what all obstacles have."""
        if self.name is not None and (not isinstance(self.name, str) or not self.name.strip()):
            raise ParameterError("name", self.name, "a text, or None")
        self._set("position", finite_array("position", getattr(self, "position", np.zeros(3)), (3,), "m"))
        self._set("rotation", rotation_matrix("rotation", getattr(self, "rotation", np.eye(3))))
        if self.pose is not None and not callable(self.pose):
            self._set("pose", rigid_transform("pose", self.pose))

    def _set(self, name: str, value: Any) -> None:
        if name in {one.name for one in fields(self)}:
            object.__setattr__(self, name, read_only(value) if isinstance(value, np.ndarray) else value)

    @property
    def moves(self) -> bool:
        """Whether its pose is a function of a parameter."""
        return callable(self.pose)

    def _check_fixed(self) -> None:
        if callable(self.pose):
            raise ParameterError("obstacle", self, "fixed: its pose is a function of a parameter (Environment.at fixes it)")

    @property
    def own_transform(self) -> FloatArray:
        """Frame of the shape in the frame that `pose` moves, shape (4, 4)."""
        return _transform(getattr(self, "rotation", np.eye(3)), getattr(self, "position", np.zeros(3)))

    @property
    def transform_to_world(self) -> FloatArray:
        """Frame of its shape (centre and axes; of a half-space: a point of the plane, z along the normal), shape (4, 4).

        Raises:
            ParameterError: If it moves: `at` fixes it.
        """
        self._check_fixed()
        return self.own_transform if self.pose is None else np.asarray(np.asarray(self.pose) @ self.own_transform)

    def at(self: Kind, parameter: float) -> Kind:
        """Return the obstacle fixed in the pose that it has at a value of the parameter.

        Raises:
            ParameterError: If `pose` returns no rigid transform.
        """
        if not callable(self.pose):
            return self
        return replace(self, pose=rigid_transform(f"pose({parameter!r}) of {self.name or self.kind}", self.pose(parameter)))

    def moved(self: Kind, transform: Any) -> Kind:
        """Return the obstacle moved by a rigid transform of the world, a `pinocchio.SE3` or shape (4, 4), on top of its pose.

        Raises:
            ParameterError: If it is no rigid transform, or if the obstacle is moved by a function.
        """
        self._check_fixed()
        moved = rigid_transform("transform", transform)
        return replace(self, pose=moved if self.pose is None else moved @ np.asarray(self.pose))

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data: its kind and fields, arrays as lists.

        Raises:
            ParameterError: If it moves: `at` fixes it.
        """
        self._check_fixed()
        pairs = ((one.name, getattr(self, one.name)) for one in fields(self) if one.init)
        plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in pairs}
        return {"kind": self.kind, **{name: value for name, value in plain.items() if value is not None}}

    def _content(self) -> tuple[Any, ...]:
        values = (getattr(self, one.name) for one in fields(self))
        return type(self), *(
            (value.shape, (value + 0.0).tobytes()) if isinstance(value, np.ndarray) else value for value in values
        )

    def __repr__(self) -> str:
        """What differs from the defaults, in one line; of a mesh the number of its vertices."""
        words = []
        for one in fields(self):
            value = getattr(self, one.name)
            if not one.init or (one.default is not MISSING and np.array_equal(value, one.default)):
                continue
            if isinstance(value, np.ndarray):
                value = f"<{len(value)} rows>" if len(value) > _ROWS_SHOWN else value.tolist()
            words.append(f"{one.name}={value if isinstance(value, str) and one.name != 'name' else repr(value)}")
        return f"{type(self).__name__}({', '.join(words)})"

    def __eq__(self, other: object) -> bool:
        """Whether the other is the same obstacle."""
        return isinstance(other, Obstacle) and self._content() == other._content()

    def __hash__(self) -> int:
        """Hash that fits `==`."""
        return hash(self._content())


@dataclass(frozen=True, eq=False, repr=False)
class HalfSpace(Obstacle):
    """A wall or floor: the robot is free where `normal . x >= offset`, with the unit normal."""

    normal: Any
    """Direction out of the wall, shape (3,); made a unit vector."""
    offset: float = 0.0
    """Distance of the plane from the origin along the unit normal, whatever the length of the one given [m]."""

    kind: ClassVar[str] = "half_space"

    def __post_init__(self) -> None:
        """Check the fields."""
        self._set("normal", unit_vector("normal", self.normal))
        self._set("offset", finite_number("offset", self.offset, "m"))
        super().__post_init__()

    @property
    def own_transform(self) -> FloatArray:
        """The point of the plane nearest to the origin, with z along the normal; shape (4, 4)."""
        return _transform(axes_along(self.normal), self.offset * self.normal)


@dataclass(frozen=True, eq=False, repr=False)
class Sphere(Obstacle):
    """A ball."""

    radius: float
    """Radius [m]."""
    position: Any = (0.0, 0.0, 0.0)
    """Centre, world axes, shape (3,) [m]."""

    kind: ClassVar[str] = "sphere"

    def __post_init__(self) -> None:
        """Check the fields."""
        self._set("radius", positive_number("radius", self.radius, "m"))
        super().__post_init__()


@dataclass(frozen=True, eq=False, repr=False)
class Box(Obstacle):
    """A rectangular block."""

    size: Any
    """Length of its edges along its own x, y and z, shape (3,) [m]."""
    position: Any = (0.0, 0.0, 0.0)
    """Centre, world axes, shape (3,) [m]."""
    rotation: Any = NO_TURN
    """Its own axes as columns, shape (3, 3)."""

    kind: ClassVar[str] = "box"

    def __post_init__(self) -> None:
        """Check the fields."""
        finite_array("size", self.size, (3,), "m")
        self._set("size", positive_array("size", self.size, "m"))
        super().__post_init__()


@dataclass(frozen=True, eq=False, repr=False)
class _Round(Obstacle):
    """A body of revolution about its own z axis."""

    radius: float
    """Radius [m]."""
    length: float
    """Length along its own z axis [m]; of a capsule: of the straight part, between the centres of the round ends."""
    position: Any = (0.0, 0.0, 0.0)
    """Centre, world axes, shape (3,) [m]."""
    rotation: Any = NO_TURN
    """Its own axes as columns, shape (3, 3)."""

    def __post_init__(self) -> None:
        """Check the fields."""
        self._set("radius", positive_number("radius", self.radius, "m"))
        self._set("length", positive_number("length", self.length, "m"))
        super().__post_init__()


@dataclass(frozen=True, eq=False, repr=False)
class Cylinder(_Round):
    """A cylinder with flat ends, along its own z axis."""

    kind: ClassVar[str] = "cylinder"


@dataclass(frozen=True, eq=False, repr=False)
class Capsule(_Round):
    """A cylinder with round ends, along its own z axis; `length` is that of the straight part."""

    kind: ClassVar[str] = "capsule"
