"""The same robots in other tools: where they stand in equilibrium, and where their links are, against Pinocchio.

Equilibrium: three robots in five poses, weightless and under gravity, with a force on the tip, motors at rest. Each simulator
gets the file that softrobots exports for it, and the force. Two answers are compared with Pinocchio's: where the simulator's
own generalised forces balance, and where 60 s of its simulation end, joints damped near critical. Which joint springs of a
URDF, MJCF or SDF file arrive there is measured: joints are displaced, and those that push back are counted.

Kinematics: each URDF file in urdf/, at 20 random configurations, in every tool that loads URDF.

Prints the tables, and writes every number as JSON if told. Takes minutes, half of one with --no-simulation. Ends with status 1
if a tool does not agree within its tolerance.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.cli.tools.kinematics import KinematicsRow, compare_kinematics
from softrobots.cli.tools.known_tools import TOOLS
from softrobots.core.files import make_folder, new_file, write_text
from softrobots.core.json_text import read_json
from softrobots.description.paths import urdf_folder
from softrobots.export import to_mjcf, to_sdf
from softrobots.view.figures import canvas
from studies.interop.cases import WELDED, equilibrium_cases
from studies.interop.simulators import SIMULATORS, EquilibriumRow, compare_equilibrium
from studies.interop.springs_read import FORMATS, springs_read
from studies.marked_text import marked

ROBOTS = {"inflatable_arm": "inflatable arm", "pcc_arm_lumped": "arm of muscles", "helix_tube_lumped": "helical tube"}
"""Robots of the equilibria, and what the tables call them."""
CHECKOUT = Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- interoperability:begin -->", "<!-- interoperability:end -->"
"""The lines of the page between which the tables stand."""
PAGE = "docs/other_tools.md"
POSES = 5
SMALLEST = 1e-18
"""Where the picture puts a difference of zero."""

LARGEST_FILE = 10_000_000
"""Bytes of a file of results."""

KEYS = {
    "springs": {"tool", "robot", "format", "read", "of"},
    "equilibrium": {"agrees", *(field.name for field in dataclasses.fields(EquilibriumRow))},
    "kinematics": {"agrees", *(field.name for field in dataclasses.fields(KinematicsRow))},
}
"""What each row of the results holds."""

Results = dict[str, Any]
"""What is written as JSON: "springs", "equilibrium" and "kinematics", each a list with a dictionary a case."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    told = f"tools to ask, of {', '.join(TOOLS)} (those that are installed)"
    made.add_argument("--tools", nargs="+", choices=list(TOOLS), metavar="TOOL", help=told)
    told = "robots of the equilibria, of %(choices)s (all)"
    made.add_argument("--robots", nargs="+", choices=list(ROBOTS), default=list(ROBOTS), metavar="ROBOT", help=told)
    made.add_argument("--poses", type=int, default=POSES, help="poses of each robot, 1 to 5 (%(default)s)")
    made.add_argument("--no-simulation", action="store_true", help="compare where forces balance only, which is quick")
    only = made.add_mutually_exclusive_group()
    only.add_argument("--equilibrium-only", action="store_true", help="leave out the kinematics")
    only.add_argument("--kinematics-only", action="store_true", help="leave out springs and equilibria")
    made.add_argument(
        "--from", type=Path, dest="saved", metavar="FILE", help="make tables and pictures of saved results instead"
    )
    made.add_argument("--output", type=Path, metavar="FILE", help="also write the results to a new JSON file")
    told = "write docs/interoperability.json, docs/images/interoperability.png and the tables in docs/other_tools.md"
    made.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=told)
    return made


