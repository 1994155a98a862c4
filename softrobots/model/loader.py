"""Loading of a robot as a `SoftModel`: URDF, MJCF or SDF, with springs from the file or from the caller."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass, replace
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.constant_curvature.strain_chain import joint_positions
from softrobots.core.checks import FloatArray, choice, finite_array, finite_number, positive_number
from softrobots.core.errors import DescriptionError, NameNotFound, ParameterError
from softrobots.description.sources import Robot, named_robot, read_source
from softrobots.description.tag_reader import read_tags
from softrobots.description.urdf_tags import RobotTags, SectionTag, SpringTag
from softrobots.model.assembly import assemble, reassemble
from softrobots.model.coordinates import rest_coordinates
from softrobots.model.dry_friction import FrictionMemory
from softrobots.model.friction_coordinates import grip_of, memory_of, remembering
from softrobots.model.muscles import MUSCLE_INPUTS
from softrobots.model.soft_model import SoftModel, check_model


def load_model(
    source: Robot | Path | str,
    *,
    springs: Mapping[str, float | tuple[float, float] | None] | None = None,
    motors: Sequence[str] | None = None,
    tip: str | None = None,
    muscles: str | None = None,
) -> SoftModel:
    """Load a robot of this package, also by its name in `ROBOTS`, or a URDF, MJCF or SDF file.

    The root tag decides which. MJCF (`stiffness`, `springref`; needs MuJoCo) and SDF (`spring_stiffness`,
    `spring_reference`; needs Drake) are translated: `urdf` of the model is the translation, coordinates are those of the file
    (`qpos`, joint angle). See `softrobots.description.readers.mjcf.read_mjcf` and `softrobots.description.readers.sdf.read_sdf`
    for names, and for elements that are refused because they affect the statics and are not supported. The gravity of a file is
    ignored: without `gravity=` the robot is weightless.

    Args:
        source: A robot of this package, its name ("inflatable_arm"; it wins over a file of that name, which `Path` means), a
            path (`Path` or text), or the text of a description (starting with `<`).
        springs: `{joint: stiffness}` or `{joint: (stiffness, rest)}` [N m/rad or N/m; rad or m], in place of the spring that
            the file gives that joint, if any; None takes it away, and the joint becomes a motor. A stiffness alone keeps the
            rest of the file (0 without one). The other springs of the file stay; `SoftModel.joint_roles` says what became of
            every joint. `{}` takes all springs away: a rigid robot.
        motors: Names of the motor joints; movable joints that are neither motor, spring nor part of a section are then locked
            at zero. By default every movable joint without a spring is a motor.
        tip: Name of the tip frame; by default the one in the file, else `tip`, else the only leaf of the tree.
        muscles: What `q_motors` holds of muscles of given length or tension: their "lengths" [m] or tensions, "forces" [N]; by
            default, and for muscles of other kinds, what the file says.

    Returns:
        The model.

    Raises:
        DescriptionError: If the file cannot be read, is of another kind or has unsupported elements, has no springs and none
            are given, has joints other than revolute, continuous and prismatic, has a spring on a fixed joint, would have a
            motor that mimics another joint, has a section whose joints are not the chain that its tag describes, has muscles
            of which some have given lengths and others not, or has several leaves and no tip.
        MissingDependency: If it is MJCF or SDF, and MuJoCo or Drake is not installed (extra `interop`).
        NameNotFound: If a named joint or frame does not exist.
        ParameterError: If a stiffness is not positive, a rest coordinate is not finite, a joint is named twice or belongs to a
            section, or `muscles` is not one of the choices.
    """
    if muscles is not None:
        choice("muscles", muscles, MUSCLE_INPUTS)
    source = named_robot(source)
    urdf, label = read_source(source)
    tags = read_tags(urdf, label)
    try:
        model = pin.buildModelFromXML(urdf)
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f"Pinocchio refuses {label}: {error} (its parser prints the reason on stderr)") from error
    movable = [name for name in model.names if name != "universe"]
    in_sections = {name for section in tags.sections for name in section.joints}
    free = [name for name in movable if name not in in_sections]
    spring_tags = dict(tags.springs) if springs is None else _given_springs(springs, free, tags.springs if springs else {})
    if springs is None and not spring_tags and not tags.sections:
        raise DescriptionError(
            f"{label} has no joint springs; give springs={{joint: stiffness}} for its movable joints "
            f"({', '.join(movable) or 'none'}), or springs={{}} for a rigid robot; "
            "in commands --spring JOINT=STIFFNESS"
        )
    stray = [name for name in (*spring_tags, *in_sections) if name not in movable]
    if stray:
        raise DescriptionError(
            f"{label} has a spring or a section on {', '.join(stray)}, which cannot move; movable: {', '.join(movable)}"
        )
    motor_names = _motor_names(motors, free, spring_tags, tags)
    coupled = [name for name in tags.mimics if name in motor_names or name in spring_tags or name in in_sections]
    if coupled:
        raise DescriptionError(
            f"{label} has joints that mimic others ({', '.join(coupled)}); they cannot be motors or springs: name the motors, "
            "motors=[...], and the rest is locked"
        )
    locked = [name for name in free if name not in spring_tags and name not in motor_names]
    if locked:
        model = pin.buildReducedModel(model, [model.getJointId(name) for name in locked], pin.neutral(model))
    _check_joints(model, label)
    if tags.sections:
        _check_sections(model, tags.sections, label)
    lumped = tuple(tag for tag in tags.lumped_sections if all(name in spring_tags for name in tag.joints.values()))
    if tags.muscles and len(lumped) < len(tags.lumped_sections):
        raise DescriptionError(f"{label} has muscles along lumped sections; each joint of those needs a spring")
    return assemble(
        model,
        urdf,
        replace(tags, lumped_sections=lumped),
        springs=spring_tags,
        motors=motor_names,
        tip=_tip(model, tags.tip if tip is None else tip, label),
        muscle_input=muscles,
        locked=locked,
        robot=source if is_dataclass(source) else None,
    )


def with_springs(model: SoftModel, springs: Mapping[str, float | tuple[float, float]]) -> SoftModel:
    """Return a robot with other springs, equal to loading it anew; neither xacro nor the URDF is read again.

    That is 10 to 100 times faster: tens of microseconds for an arm of two links; two milliseconds for muscles of given length
    along 90 hinges, whose free coordinates depend on the stiffness. The two models share Pinocchio's model and workspace.

    Args:
        model: The robot; it stays as it is.
        springs: As for `load_model`: `{joint: stiffness}`, which keeps the rest of the joint, or `{joint: (stiffness, rest)}`
            [N m/rad or N/m; rad or m]. The other springs stay; `{}` changes nothing.

    Returns:
        The model with these springs. Its `urdf` is the text that `model` was loaded from; exports and files have its springs.

    Raises:
        NameNotFound: If there is no such joint or it has no spring; the stiffness of sections of constant strain is that of the
            file.
        ParameterError: If `model` is not a `SoftModel`, a stiffness is not positive, or a rest coordinate is not finite.
        DescriptionError: If the springs of an inflated link with a largest moment would differ in stiffness.
    """
    structure = check_model(model).structure
    present = {name: SpringTag(*pair) for name, pair in model.spring_table.items()}
    return reassemble(model, _given_springs(springs, structure.spring_joints, present, removable=False))


def with_points(model: SoftModel, points: Mapping[str, tuple[str, Any]]) -> SoftModel:
    """Return a robot with further frames at points of its links: where forces act, or where the robot is touched.

    Each is a link without mass in the URDF text of the model, fixed to its link with the same axes: `frame=` of a load, of
    `estimate_load`, of files and other tools knows it by its name. The statics stays as it is.

    Args:
        model: The robot; it stays as it is.
        points: By the name of the frame, a link (or another frame of the file) and the point in its axes, shape (3,) [m].

    Returns:
        The model, loaded from that text; friction has no memory there, and `robot` is None.

    Raises:
        NameNotFound: If a link does not exist.
        ParameterError: If `model` is not a `SoftModel`, a name is taken or no text, or a point is not three finite numbers.
    """
    links = [frame.name for frame in check_model(model).pinocchio.frames if frame.type == pin.FrameType.BODY]
    if not isinstance(points, Mapping):
        raise ParameterError("points", points, "a mapping {name: (link, point)}")
    added = []
    for name, place in points.items():
        if not isinstance(name, str) or not name.isprintable() or not name or model.pinocchio.existFrame(name):
            raise ParameterError("points", name, "names that no frame or joint of the robot has")
        if not isinstance(place, tuple) or len(place) != 2:
            raise ParameterError(f"points[{name!r}]", place, "a link and a point of it, (link, (x, y, z))")
        if place[0] not in links:
            raise NameNotFound("link", str(place[0]), links)
        at = " ".join(map(repr, finite_array(f"points[{name!r}]", place[1], (3,), "m").tolist()))
        link, parent, joint = (f'"{escape(word)}"' for word in (name, place[0], f"{name}_joint"))
        added.append(f'  <link name={link}/>\n  <joint name={joint} type="fixed">\n    <parent link={parent}/>\n')
        added.append(f'    <child link={link}/>\n    <origin xyz="{at}"/>\n  </joint>\n')
    before, end, after = model.urdf.rpartition("</robot>")
    return load_again("".join([before, *added, end, after]), **load_arguments(model))


def _given_springs(
    springs: Any, joints: Sequence[str], present: Mapping[str, SpringTag], *, removable: bool = True
) -> dict[str, SpringTag]:
    """The springs that are present, changed as the caller says; a joint without one can be given one if it is in `joints`."""
    if not isinstance(springs, Mapping):
        raise ParameterError("springs", springs, "a mapping {joint: stiffness} or {joint: (stiffness, rest)}")
    tags = dict(present)
    for name, value in springs.items():
        if name not in joints:
            raise NameNotFound("movable joint" if removable else "joint with a spring", str(name), joints)
        if value is None and removable:
            tags.pop(name, None)
            continue
        kept = tags[name].rest if name in tags else 0.0
        stiffness, rest = value if isinstance(value, tuple | list) and len(value) == 2 else (value, kept)
        field = f"springs[{name!r}]"
        tags[name] = SpringTag(positive_number(field, stiffness, "N m/rad or N/m"), finite_number(field, rest, "rad or m"))
    return tags


def _motor_names(motors: Any, movable: Sequence[str], springs: Mapping[str, SpringTag], tags: RobotTags) -> list[str]:
    if motors is None:
        return [name for name in movable if name not in springs and tags.roles.get(name, "motor") != "locked"]
    if isinstance(motors, str) or not isinstance(motors, Sequence):
        raise ParameterError("motors", motors, "a list of joint names")
    for name in motors:
        if name not in movable:
            raise NameNotFound("movable joint", str(name), movable)
        if name in springs:
            raise ParameterError("motors", name, "a joint without a spring")
    if len(set(motors)) != len(motors):
        raise ParameterError("motors", motors, "names without repetition")
    return list(motors)


def _check_joints(model: Any, label: str) -> None:
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:  # the first is the universe
        if joint.nv != 1 or joint.nq not in (1, 2):
            raise DescriptionError(
                f"joint {name} of {label} is a {joint.shortname()}; revolute, continuous and prismatic joints are supported"
            )
        low, high = lower[joint.idx_q], upper[joint.idx_q]
        if joint.nq == 1 and low > high:
            raise DescriptionError(f"joint {name} of {label} has the lower limit {low} above the upper one, {high}")


def _check_sections(model: Any, sections: Sequence[SectionTag], label: str) -> None:
    """Refuse six joints that are not the chain of `strain_chain` with the rest shape of their section in its origins."""
    places = joint_positions(rest_coordinates(sections), np.array([section.bends for section in sections]))
    origins = np.tile(np.eye(4), (*places.shape, 1, 1))
    for place, axis in ((1, 1), (3, 0), (4, 1), (5, 2)):
        sine, cosine, (one, two) = np.sin(places[:, place]), np.cos(places[:, place]), ((axis + 1) % 3, (axis + 2) % 3)
        origins[:, place, one, one] = origins[:, place, two, two] = cosine
        origins[:, place, two, one], origins[:, place, one, two] = sine, -sine
    origins[:, 2, 2, 3] = chords = places[:, 2]
    numbers = [[model.getJointId(name) for name in section.joints] for section in sections]
    joints, parents, placements = model.joints, model.parents, model.jointPlacements
    found = np.array([[placements[number].homogeneous for number in row] for row in numbers])
    scale = np.where(np.arange(4) < 3, 1.0, chords[:, None])[:, None, None, :]  # of columns: three axes, one place
    there = np.all(np.abs(found - origins) <= 1e-9 * scale, axis=(2, 3))
    for section, row, as_told in zip(sections, numbers, there.tolist(), strict=True):
        for place, (number, kind) in enumerate(zip(row, ("RX", "RY", "PZ", "RX", "RY", "RZ"), strict=True)):
            if joints[number].shortname() != f"JointModel{kind}":
                problem = f"a {joints[number].shortname()}, required: JointModel{kind}"
            elif place > 0 and parents[number] != row[place - 1]:
                problem = f"not a child of joint {section.joints[place - 1]}"
            elif place > 0 and not as_told[place]:
                problem = "not where the rest shape of the section puts it"
            else:
                continue
            raise DescriptionError(f"joint {section.joints[place]} of section {section.name} of {label} is {problem}")


def _tip(model: Any, tip: str | None, label: str) -> str:
    if tip is not None:
        if not isinstance(tip, str) or not model.existFrame(tip):
            bodies = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
            raise NameNotFound("frame", str(tip), bodies)
        return tip
    if model.existBodyName("tip"):
        return "tip"
    parents = {frame.parentFrame for frame in model.frames}
    leaves = [frame.name for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY and i not in parents]
    if len(leaves) != 1:
        names = ", ".join(leaves[:20]) + (", ..." if len(leaves) > 20 else "")
        raise DescriptionError(f"{label} has {len(leaves)} ends ({names}); give the name of the tip frame, tip=...")
    return str(leaves[0])


def load_arguments(model: SoftModel) -> dict[str, Any]:
    """Return the arguments with which `load_again` builds a model again from its URDF text."""
    motors = model.structure.motor_joints
    return {"springs": model.spring_table, "motors": motors, "tip": model.tip, "muscles": model.muscle_input}


def load_again(urdf: str, *, springs: Mapping[str, tuple[float, float]], robot: Any = None, **arguments: Any) -> SoftModel:
    """Return the model of URDF text and `load_arguments`: its springs are all in `springs`, those of the text do not count."""
    model = load_model(urdf, springs=dict.fromkeys(read_tags(urdf).springs) | dict(springs), **arguments)
    return replace(model, robot=robot)


def _reduce(model: SoftModel) -> tuple[Any, ...]:
    load = partial(load_again, robot=model.robot, **load_arguments(model))
    if model.structure.friction is None:
        return load, (model.urdf,)
    return _load_remembering, (load, model.urdf, memory_of(model), grip_of(model))


def _load_remembering(load: Callable[[str], SoftModel], urdf: str, memory: FrictionMemory, grip: FloatArray) -> SoftModel:
    return remembering(load(urdf), memory, grip)


copyreg.pickle(SoftModel, _reduce)  # as URDF text and arguments; Pinocchio's workspaces are not pickled
