"""The legend of a page or figure: colour and meaning of everything that is drawn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from softrobots.statics.contact.contact import Contact
from softrobots.view.appearance import (
    CAPSULE_COLOUR,
    CONTACT_COLOUR,
    FORCE_COLOUR,
    LINE_COLOUR,
    OBSTACLE_COLOUR,
    PATH_COLOUR,
    RIGID_COLOUR,
    TAIL_COLOUR,
    TUBE_COLOUR,
    Colour,
)
from softrobots.view.robot_shapes import Shape
from softrobots.view.scene import WRINKLING_COLOURS, Arrow, Scene
from softrobots.view.tension_scale import ZERO, ZERO_COLOUR, DrawnActuator, scale_end, tension_colour

_MOST_NAMED = 12  # actuators that are listed one by one
_NO_FORCE = 1e-9  # [N], contacts with less only touch


class LegendEntry(NamedTuple):
    """Something that is drawn."""

    colour: Colour
    """Its colour."""
    meaning: str
    """What it is."""
    dashed: bool = False
    """Whether it is a dashed line."""


def legend(
    shapes: Iterable[Shape], scene: Scene, animated: Iterable[Scene] = (), *, path: bool = False, target: bool = False
) -> list[LegendEntry]:
    """Return colour and meaning of everything that is drawn.

    Args:
        shapes: The shapes of the robot.
        scene: What is shown.
        animated: The scenes of an animation.
        path: Whether the path of the tip is drawn.
        target: Whether a target is drawn.
    """
    shapes, played = tuple(shapes), tuple(animated)
    states = (scene, *played)
    entries = [LegendEntry(RIGID_COLOUR, scene.reference)] * any(shape.elastic for shape in shapes)
    if all(shape.inflated_link is None for shape in shapes):
        entries += [LegendEntry(shape.colour, "equivalent rigid chain") for shape in shapes if shape.of_section][:1]
    entries += [LegendEntry(TUBE_COLOUR, "body")] * any(state.segments for state in states)
    lines = dict.fromkeys(name for state in states for segment in state.segments for name in segment.lines)
    entries += [LegendEntry(LINE_COLOUR, name) for name in lines]
    if any(state.segments and state.grown is not None and state.grown < 1.0 for state in states):
        entries.append(LegendEntry(TAIL_COLOUR, "wall that has not come out"))
    entries += tension_entries([state.actuators for state in played or (scene,)])
    entries += [LegendEntry(PATH_COLOUR, "path of the tip")] * path + [LegendEntry(PATH_COLOUR, "target (cross)")] * target
    entries += force_entries([state.arrows for state in played or (scene,)])
    entries += [LegendEntry(CAPSULE_COLOUR, "capsules of links, which touch")] * any(state.capsules for state in states)
    entries += [LegendEntry(OBSTACLE_COLOUR, "obstacle")] * any(state.obstacles for state in states)
    entries += contact_entries([state.contacts for state in played or (scene,)])
    above = 1.0
    for least, colour in WRINKLING_COLOURS if scene.wrinkling else ():
        text = f"{100 * above:.0f} - {100 * least:.0f} % of the wrinkling moment left" if least > -np.inf else "wrinkled"
        entries.append(LegendEntry(colour, text))
        above = least
    return entries


def force_entries(states: Sequence[Mapping[str, Arrow]]) -> list[LegendEntry]:
    """Return the forces of some states of a robot, without those of contacts, and their sizes.

    Args:
        states: The arrows in each state.
    """
    sizes: dict[str, list[float]] = {}
    for state in states:
        for frame, arrow in state.items():
            if not arrow.of_contact:
                sizes.setdefault(frame, []).append(arrow.force)
    if len(sizes) > _MOST_NAMED:
        sizes = {f"each of {len(sizes)} frames": [size for some in sizes.values() for size in some]}
    words = {frame: " to ".join(dict.fromkeys(f"{end(some):.3g}" for end in (min, max))) for frame, some in sizes.items()}
    return [LegendEntry(FORCE_COLOUR, f"force{f' on {frame}' * (len(words) > 1)} {size} N") for frame, size in words.items()]


def contact_entries(states: Sequence[Mapping[str, Contact]]) -> list[LegendEntry]:
    """Return the contacts of some states of a robot: the sum of the forces of each obstacle, of many obstacles their range.

    Args:
        states: The contacts in each state.
    """
    names = dict.fromkeys(one.obstacle for state in states for one in state.values())
    forces = {name: [_pressing(name, state) for state in states] for name in names}
    if len(names) > _MOST_NAMED:
        forces = {f"each of {len(names)} obstacles": [one for some in forces.values() for one in some]}
    slipping = {one.obstacle for one in states[0].values() if one.status == "slips"} if len(states) == 1 else set()
    return [LegendEntry(CONTACT_COLOUR, _words_of_contact(name, some, name in slipping)) for name, some in forces.items()]


def _pressing(obstacle: str, contacts: Mapping[str, Contact]) -> tuple[float, int]:
    """Sum of the sizes of the forces of an obstacle on a robot [N], and the number of points."""
    sizes = [float(np.linalg.norm(one.force)) for one in contacts.values() if one.obstacle == obstacle]
    return sum(sizes), len(sizes)


def _words_of_contact(obstacle: str, pressing: Sequence[tuple[float, int]], slips: bool) -> str:
    """What an obstacle does in some states, in words."""
    forces = [force for force, _ in pressing]
    if max(forces) <= _NO_FORCE:
        return f"touches {obstacle}"
    least, most = (f"{number:.3g}" for number in (min(forces), max(forces)))
    words = f"{obstacle} presses with {least if least == most else f'{least} to {most}'} N"
    points = pressing[0][1]
    return words + f" at {points} points" * (len(pressing) == 1 and points > 1) + ", slips" * slips


def tension_entries(states: Sequence[Sequence[DrawnActuator]]) -> list[LegendEntry]:
    """Return colour and meaning of the actuators of some states of a robot.

    Up to a dozen are told by name, coloured by their largest tension. Colours that change, or are those of more actuators,
    are told by their scale.

    Args:
        states: The actuators in each state.
    """
    drawn = [actuator for state in states for actuator in state]
    known = [actuator.tension for actuator in drawn if actuator.tension is not None]
    if not known:
        return [LegendEntry(ZERO_COLOUR, "actuator")] * bool(drawn)
    end, entries = scale_end(known), []
    names = dict.fromkeys(actuator.curve.name for actuator in drawn)
    if len(states) > 1 or len(names) > _MOST_NAMED:
        shares = [1.0, 0.5] * (max(known) > 0.0) + [0.0] + [-0.5, -1.0] * (min(known) < 0.0)
        entries += [LegendEntry(tension_colour(share * end, end), _words(share * end, share * end)) for share in shares]
        entries += [LegendEntry(ZERO_COLOUR, "slack", dashed=True)] * any(actuator.slack for actuator in drawn)
    if len(names) <= _MOST_NAMED:
        entries += [_entry(name, [one for one in drawn if one.curve.name == name], end) for name in names]
    return entries


def _entry(name: str, states: Sequence[DrawnActuator], end: float) -> LegendEntry:
    """The entry of one actuator in some states, on a scale with an end [N]."""
    tensions = [0.0 if abs(one.tension) < ZERO * end else one.tension for one in states if one.tension is not None]
    slack = all(one.slack for one in states)
    words = "slack" if slack else _words(min(tensions), max(tensions))
    return LegendEntry(tension_colour(max(tensions, key=abs), end), f"{name}: {words}", slack)


def _words(least: float, most: float) -> str:
    """Tensions from the least to the most in words [N]."""
    low, high = (f"{number:.3g}" if abs(number) < 1000.0 else f"{number:.0f}" for number in (least, most))
    if least < 0.0 < most:
        return f"{low} N (pushes) to {high} N (pulls)"
    way = "pulls " if most > 0.0 else "pushes " if least < 0.0 else ""
    low, high = sorted((low.removeprefix("-"), high.removeprefix("-")), key=float)
    return f"{way}{high} N" if low == high else f"{way}{low} to {high} N"
