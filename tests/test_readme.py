"""The README keeps its promises: its commands and numbers are those of the project. (`test_documentation.py` runs its code.)"""

from __future__ import annotations

import json
import re

import pytest

from tests.conftest import CHECKOUT

pytestmark = pytest.mark.system

README = (CHECKOUT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_it_shows_before_it_tells() -> None:
    """One sentence, a moving picture, how to install, eight lines of code that end in a number, the robots, pages, limits."""
    marks = ("Soft robots as", "images/inflatable_arm.gif", "pip install", "```python", "```text", "## Three robots")
    marks += ("## I want to", "## What it does not do", "## Sources")
    order = [README.index(mark) for mark in marks]
    assert order == sorted(order)
    assert README.count("\n") <= 125
    assert (CHECKOUT / "docs/images/inflatable_arm.gif").stat().st_size > 10_000
    code, printed = blocks("python")[0], blocks("text")[0]
    assert len([line for line in code.splitlines() if line]) == 8
    assert re.search(r"\d+\.\d+ N$", printed.strip())


def test_there_are_two_commands_and_each_stands_alone() -> None:
    commands = [block.strip() for block in blocks("sh")]
    assert len(commands) == 2
    for command in commands:
        assert "\n" not in command
        assert command.startswith("python3 -m venv .venv && .venv/bin/pip install -e ")


def test_every_dependency_is_named_with_its_purpose() -> None:
    project = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    listed = project[project.index("\ndependencies = [") : project.index("[project.optional-dependencies]")]
    packages = re.findall(r'^ +"([\w-]+)', listed, flags=re.MULTILINE)
    assert {"pin", "numpy", "xacro"} <= set(packages)
    page = (CHECKOUT / "docs" / "index.md").read_text(encoding="utf-8")
    for package in (*packages, "example-robot-data", "pytest"):
        assert f"| {package} |" in page, package


def test_the_numbers_of_the_default_trajectory_are_current(tmp_path) -> None:
    from tests.support.scripts import run_script

    run_script("ik_trajectory", ["--output", str(tmp_path / "a"), "--no-plots"])
    summary = json.loads((tmp_path / "a" / "summary.json").read_text())
    text = " ".join((CHECKOUT / "docs" / "inflatable_arm.md").read_text(encoding="utf-8").split())
    assert f"({summary['largest_moment_N_m'][0]:.2f} N m) is within 10 %" in text
    assert f"{summary['required_pressure_Pa'] / 1e3:.2f} kPa would then do" in text
    assert f"off by up to {1e3 * summary['tip_error_uncompensated_m']:.0f} mm" in text
    assert f"by up to {1e3 * summary['tip_error_paper_m']:.0f} mm" in text
    assert summary["tip_error_compensated_m"] <= 1e-9
    assert summary["required_tabulated_pressure_Pa"] == 50e3
    assert abs(summary["largest_moment_N_m"][0] / 17.51 - 1) < 0.1


def test_the_rate_tables_are_those_of_the_recorded_run() -> None:
    page = (CHECKOUT / "docs" / "validation.md").read_text(encoding="utf-8")
    rates = json.loads((CHECKOUT / "docs" / "solver_rates.json").read_text(encoding="utf-8"))
    assert rates["cases"] == 10_000
    for table in ("equilibrium", "load_estimation"):
        for method, row in rates[table].items():
            cells = " | ".join(f"{rate:.2f}" for rate in row.values())
            assert re.search(rf"\| {method}[^|]* \| {re.escape(cells)} \|", page), (method, cells)


def test_citation_names_the_papers() -> None:
    text = (CHECKOUT / "CITATION.cff").read_text(encoding="utf-8")
    assert "10.3390/app11062558" in text
    assert "Helical Actuation on a Soft Inflated Robot Body" in text
    assert "two-segment continuum robot" in text
