r"""Assembly of bodies and joints of another format into a `RigidTree` for URDF.

In URDF a link has one parent joint, at its origin. In other formats joints have anchors, and a body may have several joints:

.. math:: X_{PB}(q) = A_1 J_1(q_1) A_2 J_2(q_2) \ldots A_n J_n(q_n) C

with `A_i` from one joint frame to the next and `C` from the last one to the body. Each `J_i` but the last gets an extra link. A
last hinge with `C` off its axis gets one too, to which the body is fixed; otherwise `C` is moved before `J_n`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from softrobots.core.checks import LARGEST, FloatArray, read_only
from softrobots.core.errors import DescriptionError
from softrobots.description.readers.shared_mass import give_mass, gyration, small_ball
from softrobots.description.rigid_tree import Body, Joint, Placement, RigidTree
from softrobots.description.urdf_tags import SpringTag

_ROUNDING = 1e-12  # [m]; a joint nearer to the origin of its body counts as at it
_UNIT = 1e-6  # tolerance of the length of an axis
_X_AXIS = read_only(np.array([1.0, 0.0, 0.0]))


class TreeBuilder:
    """Collects bodies and joints, parents first."""

    def __init__(
        self, name: str, source: str, bodies: Iterable[str], joints: Iterable[str], springs: Mapping[str, SpringTag]
    ) -> None:
        """Start with an empty world.

        Args:
            name: Name of the robot.
            source: Its origin, for errors.
            bodies: Names of all bodies; extra links get other names.
            joints: Names of all joints.
            springs: Springs by name of the joint.

        Raises:
            DescriptionError: If a name in the file is also generated for an unnamed or nested part.
        """
        bodies, joints = list(bodies), list(joints)
        for names in (bodies, joints):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise DescriptionError(
                    f"{source} has a name {', '.join(twice)} that is also generated for an unnamed or nested part; "
                    "choose another"
                )
        self._name, self._source = name, source
        self._links, self._names = {"world", *bodies}, set(joints)
        self._bodies: list[Body] = [Body("world", 0.0, Placement(), read_only(np.zeros((3, 3))))]
        self._joints: list[Joint] = []
        self._springs = springs
        self._moving: set[str] = set()
        self._carriers: set[str] = set()

    def draw_on_world(self, world: Body) -> None:
        """Copy the shapes of a body to the world."""
        self._bodies[0] = replace(self._bodies[0], visuals=world.visuals, collisions=world.collisions)

    def add(self, body: Body, parent: str, joints: Sequence[Joint], end: Placement) -> None:
        """Add a body.

        Args:
            body: The body.
            parent: Its parent body.
            joints: Degrees of freedom from the parent to it, each placed in the frame of the previous one; none if it is fixed.
            end: Pose of the body in the frame of the last of them, or in its parent.

        Raises:
            DescriptionError: If a number is not finite, or the axis of a joint is no unit vector (its length overflows).
        """
        self._check(f"the body {body.name}", body.mass, body.centre.position, body.centre.rotation, body.inertia)
        self._check(f"the body {body.name}", end.position, end.rotation)
        for joint in joints:
            bounds = np.array([bound for bound in joint.limits if not np.isinf(bound)])
            self._check(f"the joint {joint.name}", joint.placement.position, joint.placement.rotation, joint.axis, bounds)
            self._check(f"the joint {joint.name}", joint.damping, joint.friction, joint.rotor_inertia)
            if not abs(np.linalg.norm(joint.axis) - 1.0) <= _UNIT:
                raise DescriptionError(
                    f"{self._source}: the joint {joint.name} has the axis {joint.axis.tolist()}; a direction is required"
                )
        self._carriers.add(parent)
        if joints or parent in self._moving:
            self._moving.add(body.name)
        if not joints:
            self._fix(body, parent, end)
            return
        last = joints[-1]
        beside = last.kind == "revolute" and float(np.linalg.norm(np.cross(last.axis, end.position))) > _ROUNDING
        if not beside:
            turned = end.rotation.T @ last.axis
            axis = read_only(turned / np.linalg.norm(turned))
            last, end = replace(last, placement=last.placement @ end, axis=axis), Placement()
        joints = [*joints[:-1], last]
        body, shares = self._shared(body, joints, end)
        for joint, mass, following in zip(joints[:-1], shares, joints[1:], strict=True):
            name = self._free_name(self._links, f"{body.name}_{joint.name}")
            self._bodies.append(small_ball(name, mass, following.placement.position, gyration(body)))
            self._move(joint, parent, name)
            parent = name
        if beside:
            name = self._free_name(self._links, f"{body.name}_{last.name}")
            self._bodies.append(small_ball(name, 0.0, np.zeros(3), 0.0))
            self._move(last, parent, name)
            self._fix(body, name, end)
        else:
            self._bodies.append(body)
            self._move(last, parent, body.name)

    def add_frame(self, name: str, parent: str, placement: Placement) -> None:
        """Add a link without mass that marks a frame on a body, unless another link has its name."""
        if name in self._links:
            return
        self._links.add(name)
        self._fix(small_ball(name, 0.0, np.zeros(3), 0.0), parent, placement)

    def tree(self) -> RigidTree:
        """Return the tree; its tip is the link called `tip`, or the only moving body without children.

        Raises:
            DescriptionError: If there are no bodies, and nothing stands on the world.
        """
        if len(self._bodies) == 1 and not self._bodies[0].collisions:
            raise DescriptionError(f"{self._source} has no bodies")
        ends = self._moving - self._carriers
        tip = "tip" if "tip" in self._links else next(iter(ends)) if len(ends) == 1 else None
        return RigidTree(self._name, tuple(self._bodies), tuple(self._joints), dict(self._springs), tip)

    def _shared(self, body: Body, joints: Sequence[Joint], end: Placement) -> tuple[Body, list[float]]:
        """Move mass from the body to each link before the last hinges whose axes meet at one point."""
        takers = 0
        for joint in reversed(joints[1:]):
            if joint.kind != "revolute":
                break
            takers += 1
            if np.any(joint.placement.position):
                break
        point = -end.rotation.T @ end.position
        lighter, each = give_mass(body, point, takers)
        return lighter, [0.0] * (len(joints) - 1 - takers) + [each] * takers

    def _move(self, joint: Joint, parent: str, child: str) -> None:
        effort, velocity = (value if value > 0.0 else LARGEST for value in (joint.effort, joint.velocity))
        self._joints.append(replace(joint, parent=parent, child=child, effort=effort, velocity=velocity))

    def _fix(self, body: Body, parent: str, placement: Placement) -> None:
        self._bodies.append(body)
        name = self._free_name(self._names, f"{body.name}_fixed")
        self._joints.append(Joint(name, "fixed", parent, body.name, placement, _X_AXIS, (0.0, 0.0), 0.0, 0.0, 0.0))

    def _check(self, what: str, *values: FloatArray | float) -> None:
        if not all(np.all(np.abs(value) <= LARGEST) for value in values):
            raise DescriptionError(f"{self._source}: {what} has a number that is not finite or above {LARGEST:g} in size")

    @staticmethod
    def _free_name(taken: set[str], wanted: str) -> str:
        name, number = wanted, 1
        while name in taken:
            number += 1
            name = f"{wanted}_{number}"
        taken.add(name)
        return name
