"""A long boom that is pulled down at its end: a rod on an elastic clamp, two numbers fitted on every other length.

The rod is a `PccArm` without muscles. The clamp is its first segment, a millimetre long, which turns under a moment as a
spring does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.loader import load_model
from softrobots.robots import PccArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.view.figures import canvas
from studies.measured.comparison import EXAMPLES, Comparison, Overview, read_numbers, rms, table_of

HEADS = ("Boom Extension (mm)", "Applied Force (N)", "Endpoint Height (mm)", "Deflection (mm)")
DENSITY, CAP = 0.188, 0.25
"""The source's linear density of the boom [kg/m], and its weight of the cap at the end [N]."""
FITTED = (0.502, 1.000, 1.504, 2.013)
"""Extensions that the two numbers are fitted on [m]; the other four are predicted."""
CLAMP = 1e-3  # length of the segment that turns as the clamp does [m]
RIGID = 1e9  # of a clamp that does not turn [N m/rad]


def measurements() -> FloatArray:
    """Extension [m], force [N] and deflection [m] of each row, shape (53, 3)."""
    return read_numbers(EXAMPLES / "boom" / "deflections.csv", HEADS)[:, [0, 1, 3]] * [1e-3, 1.0, 1e-3]


def deflections(length: float, forces: FloatArray, bending_stiffness: float, clamp: float) -> FloatArray:
    """How far the end comes down under its weight and forces, shape of the forces [m].

    Args:
        length: Of the boom [m].
        forces: Down at the end, beside the cap [N].
        bending_stiffness: Of the boom [N m^2].
        clamp: Stiffness of the clamp [N m/rad].
    """
    rod = PccArm(
        segment_lengths=(CLAMP, length - CLAMP),
        offset=0.0,
        muscle_azimuths=(),
        bending_stiffness=(clamp * CLAMP, bending_stiffness),
        axial_stiffness=1e7,
        linear_density=(1.0, DENSITY),  # the clamp weighs a gram, at the base
        chain="lumped",
        hinges=8,
    )
    model, down = load_model(rod), (EARTH_GRAVITY[2], 0.0, 0.0)  # the boom lies along z
    tips = [solve_equilibrium(model, (), (-force - CAP, 0.0, 0.0), gravity=down).tip_position for force in forces]
    return -np.array(tips)[:, 0]


def straight(length: float, bending_stiffness: float, clamp: float) -> float:
    """Compliance of the end for small deflections in closed form, `L^3 / 3 EI + L^2 / k` [m/N]."""
    return length**3 / (3.0 * bending_stiffness) + length**2 / clamp


def run() -> dict[str, Any]:
    """Fit both models on some lengths, and predict all."""
    from scipy.optimize import least_squares

    data = measurements()
    lengths = np.unique(data[:, 0])
    rows = {float(length): data[data[:, 0] == length] for length in lengths}
    models = {}
    for name, starts in (("rigid clamp", [100.0]), ("elastic clamp", [100.0, 700.0])):

        def stiffnesses(logs: Any) -> tuple[float, float]:
            return (float(np.exp(logs[0])), float(np.exp(logs[1])) if len(logs) > 1 else RIGID)

        def misses(logs: Any, chosen: Any = FITTED) -> FloatArray:
            parts = [_loaded(rows[length], stiffnesses(logs)) for length in chosen]
            return np.concatenate([found - measured for found, measured in parts])

        fit = least_squares(misses, np.log(starts), diff_step=1e-3, xtol=1e-6)
        bending, clamp = stiffnesses(fit.x)
        errors = {length: misses(fit.x, (length,)) for length in rows}
        models[name] = {
            "bending_stiffness": bending,
            "clamp_stiffness": None if len(starts) < 2 else clamp,
            "fitted_m": rms(np.concatenate([errors[length] for length in FITTED])),
            "predicted_m": rms(np.concatenate([errors[length] for length in rows if length not in FITTED])),
            "largest_m": float(max(np.abs(error).max() for error in errors.values())),
            "lengths": [_of_length(rows[length], errors[length], (bending, clamp)) for length in rows],
        }
    weights = CAP * lengths**3 / 3.0 + DENSITY * -EARTH_GRAVITY[2] * lengths**4 / 8.0
    arms = data[:, 1] * data[:, 0] ** 3 / 3.0 + weights[np.searchsorted(lengths, data[:, 0])]
    slope = float(arms @ data[:, 2] / (arms @ arms))
    source = {"bending_stiffness": 1.0 / slope, "all_rows_m": rms(slope * arms - data[:, 2])}
    return {"rows": data.tolist(), "fitted_lengths_m": list(FITTED), "models": models, "source": source}


