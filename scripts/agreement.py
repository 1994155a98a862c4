"""Compare models of the same robot: tip error against the number of segments, with the observed order of convergence.

Chains of rigid links (pseudo-rigid links, lumped hinges, sections of constant strain) and the lumped chain in MuJoCo, against a
Kirchhoff rod by a boundary-value solve (scipy.integrate.solve_bvp). Robots:

- inflatable_link: one inflated link, horizontal, under a small and a large tip force;
- pcc_arm: two segments with muscles of given length, hanging, under a tip force and its weight;
- helix_tube: a tube that is a helix at rest, of one turn and of 2.7, under a tip force and its weight;
- steel_rod: a rod under random forces and moments at its middle and its tip, bent by up to about 90 degrees out of plane.

Prints Markdown tables; about five minutes. Needs a checkout and SciPy (extra `dev`): the rods are those of the tests.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots import inflated_beam
from softrobots.cli.options.command_line import exit_status
from softrobots.cli.tools.kinematics import pose_error
from softrobots.cli.tools.known_tools import find_tool
from softrobots.core.files import free_folder, make_folder, write_text
from softrobots.export.mjcf import to_mjcf
from softrobots.model.pinocchio_data import MAX_DOF
from softrobots.view.figures import canvas
from studies.interop.cases import TOLERANCE, WELDED
from studies.interop.mujoco_statics import static_equilibrium, tip_pose
from studies.interop.outcomes import Question
from studies.recorded_run import check_page, command_of, write_record

ROOT = Path(__file__).resolve().parent.parent
PAGE = "agreement.md"
FINE, COARSE = 1e-9, 1e-6
"""Tolerances of the boundary-value solves: of the answer, and of what it is compared with to know its own error."""
LENGTHS = ((0.50, 0.53, 0.55), (0.54, 0.51, 0.52))
"""Muscle lengths of the arm, by segment [m]."""
PCC_FORCE = (1.0, 2.0, -3.0)
"""Tip force of the arm [N]."""
TUBES: Mapping[str, tuple[float, tuple[float, float, float]]] = {
    "helix_tube_1_turn": (1.0, (0.36, -0.24, 0.30)),
    "helix_tube_2.7_turns": (2.7, (0.18, -0.12, 0.15)),
}
"""Turns and tip force [N] of the helical tubes."""
COUNTS: dict[str, tuple[int, ...]] = {
    "inflatable_link": (1, 2, 4, 8, 16, 32),
    "pcc_arm": (1, 2, 4, 8, 16, 32),
    "helix_tube_1_turn": (8, 16, 32, 64),
    "helix_tube_2.7_turns": (16, 24, 32, 40, 48, 64),
    "steel_rod": (8, 16, 32, 48),
}
"""Numbers of segments."""
LINK_FORCES = (10.0, 400.0)
"""Tip forces of the inflated link [N]; it wrinkles at 36 N."""
INEXTENSIBLE = 1e9
"""Axial stiffness of sections that must not stretch [N]."""
LUMPED: Mapping[str, Mapping[str, Any]] = {
    "lumped": {"chain": "lumped"},
    "lumped, midpoint": {"chain": "lumped", "hinge_rule": "midpoint"},
}
CHAINS = {"sections": {"chain": "sections"}, **LUMPED}
"""Forms of a continuum robot."""
IN_THE_MIDDLE, AT_THE_START = "pseudo-rigid, hinge in the middle", "pseudo-rigid, hinge at l1 = 5 %"
"""Forms of the inflated link."""
STYLES = (*CHAINS, IN_THE_MIDDLE, AT_THE_START)
"""Forms in the order of their line styles."""

Poses = list[np.ndarray]


class Form(NamedTuple):
    """A robot as a chain, for any number of segments."""

    robot: Callable[[int], Any]
    """Makes it."""
    solve: Callable[[sr.SoftModel], list[sr.Equilibrium]]
    """Loads it; an equilibrium a case."""
    axes: np.ndarray = np.eye(4)
    """The rod's axes in the robot's world, shape (4, 4)."""


class Study(NamedTuple):
    """A robot and its loads."""

    title: str
    """In words."""
    counts: tuple[int, ...]
    """Numbers of segments."""
    forms: Mapping[str, Form]
    """By name."""
    rod: Callable[[float], Poses]
    """Poses of the tip by the boundary-value solve at a tolerance; one a case."""
    mujoco: str | None = None
    """The form that MuJoCo gets."""
    closed_form: np.ndarray | None = None
    """Pose of the tip, where there is a formula."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    told = "robots, of %(choices)s (all)"
    made.add_argument("--robot", nargs="+", choices=list(STUDIES), default=list(STUDIES), metavar="ROBOT", help=told)
    made.add_argument("--cases", type=int, default=100, help="random loads of the steel rod (%(default)s)")
    made.add_argument("--seed", type=int, default=2026, help="seed of these loads (%(default)s)")
    made.add_argument("--no-mujoco", action="store_true", help="do without MuJoCo")
    made.add_argument("--json", action="store_true", help="print the numbers as one JSON object instead of tables")
    told = "new or empty folder for agreement.json, agreement.md and agreement.png (none)"
    made.add_argument("--output", type=Path, metavar="FOLDER", help=told)
    told = "write docs/agreement.md, docs/validation/agreement.json and docs/images/agreement.png of this checkout"
    made.add_argument("--docs", type=Path, nargs="?", const=ROOT, metavar="CHECKOUT", help=told)
    return made


