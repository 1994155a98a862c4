"""Obstacles from files: worlds in URDF, SDF or MJCF, and plain data in YAML or JSON."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.bounded_reading import read_text
from softrobots.core.checks import finite_array
from softrobots.core.errors import DescriptionError, FileFormatError, ParameterError
from softrobots.core.json_text import parse_json
from softrobots.core.xml_input import read_xml
from softrobots.core.yaml_text import parse_yaml
from softrobots.description.mesh_files import with_absolute_paths
from softrobots.description.readers import read_world
from softrobots.description.rigid_tree import Placement, RigidTree, Shape
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere

PLAIN_DATA = (".yaml", ".yml", ".json")
"""What names of files of plain data end with."""
LARGEST_FILE = 10_000_000
"""Largest size of a file of plain data [bytes]."""
_NAMED = 4  # joints in an error
MOST_OBSTACLES = 1000
"""Most obstacles of a file."""

_DEEPEST, _MOST_VALUES = 6, 50_000  # of YAML: rows of corners in an obstacle in the list
_READ = ("box", "cylinder", "sphere", "capsule", "mesh", "plane")


def read_plain_data(file: Path) -> Any:
    """Return the data of a file in YAML, or JSON if its name ends so, with files of meshes relative to it.

    Raises:
        FileFormatError: If it cannot be read.
    """
    text = read_text(file, LARGEST_FILE)
    json = file.suffix.lower() == ".json"
    try:
        return _beside(parse_json(text) if json else parse_yaml(text, deepest=_DEEPEST, most=_MOST_VALUES), file.parent)
    except FileFormatError as error:
        raise FileFormatError(f"cannot read obstacles from {file}: {error}") from error


def read_obstacles(file: Path, *, hull: bool = False) -> list[Obstacle]:
    """Return the collision shapes of a world in URDF, SDF or MJCF as obstacles; see `Environment.from_file`.

    Raises:
        DescriptionError: If it cannot be read, has no collision shapes or one that is not read, or a joint moves.
        MissingDependency: If MuJoCo or Drake is needed and not installed.
    """
    tree = read_world(with_absolute_paths(read_xml(file), file.parent), str(file), file)
    obstacles = _obstacles(tree, str(file), hull)
    if not obstacles:
        raise DescriptionError(f"{file} has no collision shapes; one or more are required: {', '.join(_READ)}")
    return obstacles


def _beside(data: Any, folder: Path) -> Any:
    """Plain data in which the relative files of meshes are those of a folder."""
    given = data.get("obstacles") if isinstance(data, dict) else None
    obstacles = given if isinstance(given, list) else []
    if len(obstacles) > MOST_OBSTACLES:
        raise FileFormatError(f"it has {len(obstacles)} obstacles; at most {MOST_OBSTACLES} are read")
    for one in obstacles:
        name = one.get("vertices") if isinstance(one, dict) else None
        if isinstance(name, str) and "://" not in name:
            one["vertices"] = str(folder / name)
    return data


def _obstacles(tree: RigidTree, source: str, hull: bool) -> list[Obstacle]:
    moving = [joint.name for joint in tree.joints if joint.movable]
    if moving:
        more = f" and {len(moving) - _NAMED} more" if len(moving) > _NAMED else ""
        raise DescriptionError(
            f"{source} has joints that move: {', '.join(moving[:_NAMED])}{more}; "
            "obstacles are fixed to the world: fixed joints only"
        )
    places = {tree.root: Placement()}
    for joint in tree.joints:  # parents first
        places[joint.child] = places[joint.parent] @ joint.placement
    shapes = [(body.name, number, shape) for body in tree.bodies for number, shape in enumerate(body.collisions, start=1)]
    if len(shapes) > MOST_OBSTACLES:
        raise DescriptionError(f"{source} has {len(shapes)} collision shapes; at most {MOST_OBSTACLES} are read")
    others = [
        f"{shape.kind} {shape.name!r} of {body}"
        for body, _, shape in shapes
        if shape.kind not in _READ or (shape.kind == "mesh" and not shape.filename)
    ]
    if others:
        raise DescriptionError(
            f"{source} has collision shapes that are not read: {', '.join(others)}; required: {', '.join(_READ)} (from a file)"
        )
    obstacles, shapes_of = [], Counter(body for body, _, _ in shapes)
    for body, number, shape in shapes:
        name = body if shapes_of[body] == 1 else f"{body}_{shape.name or number}"
        if body == "world":
            name = shape.name
        try:
            finite_array("position", shape.placement.position, (3,), "m")
            obstacles.append(_obstacle(shape, places[body] @ shape.placement, name or None, hull))
        except (ParameterError, FileFormatError) as error:
            raise DescriptionError(f"{source}: the collision shape {shape.name or number} of {body}: {error}") from error
    return obstacles


def _obstacle(shape: Shape, place: Placement, name: str | None, hull: bool) -> Obstacle:
    where: dict[str, Any] = {"name": name, "position": place.position}
    if shape.kind == "plane":
        normal = place.rotation[:, 2]
        return HalfSpace(normal, float(normal @ place.position), name=name)
    if shape.kind == "sphere":
        return Sphere(*shape.size, **where)
    where["rotation"] = place.rotation
    if shape.kind == "box":
        return Box(shape.size, **where)
    if shape.kind == "mesh":
        return Mesh(shape.filename, scale=np.array(shape.size), hull=hull, **where)
    return (Cylinder if shape.kind == "cylinder" else Capsule)(*shape.size, **where)
