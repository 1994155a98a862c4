"""`plot`: the figure of a result; of a pose, the robot with what loads and touches it. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, get_args

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.core.summary import PICTURES
from softrobots.dynamics.vibration import VibrationModes
from softrobots.identification.cross_validation import CrossValidation
from softrobots.identification.identification import Identification
from softrobots.identification.informative_poses import InformativePoses
from softrobots.robots.fields import XacroRobot
from softrobots.statics.buckling.equilibrium_branch import EquilibriumBranch
from softrobots.statics.workspace import Workspace
from softrobots.statics.workspace_map import WorkspaceMap
from softrobots.view import appearance
from softrobots.view.figures.canvas import CONTACT, DASHED, FORCE, GREY, INK, SMALL, equal_box, new_space, plain_words
from softrobots.view.figures.equilibria import branches
from softrobots.view.figures.experiments import cross_validation, informative
from softrobots.view.figures.identifications import predicted
from softrobots.view.figures.inline import inline_picture
from softrobots.view.figures.pose import DrawnPose, Posed, with_robot_loaded
from softrobots.view.figures.vibrations import mode_shapes
from softrobots.view.figures.workspaces import workspace, workspace_maps
from softrobots.view.legend import LegendEntry, legend
from softrobots.view.scene import WRINKLING_COLOURS
from softrobots.view.tension_scale import tension_colour

FIGURES: dict[type, Callable[[Any], Any]] = {
    VibrationModes: mode_shapes,
    Workspace: workspace,
    WorkspaceMap: workspace_maps,
    EquilibriumBranch: lambda branch: branches((branch,)),
    Identification: predicted,
    CrossValidation: cross_validation,
    InformativePoses: informative,
}
"""The figure of each kind of results that no pose stands for, by its class; of branches there are several, in a tuple."""

PICTURES.update(dict.fromkeys((XacroRobot, *get_args(Posed)), inline_picture))

_WIDE, _TALL = 6.4, 5.2  # [in], of the picture without title and legend
_LIGHT = np.array([-0.36, -0.48, 0.8])  # unit vector towards it
_SHADE = 0.55  # of a colour where the light only grazes
_MESH = 1.0 / 80.0  # of the size of the robot: corners of meshes that are nearer than that are drawn as one
_MOST_FACES = 1000  # of a surface that is drawn with all its corners


def plot(result: Any, *, title: str | None = None) -> Any:
    """Draw a result: the robot in its pose, or the figure of results that are no pose.

    The robot is drawn with its body, actuators, forces, obstacles and contacts, in metres with equal scales: an equilibrium
    beside the robot with relaxed springs and the same motors (grey), a robot or model at rest, a solution of the inverse
    kinematics with its target. A trajectory, path in contact or motion is drawn at its end, with the path of the tip, and the
    robot at the beginning in grey. The legend tells forces in newtons and the position of the tip. Colours are those of
    `softrobots.view`.

    Modes are drawn as their swings, a workspace as its points, a workspace map as its areas, branches over the force, a fit as
    what it predicts over what was measured, a cross-validation and a choice of poses as their errors. `softrobots.view.figures`
    has more, with options. As the last expression of a cell of a notebook the figure is shown there.

    Args:
        result: An equilibrium or what holds one (`IkSolution`, `ImposedDisplacement`, `LoadEstimate`), a robot, a model, a
            `Trajectory`, a `ContactPath` or a `Motion`; `VibrationModes`, a `Workspace` or `WorkspaceMap`, an
            `EquilibriumBranch` or several, an `Identification`, a `CrossValidation` or `InformativePoses`.
        title: Title of the figure; of a pose the name of the robot by default.

    Returns:
        The `matplotlib.figure.Figure`; write it with `figure.savefig("robot.png")`.

    Raises:
        ParameterError: If it is something else, or has nothing to draw.
        MissingDependency: If matplotlib is not installed.
        ViewerError: If a shape of the robot cannot be read or drawn.
        DescriptionError: If a robot cannot be loaded.
    """
    result = with_robot_loaded(result)
    if isinstance(result, Posed):
        return _robot(DrawnPose.of(result), title)
    several = isinstance(result, tuple | list) and result and all(isinstance(one, EquilibriumBranch) for one in result)
    draw = branches if several else next((draw for kind, draw in FIGURES.items() if isinstance(result, kind)), None)
    if draw is None:
        kinds = "an Equilibrium or what holds one, a robot, a SoftModel, a Trajectory, a ContactPath, a Motion"
        names = ", ".join(kind.__name__ for kind in FIGURES)
        raise ParameterError("result", result, f"{kinds}, or one of {names}; softrobots.view.figures draws others")
    figure = draw(result)
    if title is not None:
        figure.suptitle(plain_words(title))
    return figure


def _robot(pose: DrawnPose, title: str | None) -> Any:
    """Draw the robot of a pose."""
    figure, axes = new_space((_WIDE, _WIDE), "")
    seen = [_draw_solids(axes, pose), _draw_forces(axes, pose)]
    end = appearance.shared_scale([pose.scene])
    for curve, tension, slack in pose.scene.actuators:
        axes.plot(*curve.shown.T, color=tension_colour(tension, end), lw=1.8, ls=DASHED if slack else "-", zorder=4)
    for segment in pose.scene.segments:
        for points in segment.lines.values():
            axes.plot(*points.T, color=appearance.LINE_COLOUR, lw=1.8, zorder=4)
    for points, style in (
        (pose.other, {"color": GREY, "ls": ":", "lw": 2.0}),
        (pose.line, {"color": INK, "lw": 1.2}),
        (pose.path, {"color": INK, "ls": "--", "lw": 1.2}),
        (pose.tip[None], {"color": INK, "marker": "o", "ms": 5}),
        (pose.target, {"color": INK, "marker": "x", "ms": 10, "mew": 2.0}),
    ):
        if len(points):
            axes.plot(*points.T, zorder=5, **style)
        seen.append(points)
    equal_box(axes, np.concatenate(seen), pose.eye)
    rows = _add_legend(figure, pose)
    figure.suptitle(plain_words(pose.name if title is None else title), fontsize=11)
    _fit(figure, axes, rows)
    return figure


def _draw_solids(axes: Any, pose: DrawnPose) -> FloatArray:
    """Draw body and obstacles; return the corners of those that are not larger than the robot, shape (n, 3) [m]."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    seen, faces, colours = [np.zeros((0, 3))], [np.zeros((0, 3, 3))], [np.zeros((0, 4))]
    size, tube = pose.builder.extent.size, np.array(appearance.TUBE_COLOUR)
    bodies = ((*segment.thinned(0.5 * segment.radius).surface(), tube) for segment in pose.scene.segments)
    for corners, sides, colour in (*pose.solids(), *bodies):
        if len(sides) > _MOST_FACES:
            corners, sides = _coarse(corners, sides, _MESH * size)
        flat = corners[sides]
        normals = np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])
        lit = np.abs(normals @ _LIGHT) / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
        colours.append(np.column_stack([(_SHADE + (1.0 - _SHADE) * lit)[:, None] * colour[:3], np.full(len(flat), colour[3])]))
        faces.append(flat)
        if np.ptp(corners, axis=0).max() <= 1.5 * size:
            seen.append(corners)
    style = {"facecolors": np.concatenate(colours), "edgecolors": "none", "antialiased": False, "zorder": 2}
    axes.add_collection3d(Poly3DCollection(np.concatenate(faces), **style))
    return np.concatenate(seen)


