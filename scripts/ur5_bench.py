"""Characterise an inflated link on a simulated bench: a UR5 pushes it with a probe.

The bench of Troise et al. 2021 (doi:10.3390/app11062558), section 3. At each pressure of the paper's Table 3 the true link has
the stiffness and the largest moment of that table. The UR5's inverse kinematics follows the imposed displacement; the force
comes from the statics of the link, through wrinkling; the fit of the paper then recovers both numbers. Prints them beside the
table, and writes raw data (CSV), results (JSON), plots and a self-contained HTML scene into a new folder. Table 3 has no
largest moment at 60 kPa: there the link is linear, and the push ends at 95 % of the wrinkling moment. No gravity.

Needs example-robot-data: pip install 'softrobots[robots]'.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

import softrobots as sr
from softrobots import inflated_beam
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import non_negative_number, positive_integer
from softrobots.core.files import csv_text, make_folder, write_text
from softrobots.inflated_beam import CharacterisationRow, fit_characterisation
from softrobots.view.figures import canvas
from studies.shared.command_line import serve, tell_written
from studies.shared.folders import free_folder
from studies.ur5 import bench_plots
from studies.ur5.bench import UR5_JOINTS, UR5Bench
from studies.ur5.bench_run import BenchRun, Measurement, push_link

TABULATED = tuple(row.pressure / 1e3 for row in inflated_beam.TABLE_3)
"""Pressures of Table 3 [kPa]."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = f"gauge pressures out of Table 3 [kPa] ({' '.join(f'{p:g}' for p in TABULATED)})"
    result.add_argument("--pressures", type=float, nargs="+", metavar="P", default=list(TABULATED), help=help_text)
    result.add_argument("--steps", type=int, default=40, help="steps of a push (%(default)s)")
    result.add_argument(
        "--beyond", type=float, default=1.6, help="end of a push over the angle at which the plateau begins (%(default)s)"
    )
    result.add_argument(
        "--noise", type=float, nargs=2, metavar=("FORCE", "ANGLE"), default=(0.0, 0.0),
        help="standard deviations of the noise on force [N] and angle [rad], e.g. 0.3 0.0005 (none)",
    )  # fmt: skip
    result.add_argument("--seed", type=int, default=0, help="seed of the noise (%(default)s)")
    result.add_argument(
        "--scene-pressure", type=float, metavar="P", help="pressure that the scene shows [kPa] (50, or the last one)"
    )
    result.add_argument(
        "--output", type=Path, metavar="FOLDER", help="new or empty folder for the results (output/ur5_bench_<time>)"
    )
    result.add_argument("--no-plots", action="store_true", help="do without the plots, which need matplotlib")
    result.add_argument("--meshcat", action="store_true", help="serve the animation on loopback until Ctrl-C")
    return result


