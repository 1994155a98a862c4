"""What a page that solves by itself knows of a robot: shapes, tubes and curves on the frames of its chain, sliders, colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.serial_chain import ChainSection, SerialChain
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.view import appearance
from softrobots.view.actuator_curves import THREAD, offsets, thickness_and_shift
from softrobots.view.body import BentSections
from softrobots.view.mesh_triangles import triangles
from softrobots.view.robot_shapes import RobotShapes
from softrobots.view.scene import WRINKLING_COLOURS, SceneBuilder
from softrobots.view.slider_ranges import actuator_ends, slider_grid
from softrobots.view.tension_scale import NEUTRAL, PULL_COLOURS, PUSH_COLOURS, ZERO, ZERO_COLOUR

POINTS = 12
"""Frames that a solver places along each section of constant strain, the last at its end."""
_DIGITS = 7  # of lengths [m]


class ChainFrames:
    """Numbers of the frames that a solver places: behind each joint, at points along each section, the tip.

    Others follow, which the page places itself: the starts of segments, and the ends of sections that are joints in a row.
    """

    def __init__(self, model: SoftModel, chain: SerialChain, sections: BentSections) -> None:
        """Number the frames of a chain, base to tip."""
        self._rows = {row.name: row for row in model.structure.section_table}
        self.of_joint: dict[str, int] = {}
        self.of_section: dict[str, list[int]] = {}
        self.placed: list[dict[str, Any]] = []
        count = 0
        for element in chain.elements:
            if isinstance(element, ChainSection):
                self.of_section[element.name] = list(range(count - 1, count + POINTS))
                count += POINTS
                self.of_joint[self._rows[element.name].joint_names[-1]] = count - 1
            else:
                self.of_joint[element.name] = count
                count += 1

        def place(frame: int, segment: int, at: float) -> int:
            pose = sections.frames(segment, np.array([at]))[0]
            self.placed.append({"frame": frame, "pose": _rounded(pose)})
            return count + len(self.placed)

        for segment in sections.segment_numbers:
            rows, bounds = [row for row in self._rows.values() if row.segment == segment], sections.bounds(segment).tolist()
            for number, row in enumerate(rows):
                joints = [self.of_joint[name] for name in row.joint_names if name in self.of_joint]
                numbers = self.of_section.setdefault(row.name, [min(joints) - 1])
                numbers[0] = place(numbers[0], segment, 0.0) if number == 0 else self.of_section[rows[number - 1].name][-1]
                if len(numbers) == 1 or (number == len(rows) - 1 and row.bends < row.length):
                    numbers.append(place(max(joints), segment, bounds[number + 1]))

    def of_segment(self, segment: int) -> tuple[list[int], FloatArray]:
        """Frames along a segment, and their rest lengths from its start [m]; each place once."""
        rows = [row for row in self._rows.values() if row.segment == segment]
        numbers, places = [self.of_section[rows[0].name][0]], [0.0]
        for row in rows:
            new = self.of_section[row.name][1:]
            numbers += new
            places += (places[-1] + row.length * np.arange(1, len(new) + 1) / len(new)).tolist()
        return numbers, np.array(places)


def robot_data(unloaded: Equilibrium, full_force: float) -> dict[str, Any]:
    """Return what a page draws of a robot, and its sliders, as plain data for JSON; its actuators are told by the solver.

    Args:
        unloaded: The robot with relaxed actuators, without load: shapes are given as they are then, and the page, which solves
            the same, fixes them to their frames.
        full_force: Largest force of each slider [N].
    """
    model, chain = unloaded.model, unloaded.model.chain()
    scenes, sections = SceneBuilder(model), BentSections(model, unloaded.q_motors, unloaded.q_springs)
    extent, relaxed, frames = scenes.extent, scenes.loaded(unloaded), ChainFrames(model, chain, sections)
    eye, centre = extent.camera(extent.tip)
    return {
        "sliders": [dict(zip(("low", "high", "step"), slider_grid(*ends), strict=True)) for ends in actuator_ends(model)],
        "elastic": [tag.kind == "elastic" for tag in model.muscles],
        "basis": None if model.actuators.independent else model.actuators.basis.tolist(),
        "earth": list(EARTH_GRAVITY),
        "fullForce": full_force,
        "forceStep": slider_grid(-full_force, full_force)[2],
        "size": extent.size,
        "ground": extent.ground,
        "eye": _rounded(eye),
        "centre": _rounded(centre),
        "placed": frames.placed,
        "solids": _solids(scenes.robot, relaxed.deformed, model, frames),
        "tubes": _tubes(model, frames),
        "curves": _curves(model, sections, frames),
        "tensions": {"neutral": NEUTRAL, "zero": ZERO},
        "colours": {
            "wrinkling": [[least if math.isfinite(least) else -1e9, rgb] for least, rgb in WRINKLING_COLOURS],
            "rigid": appearance.RIGID_COLOUR,
            "tube": appearance.TUBE_COLOUR,
            "line": appearance.LINE_COLOUR,
            "pull": PULL_COLOURS,
            "push": PUSH_COLOURS,
            "zero": ZERO_COLOUR,
            "force": appearance.FORCE_COLOUR,
            "floor": appearance.FLOOR_COLOUR,
        },
    }


def _solids(robot: RobotShapes, poses: Sequence[FloatArray], model: SoftModel, frames: ChainFrames) -> list[dict[str, Any]]:
    """The rigid shapes with their frames; pieces of the chain inside a section are not drawn, its tube is."""
    names, solids = model.pinocchio.names, []
    for shape, joint, pose in zip(robot.shapes, robot.joints, poses, strict=True):
        if (joint and names[joint] not in frames.of_joint) or shape.of_section:
            continue
        corners, faces, flat = triangles(shape.geometry)
        solids.append(
            {
                "frame": frames.of_joint[names[joint]] if joint else -1,
                "pose": _rounded(pose),
                "corners": _rounded(corners),
                "faces": np.asarray(faces).ravel().tolist(),
                "flat": flat,
                "colour": _rounded(shape.colour),
                "link": shape.inflated_link,
                "elastic": shape.elastic,
            }
        )
    return solids


def _tubes(model: SoftModel, frames: ChainFrames) -> list[dict[str, Any]]:
    """One tube a segment; one a section where each is an inflated link of its own, which has a colour."""
    groups = {model.spring_joints[group.springs[0]]: number for number, group in enumerate(model.spring_groups)}
    sections = model.structure.section_of
    links = {sections[name].name: number for name, number in groups.items() if name in sections}
    tubes: list[dict[str, Any]] = []
    for row in model.structure.section_table:
        link, last = links.get(row.name), tubes[-1] if tubes else None
        numbers = frames.of_section[row.name]
        if last is not None and link is None and last["link"] is None and last["segment"] == row.segment:
            last["frames"] = last["frames"] + numbers[1:]
            continue
        tubes.append({"segment": row.segment, "frames": numbers, "radius": row.radius, "middle": row.middle, "link": link})
    return tubes


def _curves(model: SoftModel, sections: BentSections, frames: ChainFrames) -> list[dict[str, Any]]:
    """The actuators, and lines that are only drawn: frames, and offsets in them."""
    curves: list[dict[str, Any]] = []
    for tag, (radius, aside) in zip(model.muscles, thickness_and_shift(sections, model.muscles), strict=True):
        points: list[list[float]] = []
        for route in tag.route:
            numbers, places = frames.of_segment(route.segment)
            inside = (places >= route.at[0] - 1e-9) & (places <= route.at[-1] + 1e-9)
            distance, azimuth = offsets(route, places[inside])
            x = distance * np.cos(azimuth) + aside * np.sin(azimuth)
            y = distance * np.sin(azimuth) - aside * np.cos(azimuth)
            points += [
                [frame, *_rounded(row)] for frame, row in zip(np.array(numbers)[inside].tolist(), np.c_[x, y], strict=True)
            ]
        curves.append({"name": tag.name, "points": points, "radius": radius})
    for line in model.structure.lines:
        numbers, _ = frames.of_segment(line.segment)
        at = _rounded((line.distance * math.cos(line.azimuth), line.distance * math.sin(line.azimuth)))
        radius = THREAD * sections.radius(line.segment)
        curves.append({"name": line.name, "points": [[frame, *at] for frame in numbers], "radius": radius})
    return curves


def _rounded(values: Any) -> list[float]:
    """Numbers in one row, without the last bits, in which machines differ."""
    return [round(number, _DIGITS) + 0.0 for number in np.asarray(values, dtype=np.float64).ravel().tolist()]
