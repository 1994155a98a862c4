"""Compare the pseudo-rigid links of the inflatable arm with inflated beams: where they hold, and what lumping costs.

The beam is that of Troise et al. 2021, equation (1), and the same as a geometrically exact rod by a boundary-value solve
(scipy.integrate.solve_bvp): it bends with (E + P/S) I and shears with P + j G S.

- One link under a transverse force at its end, over pressure and force: tip deflection and rotation of (1) and of pseudo-rigid
  links against the exact beam; the line where the link wrinkles; where each leaves the exact beam by 1 and by 5 %.
- The arm of two links in random postures under random forces up to wrinkling: tip error of the pseudo-rigid arms against two
  beams with motors between; then against beams that also twist and stretch.

Prints Markdown tables; about two minutes. Needs a checkout and SciPy (extra `dev`): the rods are those of the tests.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots import inflated_beam
from softrobots.cli.options.command_line import exit_status
from softrobots.cli.tools.kinematics import pose_error
from softrobots.core.files import free_folder, make_folder, write_text
from softrobots.description.composition import fix_joints
from softrobots.inflated_beam import MEAN_STIFFNESS, TABLE_3
from softrobots.statics.kinematics import backbone
from softrobots.view.figures import canvas
from studies.recorded_run import check_page, command_of, write_record

ROOT = Path(__file__).resolve().parent.parent
PAGE = "agreement.md"
PICTURES = ("beam_validity.png", "arm_lumping.png")
TUBE = {"length": 0.6, "radius": 0.055, "wall_thickness": 0.0005}
"""The prototype link [m]."""
LENGTH, HINGE = TUBE["length"], 0.03
"""Length of a link and the paper's distance of its hinge from the clamp [m]."""
PRESSURES = (5_000, *range(10_000, 60_001, 10_000))
"""Of the map [Pa]."""
LOADS = (1, *range(4, 101, 4))
"""Tip forces of the map [N]."""
SHOWN = 50e3
"""Pressure of the arm and of the curves over the load [Pa]."""
LIMITS = (1.0, 5.0)
"""Differences whose lines are drawn [%]."""
LARGEST_FORCE = 30.0
"""On the arm [N]; with a short lever it would take much more to wrinkle a link."""
FITTED = 40
"""Cases that the best single hinge is fitted to, at most."""
EVALUATIONS = 80
"""Robots tried for it, at most."""
RIGID = "rigid links: the deflection itself"
"""An arm that does not bend: its error is the deflection."""
DIGITS = 6
"""Of the recorded numbers."""


class Hinges(NamedTuple):
    """How a link is lumped: its hinges, all alike."""

    places: tuple[float, ...]
    """Distances from the clamp [m]."""
    stiffness: float
    """Of each spring [N m/rad]."""

    def robot(self, links: int) -> Any:
        """An arm of such links. A link of two hinges is two links of half the length, the motor between them fixed at 0."""
        half = LENGTH / len(self.places)
        offsets = [place - half * number for number, place in enumerate(self.places)] * links
        robot = sr.InflatableArm(
            link_lengths=(half,) * len(offsets), hinge_offset=tuple(offsets), stiffness=self.stiffness, pressure=SHOWN
        )
        within = [f"motor_{number + 2}" for number in range(1, len(offsets)) if number % len(self.places)]
        return fix_joints(robot, dict.fromkeys(within, 0.0)) if within else robot


