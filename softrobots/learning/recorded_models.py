"""Derivatives of the numbers of many robots by parameters, from recorded expansions of their description.

The counterpart of `recorded_chains` for trees, sections and actuators. The robots are loaded; their neighbours, of which the
differences are, are not: placements and masses are composed for all at once, and sections, springs and actuators are those of
one loaded robot with other numbers in their tags. What this says of the loaded ones confirms it.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.description.urdf_tags import SpringTag
from softrobots.identification.model_change import ModelChange, model_change, neighbours, numbers_of, scales_of
from softrobots.identification.parameters import ParameterSet
from softrobots.learning.recorded_chains import Read, descriptions, largest_linear_moment, tree_columns
from softrobots.model.assembly import elastic_parts
from softrobots.model.muscle_lengths import MuscleLengths
from softrobots.model.muscle_paths import MusclePaths
from softrobots.model.numbers import Numbers, strain_springs, structure_numbers
from softrobots.model.soft_model import SoftModel

_ASIDE = 1e-3  # how far from its present values the robot with the tags is, relative
_OTHERWISE = dict(bending_stiffness="EI", torsional_stiffness="GJ", axial_stiffness="EA", bends="length", relaxed="rest")
"""Attribute of the file by field of a tag, where none is called like the field."""


class RecordedModels:
    """Derivatives of a robot by its parameters."""

    def __init__(self, parameters: ParameterSet) -> None:
        self._parameters = parameters

    @cached_property
    def _like(self) -> SoftModel | None:
        """The robot with all parameters moved."""
        given = self._parameters
        step = _ASIDE * scales_of(given, given.values) * np.random.default_rng(0).uniform(0.5, 1.0, len(given.values))
        with suppress(SoftRobotsError):
            return given.model(given.values + np.where(given.values + step < given.upper, step, -step))
        return None

    def changes(self, each: Sequence[tuple[float, ...]], models: Sequence[SoftModel]) -> dict[tuple[float, ...], ModelChange]:
        """Return `model_change` at values of the parameters, of the robots with them; not of those that no tape tells."""
        given, found, rows = self._parameters, dict[tuple[float, ...], ModelChange](), np.array(each)
        if not given.entries and not given.present.muscles:  # joint springs are numbers themselves
            return dict.fromkeys(each, model_change(given))
        if self._like is None:
            return found
        moved, weights = neighbours(given, rows)
        for same, root, read in descriptions(given, np.concatenate(moved)):
            follow = np.flatnonzero(same.reshape(len(moved), -1).all(axis=0)).tolist()
            own = [row for row in follow if each[row] not in found]
            if not own:
                continue
            numbers_at = _numbers_like(self._like, root, read, len(same))
            for row in own:
                base, near = numbers_of(models[row]), [numbers_at(number) for number in range(row, len(same), len(rows))]
                alike = all(one[name].shape == base[name].shape for one in near for name in base)
                if not alike or not all(np.allclose(near[0][name], base[name], 1e-11, 1e-13) for name in base):
                    continue
                slopes = (
                    (place, name, one * (up[name] - near[0][name]) + other * (down[name] - near[0][name]))
                    for place, (up, down) in enumerate(zip(near[1:], near[1 + rows.shape[1] :], strict=False))
                    for one, other in [weights[:, row, place]]
                    for name in base
                )
                found[each[row]] = ModelChange.of(rows.shape[1], base, (one for one in slopes if np.any(one[2])))
        return found


def _numbers_like(model: SoftModel, root: ElementTree.Element, read: Read, count: int) -> Callable[[int], Numbers]:
    """Return what tells `model_numbers` of robots that differ from one in numbers of their text, by the row of these."""
    rigid, structure, laws = model.pinocchio, model.structure, strain_springs(model)
    parts, masses, placed = tree_columns(root, list(rigid.names)[1:], [np.eye(3)] * len(rigid.names), read)
    joints: dict[Any, Any] = {joint.get("name"): joint for joint in root.findall("joint")}
    ends = [placed(joints[one.name].find("child").get("link") if one.name in joints else one.name) for one in rigid.frames]

    def stacked(pairs: Sequence[Any]) -> FloatArray:
        wide = [[np.broadcast_to(one, (count, *one.shape[1:])) for one in pair] for pair in pairs]
        return np.stack([np.concatenate(pair, axis=-1) for pair in wide], axis=1)

    columns = {
        "placements": stacked([(turn.reshape(-1, 3, 3), at[..., None]) for turn, at in parts]),
        "frames": stacked([(turn, at[..., None]) for _, turn, at in ends]),
        "masses": stacked(masses[:-1]),
        "moments": np.zeros((count, len(laws.groups))),
    }
    for number, group in enumerate(laws.groups):
        if group.linear_up_to is not None:
            columns["moments"][:, [number]] = largest_linear_moment(root, laws.names[group.springs[0]], read)
    elements = {one.get("name"): one for one in root if one.tag.startswith("{") and one.get("name")}
    springs = {name: one for name, joint in joints.items() for one in joint.findall("{*}spring")}
    attributes = [part.attrib for one in (*elements.values(), *springs.values()) for part in one.iter()]
    texts = {text for some in attributes for text in some.values() if "\ue000" in text}
    wide = {text: np.broadcast_to(read(text), (count, len(text.split()))) for text in texts}
    words = {text: list(map(tuple, one.tolist())) for text, one in wide.items()}
    routes = dict[Any, MusclePaths]()
    keys, made = list(zip(*words.values(), strict=True)) or [()] * count, dict[Any, Numbers]()

    @cache
    def fields(kind: Any, element: Any) -> dict[str, str]:
        read_from = {one: element.get(one) or element.get(_OTHERWISE.get(one, "")) for one in kind.__dataclass_fields__}
        return {name: text for name, text in read_from.items() if text in words}

    def changed(row: int, tag: Any, element: Any) -> Any:
        given: Any = {name: words[text][row] for name, text in fields(tag.__class__, element).items()}
        given = {name: one if isinstance(getattr(tag, name), tuple) else one[0] for name, one in given.items()}
        if routes := element.findall("{*}route"):
            given["route"] = tuple(changed(row, *both) for both in zip(tag.route, routes, strict=False))
        return replace(tag, **given)

    def of_structure(row: int) -> Numbers:
        some: Any = [structure.tags.sections, structure.tags.lumped_sections, structure.muscles]
        sections, lumped, muscles = (tuple(changed(row, tag, elements.get(tag.name, root)) for tag in tags) for tags in some)
        tags = replace(structure.tags, sections=sections, lumped_sections=lumped)
        stiff = {name: changed(row, SpringTag(*pair), springs.get(name, root)) for name, pair in model.spring_table.items()}
        table, strains = elastic_parts(rigid, tags, stiff, structure.spring_joints)
        around = (muscles, tuple((tag.length, tag.rest) for tag in (*sections, *lumped)))
        if around not in routes:
            routes[around] = MusclePaths(muscles, table, len(strains.names))
        paths, held = routes[around], structure.muscle_lengths
        lengths = held and MuscleLengths(held.inner, muscles, table, strains, paths)
        new: Any = {"section_table": tuple(table), "strain_springs": strains, "muscles": muscles, "muscle_paths": paths}
        return structure_numbers(replace(structure, **new, muscle_lengths=lengths))

    def numbers_at(row: int) -> Numbers:
        if keys[row] not in made:
            made[keys[row]] = of_structure(row)
        return {name: one[row] for name, one in columns.items()} | made[keys[row]]

    return numbers_at