# --- The robots


def link_stiffness() -> float:
    """EI of the inflated link at 50 kPa, [Troise 2021] (1): (E + P/S) I, with the modulus of the mean stiffness [N m^2]."""
    arm = sr.InflatableArm(link_lengths=(0.6,))
    (pressure,), (radius,), (wall,), (stiffness,) = arm.pressure, arm.radius, arm.wall_thickness, arm.stiffness
    modulus = inflated_beam.young_modulus_from_stiffness(
        stiffness, pressure=pressure, length=0.6, radius=radius, wall_thickness=wall
    )
    stress = pressure * radius / (2.0 * wall)  # cap force over section
    return float((modulus + stress) * math.pi * radius**3 * wall)


def inflatable_link(force: float, oracles: ModuleType) -> Study:
    """One inflated link in n pieces, each with one pair of hinges; and as a rod without muscles."""
    length, stiffness = 0.6, link_stiffness()
    rod = oracles.rods.Rod(length, stiffness, stiffness / 1.3)

    def pieces(n: int, share: float) -> Any:
        return sr.InflatableArm(
            link_lengths=(length / n,) * n, hinge_offset=share * length / n, stiffness=n * stiffness / length
        )

    def passive(form: Mapping[str, Any], n: int) -> Any:
        return passive_rod(rod, (length,), n, form if "lumped" not in form.values() else {**form, "extension": False})

    def answer(tol: float) -> Poses:
        return [pose(*oracles.rods.rod_tip(rod, (force, 0.0, 0.0, 0.0, 0.0, 0.0), tol=tol))]

    x, z, angle = oracles.rods.elastica_tip(stiffness, length, force)
    turned = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    axes = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])  # along +x, pushed down
    pushed = partial(solved, force=(0.0, 0.0, -force))
    forms = {
        IN_THE_MIDDLE: Form(lambda n: pieces(n, 0.5), pushed, axes),
        AT_THE_START: Form(lambda n: pieces(n, 0.05), pushed, axes),
    }
    for name in ("lumped", "sections"):
        forms[name] = Form(partial(passive, CHAINS[name]), partial(solved, force=(force, 0.0, 0.0)))
    title = f"Inflated link, tip force {force:g} N, F l^2 / EI = {force * length**2 / stiffness:.3g}"
    exact = pose(np.array([x, 0.0, z]), turned)
    return Study(title, COUNTS["inflatable_link"], forms, answer, IN_THE_MIDDLE, exact)