def measure(arguments: argparse.Namespace) -> Results:
    """Ask the tools."""
    missing = [name for name in arguments.tools or () if TOOLS[name].version is None]
    if missing:
        raise sr.MissingDependency(TOOLS[missing[0]].package, TOOLS[missing[0]].extra)
    asked = arguments.tools or [name for name, tool in TOOLS.items() if tool.version is not None]
    simulators = [name for name in SIMULATORS if name in asked]
    if arguments.equilibrium_only and not simulators:
        requirement = f"tools with one of {', '.join(SIMULATORS)} among them: the others have no statics"
        raise sr.ParameterError("--tools", asked, requirement)
    if arguments.kinematics_only and (arguments.no_simulation or arguments.poses != POSES or arguments.robots != list(ROBOTS)):
        raise sr.ParameterError("--kinematics-only", True, "given without --robots, --poses and --no-simulation")
    results: Results = {"springs": [], "equilibrium": [], "kinematics": []}
    if not arguments.kinematics_only:
        results["springs"] = arriving_springs(simulators, arguments.robots)
        cases = [(case, tool) for case in equilibrium_cases(arguments.robots, arguments.poses) for tool in simulators]
        with tqdm(cases, desc="equilibria", unit="case") as bar:
            for case, tool in bar:
                bar.set_postfix_str(f"{tool}, {case.name}")
                row = compare_equilibrium(case, tool, simulated=not arguments.no_simulation)
                results["equilibrium"].append(dataclasses.asdict(row) | {"agrees": row.agrees})
    if not arguments.equilibrium_only:
        for file in tqdm(sorted(urdf_folder().glob("*.urdf")), desc="kinematics", unit="file"):
            rows = compare_kinematics(file, asked)
            results["kinematics"] += [dataclasses.asdict(row) | {"agrees": row.agrees} for row in rows]
    return results


def arriving_springs(tools: Sequence[str], robots: Sequence[str]) -> list[dict[str, Any]]:
    """How many joint springs of each file arrive in each tool."""
    made = []
    for case in equilibrium_cases(robots, 1):
        if case.gravity is not None:
            continue
        texts = {
            "URDF": case.model.urdf,
            "MJCF": to_mjcf(case.model, case.expected.q_motors, actuators=WELDED),
            "SDF": to_sdf(case.model, case.expected.q_motors, actuators=WELDED),
        }
        for tool in tools:
            for name in FORMATS:
                read = springs_read(tool, texts[name], name)
                made.append(
                    {"tool": tool, "robot": case.robot, "format": name, "read": read, "of": len(case.model.spring_table)}
                )
    return made


def agreed(results: Results) -> bool:
    """Whether every tool agrees."""
    return all(row["agrees"] for row in (*results["equilibrium"], *results["kinematics"]))


def springs_table(results: Results) -> str:
    """Format as Markdown which files bring springs into which simulator, and what it gets instead."""
    lines = [_line(["tool", *(f"springs from {name}" for name in FORMATS), "what it gets here, and how it simulates"])]
    lines.append("|" + "---|" * (len(FORMATS) + 2))
    for tool, version in _versions(results["equilibrium"]).items():
        cells = [f"{tool} {version}", *(_springs(results, tool, name) for name in FORMATS)]
        lines.append(_line([*cells, f"{SIMULATORS[tool].how}; {SIMULATORS[tool].simulated}"]))
    return "\n".join(lines)


def equilibrium_table(results: Results) -> str:
    """Format the equilibria as Markdown: a line a robot with the largest difference in each tool."""
    rows = results["equilibrium"]
    titles, keys = [], []
    for tool in _versions(rows):
        for key, told in (("static", "forces balance"), ("simulated", "simulated")):
            if any(row["tool"] == tool and row[f"{key}_difference"] is not None for row in rows):
                titles.append(f"{tool}, {told}")
                keys.append((tool, key))
    lines = [_line(["", *titles]), "|---|" + "---:|" * len(titles)]
    for robot in (name for name in ROBOTS if any(row["robot"] == name for row in rows)):
        mine = [[row for row in rows if (row["tool"], row["robot"]) == (tool, robot)] for tool, _ in keys]
        cells = [
            "failed" if any(row["problem"] for row in some) else _largest(row[f"{key}_difference"] for row in some)
            for some, (_, key) in zip(mine, keys, strict=True)
        ]
        lines.append(_line([ROBOTS[robot], *cells]))
    allowed = [_power(getattr(SIMULATORS[tool], f"{key}_tolerance")) for tool, key in keys]
    return "\n".join([*lines, _line(["allowed", *allowed])])


def kinematics_table(results: Results) -> str:
    """Format the kinematics as Markdown: a line a tool, the largest errors of all files."""
    lines = [
        "| tool | URDF files | links found | position off by [m] | rotation off by [rad] | allowed |",
        "|---|---|---|---:|---:|---:|",
    ]
    for tool, version in _versions(results["kinematics"]).items():
        rows = [row for row in results["kinematics"] if row["tool"] == tool]
        read = [row for row in rows if not row["problem"]]
        kept, links = sum(row["links"] for row in rows), sum(row["links"] + len(row["lost_links"]) for row in rows)
        cells = [f"{tool} {version}", f"{len(read)} of {len(rows)}", "all" if kept == links else f"{kept} of {links}"]
        cells += [_largest(row[key] for row in read) for key in ("position_error", "rotation_error")]
        lines.append(_line([*cells, _power(rows[0]["precision"])]))
    return "\n".join(lines)