def _loaded(rows: FloatArray, stiffnesses: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Deflections beyond that of the unloaded boom, found and measured, of the loaded rows of one length [m]."""
    found = deflections(float(rows[0, 0]), rows[:, 1], *stiffnesses)
    return found[1:] - found[0], rows[1:, 2] - rows[0, 2]


def _of_length(rows: FloatArray, errors: FloatArray, stiffnesses: tuple[float, float]) -> dict[str, Any]:
    """What is told of one length."""
    length, last = float(rows[0, 0]), rows[-1]
    found, measured = _loaded(rows[[0, -1]], stiffnesses)
    return {
        "length_m": length,
        "rows": len(rows) - 1,
        "force_N": float(last[1]),
        "measured_m": float(measured[0]),
        "found_m": float(found[0]),
        "straight_m": float(last[1] * straight(length, *stiffnesses)),
        "rms_m": rms(errors),
        "unloaded_measured_m": float(rows[0, 2]),
        "unloaded_found_m": float(deflections(length, np.zeros(1), *stiffnesses)[0]),
    }


def table(record: Mapping[str, Any]) -> str:
    """The numbers as Markdown."""
    rigid, elastic = record["models"]["rigid clamp"], record["models"]["elastic clamp"]
    fits = [
        (
            name,
            f"{model['bending_stiffness']:.1f}",
            "-" if model["clamp_stiffness"] is None else f"{model['clamp_stiffness']:.0f}",
            *(f"{1e3 * model[key]:.2f}" for key in ("fitted_m", "predicted_m", "largest_m")),
        )
        for name, model in record["models"].items()
    ]
    by_length = [
        (
            f"{one['length_m']:.3f}",
            "fitted" if one["length_m"] in record["fitted_lengths_m"] else "predicted",
            f"{one['force_N']:g}",
            *(f"{1e3 * one[key]:.1f}" for key in ("measured_m", "found_m", "straight_m")),
            f"{1e3 * one['rms_m']:.1f}",
            f"{1e3 * other['rms_m']:.1f}",
            f"{1e3 * one['unloaded_measured_m']:.0f}",
            f"{1e3 * one['unloaded_found_m']:.1f}",
        )
        for one, other in zip(elastic["lengths"], rigid["lengths"], strict=True)
    ]
    heads = ["model", "EI [N m^2]", "clamp [N m/rad]", "four lengths of the fit", "four others, predicted", "largest"]
    first = table_of(heads, fits, words=1)
    heads = ["length [m]", "", "largest force [N]", "measured", "found", "closed form", "error", "error, rigid clamp"]
    second = table_of([*heads, "unloaded, measured", "unloaded, found"], by_length, words=2)
    return f"Errors of the deflection by the load [mm], root mean square but for the largest:\n\n{first}\n\n{second}"


def overview(record: Mapping[str, Any]) -> Overview:
    """The row of the table over all comparisons."""
    model = record["models"]["elastic clamp"]
    furthest = max(one["measured_m"] for one in model["lengths"])
    return Overview(
        "[boom of 0.26 to 2.0 m](#a-long-boom), pulled down at its end",
        "[GIRAF](references.md#measurements), 53 rows",
        "none stated; numbers quoted",
        "deflection by the load, four lengths",
        f"{1e3 * model['predicted_m']:.1f} mm of up to {1e3 * furthest:.0f} mm",
        "bending stiffness and clamp, on four other lengths",
        "`python scripts/measured.py boom`",
    )


def picture(record: Mapping[str, Any]) -> Any:
    """Deflection over force, by length."""
    figure = canvas.new_figure((4.8, 7.4))
    data, model = np.array(record["rows"]), record["models"]["elastic clamp"]
    lengths = np.unique(data[:, 0])
    for axes, chosen, title in zip(
        figure.subplots(2, 1, sharex=True, sharey=True),
        ([one for one in lengths if one in FITTED], [one for one in lengths if one not in FITTED]),
        ("lengths of the fit", "other lengths, predicted"),
        strict=True,
    ):
        for number, length in enumerate(chosen):
            rows = data[data[:, 0] == length]
            style = canvas.line_style(number)
            forces = np.linspace(0.0, rows[-1, 1], 9)
            curve = deflections(float(length), forces, model["bending_stiffness"], model["clamp_stiffness"])
            axes.plot(forces, 1e3 * (curve - curve[0]), color=style["color"], ls=style["ls"])
            measured = 1e3 * (rows[:, 2] - rows[0, 2])
            axes.plot(rows[:, 1], measured, color=style["color"], marker=style["marker"], ls="", label=f"{length:.2f} m")
        axes.set(ylabel="deflection by the load [mm]", title=title)
        canvas.grid_and_legend(axes)
    figure.axes[-1].set_xlabel("force at the end [N]")
    figure.suptitle("Markers: measured\nLines: a rod on an elastic clamp", fontsize=10)
    return figure


BOOM = Comparison(run, table, picture, overview)
"""The comparison."""