def pcc_arm(oracles: ModuleType) -> Study:
    """The default arm with muscles of given length.

    It hangs: MuJoCo gets the muscles as tensions, and given tensions would not hold it upright under this load.
    """
    arm, gravity = sr.PccArm(), (0.0, 0.0, 9.81)
    names = ("bending_stiffness", "torsional_stiffness", "axial_stiffness")
    segments = []
    for i, muscles in enumerate(LENGTHS):
        fields = {"length": arm.segment_lengths[i], "turn": arm.offset[i], "density": arm.linear_density[i]}
        fields |= {name: getattr(arm, name)[i] for name in names}
        segments.append(oracles.muscle_rods.MuscleSegment.of_three(muscles, arm.muscle_distance[i], **fields))

    def answer(tol: float) -> Poses:
        return [oracles.muscle_rods.solve_muscle_arm(segments, PCC_FORCE, gravity, tol=tol).pose]

    def robot(form: Mapping[str, Any], n: int) -> Any:
        return sr.PccArm(elastic_sections=n, hinges=n, **form)

    solve = partial(solved, q_motors=np.ravel(LENGTHS), force=PCC_FORCE, gravity=gravity)
    forms = {name: Form(partial(robot, form), solve) for name, form in CHAINS.items()}
    title = "Hanging arm of two segments, muscle lengths given, its weight and 3.7 N at the tip; n counts a segment's"
    return Study(title, COUNTS["pcc_arm"], forms, answer, "lumped")


def helix_tube(name: str, oracles: ModuleType) -> Study:
    """The default tube, cut to a number of turns, with its stiffness as numbers."""
    turns, force = TUBES[name]
    gravity, default = sr.EARTH_GRAVITY, sr.HelixTube()
    fields = {
        "length": default.length * turns / default.turns,
        "bending_stiffness": 0.286, "torsional_stiffness": 0.203, "axial_stiffness": 2080.0,
    }  # fmt: skip
    rod = oracles.helix_rods.actuated_rod(default.contraction, default.angle, default.diameter, sign=1, **fields)
    wall = default.density * math.pi * default.diameter * default.wall_thickness * fields["length"]

    def answer(tol: float) -> Poses:
        spread = wall / rod.length * np.array(gravity)
        found = oracles.helix_rods.solve_helix_rod(rod, (*force, 0.0, 0.0, 0.0), spread, tol=tol)
        return [pose(*found[:2])]

    def robot(form: Mapping[str, Any], n: int) -> Any:
        return sr.HelixTube(elastic_sections=n, hinges=n, **fields, **form)

    solve = partial(solved, force=force, gravity=gravity)
    forms = {name: Form(partial(robot, form), solve) for name, form in CHAINS.items()}
    title = f"Helical tube, turns: {turns:.2g}, its weight and {np.linalg.norm(force):.2g} N at the tip"
    return Study(title, COUNTS[name], forms, answer, "lumped")


