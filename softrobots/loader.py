"""Loading a robot into a `SoftModel`: ours, or anybody's URDF with springs said by the caller."""

from __future__ import annotations

import copyreg
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pinocchio as pin

from softrobots.checks import finite_number, positive_number
from softrobots.description import RobotTags, SpringTag, read_tags
from softrobots.errors import DescriptionError, NameNotFound, ParameterError
from softrobots.model import SoftModel
from softrobots.robots import InflatableArm


def load_model(
    source: InflatableArm | Path | str,
    *,
    springs: Mapping[str, float | tuple[float, float]] | None = None,
    motors: Sequence[str] | None = None,
    tip: str | None = None,
) -> SoftModel:
    """Load a robot: ours, or anybody's URDF with springs said by the caller.

    Args:
        source: A robot of this package, a path (`Path` or text), or URDF text (starting with `<`).
        springs: For files without springs of their own: `{joint: stiffness}` or `{joint: (stiffness, rest)}`
            [N m/rad or N/m; rad or m]. Given, it replaces the springs in the file. `{}` says that the robot is rigid.
        motors: Names of the motor joints; movable joints that are neither motor nor spring are then locked at zero.
            By default every movable joint without a spring is a motor.
        tip: Name of the tip frame; by default `tip`, or the only link at the end of the tree.

    Returns:
        The model.

    Raises:
        DescriptionError: If the file cannot be read or is no URDF, has no springs and none are given, has joints other than
            revolute, continuous and prismatic, has a spring on a fixed joint, would have a motor that mimics another joint,
            or has no single end.
        NameNotFound: If a named joint or frame does not exist.
        ParameterError: If a stiffness is not positive, a rest coordinate is not finite, or a joint is named twice.
    """
    urdf, label = _read_source(source)
    tags = read_tags(urdf, label)
    try:
        model = pin.buildModelFromXML(urdf)
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f"Pinocchio refuses {label}: {error} (its parser prints the reason on stderr)") from error
    movable = [name for name in model.names if name != "universe"]
    spring_tags = _springs_said(springs, movable) if springs is not None else dict(tags.springs)
    if springs is None and not spring_tags:
        raise DescriptionError(
            f"{label} has no joint springs; give springs={{joint: stiffness}} for its movable joints "
            f"({', '.join(movable) or 'none'}), or springs={{}} for a rigid robot"
        )
    stray = [name for name in spring_tags if name not in movable]
    if stray:
        raise DescriptionError(f"{label} has a spring on {', '.join(stray)}, which cannot move; movable: {', '.join(movable)}")
    motor_names = _motors_said(motors, movable, spring_tags, tags)
    coupled = [name for name in tags.mimics if name in motor_names or name in spring_tags]
    if coupled:
        raise DescriptionError(
            f"{label} has joints that mimic others ({', '.join(coupled)}); they cannot be motors or springs: name the motors, "
            "motors=[...], and the rest is locked"
        )
    locked = [name for name in movable if name not in spring_tags and name not in motor_names]
    if locked:
        model = pin.buildReducedModel(model, [model.getJointId(name) for name in locked], pin.neutral(model))
    _check_joints(model, label)
    groups = [link for link in tags.inflated_links if all(name in spring_tags for name in link.springs)]
    return SoftModel(
        pinocchio_model=model,
        urdf=urdf,
        springs=spring_tags,
        motors=motor_names,
        inflated_links=groups,
        tip=_tip(model, tip, label),
    )


def _read_source(source: Any) -> tuple[str, str]:
    """Return URDF text and a label for errors."""
    if not isinstance(source, type) and callable(getattr(source, "urdf", None)):
        return str(source.urdf()), type(source).__name__
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return source.lstrip("\ufeff \t\r\n"), "the URDF text"
    if not isinstance(source, str | Path):
        raise ParameterError("source", source, "a robot, a path, or URDF text")
    try:
        return Path(source).read_text(encoding="utf-8-sig"), str(source)
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise DescriptionError(
            f"cannot read {str(source)[:200]!r}: {error}; a path of a URDF file or its text is required"
        ) from error


def _springs_said(springs: Any, movable: Sequence[str]) -> dict[str, SpringTag]:
    if not isinstance(springs, Mapping):
        raise ParameterError("springs", springs, "a mapping {joint: stiffness} or {joint: (stiffness, rest)}")
    said = {}
    for name, value in springs.items():
        if name not in movable:
            raise NameNotFound("movable joint", str(name), movable)
        stiffness, rest = value if isinstance(value, tuple | list) and len(value) == 2 else (value, 0.0)
        field = f"springs[{name!r}]"
        said[name] = SpringTag(positive_number(field, stiffness, "N m/rad or N/m"), finite_number(field, rest, "rad or m"))
    return said


def _motors_said(motors: Any, movable: Sequence[str], springs: Mapping[str, SpringTag], tags: RobotTags) -> list[str]:
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
    for name in list(model.names)[1:]:  # the first is the universe
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1 or joint.nq not in (1, 2):
            raise DescriptionError(
                f"joint {name} of {label} is a {joint.shortname()}; revolute, continuous and prismatic joints are supported"
            )
        low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        if joint.nq == 1 and low > high:
            raise DescriptionError(f"joint {name} of {label} has the lower limit {low} above the upper one, {high}")


def _tip(model: Any, tip: str | None, label: str) -> str:
    bodies = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
    if tip is not None:
        if not isinstance(tip, str) or not model.existFrame(tip):
            raise NameNotFound("frame", str(tip), bodies)
        return tip
    if "tip" in bodies:
        return "tip"
    parents = {frame.parentFrame for frame in model.frames}
    leaves = [frame.name for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY and i not in parents]
    if len(leaves) != 1:
        raise DescriptionError(f"{label} has {len(leaves)} ends ({', '.join(leaves)}); say which frame is the tip: tip=...")
    return str(leaves[0])


def _rebuild(urdf: str, springs: dict[str, tuple[float, float]], motors: tuple[str, ...], tip: str) -> SoftModel:
    return load_model(urdf, springs=springs, motors=motors, tip=tip)


def _reduce(model: SoftModel) -> tuple[Any, ...]:
    return _rebuild, (model.urdf, model.spring_table, model.motor_joints, model.tip)


copyreg.pickle(SoftModel, _reduce)  # as the URDF and what was said about it; Pinocchio workspaces are not carried along