def run(arguments: argparse.Namespace) -> Path:
    """Do the whole job and return the folder of the results."""
    rows = _rows(arguments.pressures)
    steps = positive_integer("--steps", arguments.steps)
    if steps < 10:
        raise sr.ParameterError("--steps", steps, "at least 10, for slope and plateau to be told apart")
    shown = _shown(arguments.scene_pressure, rows)
    for name, deviation in zip(("FORCE", "ANGLE"), arguments.noise, strict=True):
        non_negative_number(f"--noise {name}", deviation)
    if arguments.seed < 0:
        raise sr.ParameterError("--seed", arguments.seed, "a whole number from 0")
    if not arguments.no_plots:
        canvas.require_matplotlib()  # tells at once what is missing
    folder = free_folder(arguments.output or Path("output") / f"ur5_bench_{datetime.now():%Y%m%d_%H%M%S}")
    pushes: list[tuple[CharacterisationRow, BenchRun, Measurement]] = []
    for number, row in enumerate(rows):
        link = sr.InflatableArm(
            link_lengths=(0.6,), stiffness=row.stiffness, pressure=row.pressure, max_moment=row.max_moment
        )  # fmt: skip
        bench = UR5Bench(link=link)
        ways = np.linspace(0.0, bench.push_end(arguments.beyond), steps + 1)
        done = push_link(bench, ways, progress=f"{row.pressure / 1e3:g} kPa")
        force_std, angle_std = arguments.noise
        measured = done.measure(force_std=force_std, angle_std=angle_std, seed=arguments.seed + number)
        pushes.append((row, done, measured))
    results = [_result(*push) for push in pushes]
    scene = pushes[shown][1]
    with sr.view(scene.bench.model, scene.trajectory()) as viewer:
        viewer.look_from(*scene.bench.camera)
        make_folder(folder)
        write_text(folder / "raw.csv", _raw(pushes), overwrite=False)
        settings = {"steps": steps, "beyond": arguments.beyond, "noise": list(arguments.noise), "seed": arguments.seed}
        text = json.dumps({"settings": settings, "results": results}, indent=2) + "\n"
        write_text(folder / "results.json", text, overwrite=False)
        if not arguments.no_plots:
            canvas.write_png(bench_plots.force_displacement(pushes), folder / "force_displacement.png", overwrite=False)
            canvas.write_png(bench_plots.moment_angle(pushes), folder / "moment_angle.png", overwrite=False)
        title = f"UR5 pushes the inflated link at {scene.bench.pressure / 1e3:g} kPa"
        viewer.write_html(folder / "scene.html", title=title)
        print(table(results))
        print(ur5_table([done for _, done, _ in pushes]))
        tell_written(folder)
        if arguments.meshcat:
            serve(viewer)
    return folder


def _rows(pressures: list[float]) -> list[CharacterisationRow]:
    """Rows of Table 3 by pressure [kPa]."""
    by_pressure = dict(zip(TABULATED, inflated_beam.TABLE_3, strict=True))
    unknown = [p for p in pressures if p not in by_pressure]
    if unknown or len(set(pressures)) != len(pressures):
        raise sr.ParameterError("--pressures", pressures, f"pressures of Table 3, each once: {list(TABULATED)} kPa")
    return [by_pressure[p] for p in sorted(pressures)]


def _shown(pressure: float | None, rows: list[CharacterisationRow]) -> int:
    """Which push the scene shows."""
    available = [row.pressure / 1e3 for row in rows]
    if pressure is None:
        return available.index(50.0) if 50.0 in available else len(rows) - 1
    if pressure not in available:
        raise sr.ParameterError("--scene-pressure", pressure, f"one of the pressures that are tested: {available} kPa")
    return available.index(pressure)


def _result(row: CharacterisationRow, done: BenchRun, measured: Measurement) -> dict[str, Any]:
    """What a push tells, beside the table."""
    bench = done.bench
    fit = fit_characterisation(measured.angle, measured.moment, pressure=row.pressure, radius=bench.radius)
    small = fit_characterisation(
        *bench.test.small_angles(done.displacement, measured.force),
        pressure=row.pressure,
        radius=bench.radius,
        angle_offset=0.0,  # as the paper
    )  # fmt: skip
    return {
        "pressure_Pa": row.pressure,
        "table_stiffness_N_m_rad": row.stiffness,
        "table_stiffness_std_N_m_rad": row.stiffness_std,
        "table_max_moment_N_m": row.max_moment,
        **{f"fit_{name}": value for name, value in asdict(fit).items()},
        "small_angles_stiffness": small.stiffness,
        "small_angles_max_moment": small.max_moment,
        "largest_displacement_m": float(done.displacement.max()),
        "largest_force_N": float(done.force.max()),
        "largest_angle_rad": float(measured.angle.max()),
        "largest_ik_error_m": float(done.ik_error.max()),
        "largest_ik_orientation_error_rad": float(done.ik_orientation_error.max()),
        "all_stable_while_held": done.stable,
        "ur5_largest_torques_N_m": np.abs(done.ur5_torques).max(axis=0).tolist(),
        "ur5_effort_N_m": done.ur5_effort.tolist(),
    }


