"""The soak of contacts: its core small, its distances, and that it can fail."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from studies.soak import contact_cases
from studies.soak.contact_cases import FAMILIES, judge
from studies.soak.contact_running import family_of, soak_contact, table
from studies.soak.plain_contact import distance
from studies.soak.running import as_json
from tests.support.scripts import run_script


@pytest.mark.study
def test_a_small_soak_breaks_no_law(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.soak.contact_running.FAMILIES", FAMILIES[:1])
    tallies = soak_contact(40, seed=5)
    assert as_json(tallies, seed=5)["broken"] == 0
    arm = tallies["arm"]
    assert arm.cases == 28
    assert sum(count for outcome, count in arm.outcomes.items() if outcome.isdecimal() and outcome != "0") > 8
    assert arm.penetration <= 1e-9
    assert arm.residual <= 1.01
    assert arm.disturbed == 2
    assert table(tallies).count("\n") == 3


@pytest.mark.study
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_a_soak_of_every_robot_breaks_no_law(family: Any) -> None:
    tally = judge(family, 11, range(25))
    assert tally.broken == []
    assert tally.cases == 25


def tampered(monkeypatch: pytest.MonkeyPatch, change: Callable[[Any], Any]) -> list[str]:
    """Laws that are broken when the answers for the arm are changed."""
    solve = contact_cases.solve_equilibrium
    monkeypatch.setattr(contact_cases, "solve_equilibrium", lambda *asked, **load: change(solve(*asked, **load)))
    return [law for _, law in judge(family_of("arm"), 5, range(2, 5)).broken]


def with_contacts(found: Any, **changes: Any) -> Any:
    """The same answer with other contacts."""
    names = ("q_springs", "q_motors", "model", "load", "stable")
    contacts = [replace(one, **{name: change(one) for name, change in changes.items()}) for one in found.contacts]
    return SimpleNamespace(contacts=contacts, **{name: getattr(found, name) for name in names})


@pytest.mark.study
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda found: SimpleNamespace(**{**vars(with_contacts(found)), "contacts": []}), "out of balance"),
        (lambda found: with_contacts(found, force=lambda one: 1.001 * one.force), "out of balance"),
        (lambda found: with_contacts(found, point=lambda one: one.point + [0.0, 1e-6, 1e-6]), "out of balance"),
        (lambda found: with_contacts(found, normal_force=lambda one: -one.normal_force), "a contact with force -"),
        (lambda found: with_contacts(found, gap=lambda one: 1e-8), "gap 1e-08"),
        (lambda found: with_contacts(found, obstacle_point=lambda one: one.point + 1e-6 * one.normal), "off the surface"),
        (lambda found: with_contacts(found, normal=lambda one: one.normal[[1, 2, 0]]), "a normal that is off"),
    ],
)
def test_a_soak_sees_what_is_wrong(monkeypatch: pytest.MonkeyPatch, change: Callable[[Any], Any], words: str) -> None:
    assert any(words in law for law in tampered(monkeypatch, change))


def test_a_soak_sees_penetrations_and_what_is_no_minimum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers of a solver that knows no obstacles, and of one that takes a saddle for a minimum."""
    solve = contact_cases.solve_equilibrium
    monkeypatch.setattr(contact_cases, "solve_equilibrium", lambda *asked, environment, **load: solve(*asked, **load))
    assert any("a penetration of" in law for _, law in judge(family_of("arm"), 5, range(20)).broken)
    arm = sr.load_model(sr.InflatableArm())
    body = contact_cases.PlainBody(contact_cases.PlainStatics(arm))
    case, _ = contact_cases.draw(family_of("arm"), body, 0, 0)
    case = case._replace(motors=np.zeros((1, 3)), forces=np.array([[-150.0, 0.0, 0.0]]))  # beyond its buckling load
    load = sr.solve_equilibrium(arm, (0, 0, 0), (-1.0, 0, 0)).load
    straight = SimpleNamespace(model=arm, q_motors=np.zeros(3), q_springs=np.zeros(4), load=load)
    far = sr.Environment([sr.Sphere(0.1, (0.0, 0.0, 5.0))])
    laws = contact_cases._not_lowest(body, case, far, straight, np.random.default_rng(0))
    assert [law.startswith("a certified minimum, but ") for law in laws] == [True]


def test_distances_are_those_by_hand() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # x to y
    box = sr.Box((2.0, 4.0, 6.0), (1.0, 0.0, 0.0), turn)  # 4 along x, 2 along y
    cylinder, capsule = sr.Cylinder(1.0, 2.0), sr.Capsule(1.0, 2.0)
    for obstacle, point, expected in (
        (sr.HalfSpace((0.0, 0.0, 2.0), 1.0), (5.0, 0.0, 3.0), 2.0),
        (sr.Sphere(0.5, (0.0, 3.0, 0.0)), (0.0, 0.0, 4.0), 4.5),
        (box, (6.0, 0.0, 0.0), 3.0),
        (box, (6.0, 5.0, 0.0), 5.0),
        (box, (1.0, 0.5, 0.0), -0.5),
        (cylinder, (4.0, 0.0, 5.0), 5.0),
        (cylinder, (0.0, 0.0, 0.75), -0.25),
        (capsule, (3.0, 0.0, 5.0), 4.0),
        (capsule, (0.0, 3.0, 0.5), 2.0),
    ):
        assert float(distance(obstacle, np.array(point))) == pytest.approx(expected, abs=1e-14)  # rounding


def test_the_script_records_its_table_and_runs_a_case_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("studies.soak.contact_running.FAMILIES", FAMILIES[:1])
    (tmp_path / "docs").mkdir()
    page = tmp_path / "docs" / "validation.md"
    page.write_text("<!-- soak_contact:begin -->\n<!-- soak_contact:end -->\n")
    assert run_script("soak_contact", ["--cases", "3", "--processes", "1", "--docs", str(tmp_path)]) == 0
    assert page.read_text().count("| arm |") == 1
    assert json.loads((tmp_path / "docs" / "validation" / "soak_contact.json").read_text())["broken"] == 0
    assert run_script("soak_contact", ["--case", "arm:3"]) == 0
    assert "obstacles:" in capsys.readouterr().out
    assert run_script("soak_contact", ["--case", "arm"]) == 2
    assert run_script("soak_contact", ["--case", "leg:3"]) == 2
    assert run_script("soak_contact", ["--cases", "0"]) == 2
