"""What touches in an exported file: the capsules of a robot and the obstacles around it, in place of the shapes of its URDF.

Statics has rigid contact of capsules with obstacles (`softrobots.statics.contact`). Simulators have stiff springs there; each
exporter says how stiff. The collision shapes of the URDF are left out, because they are others, and shorter.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

from softrobots.core.checks import non_negative_number, read_only
from softrobots.core.errors import ParameterError
from softrobots.description.rigid_tree import Placement, RigidTree, Shape, capsule_shape
from softrobots.description.urdf_tags import CapsuleTag
from softrobots.environment.capsules import capsule_tags
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.cores import cores_of
from softrobots.environment.environment import fixed_environment
from softrobots.environment.obstacles import Box, HalfSpace, Obstacle
from softrobots.environment.self_contact import self_contact_pairs
from softrobots.model.soft_model import SoftModel

_COLOUR = (0.72, 0.72, 0.68, 1.0)  # of obstacles


@dataclass(frozen=True, eq=False)
class ContactShapes:
    """Obstacles, fixed in the world, and who collides."""

    obstacles: Mapping[str, Shape]
    """Shape by name of the obstacle; "plane" has its surface at z = 0 and nothing above it, "capsule" radius and length."""
    meshes: Mapping[str, Mesh]
    """Those whose shape is a "mesh", by name."""
    friction: float
    """Coefficient of friction."""
    apart: tuple[tuple[str, str], ...] | None
    """Links of the robot that do not collide with each other, in pairs; None for all of them."""

    @property
    def remark(self) -> str:
        """What touches, for the head of the file."""
        among = "and not each other" if self.apart is None else "and, but for neighbours, each other"
        slip = f"with the coefficient of friction {self.friction!r}" if self.friction else "without friction"
        return f"Capsules of the robot touch {', '.join(self.obstacles)} {among}, {slip}."


def contact_shapes(model: SoftModel, environment: Any, friction: Any) -> ContactShapes | None:
    """Return the obstacles of an environment as shapes; None for no environment.

    Raises:
        ParameterError: If it is no environment, an obstacle of it moves, or friction is negative, or given for no environment.
        DescriptionError: If the robot has no capsules.
    """
    coefficient = non_negative_number("friction", friction, "-")
    if environment is None:
        if coefficient:
            raise ParameterError("friction", friction, "left out, or given with an environment")
        return None
    checked = fixed_environment(environment)
    return ContactShapes(
        obstacles={str(obstacle.name): _shape(obstacle) for obstacle in checked},
        meshes={str(obstacle.name): obstacle for obstacle in checked if isinstance(obstacle, Mesh)},
        friction=coefficient,
        apart=_apart(model) if checked.self_contact else None,
    )


def with_capsules(tree: RigidTree, capsules: Sequence[CapsuleTag]) -> RigidTree:
    """Return the robot with its capsules in place of its collision shapes."""
    shapes: dict[str, list[Shape]] = {}
    for capsule in capsules:
        shapes.setdefault(capsule.link, []).append(capsule_shape(capsule))
    return replace(tree, bodies=tuple(replace(body, collisions=tuple(shapes.get(body.name, ()))) for body in tree.bodies))


def _apart(model: SoftModel) -> tuple[tuple[str, str], ...]:
    """Links with capsules, in pairs, any of whose capsules may not touch each other (`self_contact_pairs`)."""
    cores = cores_of(model)
    links, capsules = [capsule.link for capsule in cores.capsules], Counter(tag.link for tag in capsule_tags(model))
    touching = Counter(frozenset((links[one], links[other])) for one, other in self_contact_pairs(model, cores).tolist())
    pairs = combinations(capsules, 2)
    return tuple((one, other) for one, other in pairs if touching[frozenset((one, other))] < capsules[one] * capsules[other])


def _shape(obstacle: Obstacle) -> Shape:
    transform = obstacle.transform_to_world
    placement = Placement(read_only(transform[:3, 3].copy()), read_only(transform[:3, :3].copy()))
    sizes = (getattr(obstacle, name, None) for name in ("radius", "length"))
    size: Any = obstacle.size if isinstance(obstacle, Box) else (1.0, 1.0, 1.0) if isinstance(obstacle, Mesh) else sizes
    kind = "plane" if isinstance(obstacle, HalfSpace) else obstacle.kind
    return Shape(kind, tuple(float(value) for value in size if value is not None), placement, _COLOUR)