def steel_rod(oracles: ModuleType, cases: int, seed: int) -> Study:
    """A rod of spring steel in two segments: half of the sections before the middle, where a wrench acts."""
    rod = oracles.rods.steel_rod()
    wrenches = oracles.rods.random_wrenches(np.random.default_rng(seed), rod, cases)

    def answer(tol: float) -> Poses:
        return [
            pose(*oracles.rods.rod_tip(rod, tip, middle, tol=tol)) for tip, middle in tqdm(wrenches, "steel rod", leave=False)
        ]

    def solve(model: sr.SoftModel) -> list[sr.Equilibrium]:
        return [sr.solve_equilibrium(model, (), wrench={"tip": tip, "segment_1": middle}) for tip, middle in wrenches]

    def robot(form: Mapping[str, Any], n: int) -> Any:
        form = form if form["chain"] == "sections" else {**form, "extension": False}
        return passive_rod(rod, (rod.length / 2, rod.length / 2), n // 2, form)

    forms = {name: Form(partial(robot, form), solve) for name, form in CHAINS.items()}
    title = f"Steel rod, {cases} random forces and moments: mean (largest) error; n counts those of two segments"
    return Study(title, COUNTS["steel_rod"], forms, answer)


def passive_rod(rod: Any, lengths: Sequence[float], each: int, form: Mapping[str, Any]) -> Any:
    """A rod without muscles, with `each` sections or hinges a segment."""
    return sr.PccArm(
        segment_lengths=lengths, offset=0.0, muscle_azimuths=(), bending_stiffness=rod.bending_stiffness,
        torsional_stiffness=rod.torsional_stiffness, axial_stiffness=rod.axial_stiffness or INEXTENSIBLE, linear_density=0.0158,
        radius=0.0008, elastic_sections=each, hinges=each, **form,
    )  # fmt: skip


def solved(model: sr.SoftModel, q_motors: Any = None, *, force: Any, gravity: Any = None) -> list[sr.Equilibrium]:
    """One equilibrium."""
    motors = np.zeros(model.n_motors) if q_motors is None else q_motors
    return [sr.solve_equilibrium(model, motors, force, gravity=gravity, tolerance=TOLERANCE)]


def pose(position: Any, rotation: Any) -> np.ndarray:
    """A pose, shape (4, 4) [m]."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation, position
    return made


STUDIES: Mapping[str, Callable[[ModuleType, int, int], dict[str, Study]]] = {
    "inflatable_link": lambda oracles, *_: {
        f"inflatable_link_{force:g}N": inflatable_link(force, oracles) for force in LINK_FORCES
    },
    "pcc_arm": lambda oracles, *_: {"pcc_arm": pcc_arm(oracles)},
    "helix_tube": lambda oracles, *_: {name: helix_tube(name, oracles) for name in TUBES},
    "steel_rod": lambda oracles, cases, seed: {"steel_rod": steel_rod(oracles, cases, seed)},
}
"""Makes the studies of a robot, by name."""


# --- The comparison


def compare(study: Study, progress: Callable[[Sequence[Any]], Any], *, mujoco: bool) -> dict[str, Any]:
    """Tip errors of every form for every number of segments, of the rod itself, and of MuJoCo's answer to the lumped chain."""
    exact, coarse = study.rod(FINE), study.rod(COARSE)
    result: dict[str, Any] = {"title": study.title, "counts": list(study.counts), "rod": errors(coarse, exact), "forms": {}}
    if study.closed_form is not None:
        result["closed_form"] = errors([study.closed_form], exact)
    jobs = [(name, n) for name, form in study.forms.items() for n in study.counts if fits(form.robot(n))]
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in study.forms}
    in_mujoco, apart = [], []
    for name, n in progress(jobs):
        form = study.forms[name]
        robot = form.robot(n)
        model = sr.load_model(robot)
        model.workspace(None)  # takes longer than a solve
        began = time.perf_counter()
        found = form.solve(model)
        spent = (time.perf_counter() - began) / len(found)
        stable = sum(one.stable for one in found)
        ours = [one.transform_tip_to_world.homogeneous for one in found]
        rows[name].append(
            {"n": n, **errors([form.axes.T @ one @ form.axes for one in ours], exact), "stable": stable, "solve_s": spent}
        )
        if mujoco and name == study.mujoco:
            theirs = [mujoco_pose(one, robot) for one in found]
            in_mujoco.append({"n": n, **errors([form.axes.T @ one @ form.axes for one in theirs], exact)})
            apart.append({"n": n, **errors(theirs, ours)})
    result["forms"] = {name: made(row) for name, row in rows.items()}
    if apart:
        result["mujoco"] = {"of": study.mujoco, **made(in_mujoco), "apart": apart}
    return result


