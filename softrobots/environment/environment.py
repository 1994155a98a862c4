"""The obstacles around a robot."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

from softrobots.core.checks import finite_number, instance_of
from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError
from softrobots.core.files import as_path
from softrobots.core.yaml_text import yaml_of
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from softrobots.environment.world_files import PLAIN_DATA, read_obstacles, read_plain_data

KINDS: dict[str, type[Obstacle]] = {kind.kind: kind for kind in (HalfSpace, Sphere, Box, Cylinder, Capsule, Mesh)}
"""Obstacles by their kind in plain data."""

_SHOWN = 6  # obstacles in a line


@dataclass(frozen=True, eq=False, repr=False)
class Environment:
    """The obstacles that a robot may touch, and whether it may touch itself.

    What a robot stands on it does not touch at its base: of an obstacle that holds an end of a capsule's core which no joint
    moves, ends within a radius of that one are no contacts. Such an end deeper inside than its radius is refused, and one
    inside of a box or cylinder, which the robot cannot leave without a contact.

    Immutable; equal, with the same hash, if the obstacles are equal, in the same order. It pickles if the poses do.
    """

    obstacles: Any = ()
    """The obstacles: a tuple, of any iterable."""
    self_contact: bool = False
    """Whether parts of the robot that are not neighbours keep apart; see `softrobots.environment.self_contact`."""

    def __post_init__(self) -> None:
        """Check the obstacles, and name those without a name."""
        if isinstance(self.obstacles, str | bytes | Mapping) or not isinstance(self.obstacles, Iterable):
            raise ParameterError("obstacles", self.obstacles, "a list of obstacles, such as [HalfSpace((0, 0, 1))]")
        given = tuple(self.obstacles)
        for place, one in enumerate(given):
            instance_of(f"obstacles[{place}]", one, Obstacle, f"an obstacle ({', '.join(k.__name__ for k in KINDS.values())})")
        instance_of("self_contact", self.self_contact, bool, "True or False")
        taken, named = {one.name for one in given}, []
        for one in given:
            if one.name is None:
                number = next(i for i in range(1, len(given) + 2) if f"{one.kind}_{i}" not in taken)
                one = replace(one, name=f"{one.kind}_{number}")
                taken.add(one.name)
            named.append(one)
        object.__setattr__(self, "obstacles", tuple(named))
        doubled = [name for name in self.names if self.names.count(name) > 1]
        if doubled:
            raise ParameterError("obstacles", self.names, f"of different names ({doubled[0]!r} comes more than once)")

    def __repr__(self) -> str:
        """Names and kinds of the first obstacles, and how many more there are, in one line."""
        words = [f"{one.name}: {type(one).__name__}" for one in self.obstacles[:_SHOWN]]
        if len(self) > _SHOWN:
            words.append(f"{len(self) - _SHOWN} more")
        return f"Environment({', '.join([*words, 'self_contact'] if self.self_contact else words)})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the obstacles, in order."""
        return tuple(one.name for one in self.obstacles)

    def __getitem__(self, name: str) -> Obstacle:
        """Return the obstacle of a name.

        Raises:
            NameNotFound: If there is none; the error lists the names.
        """
        for one in self.obstacles:
            if one.name == name:
                return one  # type: ignore[no-any-return]
        raise NameNotFound("obstacle", name, self.names)

    def __iter__(self) -> Iterator[Obstacle]:
        """Go through the obstacles."""
        return iter(self.obstacles)

    def __len__(self) -> int:
        """Number of obstacles."""
        return len(self.obstacles)

    def __eq__(self, other: object) -> bool:
        """Whether the other has the same obstacles."""
        return self is other or (isinstance(other, Environment) and self._identity == other._identity)

    def __hash__(self) -> int:
        """Hash that fits `==`."""
        return hash(self._identity)

    @cached_property
    def _identity(self) -> tuple[Any, ...]:
        return self.obstacles, self.self_contact

    @property
    def moves(self) -> bool:
        """Whether the pose of an obstacle is a function of a parameter."""
        return any(one.moves for one in self.obstacles)

    def at(self, parameter: float) -> Environment:
        """Return the environment with every obstacle fixed where it is at a value of the parameter of the poses.

        Raises:
            ParameterError: If the parameter is no finite number, or a pose no rigid transform.
        """
        number = finite_number("parameter", parameter)
        return replace(self, obstacles=tuple(one.at(number) for one in self.obstacles)) if self.moves else self

    def moved(self, name: str, transform: Any) -> Environment:
        """Return the environment with one obstacle moved by a rigid transform of the world.

        Args:
            name: Name of the obstacle, which must be fixed.
            transform: A `pinocchio.SE3`, or shape (4, 4), applied on top of where the obstacle is.

        Raises:
            NameNotFound: If there is no such obstacle.
            ParameterError: If it is no rigid transform, or if the obstacle is moved by a function.
        """
        chosen = self[name]
        after = chosen.moved(transform)
        return replace(self, obstacles=tuple(after if one is chosen else one for one in self.obstacles))

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data, for JSON or YAML.

        Raises:
            ParameterError: If an obstacle moves: `at` fixes it.
        """
        return {"obstacles": [one.to_dict() for one in self.obstacles], "self_contact": self.self_contact}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Environment:
        """Return the environment that `to_dict` returned.

        Raises:
            ParameterError: If the data has another form, or a value is invalid.
            NameNotFound: If there is no such kind of obstacle.
        """
        form = "as Environment.to_dict returns it: {'obstacles': [{'kind': 'box', 'size': ...}, ...], 'self_contact': ...}"
        if not isinstance(data, Mapping) or not {"obstacles"} <= data.keys() <= {"obstacles", "self_contact"}:
            raise ParameterError("data", data, form)
        if not isinstance(data["obstacles"], list | tuple) or not all(isinstance(one, Mapping) for one in data["obstacles"]):
            raise ParameterError("data['obstacles']", data["obstacles"], form)
        obstacles = []
        for one in data["obstacles"]:
            kind = one.get("kind")
            if not isinstance(kind, str) or kind not in KINDS:
                raise NameNotFound("kind of obstacle", str(kind), KINDS)
            known = {name.name for name in fields(KINDS[kind]) if name.init}
            values = {name: value for name, value in one.items() if name != "kind"}
            for name in values:
                if name not in known:
                    raise NameNotFound(f"field of a {kind}", name, sorted(known))
            try:
                obstacles.append(KINDS[kind](**values))
            except TypeError as error:  # a field is missing
                raise ParameterError("data['obstacles']", one, f"complete ({error})") from error
        return cls(obstacles, self_contact=data.get("self_contact", False))

    def to_yaml(self) -> str:
        """Return it as YAML, an obstacle a line, for a file that `from_file` reads.

        Raises:
            ParameterError: If an obstacle moves: `at` fixes it.
        """
        data = self.to_dict()
        lines = (f"  - {yaml_of(one)}\n" for one in data["obstacles"])
        return f"self_contact: {yaml_of(data['self_contact'])}\nobstacles:{' []' if not len(self) else ''}\n{''.join(lines)}"

    @classmethod
    def from_file(cls, path: str | os.PathLike[str], *, hull: bool = False) -> Environment:
        """Return the obstacles of a file: a world in URDF, SDF or MJCF, or plain data.

        Collision shapes of the world become obstacles, called after their links, and planes half-spaces. Boxes, spheres,
        cylinders, capsules (in URDF, those in the tags of this package) and mesh files are read; another shape is refused, and
        a joint that moves. MJCF is compiled by MuJoCo, SDF parsed by Drake (extra `interop`).

        Args:
            path: The file. One that ends with `.yaml`, `.yml` or `.json` is plain data, as `to_yaml` or `to_dict` returns it;
                mesh files in it, as `vertices`, are relative to it.
            hull: Whether a mesh of a world that is not convex is replaced by its convex hull; else it is refused.

        Raises:
            ParameterError: If `path` is no path.
            FileFormatError: If plain data cannot be read, has another form, or a value is invalid.
            DescriptionError: If a world cannot be read, has no collision shapes or one that is not read, or a joint moves.
            MissingDependency: If MuJoCo or Drake is needed and not installed.
        """
        file = as_path("path", path)
        if file.suffix.lower() not in PLAIN_DATA:
            return cls(read_obstacles(file, hull=hull))
        data = read_plain_data(file)
        try:
            return cls.from_dict(data)
        except (FileFormatError, NameNotFound, ParameterError) as error:
            raise FileFormatError(f"cannot read obstacles from {file}: {error}") from error


def check_environment(environment: Any) -> Environment:
    """Return `environment` if it is an `Environment`, or raise ParameterError."""
    return instance_of("environment", environment, Environment, "an Environment, such as Environment([HalfSpace((0, 0, 1))])")


def fixed_environment(environment: Any) -> Environment:
    """Return `environment` if it is one whose obstacles stand still, or raise ParameterError."""
    checked = check_environment(environment)
    moved = [str(obstacle.name) for obstacle in checked if obstacle.moves]
    if moved:
        requirement = f"one whose obstacles stand still, environment.at(parameter): {', '.join(moved)} would move"
        raise ParameterError("environment", environment, requirement)
    return checked
