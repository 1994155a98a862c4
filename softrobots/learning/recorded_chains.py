"""Numbers of a chain for many rows of parameters at once, from recorded expansions of its description.

To load a robot takes some 10 ms. What its xacro file computes is on tapes (`softrobots.description.number_tape`), whose
operations NumPy does for all rows; numbers of the text become those of the chain by composition of placements and masses.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from itertools import chain as chain_of
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.identification.model_change import CENTRAL, scales_of
from softrobots.identification.parameters import ParameterSet
from softrobots.model.serial_chain import SerialChain

Read = Callable[[str], FloatArray]
"""Returns words of a description as columns, shape (N or 1, words)."""


def many_numbers(parameters: ParameterSet, rows: FloatArray, loaded: Callable[[Any], FloatArray]) -> FloatArray:
    """Return the numbers of robots, shape (N, n), at rows of parameters, (N, P); NaN of those that are to be loaded."""
    chain, tip = parameters.present.chain(), parameters.present.tip
    known = bool(parameters.entries) and not parameters.places("spring") and not chain.slack_hinges
    constant, left = loaded(tuple(parameters.values.tolist())), np.arange(len(rows) * known)
    numbers = np.full((len(rows), len(constant)), np.nan)
    while left.size:
        first, left = left, left[1:]
        with suppress(SoftRobotsError):  # told when it is needed; one robot of each tape is loaded, to confirm the tape
            expected, left = loaded(tuple(rows[first[0]].tolist())), left[:0]
            for tape in tuple(parameters.variants.expansions.tapes):
                same, read = tape.read_many(rows[first][:, list(parameters.entries.values())])
                if same[0]:
                    found = chain_columns(ElementTree.fromstring(tape.marked), chain, tip, read)
                    if np.allclose(found[0], expected, rtol=1e-12, atol=1e-15):
                        numbers[first], left = np.where(same[:, None], found, np.nan), first[~same]
                    break
    near = np.abs(numbers - constant) <= 1e-15 * np.abs(constant) + 4e-16
    return np.where(near, constant, numbers)


def many_slopes(
    parameters: ParameterSet, rows: FloatArray, loaded: Callable[[Any], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return these numbers, and their derivatives by central differences, shape (N, n, P)."""
    (step, weights), units = CENTRAL, np.diag(parameters.of_model.astype(float))
    steps = step * np.array([scales_of(parameters, row) for row in rows])
    moved = np.stack([rows, *(rows + number * unit * steps for number in weights for unit in units)])
    outside = np.any((moved < parameters.lower) | (moved > parameters.upper), axis=(0, 2))
    found = many_numbers(parameters, moved.reshape(-1, len(units)), loaded).reshape(*moved.shape[:2], -1)
    found[:, outside] = np.nan
    by_step = np.tensordot(list(weights.values()), found[1:].reshape(len(weights), -1, *found.shape[1:]), 1)
    return found[0], np.moveaxis(by_step, 0, 2) / steps[:, None, :]


def chain_columns(root: ElementTree.Element, chain: SerialChain, tip: str, read: Read) -> FloatArray:
    """Return the numbers of chains that differ in numbers of their text, shape (N, n), in the order of `numbers_of`."""
    elements: Any = chain.elements
    axes = [one.axes for one in elements] + [np.eye(3)]  # the last is the world's
    places, masses, placed = tree_columns(root, [one.name for one in elements], axes, read)
    springs = [[read(str(one)) for one in pair] for pair in zip(chain.stiffness, chain.rest, strict=True)]
    strains = {one.name: one.strain for one in elements if one.strain is not None}
    for joint in root.findall("joint"):
        for spring in joint.findall("{*}spring") if joint.get("name") in strains else ():
            springs[strains[joint.get("name")]] = [read(spring.get(name, "0")) for name in ("stiffness", "rest")]
    row, _, translation = placed(tip)
    parts = [one.T for one in chain_of(*places, [translation @ axes[row]], *zip(*springs, strict=True), *masses[:-1])]
    return np.stack(np.broadcast_arrays(*chain_of(*parts)), axis=1)


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