class Case(NamedTuple):
    """A posture of the arm and a force on its tip."""

    motors: np.ndarray
    """Motor angles (3,) [rad]."""
    force: np.ndarray
    """In world axes (3,) [N]."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--cases", type=int, default=400, help="postures and forces of the arm (%(default)s)")
    made.add_argument("--seed", type=int, default=2026, help="seed of these (%(default)s)")
    made.add_argument("--json", action="store_true", help="print the numbers as one JSON object instead of tables")
    told = f"new or empty folder for beam_validity.json, beam_validity.md and {' and '.join(PICTURES)} (none)"
    made.add_argument("--output", type=Path, metavar="FOLDER", help=told)
    told = "write docs/agreement.md, docs/validation/beam_validity.json and the pictures of a checkout (this one)"
    made.add_argument("--docs", type=Path, nargs="?", const=ROOT, metavar="CHECKOUT", help=told)
    return made


# --- One link


def modulus() -> float:
    """Modulus of the wall: the mean over the six pressures of Table 3 of what the mean stiffness implies by (1) [Pa]."""
    found = [inflated_beam.young_modulus_from_stiffness(MEAN_STIFFNESS, pressure=row.pressure, **TUBE) for row in TABLE_3]
    return float(np.mean(found))


def lumped(rod: Any) -> dict[str, Hinges]:
    """Ways to lump a beam that bends with B and shears with A; under a small tip force F it deflects v F and turns t F.

    - as in the paper: hinge at l1, mean stiffness;
    - its hinge, k by (1): `l2^2 / v`, so that the deflection is right;
    - one hinge: at `L - v / t`, `k = v / t^2`, so that deflection and rotation under a force are right;
    - two hinges: at `L/2 -+ sqrt(L^2/12 + B/A)`, `k = 2 B / L` each, so that both are right under a force and a moment.
    """
    deflection, rotation = LENGTH**3 / (3.0 * rod.bending) + LENGTH / rod.shear, LENGTH**2 / (2.0 * rod.bending)
    lever, apart = deflection / rotation, math.sqrt(LENGTH**2 / 12.0 + rod.bending / rod.shear)
    return {
        "as in the paper": Hinges((HINGE,), MEAN_STIFFNESS),
        "its hinge, k by (1)": Hinges((HINGE,), (LENGTH - HINGE) ** 2 / deflection),
        "one hinge by (1)": Hinges((LENGTH - lever,), lever / rotation),
        "two hinges by (1)": Hinges((LENGTH / 2.0 - apart, LENGTH / 2.0 + apart), 2.0 * rod.bending / LENGTH),
    }


def exact_link(rods: ModuleType, rod: Any, loads: Sequence[float]) -> np.ndarray:
    """Deflection [m] and rotation [rad] of the tip by the boundary-value solve, shape (loads, 2)."""
    found = [rods.solve_inflated_chain([rod], [(1, 0, 0, 0)], (0.0, load, 0.0), tol=1e-7) for load in loads]
    return np.array([(one.position[1], math.atan2(one.rotation[1, 0], one.rotation[0, 0])) for one in found])


def linear_link(rod: Any, pressure: float, loads: Sequence[float]) -> np.ndarray:
    """The same by (1), with the rotation of the section, F L^2 / 2 B."""
    at = {"pressure": pressure, "young_modulus": modulus(), **TUBE}
    return np.array([(float(inflated_beam.deflection(LENGTH, f, **at)), f * LENGTH**2 / (2.0 * rod.bending)) for f in loads])


def lumped_link(hinges: Hinges, loads: Sequence[float]) -> np.ndarray:
    """The same of a pseudo-rigid link."""
    model = sr.load_model(hinges.robot(1))
    poses = [sr.solve_equilibrium(model, np.zeros(2), (0.0, load, 0.0)).transform_tip_to_world for load in loads]
    return np.array([(one.translation[1], math.atan2(one.rotation[1, 0], one.rotation[0, 0])) for one in poses])


def link_at(rods: ModuleType, pressure: float, loads: Sequence[float]) -> dict[str, Any]:
    """Compare the models of one link at a pressure: differences from the exact beam [%] over the load."""
    rod = rods.InflatedRod.tube(pressure=pressure, young_modulus=modulus(), **TUBE).planar()
    exact = exact_link(rods, rod, loads)
    found = {"(1)": linear_link(rod, pressure, loads)}
    found |= {name: lumped_link(hinges, loads) for name, hinges in lumped(rod).items()}
    moment = inflated_beam.wrinkling_moment(pressure, TUBE["radius"])
    return {
        "pressure_Pa": float(pressure),
        "wrinkling_moment_Nm": moment,
        "wrinkles_at_N": moment / (LENGTH - HINGE),
        "stiffness_by_1_Nm": inflated_beam.stiffness_from_young_modulus(modulus(), pressure=pressure, **TUBE),
        "deflection_m": exact[:, 0].tolist(),
        "rotation_rad": exact[:, 1].tolist(),
        "percent": {name: (100.0 * (poses / exact - 1.0)).T.tolist() for name, poses in found.items()},
    }


def reached(loads: Sequence[float], percent: Sequence[float], limit: float) -> float | None:
    """Load at which a difference first exceeds a limit [N]; 0 if it does so from the start, None if it does not."""
    force, size = np.asarray(loads, dtype=float), np.abs(percent)
    above = np.flatnonzero(size > limit)
    if not above.size:
        return None
    i = int(above[0])
    if i == 0:
        return 0.0
    return float(force[i - 1] + (force[i] - force[i - 1]) * (limit - size[i - 1]) / (size[i] - size[i - 1]))


def study_link(rods: ModuleType, pressures: Sequence[float], loads: Sequence[float]) -> dict[str, Any]:
    """Compare the models of one link over pressure and load."""
    rows = [link_at(rods, pressure, loads) for pressure in tqdm(pressures, "one link", unit="pressure")]
    for row in rows:
        row["leaves_at_N"] = {
            name: [[reached(loads, values, limit) for limit in LIMITS] for values in both]
            for name, both in row["percent"].items()
        }
    return {"modulus_Pa": modulus(), "loads_N": [float(load) for load in loads], "rows": rows}


# --- The arm


def arm_rod(rods: ModuleType) -> Any:
    """A link of the arm; its modulus is such that (1) gives the paper's stiffness at the pressure of the arm."""
    young = inflated_beam.young_modulus_from_stiffness(MEAN_STIFFNESS, pressure=SHOWN, **TUBE)
    return rods.InflatedRod.tube(pressure=SHOWN, young_modulus=young, **TUBE)


