"""Numbers of a chain for many rows of parameters at once, from recorded expansions of its description.

To load a robot takes some 10 ms. What its xacro file computes is on tapes (`softrobots.description.number_tape`), whose
operations NumPy does for all rows; numbers of the text become those of the chain by composition of placements and masses.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache, partial
from itertools import chain as chain_of
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.description.number_tape import Tape
from softrobots.identification.model_change import neighbours
from softrobots.identification.parameters import ParameterSet
from softrobots.inflated_beam import moment_limits
from softrobots.model.serial_chain import ChainJoint, SerialChain

_OF_SPRING = ("stiffness", "rest")
Read = Callable[[str], FloatArray]
"""Returns words of a description as columns, shape (N or 1, words)."""


def descriptions(parameters: ParameterSet, rows: FloatArray) -> Iterator[tuple[Any, ElementTree.Element, Read]]:
    """Yield by recorded expansion which rows of parameters, shape (N, P), follow it, its text, and what reads words of it.

    The text has the joint springs that the caller gave, and those that are parameters. Without fields among them it is the
    robot's own.
    """
    present, roles = parameters.present, parameters.present.joint_roles
    given = {name: pair for name, pair in present.spring_table.items() if roles[name] == "given spring"}
    springs = {name: dict(zip(_OF_SPRING, map(repr, pair), strict=True)) for name, pair in given.items()}
    for place, one in parameters.places("spring"):
        for name in one.place.names:
            springs.setdefault(name, {})[_OF_SPRING[one.place.parts[0]]] = f"\ue000{place}\ue002"
    inside = np.all((rows >= parameters.lower) & (rows <= parameters.upper) & ((rows > 0.0) | ~parameters.logarithmic), axis=1)
    own = [tape for tape in (Tape(()),) if tape.keep(present.urdf)]
    for tape in tuple(parameters.variants.expansions.tapes) if parameters.entries else own:
        root = ElementTree.fromstring(tape.marked)
        for joint in root.findall("joint") if springs else ():
            if changed := springs.get(joint.get("name", "")):
                found = joint.find("{*}spring")
                (ElementTree.SubElement(joint, "spring") if found is None else found).attrib.update(changed)
        same, read = tape.read_many(rows[:, list(parameters.entries.values())])
        yield same & inside, root, partial(_read, rows, read)


def _read(rows: FloatArray, read: Read, words: str) -> FloatArray:
    return rows[:, [int(words[1:-1])]] if words.endswith("\ue002") else read(words)


def many_numbers(parameters: ParameterSet, rows: FloatArray, loaded: Callable[[Any], FloatArray]) -> FloatArray:
    """Return the numbers of robots, shape (N, n), at rows of parameters, (N, P); NaN of those that are to be loaded."""
    chain, tip = parameters.present.chain(), parameters.present.tip
    alike = chain.slack_hinges and parameters.places("spring")  # springs that are to be alike, which the loader checks
    known = not alike and all(isinstance(one, ChainJoint) for one in chain.elements)
    constant, left = loaded(tuple(parameters.values.tolist())), np.arange(len(rows) * known)
    numbers = np.full((len(rows), len(constant)), np.nan)
    while left.size:
        first, left = left, left[1:]
        with suppress(SoftRobotsError):  # told when it is needed; one robot of each tape is loaded, to confirm the tape
            expected, left = loaded(tuple(rows[first[0]].tolist())), left[:0]
            for same, root, read in descriptions(parameters, rows[first]):
                if same[0]:
                    found = chain_columns(root, chain, tip, read)
                    if np.allclose(found[0], expected, rtol=1e-12, atol=1e-15):
                        numbers[first], left = np.where(same[:, None], found, np.nan), first[~same]
                    break
    near = np.abs(numbers - constant) <= 1e-15 * np.abs(constant) + 4e-16
    return np.where(near, constant, numbers)


def many_slopes(
    parameters: ParameterSet, rows: FloatArray, loaded: Callable[[Any], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return these numbers, and their derivatives by differences, shape (N, n, P)."""
    moved, weights = neighbours(parameters, rows)
    found = many_numbers(parameters, np.concatenate(moved), loaded).reshape(*moved.shape[:2], -1)
    changes = (found[1:] - found[0]).reshape(2, rows.shape[1], *found.shape[1:])
    return found[0], np.einsum("knp,kpnm->nmp", weights, changes)