def _coarse(corners: FloatArray, sides: Any, spacing: float) -> tuple[FloatArray, Any]:
    """A surface whose corners in one cell of a grid are one; triangles that vanish so are left out."""
    _, kept, cell = np.unique(np.rint(corners / spacing), axis=0, return_index=True, return_inverse=True)
    sides = cell.ravel()[sides]
    whole = (sides != np.roll(sides, 1, axis=1)).all(axis=1)
    _, first = np.unique(np.sort(sides[whole], axis=1), axis=0, return_index=True)
    return corners[kept], sides[whole][first]


def _draw_forces(axes: Any, pose: DrawnPose) -> FloatArray:
    """Draw forces, and the points of contacts; return the ends of the arrows, shape (n, 3) [m]."""
    for contact in pose.scene.contacts.values():
        axes.plot(*contact.point[:, None], ls="", marker="o", ms=5, color=CONTACT, zorder=6)
    ends = [np.zeros((0, 3))]
    for start, along, of_contact in pose.arrows():
        axes.quiver(*start, *along, color=CONTACT if of_contact else FORCE, lw=2.2, zorder=6)
        ends.append(np.stack([start, start + along]))
    return np.concatenate(ends)


def _fit(figure: Any, axes: Any, rows: int) -> None:
    """Make the figure as high as what is drawn: a title, the axes with their labels, a legend of some rows."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    box = np.array(np.meshgrid(axes.get_xlim(), axes.get_ylim(), axes.get_zlim())).reshape(3, 8)
    below, above = 0.2 * rows + 0.25, 0.4  # [in], of legend and title
    left, bottom, side, tall = 0.0, 0.0, 4.0, _TALL  # [in], of the square of the axes, and of what is drawn of it
    for step in range(3):
        height = below + tall + above
        figure.set_size_inches(_WIDE, height)
        axes.set_position((left / _WIDE, bottom / height, side / _WIDE, side / height))
        figure.draw_without_rendering()
        renderer = FigureCanvasAgg(figure).get_renderer()
        labels = [axis.get_tightbbox(renderer).get_points() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
        corners = axes.transData.transform(np.column_stack(proj_transform(*box, axes.get_proj())[:2]))
        drawn = np.concatenate([corners, *labels]) / figure.dpi
        low, high = drawn.min(axis=0), drawn.max(axis=0)
        if step == 0:
            side *= min((_WIDE - 0.2) / (high[0] - low[0]), _TALL / (high[1] - low[1]))
        else:
            left, bottom, tall = left + 0.5 * (_WIDE - low[0] - high[0]), bottom + below - low[1], high[1] - low[1]


def _add_legend(figure: Any, pose: DrawnPose) -> int:
    """Tell below the picture what is what, which forces there are, and where the tip is; return the number of rows."""
    from matplotlib.lines import Line2D

    scene = dataclasses.replace(pose.scene, capsules=())
    absent = [colour for level, (_, colour) in enumerate(WRINKLING_COLOURS) if level not in (scene.wrinkling or ())]
    rows = {}
    for entry in legend((), scene, path=len(pose.path) > 0, target=len(pose.target) > 0):
        if entry.colour not in absent:
            rows[plain_words(entry.meaning)] = _handle(entry)
    x, y, z = np.round(pose.tip, 4) + 0.0
    rows[f"tip ({x:.4f}, {y:.4f}, {z:.4f}) m"] = Line2D([], [], color=INK, ls="", marker="o", ms=5)
    rows["backbone" if scene.segments else "line through the joints"] = Line2D([], [], color=INK, lw=1.2)
    if len(pose.other):
        rows[pose.meaning] = Line2D([], [], color=GREY, ls=":", lw=2.0)
    figure.legend(rows.values(), rows.keys(), loc="outside lower center", ncols=2, fontsize=SMALL)
    return -(-len(rows) // 2)


def _handle(entry: LegendEntry) -> Any:
    """The sign of an entry of the legend: a line of what is drawn as a line, a patch of what is a solid."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colour: Any = entry.colour
    if colour == appearance.PATH_COLOUR:
        cross = "target" in entry.meaning
        return Line2D(
            [], [], color=INK, **({"ls": "", "marker": "x", "ms": 8, "mew": 2.0} if cross else {"ls": "--", "lw": 1.2})
        )
    if isinstance(colour, int):
        return Line2D([], [], color=f"#{colour:06x}", lw=2.2, marker="o" if colour == appearance.CONTACT_COLOUR else "", ms=5)
    if len(colour) == 4 and colour[3] == 1.0:
        return Line2D([], [], color=colour, lw=1.8, ls=DASHED if entry.dashed else "-")
    return Patch(color=colour)
