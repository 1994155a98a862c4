"""The notebook runs in a kernel of its own, shows the numbers it should, and its views draw the robot without any server."""

from __future__ import annotations

import html
import os
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.kinematics import frame_placement
from studies.shared.browser import find_chromium, open_browser, show_share
from tests.conftest import CHECKOUT, missing
from tests.support.pictures import coloured, pixels

pytestmark = pytest.mark.system

NOTEBOOK = CHECKOUT / "docs" / "tutorial.ipynb"
VIEWS = ("view", "animation")
"""Cells whose last expression is the viewer."""


@pytest.fixture(scope="module")
def written() -> Any:
    """The notebook as it is in the checkout."""
    try:
        import nbformat
    except ImportError:
        missing("nbformat is not installed")
    return nbformat.read(NOTEBOOK, as_version=4)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("notebook")


@pytest.fixture(scope="module")
def executed(written: Any, folder: Path) -> Any:
    """The notebook after a run from top to bottom, in an empty folder; a cell that fails raises."""
    try:
        import ipykernel  # noqa: F401
        from nbclient import NotebookClient
    except ImportError as error:
        missing(f"{error.name} is not installed")
    import copy

    notebook = copy.deepcopy(written)
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "IPYTHONDIR": str(folder.parent / "ipython")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "environ", environment)
        NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}).execute()
    return notebook


def outputs(notebook: Any, name: str) -> list[Any]:
    return next(cell for cell in notebook.cells if cell.id == name).outputs


def shown(notebook: Any, name: str, kind: str = "text/plain") -> str:
    """The value of the last expression of a cell."""
    (result,) = (output for output in outputs(notebook, name) if output.output_type == "execute_result")
    return result.data[kind]


def numbers(notebook: Any, cell: str, entry: str) -> list[float]:
    """The numbers behind an entry of the mapping that a cell shows."""
    text = shown(notebook, cell)
    (found,) = re.findall(rf"'{re.escape(entry)}': (?:array\()?(\[[^]]*\]|[^,}}]+)", text)
    return [float(word) for word in re.findall(r"-?\d+(?:\.\d*)?(?:e[+-]?\d+)?", found)]


def test_it_is_stored_without_outputs_and_asks_for_no_special_kernel(written: Any) -> None:
    code = [cell for cell in written.cells if cell.cell_type == "code"]
    assert 15 <= len(code) <= 20
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)
    assert written.metadata.kernelspec.name == "python3"
    assert len({cell.id for cell in written.cells}) == len(written.cells)
    named = {word for cell in code for word in re.findall(r"^(?:import|from) (\w+)", cell.source, re.M)}
    assert named == {"numpy", "softrobots", "pathlib", "tempfile"}  # with matplotlib of the extra: a bare Jupyter has no more
    assert not [cell.id for cell in code if re.search(r"https?://|!pip|%pip", cell.source)]


def test_every_cell_runs_and_says_nothing_on_the_side(executed: Any, folder: Path) -> None:
    code = [cell for cell in executed.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    for cell in code:
        assert [output.output_type for output in cell.outputs] == ["execute_result"] * (cell.id != "close"), cell.id
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("cell", "entry", "expected", "tolerance"),
    [  # values of docs/theory.md, 1.4, 2.3 and 3; half a unit of the last digit that is shown, there or here
        ("load", "stiffness [N m/rad]", [172.71] * 4, 0.0),
        ("equilibrium", "tip [m]", [1.01935, 0.38587, 0.09712], 1e-12),
        ("equilibrium", "springs [rad]", [0.05339, -0.09228, 0.03172, -0.04214], 1e-12),
        ("estimate", "force [N]", [0.0, 10.0, -15.0], 0.0),
        ("estimate", "cannot be felt", [0.0], 0.0),
        ("ik", "off the target [m]", [0.0], 1e-9),
        ("trajectory", "largest tip error [m]", [0.0], 1e-9),
        ("pcc", "bending [rad]", [0.726483, 0.440959], 1.1e-6),
        ("pcc", "tip, closed form [m]", [0.44957382, -0.31544214, 0.84384418], 1e-12),
        ("pcc", "difference of the chain [m]", [0.0], 1e-9),
        ("helix", "outer radius [m]", [0.0854078008], 5.1e-11),
        ("helix", "pitch [m/rad]", [0.0279647090], 5.1e-11),
        ("compile", "difference from solve_equilibrium [m]", [0.0], 1e-9),
    ],
)
def test_the_numbers_are_those_of_theory(executed: Any, cell: str, entry: str, expected: list, tolerance: float) -> None:
    assert numbers(executed, cell, entry) == pytest.approx(expected, rel=0.0, abs=tolerance)