def chain_columns(root: ElementTree.Element, chain: SerialChain, tip: str, read: Read) -> FloatArray:
    """Return the numbers of chains that differ in numbers of their text, shape (N, n), in the order of `numbers_of`."""
    elements: Any = chain.elements
    axes = [one.axes for one in elements] + [np.eye(3)]  # the last is the world's
    places, masses, placed = tree_columns(root, [one.name for one in elements], axes, read)
    springs = [[read(str(one)) for one in pair] for pair in zip(chain.stiffness, chain.rest, strict=True)]
    strains = {one.name: one.strain for one in elements if one.strain is not None}
    for joint in root.findall("joint"):
        for spring in joint.findall("{*}spring") if joint.get("name") in strains else ():
            springs[strains[joint.get("name")]] = [read(spring.get(name, "0")) for name in _OF_SPRING]
    names = {strain: name for name, strain in strains.items()}
    slack = [largest_linear_moment(root, names[inner], read) for inner, _, _ in chain.slack_hinges]
    row, _, translation = placed(tip)
    parts = [one.T for one in chain_of(*places, slack, [translation @ axes[row]], *zip(*springs, strict=True), *masses[:-1])]
    return np.stack(np.broadcast_arrays(*chain_of(*parts)), axis=1)


def largest_linear_moment(root: ElementTree.Element, spring: str, read: Read) -> FloatArray:
    """Return the moments up to which the law of the inflated link of a spring is linear, shape (N or 1, 1) [N m]."""
    link = next(one for one in root.findall("{*}inflated_link") if spring in one.get("springs", "").split())
    if "max_moment" in link.attrib:
        return read(link.attrib["max_moment"])
    return np.asarray(moment_limits(read(link.attrib["pressure"]), read(link.attrib["radius"])).slack)


def tree_columns(
    root: ElementTree.Element, joints: Sequence[str], axes: Sequence[FloatArray], read: Read
) -> tuple[list[list[FloatArray]], list[list[FloatArray]], Callable[[str | None], tuple[int, FloatArray, FloatArray]]]:
    """Return placements and masses of joints of trees that differ in numbers of their text, and what places a link.

    Placements `(R, p)`, in the joint before, are composed along fixed joints, and masses `m` with centres `c` added where they
    are fixed: `m (R c + p)` is the first moment. `axes` turn the frames of the joints, and of the world, which is the last.
    Links are placed by the row of the joint that they are fixed to, -1 for the world, and the placement there.
    """
    rows = {name: row for row, name in enumerate(joints)}
    above: dict[Any, Any] = {joint.find("child").get("link"): joint for joint in root.findall("joint")}  # type: ignore[union-attr]
    places: list[list[FloatArray]] = [[] for _ in joints]
    masses = [[read("0"), read("0 0 0")] for _ in axes]

    def origin(element: ElementTree.Element, name: str) -> FloatArray:
        given = element.find("origin")
        return read("0 0 0" if given is None else given.get(name, "0 0 0"))

    @cache
    def placed(link: str | None) -> tuple[int, FloatArray, FloatArray]:
        joint = above.get(link)
        if joint is None:
            return -1, np.eye(3)[None], np.zeros((1, 3))
        row, rotation, translation = placed(joint.find("parent").get("link"))
        translation = translation + np.einsum("nij,nj->ni", rotation, origin(joint, "xyz"))
        rotation = rotation @ Rotation.from_euler("xyz", origin(joint, "rpy")).as_matrix()
        own = rows.get(joint.get("name"))
        if own is None:
            return row, rotation, translation
        places[own] = [(axes[row].T @ rotation @ axes[own]).reshape(-1, 9), translation @ axes[row]]
        return own, np.eye(3)[None], np.zeros((1, 3))

    for link in root.findall("link"):
        row, rotation, translation = placed(link.get("name"))
        for inertial in link.findall("inertial"):
            mass = read(inertial.find("mass").get("value"))  # type: ignore[union-attr, arg-type]
            mass[mass < 0.0] = np.nan  # the loader refuses it
            moment = mass * (np.einsum("nij,nj->ni", rotation, origin(inertial, "xyz")) + translation) @ axes[row]
            masses[row] = [masses[row][0] + mass, masses[row][1] + moment]
    return places, masses, placed
