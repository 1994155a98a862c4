"""Growth of a helical tube: every grown length stands on the same helix, the wall that is out stays, the page shows it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import expm

import softrobots as sr
from softrobots.robots.growth import SHORTEST, grown_coordinates
from softrobots.view.animation_frames import growth_frames
from softrobots.view.body import body_at
from softrobots.view.robot_shapes import RobotShapes
from softrobots.view.viewer import view
from tests.support.tables import each_row


@pytest.fixture(scope="module")
def tube() -> sr.HelixTube:
    return sr.HelixTube(elastic_sections=12, length=1.0)


@pytest.fixture(scope="module")
def model(tube: sr.HelixTube) -> sr.SoftModel:
    return sr.load_model(tube)


def frames_of(model: sr.SoftModel, coordinates: np.ndarray) -> np.ndarray:
    """Frames at the ends of the sections, shape (n, 4, 4)."""
    pin_model, data = model.workspace(None)
    pin.framesForwardKinematics(pin_model, data, model.configuration((), coordinates.ravel()))
    names = [f"section_1_{number}" for number in range(1, len(coordinates) + 1)]
    return np.array([data.oMf[model.frame_id(name)].homogeneous for name in names])


def helix_frame(tube: sr.HelixTube, length: float) -> np.ndarray:
    """Frame at a length along the centre line: the exponential of its curvature and torsion, docs/theory.md (12, 13)."""
    zeta = tube.contraction * np.exp(2j * tube.angle)
    centre = tube.diameter * (1 + zeta) / (2 * (1 - zeta))  # Rc + i b
    curvature, torsion = centre.real / abs(centre) ** 2, centre.imag / abs(centre) ** 2
    sign = 1.0 if tube.handedness == "right" else -1.0
    twist = np.zeros((4, 4))
    twist[0, 2], twist[2, 0] = curvature, -curvature
    twist[1, 0], twist[0, 1] = sign * torsion, -sign * torsion
    twist[2, 3] = 1.0
    return expm(length * twist)


@pytest.mark.study
@pytest.mark.parametrize("handedness", ["right", "left"])
def test_every_grown_length_ends_on_the_same_helix(handedness: str) -> None:
    tube = sr.HelixTube(elastic_sections=12, length=1.0, handedness=handedness)
    model = sr.load_model(tube)
    for share in (SHORTEST, 0.01, 0.2, 0.5, 0.777, 1.0):
        grown = grown_coordinates(tube, share * tube.length)
        lengths = np.cumsum(grown[:, 3] + tube.centre_length / 12)
        zeta = tube.contraction * np.exp(2j * tube.angle)
        # The centre line of a tube of length L is L |1 + zeta| / (2 cos theta) long.
        assert lengths[-1] == pytest.approx(share * tube.length * abs(1 + zeta) / (2 * np.cos(tube.angle)), rel=1e-12)
        expected = np.array([helix_frame(tube, length) for length in lengths])
        assert np.allclose(frames_of(model, grown), expected, rtol=0.0, atol=1e-12)  # rounding of 12 products


def test_wall_that_is_out_stays_where_it_is(tube: sr.HelixTube, model: sr.SoftModel) -> None:
    whole = frames_of(model, grown_coordinates(tube, tube.length))
    half = frames_of(model, grown_coordinates(tube, 0.5 * tube.length))
    out = 5  # of the first six, the last is shorter by what the others keep
    assert np.allclose(half[:out], whole[:out], rtol=0.0, atol=1e-12)
    assert np.linalg.norm(half[-1] - whole[-1]) > 0.1


def test_a_grown_tube_of_its_own_has_the_same_shape(tube: sr.HelixTube, model: sr.SoftModel) -> None:
    shorter = tube.grown(0.4)
    other = sr.load_model(shorter)
    tip = np.array(sr.solve_equilibrium(other, ()).transform_tip_to_world.homogeneous)
    assert np.allclose(frames_of(model, grown_coordinates(tube, 0.4))[-1], tip, rtol=0.0, atol=1e-12)


def test_the_front_is_straight_at_the_tip_and_formed_behind(tube: sr.HelixTube) -> None:
    formed, fresh = (grown_coordinates(tube, 0.9, front) for front in (0.0, 0.3))
    lengths = tube.centre_length / 12 + fresh[:, 3]
    bends = fresh[:, 1] / lengths
    assert np.allclose(fresh[:6], formed[:6], rtol=0.0, atol=1e-15)  # more than the front behind the tip
    assert np.all(np.diff(bends[6:]) < 0.0)  # ever straighter towards the tip
    # The last section waits at the tip: half of it away, contraction 1 - 0.34 (its half length / 0.3).
    contraction = 1.0 - 0.34 * (0.5 * SHORTEST / 12) / 0.3
    assert bends[-1] == pytest.approx(2 * (1 - contraction**2) / (0.0331 * abs(1 + contraction * np.exp(2j * tube.angle)) ** 2))
    assert fresh[:, 3].sum() > formed[:, 3].sum()  # a straight tube is longer


@each_row(
    ("length", "front", "field"),
    [(0.0, 0.0, "length"), (1.1, 0.0, "length"), (0.001, 0.0, "length"), (np.nan, 0.0, "length"), (0.5, -0.1, "front")],
)
def test_bad_lengths_are_refused(tube: sr.HelixTube, length: float, front: float, field: str) -> None:
    with pytest.raises(sr.ParameterError) as caught:
        grown_coordinates(tube, length, front)
    assert caught.value.field == field


def test_only_sections_of_a_helical_tube_grow() -> None:
    with pytest.raises(sr.ParameterError, match="HelixTube"):
        grown_coordinates(sr.PccArm(), 0.5)  # type: ignore[arg-type]
    with pytest.raises(sr.ParameterError, match="sections"):
        grown_coordinates(sr.HelixTube(chain="lumped"), 0.5)


def test_frames_of_the_growth_begin_short_and_end_at_rest(tube: sr.HelixTube, model: sr.SoftModel) -> None:
    frames = growth_frames(tube, 4.0)
    lengths = [frame.q_springs.reshape(-1, 4)[:, 3].sum() for frame in frames]
    numbers = [frame.number for frame in frames]
    assert numbers[0] == 0
    assert numbers[-1] == 120  # 4 s at 30 frames a second
    growing = np.array(lengths)[np.array(numbers) <= 90]  # a quarter of the time is left for the whole tube
    assert np.all(np.diff(growing) > 0.0)
    assert np.allclose(frames[-1].q_springs, model.rest, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("length", [0.03, 0.2, 1.0])
def test_the_helix_is_formed_in_the_last_frame_however_short_the_tube(length: float) -> None:
    tube = sr.HelixTube(length=length, elastic_sections=12)
    last = growth_frames(tube, 4.0)[-1]
    strains = last.q_springs.reshape(-1, 4) / (tube.centre_length / 12)
    assert np.allclose(strains[:, 1:3], tube.strains[1:3], rtol=1e-12)
    assert last.grown == 1.0


@pytest.mark.study
def test_the_page_says_what_it_shows_after_the_growth(tube: sr.HelixTube, model: sr.SoftModel) -> None:
    with view(model) as viewer:
        viewer.animate_growth(tube, duration=0.2)
        assert "the whole tube" in viewer.html()
        viewer.show(sr.solve_equilibrium(model, (), gravity=sr.EARTH_GRAVITY))
        page = viewer.html()
        assert "wrinkling moment left" in page
        assert "the whole tube" not in page


@pytest.mark.study
@pytest.mark.parametrize("chain", ["sections", "lumped"])
@pytest.mark.parametrize("names", ["{0}_bend_y {0}_bend_x", "{0}_twist"])
def test_the_viewer_colours_a_section_whatever_its_group_names(chain: str, names: str) -> None:
    text = sr.HelixTube(chain=chain, elastic_sections=6, hinges=6).urdf()
    for section in (f"section_1_{number}" for number in range(1, 7)):
        text = text.replace(f'springs="{section}_bend_x {section}_bend_y"', f'springs="{names.format(section)}"')
    shapes = RobotShapes(sr.load_model(text)).shapes
    assert {shape.inflated_link for shape in shapes if shape.name.startswith("section_1_")} >= set(range(6))


@pytest.mark.study
def test_the_page_says_what_grows(tmp_path: Path) -> None:
    """That it grows is seen in tests/test_pages.py."""
    tube = sr.HelixTube(elastic_sections=6, length=0.6)
    with view(sr.load_model(tube)) as viewer:
        viewer.animate_growth(tube, duration=0.5)  # 15 frames: a light page
        page = viewer.write_html(tmp_path / "a.html", title="Growth")
    text = page.read_text(encoding="utf-8")
    assert "wall that has not come out" in text
    assert "wrinkling" not in re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)  # nothing is loaded


@pytest.mark.study
def test_growth_is_shown_of_the_tube_of_the_model_only(tube: sr.HelixTube, model: sr.SoftModel) -> None:
    with view(model) as viewer:
        for wrong in (tube.grown(0.5), sr.PccArm(), None):
            with pytest.raises(sr.ParameterError, match="loaded from"):
                viewer.animate_growth(wrong)  # type: ignore[arg-type]


def test_the_tip_of_a_growing_tube_is_half_a_ball(tube: sr.HelixTube, model: sr.SoftModel) -> None:
    (segment,) = body_at(model, np.zeros(0), model.rest)
    corners, _ = segment.dome()
    tip = segment.poses[-1]
    ahead = (corners[:-2] - tip[:3, 3]) @ tip[:3, 2]
    assert np.allclose(np.linalg.norm(corners[:-2] - tip[:3, 3], axis=1), 0.5 * 0.0331, rtol=1e-12)
    assert ahead.min() == pytest.approx(0.0, abs=1e-15)
    assert ahead.max() > 0.9 * 0.5 * 0.0331


def test_a_thinned_body_keeps_its_ends(model: sr.SoftModel) -> None:
    (segment,) = body_at(model, np.zeros(0), model.rest)
    for spacing in (0.0, 0.01, 0.1, 10.0):
        thin = segment.thinned(spacing)
        assert np.array_equal(thin.poses[[0, -1]], segment.poses[[0, -1]])
        assert len(thin.lines["actuator"]) == len(thin.poses) >= 2
        steps = np.linalg.norm(np.diff(thin.backbone, axis=0), axis=1)
        assert np.all(steps[:-1] > 0.9 * min(spacing, 0.05))  # chords are a little shorter than the way along
    assert len(segment.thinned(0.0).poses) == len(segment.poses)


def test_actuator_line_runs_along_the_inner_path(tube: sr.HelixTube, model: sr.SoftModel) -> None:
    (segment,) = body_at(model, np.zeros(0), model.rest)
    zeta = tube.contraction * np.exp(2j * tube.angle)
    inner = tube.diameter * zeta / (1 - zeta)
    centre = tube.diameter * (1 + zeta) / (2 * (1 - zeta))
    length = np.linalg.norm(np.diff(segment.lines["actuator"], axis=0), axis=1).sum()
    # Lengths of helices of one pitch are as their moduli |R + i b|; chords of a twelfth section are shorter by 1e-4.
    assert length == pytest.approx(tube.centre_length * abs(inner) / abs(centre), rel=3e-4)


@pytest.mark.study
@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_a_distributed_force_is_shared_out(chain: str) -> None:
    tube = sr.HelixTube(chain=chain, elastic_sections=10, hinges=10)
    model = sr.load_model(tube)
    wrenches = sr.distributed_force(model, (0.0, 0.2, -0.1))
    total = sum(wrenches.values())
    lost = 0.05 if chain == "sections" else 0.0  # half a section at the base
    assert np.allclose(total[:3], np.array([0.0, 0.2, -0.1]) * tube.centre_length * (1.0 - lost), rtol=1e-12)
    assert not total[3:].any()
    # Like a weight: as far as the masses stand for the length.
    heavy = sr.solve_equilibrium(model, (), gravity=(0.0, 0.0, -9.81)).tip_position
    weight = sum(body.mass for body in model.pinocchio.inertias[1:]) * 9.81 / tube.centre_length
    spread = sr.solve_equilibrium(model, (), wrench=sr.distributed_force(model, (0.0, 0.0, -weight))).tip_position
    moved = np.linalg.norm(heavy - sr.solve_equilibrium(model, ()).tip_position)
    assert moved > 0.01
    assert np.linalg.norm(spread - heavy) < 0.05 * moved  # both of second order: (1/10)^2 times a number near 1


def test_a_distributed_force_needs_sections(arm: sr.SoftModel, model: sr.SoftModel) -> None:
    with pytest.raises(sr.ParameterError, match="sections"):
        sr.distributed_force(arm, (0, 0, 1))
    with pytest.raises(sr.ParameterError, match="force_per_length"):
        sr.distributed_force(model, (0, 0))


@each_row(
    ("old", "new", "message"),
    [
        ('name="actuator" segment="1"', 'name="actuator" segment="2"', "line 'actuator'.*runs along segment 2; available: 1"),
        ('distance="0.01655" name="actuator"', 'distance="-1" name="actuator"', "distance -1.0; a positive number"),
        ('azimuth="0.0" distance="0.01655"', 'azimuth="x" distance="0.01655"', "azimuth = 'x'"),
        ('springs="section_1_2_bend_x ', 'springs="section_1_99_bend_x ', "section_1_99_bend_x"),
    ],
)
def test_malformed_tags_are_refused(tube: sr.HelixTube, old: str, new: str, message: str) -> None:
    text = tube.urdf()
    assert old in text
    with pytest.raises(sr.DescriptionError, match=message):
        sr.load_model(text.replace(old, new))