def document(results: Results) -> str:
    """Everything that the page shows of the results."""
    cases = len({(row["robot"], row["pose"], row["gravity"]) for row in results["equilibrium"]})
    parts = []
    if results["equilibrium"]:
        parts += [
            "Joint springs that arrive in a simulator, by file format (joints are displaced, those that push back counted;\n"
            "`-`: it does not load such a file of ours):",
            springs_table(results),
            f"Largest difference of a joint from Pinocchio's equilibrium [rad or m], over {cases} cases of pose and load:",
            equilibrium_table(results),
        ]
    if results["kinematics"]:
        parts += [
            "Links against Pinocchio, over all files in `urdf/`, 20 random configurations each:",
            kinematics_table(results),
        ]
    return "\n\n".join(parts)


def page_with(text: str, results: Results) -> str:
    """The text of the page with the tables of the results between its two marks.

    Args:
        text: The page.
        results: The results.

    Raises:
        FileFormatError: If it does not have each mark once, in order.
    """
    return marked(text, PAGE, BEGIN, END, document(results))


def figure(results: Results) -> Any:
    """Draw every difference against its tolerance."""
    made = canvas.new_figure((11.0, 5.6))
    left, right = made.subplots(1, 2, width_ratios=(1.35, 1.0))
    _draw_equilibria(left, results["equilibrium"])
    _draw_kinematics(right, results["kinematics"])
    return made


def _draw_equilibria(axes: Any, rows: Sequence[dict[str, Any]]) -> None:
    pairs = list(dict.fromkeys((row["tool"], row["robot"]) for row in rows))
    for height, (tool, robot) in enumerate(pairs):
        chosen = [row for row in rows if (row["tool"], row["robot"]) == (tool, robot)]
        for key, shift, marker, colour in (("static", -0.16, "o", 0), ("simulated", 0.16, "^", 1)):
            found = [row[f"{key}_difference"] for row in chosen]
            values = [max(value, SMALLEST) for value in found if value is not None]
            if values:
                style = {"s": 26, "marker": marker, "facecolors": "none", "edgecolors": canvas.COLOURS[colour], "lw": 1.0}
                axes.scatter(values, [height + shift] * len(values), **style)
                allowed = getattr(SIMULATORS[tool], f"{key}_tolerance")
                axes.plot([allowed] * 2, [height + shift - 0.14, height + shift + 0.14], color=canvas.COLOURS[colour], lw=2.2)
    for label, marker, colour in (("forces balance", "o", 0), ("simulated", "^", 1)):
        axes.scatter([], [], marker=marker, facecolors="none", edgecolors=canvas.COLOURS[colour], label=label)
    axes.plot([], [], color="0.3", lw=2.2, label="allowed")
    _finish(axes, [f"{tool}, {ROBOTS[robot]}" for tool, robot in pairs], "largest difference of a joint [rad or m]")
    axes.set_title("Equilibrium against Pinocchio, a mark a case")


def _draw_kinematics(axes: Any, rows: Sequence[dict[str, Any]]) -> None:
    tools = list(dict.fromkeys(row["tool"] for row in rows))
    for height, tool in enumerate(tools):
        chosen = [row for row in rows if row["tool"] == tool and not row["problem"]]
        for key, shift, marker, colour in (("position_error", -0.12, "s", 2), ("rotation_error", 0.12, "D", 3)):
            values = [max(row[key], SMALLEST) for row in chosen]
            style = {"s": 24, "marker": marker, "facecolors": "none", "edgecolors": canvas.COLOURS[colour], "lw": 1.0}
            axes.scatter(values, [height + shift] * len(values), **style)
        if chosen:
            axes.plot([chosen[0]["precision"]] * 2, [height - 0.26, height + 0.26], color="0.3", lw=2.2)
    for label, marker, colour in (("position [m]", "s", 2), ("rotation [rad]", "D", 3)):
        axes.scatter([], [], marker=marker, facecolors="none", edgecolors=canvas.COLOURS[colour], label=label)
    axes.plot([], [], color="0.3", lw=2.2, label="allowed")
    _finish(axes, tools, "largest error of a link")
    axes.set_title("Links against Pinocchio, a mark a file")


