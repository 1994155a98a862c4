"""The browser view of a continuum arm: smooth tube, muscles and chain together, in a real Chromium."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.view.body import body_at
from softrobots.view.viewer import Viewer, view
from tests.support.pictures import pictures_of

HELD = (0.47, 0.53, 0.55, 0.50, 0.55, 0.53)


@pytest.fixture(scope="module")
def pcc() -> sr.SoftModel:
    return sr.load_model(sr.PccArm())


def muscles(picture: np.ndarray) -> tuple[int, int]:
    """Pixels below the legend that are clearly blue (muscles that pull) and clearly orange (muscles that push).

    The tube, the chain and the background are grey: their red and blue differ by less than 40.
    """
    contrast = picture[200:, :, 2] - picture[200:, :, 0]
    return int(np.count_nonzero(contrast > 80)), int(np.count_nonzero(contrast < -80))


def test_page_shows_pulling_and_pushing_muscles(browser: object, pcc: sr.SoftModel, tmp_path: Path) -> None:
    loaded = sr.solve_equilibrium(pcc, HELD, (6, 4, -3), gravity=sr.EARTH_GRAVITY)
    assert loaded.muscle_forces.min() < 0.0 < loaded.muscle_forces.max()
    with view(pcc, loaded) as viewer:
        page = viewer.write_html(tmp_path / "a.html", title="PCC")
    text = page.read_text(encoding="utf-8")
    for name, force in zip(pcc.motor_joints, loaded.muscle_forces.tolist(), strict=True):
        assert f"{name}: {'pulls' if force > 0.0 else 'pushes'} {abs(force):.3g} N" in text
    assert "same muscle lengths" in text
    assert "path of the tip" not in text  # none is drawn
    (shot,) = pictures_of(browser, page.as_uri(), 0.0)
    assert min(muscles(shot)) > 300


@pytest.mark.study
def test_viewer_takes_every_kind_of_continuum_arm() -> None:
    for robot, muscles in (
        (sr.PccArm(chain="lumped", hinges=4), "lengths"),
        (sr.PccArm(), "forces"),
        (sr.PccArm(muscle_azimuths=(), segment_lengths=(0.3,)), "lengths"),
    ):
        model = sr.load_model(robot, muscles=muscles)
        with Viewer(model) as viewer:
            viewer.show(sr.solve_equilibrium(model, model.relaxed_motors, (1, 0, 0)))
            assert "MeshCat" in viewer.html() or "softrobots" in viewer.html()


def test_what_is_drawn_is_the_body(pcc: sr.SoftModel) -> None:
    """Corners of the tube stand a radius from the backbone: read back from what the page gets."""
    loaded = sr.solve_equilibrium(pcc, HELD, (6, 4, -3))
    for segment in body_at(loaded.model, loaded.q_motors, loaded.q_springs):
        corners, triangles = segment.surface()
        rings = corners[:-2].reshape(len(segment.backbone), -1, 3)
        assert np.allclose(np.linalg.norm(rings - segment.backbone[:, None], axis=2), 0.05, atol=1e-12)
        assert triangles.max() == len(corners) - 1