def test_the_rest_that_is_shown_agrees_with_independent_answers(executed: Any, arm: sr.SoftModel) -> None:
    # the largest moment of the arm, and the pressure at which a tube of 55 mm wrinkles: (3) of the paper, less what the axial
    # force of the first link, the load along the middle between its axes before and behind the hinge, takes off the cap force
    entries = ("largest moment of each link [N m]", "pressure that would do [kPa]")
    moment, pressure = (numbers(executed, "trajectory", entry)[0] for entry in entries)
    load, path = np.array([0.0, 10.0, -15.0]), sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 60)
    needed, largest = 0.0, 0.0
    for held in sr.follow_trajectory(arm, path.positions, load, times=path.times, elbow="up").equilibria:
        bent = float(np.linalg.norm(172.71 * held.q_springs[:2]))
        before, behind = (frame_placement(arm, held.q, name).rotation[:, 0] for name in ("link_1_root", "link_1"))
        axial = float(load @ (before + behind)) / np.linalg.norm(before + behind)
        needed = max(needed, bent / (np.pi**2 / 4.0 * 0.055**3) - axial / (np.pi * 0.055**2))
        largest = max(largest, bent)
    assert moment == pytest.approx(largest, abs=0.0051)  # two decimals are shown
    assert pressure * 1e3 == pytest.approx(needed, abs=5.1)
    # the spread of the force that noise of 0.05 N m makes, through the derivative of the torques by central differences
    motors, force = (0.3, 0.6, -0.8), np.array([0.0, 10.0, -15.0])
    ends = [[sr.solve_equilibrium(arm, motors, force + sign * step).motor_torques for sign in (1, -1)] for step in np.eye(3)]
    rates = np.array([(after - before) / 2.0 for after, before in ends]).T
    spread = 0.05 * np.sqrt(np.diag(np.linalg.inv(rates.T @ rates)))
    # three digits are shown; differences over 1 N are off by third derivatives, a thousandth
    assert numbers(executed, "estimate", "standard deviation [N]") == pytest.approx(spread, rel=2e-3, abs=5.1e-4)
    assert numbers(executed, "ik", "off with rigid kinematics [m]")[0] > 0.05
    assert "'stable': True" in shown(executed, "equilibrium")
    assert shown(executed, "export").count('stiffness="172.71"') == 4
    assert shown(executed, "save").count("True") == 2
    assert shown(executed, "imports") == repr(sr.__version__)


@pytest.mark.parametrize("cell", ["moments", "pcc-picture", "helix-picture", "plot"])
def test_figures_are_shown(executed: Any, cell: str) -> None:
    assert len(shown(executed, cell, "image/png")) > 20_000  # base64


@pytest.mark.parametrize("cell", VIEWS)
def test_views_are_pages_inside_the_notebook(executed: Any, cell: str) -> None:
    """Nothing comes from a server, ours or another: that has ended when the notebook is opened again."""
    (page,) = re.findall(r'<iframe [^>]*srcdoc="([^"]*)"', shown(executed, cell, "text/html"))
    page = html.unescape(page)
    assert "rigid arm, same motor angles" in page
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)
    assert not re.search(r"ws://|127\.0\.0\.1:7\d\d\d", page)


def test_the_exported_page_draws_the_robot_and_plays(executed: Any, tool: Callable[[str], ModuleType], tmp_path: Path) -> None:
    exporter = tool("nbconvert").HTMLExporter(mathjax_url="", require_js_url="")  # both on servers of others
    tool("playwright")
    try:
        find_chromium()
    except sr.ViewerError as error:
        missing(str(error))
    import nbformat

    cells = [cell for cell in executed.cells if cell.id in VIEWS]
    text, _ = exporter.from_notebook_node(nbformat.v4.new_notebook(cells=cells, metadata=executed.metadata))
    file = tmp_path / "tour.html"
    file.write_text(text, encoding="utf-8")
    with open_browser() as browser:
        page = browser.new_page(viewport={"width": 900, "height": 1300})
        messages: list[str] = []
        requests: list[str] = []
        page.on("console", lambda message: messages.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.on("request", lambda asked: None if asked.url.startswith(("data:", "blob:")) else requests.append(asked.url))
        page.goto(file.as_uri())
        frames = page.query_selector_all("iframe")
        assert len(frames) == len(VIEWS)
        pictures = []
        for frame, share in ((0, 0.0), (1, 0.0), (1, 1.0)):
            show_share(frames[frame].content_frame(), share)
            pictures.append(pixels(frames[frame].screenshot()))
    assert messages == []
    assert set(requests) <= {file.as_uri(), "about:srcdoc"}
    assert all(coloured(picture) > 2000 for picture in pictures)
    start, end = pictures[1:]
    assert np.count_nonzero(np.abs(start - end).max(axis=2) > 30) > 3000  # the arm has moved
