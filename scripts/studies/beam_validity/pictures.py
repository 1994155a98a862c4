"""The results as two figures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np

import softrobots as sr
from softrobots.inflated_beam import MEAN_STIFFNESS, TABLE_3
from softrobots.statics.kinematics import backbone
from softrobots.view.figures import canvas
from studies.beam_validity.arm import RIGID, Case, arm_rod, axes_of, beams
from studies.beam_validity.link import HINGE, LENGTH, LIMITS, SHOWN, Hinges
from studies.beam_validity.tables import row_at


def link_figure(link: Mapping[str, Any]) -> Any:
    """Draw the validity region, the stiffness over pressure, and the differences over the load at the pressure of the arm."""
    drawn = canvas.new_figure((canvas.WIDTH, 15.0))
    region, stiffness, *below = drawn.subplots(4, 1)
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
    text = "hinge at 30 mm that deflects as (1)"
    stiffness.plot(pressures, [share * k for k in by_beam], color=canvas.COLOURS[2], ls="-.", label=text)
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
    region.legend(fontsize=canvas.SMALL, loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=2)
    stiffness.legend(fontsize=canvas.SMALL, loc="lower right")
    for axes in below:
        axes.legend(fontsize=canvas.SMALL, loc="best")
    return drawn


def arm_figure(rods: ModuleType, arm: Mapping[str, Any], errors: Mapping[str, Mapping[str, np.ndarray]]) -> Any:
    """Draw one posture, and how the errors are distributed."""
    drawn = canvas.new_figure((canvas.WIDTH, 15.0))
    shape, *others = panels = drawn.subplots(4, 1)
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
    shape.set(xlabel="x [m]", ylabel="z [m]", title="The arm under 15 N downwards", ylim=(-0.08, 0.72), aspect="equal")
    looks = (
        ("bend and shear", 0, 1e3, "tip error [mm]"),
        ("bend and shear", 1, 180.0 / math.pi, "error of the angle [degrees]"),
    )
    for axes, (kind, column, unit, label) in zip(
        others, (*looks, ("also twist and stretch", 0, 1e3, "tip error [mm]")), strict=True
    ):
        looks_of = {name: canvas.line_style(number) for number, name in enumerate(arm["hinges"])}
        for name, found in errors[kind].items():
            sizes, look = unit * np.sort(found[:, column]), looks_of.get(name, {"color": "0.55", "lw": 3.5, "zorder": 1})
            if name != RIGID:
                axes.plot(sizes, np.linspace(0.0, 100.0, len(sizes)), markevery=0.2, label=name, **look)
        title = f"{label.partition(' [')[0].capitalize()} against beams that {kind}"
        axes.set(xlabel=label, ylabel="share of the cases [%]", title=title)
        axes.set_xlim(0.0, None)
    for axes in panels:
        canvas.grid_and_legend(axes)
    return drawn
