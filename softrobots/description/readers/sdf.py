"""Reader of SDF, the format of Gazebo, from the plant that Drake's parser builds.

Drake resolves poses, frames and nested models. `spring_stiffness` and `spring_reference` of revolute, continuous and prismatic
joints become springs; other movable joints are motors. Coordinates are those of the SDF joints. The gravity of a world is not
read.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import read_only
from softrobots.core.errors import DescriptionError, MissingDependency
from softrobots.core.xml_input import parse_xml
from softrobots.description.readers.sdf_shapes import collision_shapes, placement_of, visible_shapes
from softrobots.description.readers.sdf_text import warnings_of_drake, without_drawings
from softrobots.description.readers.tree_builder import TreeBuilder
from softrobots.description.rigid_tree import Body, Joint, Placement, RigidTree
from softrobots.description.urdf_structure import MOST_LINKS
from softrobots.description.urdf_tags import SpringTag

_MOST = {"link": MOST_LINKS, "model": 100, "frame": 1000}  # Drake takes 10 ms for a model, and for frames their number squared
_KINDS = {"revolute": "revolute", "prismatic": "prismatic", "weld": "fixed"}


class _Edge(NamedTuple):
    """A joint of Drake directed away from the world; `reversed` if the file has parent and child the other way round."""

    joint: Any
    parent: Any
    child: Any
    reversed: bool


def read_sdf(text: str, source: str, path: Path | None = None) -> RigidTree:
    """Read SDF into a tree with the root link `world`.

    One model of the file may move; static models are fixed to the world. Links, joints and frames keep their names; those of
    nested models, and of static ones beside the robot, get the name of the model in front, `arm__link`. A joint away from the
    origin of its child link gets a link without mass. Frames of the file become links without mass. The tip is the link or
    frame called `tip`, or the only moving link at an end of the tree. Visible boxes, cylinders, spheres and existing mesh files
    are read, and capsules as cylinders; of collision shapes all kinds, those that nothing here reads by their kind alone.
    Contacts, plugins and controllers are ignored.

    The arguments are those of `softrobots.description.readers.to_urdf`.

    Raises:
        MissingDependency: If Drake is not installed (extra `interop`).
        DescriptionError: If Drake refuses it, or finds no model or an invalid inertia; if several models move or a body is not
            fixed to the world; if bodies form a loop; or if it has other joints than revolute, continuous, prismatic and fixed
            ones, other force elements than springs, constraints, or a feature listed in
            `softrobots.description.readers.sdf`.
    """
    with MissingDependency.of_imports("drake", "interop"):
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
    root = parse_xml(text, source)
    for kind, most in _MOST.items():
        count = sum(1 for _ in root.iter(kind))
        if count > most:
            raise DescriptionError(f"{source} has {count} {kind}s; at most {most} are read")
    reasons = _not_carried(root)
    plant = MultibodyPlant(1e-3)  # discrete, because continuous plants refuse constraints
    if not reasons:
        try:
            with warnings_of_drake(shown=True) as warnings:
                Parser(plant).AddModelsFromString(without_drawings(text), "sdf")
        except (Exception, SystemExit) as error:  # RuntimeError, or SystemExit for its assertions
            raise DescriptionError(f"Drake refuses {source}: {' '.join(str(error).split())}") from error
        reasons = [*_not_supported(plant), *(line for line in warnings if "invalid inertia" in line)]
    if reasons:
        raise DescriptionError(f"{source} has features that a robot of springs and motors lacks: {'; '.join(reasons)}")
    frames = {str(frame.get("name")) for frame in root.iter("frame")}
    return _tree(plant, source, frames, visible_shapes(text, path), collision_shapes(text, path))


def _tree(plant: Any, source: str, frames: set[str], *shapes: dict[str, list[Any]]) -> RigidTree:
    edges = _edges(plant, source)
    model = _moving_model(plant, edges, source)
    names = {edge.child.index(): _name(plant, edge.child, model) for edge in edges}
    names[plant.world_body().index()] = "world"
    joints = {edge.joint.index(): _name(plant, edge.joint, model) for edge in edges if edge.joint.num_velocities()}
    by_joint, actuators = _springs(plant), map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
    drives = {one.joint().index(): (float(one.effort_limit()), float(one.default_reflected_inertia())) for one in actuators}
    springs = {name: by_joint[index] for index, name in joints.items() if index in by_joint}
    builder = TreeBuilder(model, source, names.values(), joints.values(), springs)
    for edge in edges:
        ends = names[edge.parent.index()], names[edge.child.index()]
        moving, end = _joints(edge, joints.get(edge.joint.index(), ""), ends, drives)
        builder.add(_body(edge.child, ends[1], shapes), ends[0], moving, end)
    for frame in _items(plant.get_frame, "FrameIndex", plant.num_frames()):
        if frame.name() in frames and not frame.is_body_frame():
            place = placement_of(frame.GetFixedPoseInBodyFrame())
            builder.add_frame(_name(plant, frame, model), names[frame.body().index()], place)
    return builder.tree()


def _edges(plant: Any, source: str) -> list[_Edge]:
    """Joints from the world outwards; every body is the child of exactly one."""
    remaining = list(_items(plant.get_joint, "JointIndex", plant.num_joints()))
    reached, edges = {plant.world_body().index()}, []
    while True:
        joint = next((j for j in remaining if {j.parent_body().index(), j.child_body().index()} & reached), None)
        if joint is None:
            break
        remaining.remove(joint)
        backward = joint.child_body().index() in reached
        if backward and joint.parent_body().index() in reached:
            raise DescriptionError(f"{source} has a loop of bodies that joint {joint.name()} closes; a tree is required")
        near, far = (joint.parent_body(), joint.child_body())[:: -1 if backward else 1]
        reached.add(far.index())
        edges.append(_Edge(joint, near, far, backward))
    bodies = _items(plant.get_body, "BodyIndex", plant.num_bodies())
    loose = [body.scoped_name().get_full() for body in bodies if body.index() not in reached]
    if loose:
        some = ", ".join(loose[:5]) + (", ..." if len(loose) > 5 else "")
        raise DescriptionError(
            f"{source} has bodies that are not fixed to the world ({some}): a floating base has no equilibrium under load; add "
            "a fixed joint with the parent world"
        )
    return edges


def _moving_model(plant: Any, edges: list[_Edge], source: str) -> str:
    """Name of the one model that has movable joints, or of the first one if nothing moves."""
    models = [(_models_of(plant, edge.child)[0], edge.joint.num_velocities() > 0) for edge in edges]
    moving = list(dict.fromkeys(name for name, moves in models if moves))
    if len(moving) > 1:
        raise DescriptionError(f"{source} has {len(moving)} models that move ({', '.join(moving)}); one is required in a file")
    if not models:
        raise DescriptionError(f"{source} has no models with links")
    return moving[0] if moving else models[0][0]


def _not_supported(plant: Any) -> Iterator[str]:
    for joint in _items(plant.get_joint, "JointIndex", plant.num_joints()):
        if joint.type_name() not in _KINDS:
            supported = "revolute, continuous, prismatic and fixed ones are supported"
            yield f"joint {joint.name()} of kind {joint.type_name()} ({supported})"
    for element in _items(plant.get_force_element, "ForceElementIndex", plant.num_force_elements()):
        kind = type(element).__name__
        if kind not in ("UniformGravityFieldElement", "RevoluteSpring", "PrismaticSpring"):
            yield f"a force element {kind} (only joints have springs)"
    if plant.num_constraints():
        yield f"{plant.num_constraints()} constraints (loops and couplings are not supported)"


def _joints(
    edge: _Edge, name: str, ends: tuple[str, str], drives: dict[Any, tuple[float, float]]
) -> tuple[list[Joint], Placement]:
    """The joint of an edge, if it moves, and the pose of its child in the joint, or in the parent."""
    joint = edge.joint
    start = placement_of(joint.frame_on_parent().GetFixedPoseInBodyFrame())
    end = placement_of(joint.frame_on_child().GetFixedPoseInBodyFrame())
    if joint.num_velocities() == 0:
        joined = start @ placement_of(joint.X_FM()) @ end.inverse
        return [], joined.inverse if edge.reversed else joined
    axis = np.array(joint.revolute_axis() if joint.type_name() == "revolute" else joint.translation_axis())
    if edge.reversed:  # the same motion with parent and child exchanged
        start, end, axis = end, start, -axis
    effort, rotor_inertia = drives.get(joint.index(), (np.inf, 0.0))
    moving = Joint(
        name,
        _KINDS[joint.type_name()],
        *ends,
        start,
        axis,
        (float(joint.position_lower_limits()[0]), float(joint.position_upper_limits()[0])),
        effort,
        float(joint.velocity_upper_limits()[0]),
        float(joint.default_damping_vector()[0]),
        rotor_inertia=rotor_inertia,
    )
    return [moving], end.inverse


def _springs(plant: Any) -> dict[Any, SpringTag]:
    springs = {}
    for element in _items(plant.get_force_element, "ForceElementIndex", plant.num_force_elements()):
        if type(element).__name__ not in ("RevoluteSpring", "PrismaticSpring"):
            continue
        rest = "nominal_angle" if type(element).__name__ == "RevoluteSpring" else "nominal_position"
        stiffness, reference = (  # names differ between versions of Drake and kinds of springs
            float((getattr(element, f"default_{field}", None) or getattr(element, field))()) for field in ("stiffness", rest)
        )
        if stiffness > 0.0:
            springs[element.joint().index()] = SpringTag(stiffness, reference)
    return springs


def _body(body: Any, name: str, shapes: Sequence[dict[str, list[Any]]]) -> Body:
    inertia = body.default_spatial_inertia()
    mass = float(inertia.get_mass())
    drawn = [tuple(of_kind.get(body.scoped_name().get_full(), ())) for of_kind in shapes]
    if mass == 0.0:
        return Body(name, 0.0, Placement(), read_only(np.zeros((3, 3))), *drawn)
    about_centre = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    return Body(name, mass, Placement(read_only(np.array(inertia.get_com()))), read_only(np.array(about_centre)), *drawn)


def _name(plant: Any, element: Any, model: str) -> str:
    """Name of a body, joint or frame, after the names of its models below the robot's own."""
    models = _models_of(plant, element)
    return "__".join([*(models[1:] if models[0] == model else models), str(element.name())])


