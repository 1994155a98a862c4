"""Helix designs against the complex closed form, brute-force distances, sampling of the realisable set, and their files."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softrobots import helix, load_result, save_result
from softrobots.core.errors import FileFormatError, ParameterError, SelfIntersection
from softrobots.helix import DesignWarning, HelixDesign, Wish
from tests.support.laws import law
from tests.support.tables import each_row

D = 0.0331  # the paper's tube
TURN = 2.0 * math.pi


# --- Oracles: nothing here calls the package


def complex_helix(contraction: float, angle: float, diameter: float) -> tuple[complex, complex, complex]:
    """`R + i b` of outer, centre and inner path."""
    zeta = contraction * complex(math.cos(2.0 * angle), math.sin(2.0 * angle))
    return diameter / (1.0 - zeta), diameter * (1.0 + zeta) / (2.0 * (1.0 - zeta)), diameter * zeta / (1.0 - zeta)


def actuator(centre_radius: np.ndarray, pitch: np.ndarray, diameter: float) -> tuple[np.ndarray, np.ndarray]:
    """Contraction and angle, by inverting the Moebius map of the centre line."""
    w = centre_radius + 1j * pitch
    zeta = (w - 0.5 * diameter) / (w + 0.5 * diameter)
    return np.abs(zeta), 0.5 * np.angle(zeta)


def margin(centre_radius: np.ndarray, pitch: np.ndarray, diameter: float, turns: float, samples: int = 3000) -> np.ndarray:
    """How far tubes are from contact, over the diameter; by brute force along the turn angle.

    Contact of turns counts from where the distance has stopped growing; before that it is bending, which may not be sharper
    than the radius of the tube.
    """
    radius, rise = np.atleast_1d(centre_radius)[:, None], np.atleast_1d(pitch)[:, None]
    angle = np.linspace(0.0, TURN * min(turns, 1.2), samples)
    distance = np.sqrt(2.0 * radius**2 * (1.0 - np.cos(angle)) + (rise * angle) ** 2)
    grown = np.logical_or.accumulate(np.diff(distance, axis=1, prepend=0.0) < 0.0, axis=1)
    turns_apart = np.where(grown, distance, np.inf).min(axis=1) / diameter - 1.0
    bend = (radius**2 + rise**2)[:, 0] / np.maximum(radius[:, 0], 1e-300) / (0.5 * diameter) - 1.0
    return np.minimum(turns_apart, bend)


def distance_to(wish: Wish, centre_radius: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    radius = centre_radius - (0.5 * D if wish.path == "inner" else 0.0)
    return np.hypot(np.log(radius / wish.radius), np.log(TURN * pitch / wish.turn_height))


# --- Designs


def test_a_grasp_of_the_papers_cylinder_has_its_inner_path_on_it_and_its_rise():
    design = helix.design_grasp(0.020, 0.080, diameter=D, turns=1.5)
    outer, centre, inner = complex_helix(design.contraction, design.angle, D)
    assert inner.real == pytest.approx(0.020, rel=1e-13)
    assert TURN * inner.imag == pytest.approx(0.080, rel=1e-13)
    assert design.tube_length == pytest.approx(1.5 * TURN * abs(outer) * math.cos(design.angle), rel=1e-13)
    assert design.centre_length == pytest.approx(1.5 * TURN * abs(centre), rel=1e-13)
    assert design.height == pytest.approx(0.120, rel=1e-13)
    assert design.realisable
    assert not design.contact.touches
    assert design.deviation == pytest.approx((0.0, 0.0, 0.0), abs=1e-13)


@pytest.mark.parametrize("squeeze", [0.002, 0.004])
def test_a_squeezed_object_has_a_helix_thinner_by_the_squeeze(squeeze: float):
    design = helix.design_grasp(0.020, 0.080, diameter=D, turns=1.5, squeeze=squeeze)
    assert float(design.shape.inner_radius) == pytest.approx(0.020 - squeeze, rel=1e-13)
    assert design.wish is not None
    assert (design.wish.radius, design.wish.squeeze) == (pytest.approx(0.020 - squeeze), squeeze)


@law("helix.design_antenna", "helix.turns")
@settings(max_examples=60)
@given(
    st.floats(0.3, 0.99), st.floats(0.02, 0.7), st.floats(0.005, 0.5), st.floats(0.3, 8.0), st.sampled_from(["right", "left"])
)
def test_designing_the_antenna_of_an_actuator_gives_that_actuator(
    contraction: float, angle: float, diameter: float, turns: float, handedness: str
):
    _, centre, _ = complex_helix(contraction, angle, diameter)
    if margin(centre.real, centre.imag, diameter, turns)[0] < 1e-3:
        return
    design = helix.design_antenna(centre.real, TURN * centre.imag, diameter=diameter, turns=turns, handedness=handedness)
    # The map loses at most a factor of R/D, which is below 100 here.
    assert (design.contraction, design.angle) == (pytest.approx(contraction, rel=1e-12), pytest.approx(angle, rel=1e-12))
    assert design.handedness == handedness
    assert float(helix.turns(design.shape, design.angle, design.tube_length)) == pytest.approx(turns, rel=1e-12)


def test_the_papers_reference_comes_back_from_its_antenna():
    # docs/theory.md 3: theta = 5 degrees, lambda = 0.66 give Ro, Ri and b to ten digits
    centre = 0.5 * (0.0854078008 + 0.0523078008)
    design = helix.design_antenna(centre, TURN * 0.0279647090, diameter=D, turns=2.0)
    assert (design.contraction, math.degrees(design.angle)) == (pytest.approx(0.66, rel=1e-8), pytest.approx(5.0, rel=1e-8))


def test_a_design_is_frozen_and_can_be_made_from_the_actuator_alone():
    design = HelixDesign(0.66, math.radians(5.0), D, 2.0)
    assert design.wish is None
    assert design.deviation is None
    with pytest.raises(FrozenInstanceError):
        design.contraction = 0.5  # type: ignore[misc]


# --- Wishes that cannot be made

TIGHT = {"diameter": D, "turns": 3.0}


@pytest.mark.parametrize("make", [helix.design_grasp, helix.design_antenna])
def test_a_wish_whose_turns_overlap_is_refused_with_the_finding(make: Callable[..., HelixDesign]):
    with pytest.raises(SelfIntersection, match="nearest") as caught:
        make(0.020, 0.020, **TIGHT)
    assert bool(caught.value.contact.touches)
    assert float(caught.value.contact.turn_clearance) < 0.0


def test_a_wish_that_folds_the_tube_is_refused():
    with pytest.raises(SelfIntersection, match="bends"):
        helix.design_antenna(0.008, 0.015, diameter=D, turns=0.4)


def test_a_wish_can_be_followed_all_the_same_with_a_warning_that_carries_it():
    with pytest.warns(DesignWarning, match="runs into itself") as caught:
        design = helix.design_grasp(0.020, 0.020, **TIGHT, on_unrealisable="warn")
    assert isinstance(caught[0].message, DesignWarning)
    assert caught[0].message.design is design
    assert caught[0].filename == __file__  # the warning points at the caller
    assert float(design.shape.inner_radius) == pytest.approx(0.020, rel=1e-13)
    assert bool(design.contact.touches)
    assert not design.realisable
    assert "CANNOT BE MADE: the tube runs into itself" in str(design)


@pytest.mark.parametrize("mode", ["error", "nearest", "warn"])
def test_a_wish_that_can_be_made_is_what_every_mode_returns(mode: str):
    design = helix.design_grasp(0.020, 0.080, diameter=D, turns=1.5, on_unrealisable=mode)
    assert float(design.shape.inner_radius) == pytest.approx(0.020, rel=1e-13)


# --- The nearest one

CASES = [
    ("antenna", 0.020, 0.020, 3.0),  # turns overlap
    ("grasp", 0.020, 0.020, 3.0),
    ("antenna", 0.200, 0.020, 3.0),  # a wide flat coil
    ("grasp", 0.080, 0.030, 1.0),
    ("antenna", 0.010, 0.010, 5.0),  # both contacts: ends in their corner
    ("antenna", 0.006, 0.040, 2.0),  # folds
    ("antenna", 0.006, 0.020, 0.4),  # folds, and has no neighbours
    ("antenna", 0.020, 0.010, 0.8),  # only the two ends touch
    ("grasp", 0.004, 0.010, 0.9),
]


@pytest.mark.study
@pytest.mark.parametrize(("purpose", "radius", "rise", "turns"), CASES)
def test_the_nearest_helix_is_on_the_border_and_no_realisable_one_is_nearer(
    purpose: str, radius: float, rise: float, turns: float, rng: np.random.Generator
):
    make = helix.design_grasp if purpose == "grasp" else helix.design_antenna
    design = make(radius, rise, diameter=D, turns=turns, on_unrealisable="nearest")
    wish, deviation = design.wish, design.deviation
    assert wish is not None
    assert deviation is not None
    assert design.realisable

    def realisable(centre: np.ndarray, pitch: np.ndarray, slack: float) -> np.ndarray:
        return margin(centre, pitch, D, turns) >= -slack

    # On the border: a step of 0.1 % of the way to the wish leaves the set.
    centre, pitch = float(design.shape.centre_radius), float(design.shape.pitch)
    outwards = 0.5 * D if purpose == "grasp" else 0.0
    assert deviation.distance == pytest.approx(float(distance_to(wish, np.array(centre), np.array(pitch))), rel=1e-9)
    assert realisable(np.array([centre]), np.array([pitch]), 2e-5)[0]  # the sampled distance is right to 1e-6
    share = 0.999
    nearer = outwards + wish.radius * ((centre - outwards) / wish.radius) ** share, rise / TURN * (pitch * TURN / rise) ** share
    assert not realisable(np.array([nearer[0]]), np.array([nearer[1]]), 0.0)[0]

    # No realisable one nearer: everything in the disc around the wish, up to 0.1 % of its radius.
    size = 0.999 * deviation.distance * np.sqrt(rng.uniform(0.0, 1.0, 1000))
    direction = rng.uniform(0.0, TURN, 1000)
    sampled = outwards + wish.radius * np.exp(size * np.cos(direction)), rise / TURN * np.exp(size * np.sin(direction))
    assert not np.any(realisable(*sampled, 0.0))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_nearest_one_is_nearest_along_the_border_too(side: float):
    # Where turns touch, the border is a curve of angles; contraction_limit is an independent closed form of it.
    design = helix.design_antenna(0.020, 0.020, diameter=D, turns=3.0, on_unrealisable="nearest")
    assert design.wish is not None
    assert design.deviation is not None
    for step in (1e-4, 1e-3, 1e-2):
        angle = design.angle + side * step
        _, centre, _ = complex_helix(float(helix.contraction_limit(angle)), angle, D)
        assert distance_to(design.wish, np.array(centre.real), np.array(centre.imag)) > design.deviation.distance
    assert float(design.contact.turn_clearance) == pytest.approx(0.0, abs=1e-12 * D)


# --- Words and files


def test_the_summary_tells_the_numbers_of_the_tube_and_the_change_of_the_wish():
    design = helix.design_grasp(
        0.020, 0.020, diameter=D, turns=3.0, squeeze=0.002, on_unrealisable="nearest", handedness="left"
    )
    text = str(design)
    for words in (
        "left-handed",
        "33.10 mm",
        f"{design.tube_length * 1e3:.2f} mm",
        "3.000 turns",
        "2.00 mm less than the object",
    ):
        assert words in text
    assert design.deviation is not None
    assert f"rise {design.deviation.turn_height * 1e3:+.3f} mm a turn" in text
    assert "CANNOT" not in text
    assert text == design.summary()


@pytest.mark.parametrize(
    "design",
    [
        helix.design_grasp(0.020, 0.080, diameter=D, turns=1.5, squeeze=0.001, handedness="left"),
        helix.design_antenna(0.02, 0.02, diameter=D, turns=3.0, on_unrealisable="nearest"),
        HelixDesign(0.66, 0.1, D, 2),
    ],
)
def test_a_saved_design_comes_back_to_the_last_digit(design: HelixDesign, tmp_path: Path):
    for name in ("design.json", "design.npz"):
        loaded = load_result(save_result(design, tmp_path / "new" / name))
        for field in ("contraction", "angle", "diameter", "turns", "handedness", "wish"):
            assert getattr(loaded, field) == getattr(design, field)
        assert (loaded.tube_length, loaded.summary()) == (design.tube_length, design.summary())


@each_row(
    ("change", "words"),
    [
        ({"contraction": 1.5}, "contraction"),
        ({"angle": "0.1"}, "angle"),
        ({"turns": [1.0, 2.0]}, "size 1"),
        ({"handedness": "up"}, "handedness"),
        ({"wish_purpose": "hug"}, "purpose"),
        ({"wish_path": "outer"}, "path"),
        ({"wish_radius": -0.02}, "radius"),
    ],
)
def test_a_file_that_holds_no_design_is_refused(change: dict[str, Any], words: str, tmp_path: Path):
    path = save_result(helix.design_grasp(0.020, 0.080, diameter=D, turns=1.5), tmp_path / "design.npz")
    arrays = dict(np.load(path))
    np.savez(path, **(arrays | change))
    with pytest.raises(FileFormatError, match=words):
        load_result(path)
    for name in change:
        np.savez(path, **{key: value for key, value in arrays.items() if key != name})
        with pytest.raises(FileFormatError) if name != "wish_purpose" else nullcontext():
            load_result(path)


# --- Bad input


@each_row(
    ("change", "field"),
    [
        ({"object_radius": 0.0}, "object_radius"),
        ({"object_radius": float("nan")}, "object_radius"),
        ({"turn_height": -0.08}, "turn_height"),
        ({"turn_height": 0.0}, "turn_height"),
        ({"turn_height": 1e6}, "turn_height"),  # a straight tube for all that a float can tell
        ({"object_radius": 1e-9}, "radius"),
        ({"diameter": 0.0}, "diameter"),
        ({"turns": -1.0}, "turns"),
        ({"turns": math.inf}, "turns"),
        ({"squeeze": -0.001}, "squeeze"),
        ({"squeeze": 0.020}, "squeeze"),
        ({"handedness": "both"}, "handedness"),
        ({"on_unrealisable": "ignore"}, "on_unrealisable"),
    ],
)
def test_a_bad_wish_is_refused(change: dict[str, Any], field: str):
    good: dict[str, Any] = {"object_radius": 0.020, "turn_height": 0.080, "diameter": D, "turns": 1.5}
    with pytest.raises(ParameterError) as caught:
        helix.design_grasp(**(good | change))
    assert caught.value.field == field


@each_row(("radius", "field"), [(0.0, "radius"), (-0.1, "radius"), ("wide", "radius"), (True, "radius")])
def test_a_bad_antenna_is_refused(radius: Any, field: str):
    with pytest.raises(ParameterError) as caught:
        helix.design_antenna(radius, 0.08, diameter=D, turns=1.5)
    assert caught.value.field == field


@each_row(
    "wish",
    [
        "grasp",
        ("grasp", "inner", 0.02, 0.08, 0.0),
        Wish("grasp", "inner", 0.02, 0.08, -0.1),
        Wish("grasp", "inner", math.nan, 0.08),
    ],
)
def test_a_bad_wish_of_a_design_is_refused(wish: Any):
    with pytest.raises(ParameterError, match="wish"):
        HelixDesign(0.5, 0.1, D, 1.0, wish=wish)


@pytest.mark.parametrize("actuator_", [(0.5, 0.0), (1.0, 0.1)])  # no rise; inner path beyond the axis
def test_a_wish_is_not_compared_with_a_helix_without_radius_or_rise(actuator_: tuple[float, float]):
    with pytest.raises(ParameterError, match="wish"):
        HelixDesign(*actuator_, D, 0.4, wish=Wish("grasp", "inner", 0.02, 0.08))