def fits(robot: Any) -> bool:
    """Whether Pinocchio's workspace is made for so many joints."""
    return isinstance(robot, sr.InflatableArm) or robot.n_joints <= MAX_DOF


def errors(found: Poses, exact: Poses) -> dict[str, float]:
    """Mean and largest distance [m] and angle [rad]."""
    both = np.array([pose_error(one, other) for one, other in zip(found, exact, strict=True)])
    (mean, angle), (largest, largest_angle) = both.mean(axis=0).tolist(), both.max(axis=0).tolist()
    return {"error_m": mean, "largest_m": largest, "error_rad": angle, "largest_rad": largest_angle}


def made(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Rows with the order between the last two."""
    orders = {}
    if len(rows) > 1:
        last, ratio = rows[-2:], math.log(rows[-1]["n"] / rows[-2]["n"])
        orders = {
            name: math.log(last[0][key] / last[1][key]) / ratio
            for name, key in (("order", "error_m"), ("angle_order", "error_rad"))
        }
    return {"rows": rows, **orders}


def mujoco_pose(found: sr.Equilibrium, robot: Any) -> np.ndarray:
    """Pose of the tip where MuJoCo's own forces balance, in the file of our exporter; it gets muscles as their tensions."""
    model, motors = found.model, found.q_motors
    if model.muscles and model.muscle_input == "lengths":
        model, motors = sr.load_model(robot, muscles="forces"), found.muscle_forces
    load = found.load
    text = to_mjcf(model, motors, actuators=WELDED, gravity=load.gravity)
    fx, fy, fz = load.wrenches[model.tip][:3].tolist()
    question = Question(text, model.tip, (fx, fy, fz), load.gravity)
    return tip_pose(question, static_equilibrium(question).joints)


# --- What is shown


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
    told = f"The boundary-value solve at a tolerance of {COARSE:g} lies {1e3 * result['rod']['largest_m']:.0e} mm from that at "
    told += f"{FINE:g}"
    if "closed_form" in result:
        told += f", and that lies {1e3 * result['closed_form']['largest_m']:.0e} mm from the elliptic integrals"
    lines += ["", told + "."]
    if several:
        lines += ["", "Mean time of a solve in the same run [ms] (not asserted anywhere):", ""]
        lines += [line(["model", *counts]), "|---" * (len(counts) + 1) + "|"]
        for name, form in result["forms"].items():
            lines.append(line([name, *by_count(form["rows"], counts, lambda row: f"{1e3 * row['solve_s']:.1f}")]))
    return "\n".join(lines)


def cell(row: Mapping[str, float], *, several: bool) -> str:
    """An error [mm], with the largest of several behind it."""
    return f"{1e3 * row['error_m']:.3g}" + (f" ({1e3 * row['largest_m']:.3g})" if several else "")


def by_count(rows: list[dict[str, Any]], counts: Sequence[int], told: Callable[[dict[str, Any]], str]) -> list[str]:
    """A cell for each number of segments; a chain of too many joints has none."""
    cells = {row["n"]: told(row) for row in rows}
    return [cells.get(n, "-") for n in counts]


def line(cells: Sequence[Any]) -> str:
    """A line of a Markdown table."""
    return f"| {' | '.join(map(str, cells))} |"


def figure(results: Mapping[str, dict[str, Any]]) -> Any:
    """Draw the errors over the number of segments, a panel a study, with the slopes of orders one and two."""
    width = min(len(results), 3)
    drawn = canvas.new_figure((4.4 * width, 4.3 * math.ceil(len(results) / width)))
    grid = drawn.subplots(math.ceil(len(results) / width), width, squeeze=False).ravel()
    for axes, result in zip(grid, results.values(), strict=False):
        panel(axes, result)
    for axes in grid[len(results) :]:
        axes.set_axis_off()
    entries: dict[str, Any] = {}
    for axes in grid[: len(results)]:
        handles, labels = axes.get_legend_handles_labels()
        entries = dict(zip(labels, handles, strict=True)) | entries
    drawn.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=min(4, 2 * width), fontsize=9)
    return drawn