def axes_of(motors: np.ndarray) -> np.ndarray:
    """Directions of the two links without load, shape (2, 3)."""
    turn, first, second = motors
    return np.array(
        [(math.cos(turn) * math.cos(up), math.sin(turn) * math.cos(up), math.sin(up)) for up in (first, first + second)]
    )


def beams(rods: ModuleType, rod: Any, case: Case) -> Any:
    """Equilibrium of the arm as two beams with motors between."""
    turn, first, second = case.motors
    base = rods.product(rods.turned((0, 0, 1), turn), rods.turned((0, -1, 0), first))
    return rods.solve_inflated_chain([rod] * 2, [base, rods.turned((0, -1, 0), second)], case.force, tol=1e-6)


def cases_of(rods: ModuleType, rod: Any, count: int, seed: int) -> Iterator[tuple[Case, Any]]:
    """Draw postures and forces, and solve the beams: motor angles over the whole turn, forces in all directions.

    The size of a force is uniform between 0 and what would bend the straight links at their clamps to the wrinkling moment, at
    most `LARGEST_FORCE`. Cases in which the bent beam is beyond that moment somewhere are drawn again. A case depends on the
    seed and its number alone.
    """
    limit = inflated_beam.wrinkling_moment(SHOWN, TUBE["radius"])
    for number in range(count):
        random = np.random.default_rng([seed, number])
        while True:
            motors, direction = random.uniform(-math.pi, math.pi, 3), random.normal(size=3)
            direction /= np.linalg.norm(direction)
            first, second = LENGTH * axes_of(motors)
            moments = [
                (np.cross(r, direction), axis / LENGTH)
                for r, axis in ((first + second, first), (second, first), (second, second))
            ]
            lever = max(float(np.linalg.norm(m - (m @ axis) * axis)) for m, axis in moments)
            case = Case(motors, random.uniform() * min(limit / max(lever, 1e-9), LARGEST_FORCE) * direction)
            found = beams(rods, rod, case)
            if found.bending_moments.max() <= limit:
                yield case, found
                break