def table(results: list[dict[str, Any]]) -> str:
    """Recovered numbers beside those of the paper, which are the true ones here."""
    head = [
        ("p", "k table", "sigma", "k fit", "sigma", "diff.", "M_max table", "fit", "diff.", "M_w (3)", "k small angles"),
        ("[kPa]", "[Nm/rad]", "", "[Nm/rad]", "", "[%]", "[N m]", "[N m]", "[%]", "[N m]", "[%]"),
    ]  # fmt: skip
    lines = [
        (
            f"{r['pressure_Pa'] / 1e3:g}",
            f"{r['table_stiffness_N_m_rad']:.2f}",
            f"{r['table_stiffness_std_N_m_rad']:.2f}",
            f"{r['fit_stiffness']:.2f}",
            f"{r['fit_stiffness_std']:.2f}",
            _share(r["fit_stiffness"], r["table_stiffness_N_m_rad"]),
            _number(r["table_max_moment_N_m"]),
            _number(r["fit_max_moment"]),
            _share(r["fit_max_moment"], r["table_max_moment_N_m"]),
            f"{r['fit_wrinkling_moment']:.2f}",
            _share(r["small_angles_stiffness"], r["table_stiffness_N_m_rad"]),
        )
        for r in results
    ]
    worst = max(r["largest_ik_error_m"] for r in results)
    stable = "yes" if all(r["all_stable_while_held"] for r in results) else "NO"
    text = (
        "\nTable 3 of the paper holds the true k and M_max of the simulated link; M_w (3) is (pi/4) pi p r^3. 'k small angles':"
        "\nwhat the paper's evaluation, v / (h - l1) and F (h - l1), makes of the same data, relative to the true value."
        "\n"
        f"largest distance of the probe from where it was meant to be: {worst:.2g} m; every step certified stable: {stable}"
    )
    return "\n" + _aligned([*head, *lines]) + "\n" + text


def ur5_table(runs: list[BenchRun]) -> str:
    """Largest torques of the UR5's joints by the reaction alone, beside their limits."""
    largest = np.max([np.abs(done.ur5_torques).max(axis=0) for done in runs], axis=0)
    limits = runs[0].ur5_effort
    lines = [
        (name.removesuffix("_joint"), f"{torque:.2f}", f"{limit:g}", f"{100.0 * torque / limit:.1f}")
        for name, torque, limit in zip(UR5_JOINTS, largest.tolist(), limits.tolist(), strict=True)
    ]
    return "\n" + _aligned([("UR5 joint", "torque [N m]", "limit [N m]", "share [%]"), *lines])


def _aligned(lines: list[tuple[str, ...]]) -> str:
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in lines)


def _number(value: float | None) -> str:
    return "N/A" if value is None else f"{value:.2f}"


def _share(value: float | None, true: float | None) -> str:
    """Difference from the true value [%]."""
    return "N/A" if value is None or true is None else f"{round(100.0 * (value / true - 1.0), 2) + 0.0:+.2f}"


def _raw(pushes: list[tuple[CharacterisationRow, BenchRun, Measurement]]) -> str:
    """All steps of all pushes as CSV."""
    names = [
        "pressure_Pa", "step", "displacement_m", "force_N", "measured_force_N", "measured_angle_rad", "measured_moment_N_m",
        "true_angle_rad", "true_moment_N_m", "ik_error_m", *(f"{joint}_rad" for joint in UR5_JOINTS),
        *(f"{joint}_N_m" for joint in UR5_JOINTS),
    ]  # fmt: skip
    lines = []
    for row, done, measured in pushes:
        true = done.measure()
        for step, (q, torque) in enumerate(zip(done.q_ur5.tolist(), done.ur5_torques.tolist(), strict=True)):
            numbers = (done.displacement, done.force, *measured, true.angle, true.moment, done.ik_error)
            lines.append([row.pressure, step, *(float(column[step]) for column in numbers), *q, *torque])
    return csv_text(names, lines)


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2, a push that cannot be done with 1."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