def _models_of(plant: Any, element: Any) -> list[str]:
    """Names of the models that contain a body, joint or frame, outermost first."""
    return str(plant.GetModelInstanceName(element.model_instance())).split("::")


def _items(get: Any, index: str, count: int) -> Iterator[Any]:
    from pydrake.multibody import tree

    return (get(getattr(tree, index)(number)) for number in range(count))


def _not_carried(root: ElementTree.Element) -> list[str]:
    """Return the unsupported features of a document, with reasons.

    Drake drops dry friction and mimic joints silently, ends the process at a negative stiffness or a NaN limit, and replaces a
    mass that is not positive by 1 kg.
    """
    found = []
    if next(root.iter("include"), None) is not None:
        found.append("included files (they cannot be checked before Drake reads them; `gz sdf -p` merges them)")
    for link in root.iter("link"):
        found += _features_of_link(link)
        if any(str(element.tag).endswith("deformable_properties") for element in link):
            found.append(f"the deformable link {link.get('name')} (a chain of joints with springs is supported)")
    for joint in root.iter("joint"):
        found += _features_of_joint(joint)
    return found


def _features_of_link(link: ElementTree.Element) -> list[str]:
    name, found = link.get("name", ""), []
    mass = link.find("inertial/mass")
    if mass is not None and not 0.0 < _number(mass) < math.inf:
        found.append(f"the mass {mass.text} of link {name} (a positive one is required)")
    for tag, usual, why in (
        ("gravity", "true", "every link has its full weight"),
        ("kinematic", "false", "loads move every link"),
    ):
        value = link.findtext(tag, usual).strip().lower()
        if value not in (usual, "1" if usual == "true" else "0"):
            found.append(f"<{tag}>{value}</{tag}> of link {name} ({why})")
    return found


def _features_of_joint(joint: ElementTree.Element) -> list[str]:
    name, found = joint.get("name", ""), []
    if any((element.text or "").strip().lower().lstrip("+-").startswith("nan") for element in joint.iter()):
        found.append(f"a NaN in joint {name}")
    for axis in (*joint.findall("axis"), *joint.findall("axis2")):
        stiffness, reference, friction = (
            _number(axis.find(f"dynamics/{name}")) for name in ("spring_stiffness", "spring_reference", "friction")
        )
        if not 0.0 <= stiffness < math.inf or not math.isfinite(reference):
            found.append(
                f"stiffness {stiffness:g} and rest {reference:g} of joint {name} (finite ones are required, not negative)"
            )
        elif stiffness > 0.0 and friction != 0.0:
            found.append(f"joint {name} with spring and dry friction (its equilibrium is not unique)")
        if axis.find("mimic") is not None:
            found.append(f"the mimic of joint {name} (couplings are not supported)")
    return found


def _number(element: ElementTree.Element | None) -> float:
    if element is None:
        return 0.0
    try:
        return float(element.text or "")
    except ValueError:
        return math.nan