def pose(position: Any, rotation: Any) -> np.ndarray:
    """A pose, shape (4, 4) [m]."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation, position
    return made


def solved(model: sr.SoftModel, cases: Iterable[Case]) -> list[np.ndarray]:
    """Poses of the tip of a pseudo-rigid arm."""
    return [sr.solve_equilibrium(model, one.motors, one.force).transform_tip_to_world.homogeneous for one in cases]


def fitted(cases: Sequence[Case], exact: Sequence[np.ndarray], start: Hinges) -> Hinges:
    """The single hinge, place and stiffness, with the least squares of the tip error in these cases."""
    from scipy.optimize import minimize

    with tqdm(desc="best single hinge", unit="robot") as bar:

        def squares(x: np.ndarray) -> float:
            bar.update()
            if not 0.0 < x[0] < 1.0 or x[1] <= 0.0:
                return math.inf
            model = sr.load_model(Hinges((LENGTH * x[0],), 100.0 * x[1]).robot(2))
            tips = np.array([found[:3, 3] for found in solved(model, cases)])
            return float(np.sum((tips - [one[:3, 3] for one in exact]) ** 2))

        begin = np.array([start.places[0] / LENGTH, start.stiffness / 100.0])
        found = minimize(squares, begin, method="Nelder-Mead", options={"xatol": 2e-3, "fatol": 1e-9, "maxfev": EVALUATIONS})
    return Hinges((float(LENGTH * found.x[0]),), float(100.0 * found.x[1]))


def study_arm(rods: ModuleType, count: int, seed: int) -> tuple[dict[str, Any], dict[str, dict[str, np.ndarray]]]:
    """Compare the arms; also return the errors by kind of beam and by model, shape (cases, 2) [m, rad]."""
    rod = arm_rod(rods)
    drawn = list(tqdm(cases_of(rods, rod, count, seed), "beams that twist", count, unit="case"))
    cases = [case for case, _ in drawn]
    whole = [pose(found.position, found.rotation) for _, found in drawn]
    planar = []
    for case in tqdm(cases, "beams", unit="case"):
        found = beams(rods, rod.planar(), case)
        planar.append(pose(found.position, found.rotation))
    forms = lumped(rod.planar())
    forms["one hinge, best fit"] = fitted(cases[:FITTED], planar[:FITTED], forms["one hinge by (1)"])
    answers: dict[str, list[np.ndarray]] = {}
    for name, hinges in forms.items():
        answers[name] = solved(sr.load_model(hinges.robot(2)), tqdm(cases, name, unit="case"))
    answers["beams that do not twist or stretch"] = planar
    rigid = sr.load_model(sr.InflatableArm(stiffness=1e9))
    answers["rigid links: the deflection itself"] = solved(rigid, cases)
    errors = {
        kind: {
            name: np.array([pose_error(one, other) for one, other in zip(found, truth, strict=True)])
            for name, found in answers.items()
            if found is not truth
        }
        for kind, truth in (("bend and shear", planar), ("also twist and stretch", whole))
    }
    result = {
        "cases": count,
        "seed": seed,
        "pressure_Pa": SHOWN,
        "hinges": {name: {"places_m": list(one.places), "stiffness_Nm": one.stiffness} for name, one in forms.items()},
        "beams": {
            kind: {name: statistics(found, of) for name, found in rows.items()}
            for kind, rows in errors.items()
            for of in [rows[RIGID]]
        },
        "first": {kind: {name: found[:3].tolist() for name, found in rows.items()} for kind, rows in errors.items()},
    }
    return result, errors


def statistics(errors: np.ndarray, deflections: np.ndarray) -> dict[str, list[float]]:
    """Median, 95 % and largest, of the tip error [m], of its share of the deflection, and of the angle [rad]."""
    columns = {"error_m": errors[:, 0], "share": errors[:, 0] / deflections[:, 0], "error_rad": errors[:, 1]}
    return {name: np.percentile(column, [50.0, 95.0, 100.0]).tolist() for name, column in columns.items()}


# --- What is shown


def table(result: Mapping[str, Any]) -> str:
    """Format the results as Markdown."""
    return "\n\n".join([*link_tables(result["link"]), *arm_tables(result["arm"])])


def line(cells: Sequence[Any]) -> str:
    """A line of a Markdown table."""
    return f"| {' | '.join(map(str, cells))} |"


def link_tables(link: Mapping[str, Any]) -> list[str]:
    """The tables of one link."""
    loads, measured = link["loads_N"], {row.pressure: row.stiffness for row in TABLE_3}
    rows = [row for row in link["rows"] if row["pressure_Pa"] in measured]
    names = list(rows[0]["percent"])
    first = [line(["pressure [kPa]", "k measured", "k by (1) [N m/rad]", "wrinkles at [N]", "tip there [mm]", *names])]
    first.append("|---" * (5 + len(names)) + "|")
    for row in rows:
        force, by = row["wrinkles_at_N"], row["percent"]
        cells = [
            f"{row['pressure_Pa'] / 1e3:g}",
            f"{measured[row['pressure_Pa']]:.1f}",
            f"{row['stiffness_by_1_Nm']:.1f}",
            f"{force:.1f}",
        ]
        cells.append(f"{1e3 * at(force, loads, row['deflection_m']):.1f}")
        first.append(line([*cells, *(" / ".join(signed(at(force, loads, by[name][i])) for i in (0, 1)) for name in names)]))
    second = [line(["", *(f"{word} {limit:g} %" for word in ("deflection", "rotation") for limit in LIMITS)]), "|---" * 5 + "|"]
    for name, both in row_at(link, SHOWN)["leaves_at_N"].items():
        second.append(
            line([name, *(f"> {loads[-1]:g}" if f is None else f"{f:.0f}" if f else "at once" for one in both for f in one)])
        )
    forces = np.array([[f or 0.0 for both in row["leaves_at_N"].values() for one in both for f in one] for row in link["rows"]])
    apart = float(np.abs(forces - forces[link["rows"].index(row_at(link, SHOWN))]).max())
    told = (
        "One link at the force at which it wrinkles (moment at $l_1$): difference of tip deflection / rotation from the exact "
        f"beam [%]. Modulus of the wall: {link['modulus_Pa'] / 1e6:.1f} MPa."
    )
    return [
        told,
        "\n".join(first),
        f"Force [N] at which a model leaves the exact beam, at {SHOWN / 1e3:g} kPa (at other pressures within {apart:.1f} N):",
        "\n".join(second),
    ]


def signed(number: float) -> str:
    """A number with its sign and one digit; zero has none."""
    text = f"{number:+.1f}"
    return text if float(text) else "0"


def row_at(link: Mapping[str, Any], pressure: float) -> Mapping[str, Any]:
    """The row of a pressure."""
    (found,) = [row for row in link["rows"] if row["pressure_Pa"] == pressure]
    return dict(found)


def at(force: float, loads: Sequence[float], values: Sequence[float]) -> float:
    """A value at a force between those of the map."""
    return float(np.interp(force, loads, values))


def arm_tables(arm: Mapping[str, Any]) -> list[str]:
    """The tables of the arm."""
    told = f"The arm at {arm['pressure_Pa'] / 1e3:g} kPa in {arm['cases']} random postures under random forces below wrinkling"
    parts = []
    for kind, rows in arm["beams"].items():
        lines = [
            line(
                [
                    "against beams that " + kind,
                    "hinges of a link [mm]",
                    "k [N m/rad]",
                    "tip [mm]",
                    "of the deflection [%]",
                    "angle [degrees]",
                ]
            )
        ]
        lines.append("|---" * 6 + "|")
        for name, row in rows.items():
            hinges = arm["hinges"].get(name)
            places = " and ".join(f"{1e3 * place:.0f}" for place in hinges["places_m"]) if hinges else ""
            cells = [name, places, f"{hinges['stiffness_Nm']:.1f}" if hinges else ""]
            for key, unit, digits in (("error_m", 1e3, 1), ("share", 1e2, 1), ("error_rad", 180.0 / math.pi, 2)):
                cells.append(
                    "" if name == RIGID and key == "share" else " / ".join(f"{unit * value:.{digits}f}" for value in row[key])
                )
            lines.append(line(cells))
        parts.append("\n".join(lines))
    return [f"{told}: error of the tip, median / 95 % / largest:", *parts]


def link_figure(link: Mapping[str, Any]) -> Any:
    """Draw the validity region, the stiffness over pressure, and the differences over the load at the pressure of the arm."""
    drawn = canvas.new_figure((12.0, 9.0))
    (region, stiffness), below = drawn.subplots(2, 2)
    rows, loads = link["rows"], np.array(link["loads_N"])
    pressures = 1e-3 * np.array([row["pressure_Pa"] for row in rows])
    wrinkling = np.array([row["wrinkles_at_N"] for row in rows])
    map_of_paper = np.array([row["percent"]["as in the paper"][0] for row in rows]).T
    levels = np.arange(math.floor(map_of_paper.min()), math.ceil(map_of_paper.max()) + 1.0)
    filled = region.contourf(pressures, loads, map_of_paper, levels=levels, cmap="Blues_r", alpha=0.75)
    drawn.colorbar(filled, ax=region, label="paper's link, tip deflection - exact beam [%]")
    region.fill_between(pressures, wrinkling, loads[-1], facecolor="none", edgecolor="0.45", hatch="//", lw=0.0)
    region.plot(pressures, wrinkling, color="black", lw=2.5, label="wrinkles above: M_w / l2")
    region.plot(pressures, wrinkling * (LENGTH - HINGE) / LENGTH, color="black", lw=1.0, ls="--", label="M_w / L, at the clamp")
    for number, name in enumerate(rows[0]["leaves_at_N"]):
        for which, (limit, style) in enumerate(zip(LIMITS, ("--", "-"), strict=True)):
            forces = [row["leaves_at_N"][name][0][which] for row in rows]
            if all(forces):
                look = canvas.line_style(number) | {"ls": style, "markevery": (number, 4)}
                region.plot(pressures, forces, label=f"{name}: {limit:g} % off", **look)
    region.set(xlabel="gauge pressure [kPa]", ylabel="tip force [N]", title="Tip deflection of one link")
    region.set_ylim(0.0, loads[-1])
    measured = np.array([(row.pressure, row.stiffness, row.stiffness_std) for row in TABLE_3])
    points = {"ls": "", "marker": "o", "color": canvas.COLOURS[0], "ms": 6, "capsize": 4}
    stiffness.errorbar(1e-3 * measured[:, 0], measured[:, 1], measured[:, 2], label="measured, Table 3, +- one sigma", **points)
    by_beam = [row["stiffness_by_1_Nm"] for row in rows]
    stiffness.plot(pressures, by_beam, color=canvas.COLOURS[1], ls="-", label=f"by (1), E = {link['modulus_Pa'] / 1e6:.1f} MPa")
    stiffness.axhline(MEAN_STIFFNESS, color="0.5", ls="--", lw=1.2, label="mean, as in the paper")
    share = ((LENGTH - HINGE) / LENGTH) ** 2
    told = "hinge at 30 mm that deflects as (1)"
    stiffness.plot(pressures, [share * k for k in by_beam], color=canvas.COLOURS[2], ls="-.", label=told)
    stiffness.set(xlabel="gauge pressure [kPa]", ylabel="stiffness k [N m/rad]", title="Stiffness of the hinge")
    stiffness.set_ylim(0.0, 210.0)
    row = row_at(link, SHOWN)
    for axes, which, word in zip(below, (0, 1), ("deflection", "rotation"), strict=True):
        for number, (name, percent) in enumerate(row["percent"].items()):
            axes.plot(loads, percent[which], markevery=3, label=name, **canvas.line_style(number))
        axes.axvspan(row["wrinkles_at_N"], loads[-1], facecolor="none", edgecolor="0.6", hatch="//", lw=0.0)
        axes.axvline(row["wrinkles_at_N"], color="black", lw=2.5)
        axes.set(xlabel="tip force [N]", ylabel="difference from the exact beam [%]")
        axes.set_title(f"Tip {word} at {SHOWN / 1e3:g} kPa; hatched: wrinkled")
        axes.set_xlim(0.0, loads[-1])
    for axes in (region, stiffness, *below):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, loc="lower right" if axes is stiffness else "best")
    return drawn


def arm_figure(rods: ModuleType, arm: Mapping[str, Any], errors: Mapping[str, Mapping[str, np.ndarray]]) -> Any:
    """Draw one posture, and how the errors are distributed."""
    drawn = canvas.new_figure((12.0, 9.0))
    panels = drawn.subplots(2, 2)
    shape, others = panels[0, 0], panels.ravel()[1:]
    rod, case = arm_rod(rods).planar(), Case(np.array([0.0, 0.7, -1.0]), np.array([0.0, 0.0, -15.0]))
    line_of = beams(rods, rod, case).shape
    shape.plot(line_of[:, 0], line_of[:, 2], color="black", lw=3.0, label="two beams")
    straight = np.vstack([np.zeros(3), np.cumsum(LENGTH * axes_of(case.motors), axis=0)])
    shape.plot(straight[:, 0], straight[:, 2], color="0.6", lw=1.0, ls=":", label="without load")
    shown = ("as in the paper", "one hinge by (1)", "two hinges by (1)")
    for number, name in enumerate(arm["hinges"]):
        if name not in shown:
            continue
        hinges = Hinges(tuple(arm["hinges"][name]["places_m"]), arm["hinges"][name]["stiffness_Nm"])
        model = sr.load_model(hinges.robot(2))
        points = backbone(model, sr.solve_equilibrium(model, case.motors, case.force).q)
        shape.plot(points[:, 0], points[:, 2], label=name, **canvas.line_style(number))
    shape.set(xlabel="x [m]", ylabel="z [m]", title="The arm under 15 N downwards", aspect="equal")
    looks = (
        ("bend and shear", 0, 1e3, "tip error [mm]"),
        ("bend and shear", 1, 180.0 / math.pi, "error of the angle [degrees]"),
    )
    for axes, (kind, column, unit, label) in zip(
        others, (*looks, ("also twist and stretch", 0, 1e3, "tip error [mm]")), strict=True
    ):
        rows = {name: found for name, found in errors[kind].items() if name != RIGID}
        for number, (name, found) in enumerate(rows.items()):
            sizes = unit * np.sort(found[:, column])
            axes.plot(sizes, np.linspace(0.0, 100.0, len(sizes)), markevery=0.2, label=name, **canvas.line_style(number))
        axes.set(xlabel=label, ylabel="share of the cases [%]", title=f"Against beams that {kind}")
        axes.set_xlim(0.0, None)
    for axes in panels.ravel():
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    return drawn


def tests_rods() -> ModuleType:
    """The inflated rods of the tests."""
    sys.path.insert(0, str(ROOT))
    try:
        from tests.support import inflated_rods
    except ImportError as error:
        raise sr.MissingDependency("scipy", "dev") from error
    return inflated_rods


def rounded(value: Any) -> Any:
    """The same with all numbers to `DIGITS` digits."""
    if isinstance(value, Mapping):
        return {name: rounded(one) for name, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    for option, value, least in (("--cases", arguments.cases, 1), ("--seed", arguments.seed, 0)):
        if value < least:
            raise sr.ParameterError(option, value, f"at least {least}")
    if arguments.docs is not None:
        check_page(arguments.docs, "beam_validity", page=PAGE)
    if arguments.output is not None or arguments.docs is not None:
        canvas.require_matplotlib()
    folder = None if arguments.output is None else free_folder(arguments.output)
    rods = tests_rods()
    link = study_link(rods, PRESSURES, LOADS)
    arm, errors = study_arm(rods, arguments.cases, arguments.seed)
    result = rounded({"link": link, "arm": arm})
    text = json.dumps(result, indent=1, allow_nan=False)
    print(text if arguments.json else f"\n{table(result)}")
    if folder is None and arguments.docs is None:
        return
    figures = dict(zip(PICTURES, (link_figure(link), arm_figure(rods, arm, errors)), strict=True))
    if folder is not None:
        make_folder(folder)
        write_text(folder / "beam_validity.json", text + "\n", overwrite=False)
        write_text(folder / "beam_validity.md", table(result) + "\n", overwrite=False)
        for name, figure in figures.items():
            canvas.write_png(figure, folder / name, overwrite=False)
    if arguments.docs is not None:
        for name, figure in figures.items():
            canvas.write_png(figure, arguments.docs / "docs" / "images" / name, overwrite=True)
        command = command_of("beam_validity", parser(), arguments, "cases", "seed")
        write_record(arguments.docs, "beam_validity", table(result), result, command=command, page=PAGE)


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input, 1 if an equilibrium is not found."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
