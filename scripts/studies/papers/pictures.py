"""The figures of the three papers that can be drawn again. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from softrobots import constant_curvature as cc
from softrobots import helix
from softrobots.inflated_beam import TABLE_3
from softrobots.view.figures.canvas import COLOURS, WIDTH, equal_box, new_figure
from studies.papers import helices, link_pictures, pcc_equations, pcc_two_segments, trajectory_pictures
from studies.papers.arm_path import GAIN, movement
from studies.papers.grasp_picture import grasp
from studies.papers.helix_grid import PAPER_ANGLES, PAPER_CONTRACTIONS, PAPER_DIAMETER, PAPER_SCALED
from studies.papers.helix_sheet import draw, sheet
from studies.papers.inflatable_arm import RADIUS


class Picture(NamedTuple):
    """A figure and what it shows."""

    draw: Callable[[], Any]
    """Makes the figure; raises `MissingDependency` without matplotlib."""
    caption: str
    """What it shows, and which figure of the paper it is after."""
    elsewhere: str = ""
    """File in docs/images that shows the same already, with the script that makes it; empty if there is none."""


def moment_angle_law() -> Any:
    """Moment over angle of the link from Table 3, a line a pressure: after [Troise 2021] Figure 9."""
    return link_pictures.moment_angle_laws(TABLE_3, 1e-3 * float(RADIUS))


def tracking() -> Any:
    """Distance of the loaded tip from its targets, for the paper's recursion, the exact solution and no compensation."""
    ours = movement()
    errors = {
        "rigid inverse kinematics, arm sags": ours.sagging.tip_error,
        f"recursion of Figure 6, gain {GAIN:g} 1/s": ours.closed_loop.tip_error,
        "Newton at every waypoint": ours.loaded.tip_error,
    }
    return trajectory_pictures.tip_errors(errors, ours.loaded.times)


def two_segments() -> Any:
    """The arm of our example with both frames, and the azimuth by (34): [PCC paper]."""
    figure = new_figure((WIDTH, 9.6))
    upper, lower = figure.add_subplot(2, 1, 1, projection="3d"), figure.add_subplot(2, 1, 2)
    arcs = [cc.arc_from_muscles(lengths, pcc_two_segments.DISTANCE) for lengths in pcc_two_segments.LENGTHS]
    everything = [np.zeros((1, 3))]
    fractions = np.linspace(0.0, 1.0, 60)
    styles = {
        "torsion_free": ("body without twist", COLOURS[0], "-"),
        "bending_plane": ("frames of (14)", COLOURS[1], "--"),
    }
    for frame, (note, colour, style) in styles.items():
        base, end = cc.chain_transforms(arcs, frame=frame)
        turn = base[:3, :3] @ pcc_equations.about_z(np.asarray(pcc_equations.OFFSET))
        parts = [cc.backbone(arcs[0], fractions), base[:3, 3] + cc.backbone(arcs[1], fractions) @ turn.T]
        for number, (points, face) in enumerate(zip(parts, (colour, "white"), strict=True)):
            label = f"segment 2, {note}" if number else None
            shade = "0.25" if number == 0 else colour
            upper.plot(*points.T, color=shade, lw=3.0 if number == 0 else 2.2, ls="-" if number == 0 else style, label=label)
            upper.plot(*points[-1:].T, color=shade, marker="o", mfc=face if number else shade, ls="none")
        everything += [*parts, end[None, :3, 3]]
    upper.plot([], [], color="0.25", lw=3.0, label="segment 1")
    upper.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="Tip of two segments, our example")
    equal_box(upper, np.vstack(everything))
    upper.legend(loc="center right", bbox_to_anchor=(0.2, 0.5), fontsize=9)
    figure.get_layout_engine().set(hspace=0.08)
    azimuth = np.radians(np.arange(-179.5, 180.0))
    lengths = cc.muscles_from_arc(
        cc.Arc(np.full_like(azimuth, 0.524), np.ones_like(azimuth), azimuth), pcc_two_segments.DISTANCE
    )
    given, plain = np.degrees(azimuth), np.degrees(pcc_equations.azimuth(lengths))
    plain[np.append(np.abs(np.diff(plain)) > 90.0, False)] = np.nan  # no line across the jumps
    whole = np.degrees(cc.arc_from_muscles(lengths, pcc_two_segments.DISTANCE).azimuth)
    lower.plot(given, whole, color=COLOURS[0], lw=2.4, label="atan2 of (33) and (32)")
    lower.plot(given, plain, color=COLOURS[1], lw=2.0, ls="--", label="arctangent of (34) as printed")
    lower.set(
        xlabel="direction of bending [degrees]",
        ylabel="azimuth from the muscle lengths [degrees]",
        title="Azimuth from the lengths of three muscles",
        xticks=range(-180, 181, 60),
        yticks=range(-180, 181, 60),
    )
    lower.grid(alpha=0.3)
    lower.legend(fontsize=9, loc="upper left")
    return figure


def scaled() -> Any:
    """One actuator on tubes of two sizes, to one scale: after [Blumenschein 2018] Figure 6."""
    share, angle = float(PAPER_SCALED.contraction), float(PAPER_SCALED.angle)
    drawn = [[draw(share, angle, float(size), float(size / PAPER_DIAMETER), "right") for size in PAPER_SCALED.diameter]]
    title = "The same actuator on tubes 3.31 and 8.28 cm thick, 1 and 2.5 m long"
    return sheet(drawn, np.array([share, share]), np.array([angle]), title)


PICTURES: Mapping[str, Mapping[str, Picture]] = {
    "inflatable_arm": {
        "arm_law": Picture(moment_angle_law, "Figure 9: the curves, from Table 3. The points of the tests are not published."),
        "arm_poses": Picture(
            lambda: trajectory_pictures.poses(movement().loaded), "Figure 10: the arm along a path; start and end are ours."
        ),
        "arm_angles": Picture(
            lambda: trajectory_pictures.motor_angles(movement().loaded, movement().rigid),
            "Figure 11: angles of the motors on our path.",
        ),
        "arm_moments": Picture(
            lambda: trajectory_pictures.link_moments(movement().loaded),
            "Section 4: moments of the links on our path, and the limit at 50 kPa.",
        ),
        "arm_tracking": Picture(tracking, "Figure 6: how near the recursion follows our path."),
    },
    "pcc_two_segments": {
        "pcc_segments": Picture(
            two_segments, "(14) and (34): the frames of the paper and of a body without twist; the quadrant that is lost."
        ),
    },
    "helical_actuation": {
        "helix_grid": Picture(
            lambda: helices.grid(PAPER_CONTRACTIONS[::-1], PAPER_ANGLES, PAPER_DIAMETER, 1.0),
            "Figure 5: helices by angle and contraction.",
            "helix_grid.png",
        ),
        "helix_scaled": Picture(scaled, "Figure 6: radii and pitch grow with the diameter."),
        "helix_curves": Picture(
            lambda: helices.radius_and_pitch(PAPER_ANGLES, PAPER_DIAMETER),
            "Figure 7: outer radius and pitch against contraction. The measured points are not published.",
            "helix_shapes.png",
        ),
        "helix_grasp": Picture(
            lambda: grasp(helix.PAPER_CYLINDER, 10e3),
            "Figure 9: grasp force of our model; the paper's are measured.",
        ),
    },
}
"""Figures by paper and name."""
