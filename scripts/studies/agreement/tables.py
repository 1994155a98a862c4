"""The results as Markdown tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from studies.agreement.robots import COARSE, FINE
from studies.shared.markdown import line


def table(results: Mapping[str, dict[str, Any]]) -> str:
    """Format the results as Markdown."""
    return "\n\n".join(section(result) for result in results.values())


def section(result: dict[str, Any]) -> str:
    """The tables of a study."""
    counts = result["counts"]
    several = any(row["largest_m"] > row["error_m"] for form in result["forms"].values() for row in form["rows"])
    lines = [f"### {result['title']}", "", "Tip error [mm] for n segments:", ""]
    lines += [line(["model", *counts, "order", "order of the angle"]), "|---" * (len(counts) + 3) + "|"]
    entries = dict(result["forms"])
    if "mujoco" in result:
        entries[f'MuJoCo, of "{result["mujoco"]["of"]}"'] = result["mujoco"]
    for name, form in entries.items():
        cells = by_count(form["rows"], counts, lambda row: cell(row, several=several))
        lines.append(line([name, *cells, *(f"{form[key]:.2f}" if key in form else "" for key in ("order", "angle_order"))]))
    if "mujoco" in result:
        cells = by_count(result["mujoco"]["apart"], counts, lambda row: f"{1e3 * row['error_m']:.0e}")
        lines.append(line(["difference of MuJoCo from ours", *cells, "", ""]))
    text = f"The boundary-value solve at a tolerance of {COARSE:g} lies {1e3 * result['rod']['largest_m']:.0e} mm from that at "
    text += f"{FINE:g}"
    if "closed_form" in result:
        text += f", and that lies {1e3 * result['closed_form']['largest_m']:.0e} mm from the elliptic integrals"
    lines += ["", text + "."]
    if several:
        lines += ["", "Mean time of a solve in the same run [ms] (not asserted anywhere):", ""]
        lines += [line(["model", *counts]), "|---" * (len(counts) + 1) + "|"]
        for name, form in result["forms"].items():
            lines.append(line([name, *by_count(form["rows"], counts, lambda row: f"{1e3 * row['solve_s']:.1f}")]))
    return "\n".join(lines)


def cell(row: Mapping[str, float], *, several: bool) -> str:
    """An error [mm], with the largest of several behind it."""
    return f"{1e3 * row['error_m']:.3g}" + (f" ({1e3 * row['largest_m']:.3g})" if several else "")


def by_count(rows: list[dict[str, Any]], counts: Sequence[int], text: Callable[[dict[str, Any]], str]) -> list[str]:
    """A cell for each number of segments; a chain of too many joints has none."""
    cells = {row["n"]: text(row) for row in rows}
    return [cells.get(n, "-") for n in counts]