def panel(axes: Any, result: dict[str, Any]) -> None:
    """Draw a study."""
    counts = np.array(result["counts"], dtype=float)
    for name, form in sorted(result["forms"].items(), key=lambda item: STYLES.index(item[0])):
        points = [(row["n"], 1e3 * row["error_m"]) for row in form["rows"]]
        axes.loglog(*zip(*points, strict=True), label=name, **canvas.line_style(STYLES.index(name)))
    if "mujoco" in result:
        points = [(row["n"], 1e3 * row["error_m"]) for row in result["mujoco"]["rows"]]
        style = {"ls": "none", "marker": "o", "ms": 10, "mfc": "none", "mec": "black", "mew": 0.9}
        axes.loglog(*zip(*points, strict=True), label="MuJoCo", **style)
    top = max(1e3 * row["error_m"] for form in result["forms"].values() for row in form["rows"])
    for order, style in ((1, ":"), (2, "-")):
        axes.loglog(counts, 1.5 * top * (counts[0] / counts) ** order, color="0.6", lw=1.0, ls=style, label=f"order {order}")
    axes.set_xticks(counts, [f"{n:g}" for n in counts])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    head, _, rest = result["title"].partition(", ")
    axes.set_title(f"{head}\n{rest.partition(';')[0]}", fontsize=9)
    axes.set(xlabel="segments n [-]", ylabel="tip error [mm]")


def tests_oracles() -> Any:
    """The rods of the tests."""
    sys.path.insert(0, str(ROOT))
    try:
        import tests.support.helix_rods
        import tests.support.muscle_rods
        import tests.support.rods
    except ImportError as error:
        raise sr.MissingDependency("scipy", "dev") from error
    return tests.support


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    for option, value, least in (("--cases", arguments.cases, 1), ("--seed", arguments.seed, 0)):
        if value < least:
            raise sr.ParameterError(option, value, f"at least {least}")
    if arguments.docs is not None:
        if arguments.robot != list(STUDIES) or arguments.no_mujoco:
            raise sr.ParameterError("--docs", arguments.docs, "given without --robot and --no-mujoco")
        check_page(arguments.docs, "agreement", page=PAGE)
    if arguments.output is not None or arguments.docs is not None:
        canvas.require_matplotlib()
    folder = None if arguments.output is None else free_folder(arguments.output)
    if not arguments.no_mujoco:
        find_tool("MuJoCo").load()
    oracles = tests_oracles()
    results = {}
    for robot in dict.fromkeys(arguments.robot):
        for name, study in STUDIES[robot](oracles, arguments.cases, arguments.seed).items():
            results[name] = compare(study, partial(tqdm, desc=name, unit="model"), mujoco=not arguments.no_mujoco)
    told = {"cases": arguments.cases, "seed": arguments.seed, "studies": results}
    text, shown = json.dumps(told, indent=1, allow_nan=False), table(results)
    if folder is not None:
        make_folder(folder)
        write_text(folder / "agreement.json", text + "\n", overwrite=False)
        write_text(folder / "agreement.md", shown + "\n", overwrite=False)
        canvas.write_png(figure(results), folder / "agreement.png", overwrite=False)
    if arguments.docs is not None:
        canvas.write_png(figure(results), arguments.docs / "docs" / "images" / "agreement.png", overwrite=True)
        command = command_of("agreement", parser(), arguments, "cases", "seed")
        write_record(arguments.docs, "agreement", shown, told, command=command, page=PAGE)
    print(text if arguments.json else f"\n{shown}")


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input, 1 if an equilibrium is not found."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
