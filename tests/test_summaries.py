"""Every result tells what it holds: as text, as HTML, in a line, and in `help()`; numbers by the dozen only when asked."""

from __future__ import annotations

import dataclasses
import inspect
import pickle
import pydoc
import re
from functools import cache
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softrobots as sr
from softrobots.core.summary import MOST_ROWS, Summarised, Table, html_of, text_of
from tests.support.hostile_data import results
from tests.support.laws import law

ONE_LINE = 300
"""Characters of a `repr`, which error messages contain."""

TIMES = np.linspace(0.0, 4.0, 400)
"""Times of a record of a vibration [s]."""

EVIL = '<script>alert(1)</script> & "it"'
"""A name as a hostile file has it."""


DRAWN = {"svg", "title", "rect", "path", "circle", "text"}
"""Elements of a small picture."""


class _Reader(HTMLParser):
    """Texts of the cells of a page; refuses tags that are left open, closed twice, or could do something."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.said = ""

    def handle_starttag(self, tag: str, attrs: object) -> None:
        assert tag in {"div", "p", "br", "table", "caption", "tr", "th", "td"} | DRAWN
        if tag != "br":
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in {"th", "td"}:
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.said += data
        if self.open and self.open[-1] in {"th", "td"}:
            self.rows[-1][-1] += data


def read(html: str) -> _Reader:
    reader = _Reader()
    reader.feed(html)
    reader.close()
    assert not reader.open
    return reader


@cache
def every_result() -> dict[str, Any]:
    """A result of every kind that can be saved, and of the others that functions return."""
    known = results()
    held, modes, path = known["equilibrium"], known["vibration_modes"], known["trajectory"]
    robot = sr.InflatableArm(stiffness=150.0)
    compiled = sr.compile(held.model, backend="python")
    motors, torques, force = (np.tile(row, (30, 1)) for row in (held.q_motors, held.motor_torques, (0.0, 10.0, -15.0)))
    design = sr.helix.design_antenna(0.05, 0.04, diameter=0.02, turns=3.0)
    return {
        **{name: one for name, one in known.items() if name != "branches"},
        "branch": known["branches"][0],
        "robot": held.model,
        "link_limits": held.link_limits,
        "sensitivity": sr.sensitivity(
            sr.load_model(robot), sr.solve_equilibrium(sr.load_model(robot), held.q_motors), "stiffness"
        ),
        "linear_model": sr.linearize(held.model, held),
        "informative_poses": sr.informative_poses(robot, "stiffness", np.eye(3), 2, force=np.tile((0.0, 0.0, -5.0), (3, 1))),
        "compiled_equilibrium": compiled.equilibrium(held.q_motors, (0.0, 10.0, -15.0)),
        "equilibria": compiled.equilibria(motors, force),
        "forces": compiled.estimate_loads(motors, torques),
        "input_shaper": sr.input_shaper(modes.frequencies[0], 0.02),
        "shaped_trajectory": sr.shape_input(path, sr.vibration_modes(path.model, path.equilibria[0])),
        "design": design,
        "shape": design.shape,
        "bent_tube": sr.helix.bent_tube(design.contraction, design.angle, design.diameter, design.tube_length),
        "pattern": sr.helix.pinch_pattern(design, 0.02),
        "contact_place": sr.locate_contact(held.model, held.q_motors, held.motor_torques, torque_std=0.1, count=2)[0],
        "stability": held.stability,
        "ring_down": sr.ring_down(TIMES, np.exp(-0.3 * TIMES) * np.cos(12.0 * TIMES) + 1e-4 * np.cos(97.0 * TIMES)),
    }


NAMES = [
    *("equilibrium", "ik_solution", "load_estimate", "trajectory", "imposed_displacement", "branch", "contact_path"),
    *("stability", "ring_down"),
    *("workspace", "workspace_map", "contact_place", "robot", "link_limits", "characterisation", "vibration_modes", "motion"),
    *("linear_model", "input_shaper", "shaped_trajectory", "measurements", "identification", "cross_validation", "sensitivity"),
    *("informative_poses", "compiled_equilibrium", "equilibria", "forces", "design", "shape", "bent_tube", "pattern"),
]


@pytest.mark.study
@pytest.mark.parametrize("name", NAMES)
def test_a_result_tells_what_it_holds(name: str) -> None:
    result = every_result()[name]
    text, page = result.summary(), read(result._repr_html_())
    assert str(result) == text
    assert text.strip()
    assert not re.search(r"\bnan\b|array\(|\n\n\n|object at 0x", text)
    assert all(len(block.splitlines()) <= MOST_ROWS + 3 for block in text.split("\n\n"))
    for cells in page.rows:
        assert all(cell.strip() in text for cell in cells)
    line = repr(result)
    assert line.startswith(type(result).__name__)
    assert len(line) < ONE_LINE
    assert "array" not in line
    assert "\n" not in line
    assert not line.endswith("()")
    again = pickle.loads(pickle.dumps(result))
    assert (repr(again), again.summary()) == (line, text)


def test_an_equilibrium_names_its_actuators_with_units_and_its_tip() -> None:
    held = results()["equilibrium"]
    text = held.summary()
    for joint in (*held.model.motor_joints, *held.model.spring_joints):
        assert re.search(rf"^{joint} +-?\d\.\d+  rad +-?\d+\.\d+  N m$", text, re.M)
    x, y, z = (f"{number:.6g}" for number in held.tip_position)
    assert f"{x}  {y}  {z} m" in text
    assert "yes, certified" in text


def test_a_robot_names_its_actuators_with_limits_and_units() -> None:
    text = sr.load_model(sr.PccArm(kind="pressure", segment_lengths=(0.3,), muscle_max_pressure=2e5)).summary()
    assert len(re.findall(r"^muscle\S* +pressure +0 +200000 +0  Pa$", text, re.M)) == 3


def test_names_of_files_are_escaped() -> None:
    urdf = (
        sr.InflatableArm()
        .urdf()
        .replace(
            'name="inflatable_arm"', f'name="{EVIL.replace("&", "&amp;").replace("<", "&lt;").replace(chr(34), "&quot;")}"'
        )
    )
    model = sr.load_model(urdf)
    held = sr.solve_equilibrium(model, np.zeros(3))
    for result in (model, held):
        assert EVIL in result.summary()
        assert EVIL in read(result._repr_html_()).said
        assert "<script" not in result._repr_html_()


WORDS = st.text(st.characters(exclude_categories=("Cc", "Cs", "Zl", "Zp")), max_size=12)


@law("SoftModel.summary", "SoftModel.summary_parts")
@given(st.integers(1, 9), st.integers(0, 12), st.data())
def test_text_and_page_have_the_same_cells(columns: int, count: int, data: st.DataObject) -> None:
    rows = [tuple(data.draw(WORDS) for _ in range(columns)) for _ in range(count)]
    table = Table([tuple(f"c{place}" for place in range(columns)), *rows])

    class Known(Summarised):
        def summary_parts(self) -> list[Any]:
            return [EVIL, table]

    result = Known()
    page = read(result._repr_html_())
    assert [tuple(row) for row in page.rows] == [*table.rows]
    assert page.said.startswith(EVIL)
    assert sr.SoftModel.summary is Summarised.summary is not sr.SoftModel.summary_parts
    lines = result.summary().split("\n")
    assert len(lines) == count + 3
    for line, row in zip(lines[2:], table.rows, strict=True):
        assert "".join(line.split()) == "".join("".join(row).split())


def test_a_long_table_is_cut_unless_all_is_asked_for() -> None:
    table = Table([("name", "value"), *((f"n{row}", str(row)) for row in range(100))])
    lines = text_of([table]).splitlines()
    assert len(lines) == MOST_ROWS + 2
    assert lines[MOST_ROWS // 2 + 1] == f"... {100 - MOST_ROWS} more ..."
    assert lines[-1].split() == ["n99", "99"]
    assert len(text_of([table], None).splitlines()) == 101
    assert len(read(html_of([table])).rows) == MOST_ROWS + 2


ROBOTS = (sr.InflatableArm, sr.PccArm, sr.TendonArm, sr.HelixTube, sr.Route)
RESULTS = (
    sr.Equilibrium,
    sr.LinkLimits,
    sr.IkSolution,
    sr.Trajectory,
    sr.LoadEstimate,
    sr.Motion,
    sr.VibrationModes,
    sr.Workspace,
)
HELPED = (*ROBOTS, *RESULTS, sr.LinearModel, sr.Measurements, sr.Identification, sr.SoftModel, sr.helix.HelixDesign)


@pytest.mark.parametrize("kind", HELPED)
def test_help_tells_every_field_with_its_unit(kind: Any) -> None:
    """The unit stands in the source below the field, or in its facts; `pydoc` shows it."""
    shown = re.sub(r"\n *\| *", " ", pydoc.render_doc(kind, renderer=pydoc.plaintext))
    shown = shown.partition("Attributes:")[2].partition("Method resolution order")[0]
    fields = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ()
    source = "".join(inspect.getsource(one) for one in kind.__mro__ if one.__module__.startswith("softrobots"))
    for field in fields:
        entry = shown.partition(f" {field.name}: ")[2]
        assert entry, field.name
        if "facts" in field.metadata:
            unit = field.metadata["facts"].unit
            assert not unit or f"[{unit}]" in entry[: entry.index("Default:")]
            assert repr(field.default) in entry
        else:
            (text,) = re.findall(rf'^    {field.name}: [^\n]*\n    r?"""(.*?)"""', source, re.M | re.S)
            assert " ".join(entry.split()).startswith(" ".join(text.split())[:60])
    for name in getattr(kind, "_fields", ()):
        assert f" {name}: " in shown


def test_help_has_no_private_fields() -> None:
    for kind in (*ROBOTS, sr.SoftModel):
        assert not re.search(r"^ *_\w+:", kind.__doc__.partition("Attributes:")[2], re.M)


def test_a_probe_that_has_to_pull_says_so(arm: sr.SoftModel) -> None:
    for displacement, told in ((0.01, "no"), (-0.01, "YES: what the robot only touches cannot")):
        found = sr.solve_imposed_displacement(arm, (0, 0.3, 0), displacement, direction=(0, 0, 1))
        assert found.pulls == (told != "no")
        assert re.search(rf"the probe has to pull +{told}$", found.summary(), re.M)


def test_a_force_that_is_estimated_as_none_is_printed_as_none(arm: sr.SoftModel) -> None:
    """Rounding of a solution, 1e-11 N, is no force."""
    held = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 0, -5), gravity=sr.EARTH_GRAVITY)
    found = sr.estimate_load(arm, held.q_motors, held.motor_torques, gravity=sr.EARTH_GRAVITY)
    assert re.search(r"^force on tip +0  0  -5 N$", found.summary(), re.M)
    assert re.search(r"^load on tip +force 0  0  -5 N$", found.summary(), re.M)