def _finish(axes: Any, labels: Sequence[str], quantity: str) -> None:
    axes.set_xscale("log")
    axes.set_xlim(0.3 * SMALLEST, 1.0)
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.set_xlabel(f"{quantity}; 0 is drawn at {SMALLEST:.0e}")
    axes.grid(alpha=0.3, axis="x")
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3)


def read_results(path: Path) -> Results:
    """Read saved results.

    Raises:
        FileFormatError: If the file cannot be read or holds something else.
    """
    results = read_json(path, LARGEST_FILE)
    parts = {part: results.get(part) for part in KEYS} if isinstance(results, dict) else {}
    rows = [(part, row) for part, some in parts.items() if isinstance(some, list) for row in some]
    lists = [some for some in parts.values() if isinstance(some, list)]
    if len(lists) != len(KEYS) or not all(isinstance(row, dict) and row.keys() >= KEYS[part] for part, row in rows):
        raise sr.FileFormatError(f"{path} holds no results of this script")
    return results


def write_docs(results: Results, checkout: Path) -> list[Path]:
    """Write results, picture and tables into a checkout; return the files."""
    asked = {row["tool"] for row in results["equilibrium"]}, {row["tool"] for row in results["kinematics"]}
    cases = {(row["robot"], row["pose"], row["gravity"]) for row in results["equilibrium"]}
    simulated = all(row["simulated_difference"] is not None for row in results["equilibrium"])
    if asked != (set(SIMULATORS), set(TOOLS)) or len(cases) != 2 * POSES * len(ROBOTS) or not simulated:
        raise sr.ParameterError("--docs", str(checkout), "given for results of all tools, robots and poses, simulated")
    try:
        page = (checkout / PAGE).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise sr.FileFormatError(f"cannot read {checkout / PAGE}: {error}") from error
    updated, drawing = page_with(page, results), figure(results)
    files = [write_text(checkout / "docs" / "interoperability.json", as_json(results), overwrite=True)]
    files.append(canvas.write_png(drawing, checkout / "docs" / "images" / "interoperability.png", overwrite=True))
    files.append(write_text(checkout / PAGE, updated, overwrite=True))
    return files


def as_json(results: Results) -> str:
    """The results as JSON text."""
    return json.dumps(results, indent=1) + "\n"


def _versions(rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Version of each tool, in order."""
    return {row["tool"]: row["version"] for row in rows}


def _springs(results: Results, tool: str, name: str) -> str:
    rows = [row for row in results["springs"] if (row["tool"], row["format"]) == (tool, name)]
    read = [row["read"] for row in rows if row["read"] is not None]
    if not read:
        return "-"
    count, of = sum(read), sum(row["of"] for row in rows)
    return "none" if count == 0 else "all" if count == of else f"{count} of {of}"


def _largest(values: Any) -> str:
    largest = max((value for value in values if value is not None), default=None)
    return "-" if largest is None else _power(largest)


def _power(value: float) -> str:
    return f"{value:.0e}".replace("e-0", "e-") if value > 0.0 else "0"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def run(arguments: argparse.Namespace) -> bool:
    """Do the whole job; return whether every tool agrees."""
    if not 1 <= arguments.poses <= POSES:
        raise sr.ParameterError("--poses", arguments.poses, f"from 1 to {POSES}")
    if arguments.docs is not None:
        canvas.require_matplotlib()  # tells at once what is missing
    if arguments.output is not None:
        new_file(arguments.output, overwrite=False)
    results = measure(arguments) if arguments.saved is None else read_results(arguments.saved)
    passed = agreed(results)
    print(f"\n{document(results)}\n\n{'all agree' if passed else 'FAILED: a tool does not agree'}")
    if arguments.output is not None:
        print(f"\nwritten: {write_text(arguments.output, as_json(results), overwrite=False)}")
    if arguments.docs is not None:
        print(f"\nwritten: {', '.join(map(str, write_docs(results, make_folder(arguments.docs))))}")
    return passed


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0 if every tool agrees, 1 if not, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
