"""One picture of one pose of any robot, with what loads and touches it. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.dynamics.motion import Motion
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact_path import ContactPath
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.imposed_displacement import ImposedDisplacement
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.load_estimation import LoadEstimate
from softrobots.statics.trajectory import Trajectory
from softrobots.view import appearance
from softrobots.view.animation_frames import FRAME_RATE
from softrobots.view.body import robot_line
from softrobots.view.figures.canvas import CONTACT, DASHED, FORCE, GREY, INK, SMALL, equal_box, new_space, plain_words
from softrobots.view.legend import LegendEntry, legend
from softrobots.view.mesh_triangles import triangles
from softrobots.view.scene import WRINKLING_COLOURS, Scene, SceneBuilder
from softrobots.view.tension_scale import tension_colour

Drawable = Equilibrium | SoftModel | IkSolution | ImposedDisplacement | LoadEstimate | Trajectory | ContactPath | Motion
"""What `plot` draws."""

_WIDE, _TALL = 6.4, 5.2  # [in], of the picture without title and legend
_ASIDE = np.deg2rad(62.0)  # azimuth from which a robot is seen, from the direction in which its tip is
_LIGHT = np.array([-0.36, -0.48, 0.8])  # unit vector towards it
_SHADE = 0.55  # of a colour where the light only grazes
_MESH = 1.0 / 80.0  # of the size of the robot: corners of meshes that are nearer than that are drawn as one
_MOST_FACES = 1000  # of a surface that is drawn with all its corners


class _Pose(NamedTuple):
    """A pose that is drawn."""

    scene: Scene
    line: FloatArray  # through the robot, shape (n, 3) [m]
    tip: FloatArray
    other: FloatArray = np.zeros((0, 3))  # the line through the robot with relaxed springs, or at the beginning
    meaning: str = ""  # of that line
    path: FloatArray = np.zeros((0, 3))
    target: FloatArray = np.zeros((0, 3))


def plot(result: Drawable, *, title: str | None = None) -> Any:
    """Draw one picture of a robot: its body, actuators, forces, obstacles and contacts, in metres with equal scales.

    An equilibrium is drawn beside the robot with relaxed springs and the same motors (grey), a model at rest, a solution of the
    inverse kinematics with its target. A trajectory, path in contact or motion is drawn at its end, with the path of the tip,
    and the robot at the beginning in grey. The legend tells forces in newtons and the position of the tip. Colours are those of
    `softrobots.view`. As the last expression of a cell of a notebook the figure is shown there.

    Args:
        result: An equilibrium or what holds one (`IkSolution`, `ImposedDisplacement`, `LoadEstimate`), a model, a `Trajectory`,
            a `ContactPath` or a `Motion`.
        title: Title of the figure; the name of the robot by default.

    Returns:
        The `matplotlib.figure.Figure`; write it with `figure.savefig("robot.png")`.

    Raises:
        ParameterError: If it is something else.
        MissingDependency: If matplotlib is not installed.
        ViewerError: If a shape of the robot cannot be read or drawn.
    """
    if not isinstance(result, Drawable):
        wanted = "an Equilibrium or what holds one, a SoftModel, a Trajectory, a ContactPath or a Motion"
        raise ParameterError("result", result, f"{wanted}; softrobots.view.figures draws others")
    state = result.equilibrium if isinstance(result, IkSolution | ImposedDisplacement | LoadEstimate) else result
    state = state.equilibria[-1] if isinstance(state, Trajectory | ContactPath) else state
    model = state if isinstance(state, SoftModel) else state.model
    figure, axes = new_space((_WIDE, _WIDE), "")
    builder = SceneBuilder(model)
    pose, size = _pose(result, model, builder), builder.extent.size
    seen = [_draw_solids(axes, pose.scene, builder), _draw_forces(axes, pose.scene, size)]
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
    along = np.round((pose.tip - builder.extent.base) / size, 3)
    azimuth = np.arctan2(along[1], along[0]) - _ASIDE
    equal_box(axes, np.concatenate(seen), (np.cos(azimuth), np.sin(azimuth), 0.4))
    rows = _add_legend(figure, pose)
    figure.suptitle(plain_words(str(model.pinocchio.name) if title is None else title), fontsize=11)
    _fit(figure, axes, rows)
    return figure


def _pose(result: Drawable, model: SoftModel, builder: SceneBuilder) -> _Pose:
    """What is drawn of a result."""

    def line(q_motors: FloatArray, q_springs: FloatArray) -> FloatArray:
        return robot_line(model, q_motors, q_springs)

    if isinstance(result, SoftModel):
        q = model.configuration(model.relaxed_motors)
        tip = np.array(frame_placement(model, q, model.tip).translation)
        return _Pose(builder.relaxed(), line(model.relaxed_motors, model.rest), tip)
    if isinstance(result, Motion):
        scene, path = list(builder.movement(result, 1.0 / FRAME_RATE).values())[-1], result.tip_position
        ends = [line(result.q_motors[row], result.q_springs[row]) for row in (0, -1)]
        return _Pose(scene, ends[1], path[-1], ends[0], f"{result.time[-1] - result.time[0]:.3g} s before", path)
    if isinstance(result, Trajectory | ContactPath):
        first, last = result.equilibria[0], result.equilibria[-1]
        shown, before = (line(one.q_motors, one.q_springs) for one in (last, first))
        return _Pose(builder.loaded(last), shown, last.tip_position, before, "at the beginning", result.tip_positions)
    loaded = result if isinstance(result, Equilibrium) else result.equilibrium
    scene = builder.loaded(loaded)
    other = line(loaded.q_motors, model.rest) if model.n_springs else np.zeros((0, 3))
    target = result.target[None] if isinstance(result, IkSolution) else np.zeros((0, 3))
    shown = line(loaded.q_motors, loaded.q_springs)
    return _Pose(scene, shown, loaded.tip_position, other, scene.reference, target=target)


def _draw_solids(axes: Any, scene: Scene, builder: SceneBuilder) -> FloatArray:
    """Draw body and obstacles; return the corners of those that are not larger than the robot, shape (n, 3) [m]."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    seen, faces, colours = [np.zeros((0, 3))], [np.zeros((0, 3, 3))], [np.zeros((0, 4))]
    size = builder.extent.size
    for corners, sides, colour in _surfaces(scene, builder):
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


def _surfaces(scene: Scene, builder: SceneBuilder) -> Iterator[tuple[FloatArray, Any, FloatArray]]:
    """Corners, triangles and colour of everything solid; the body stands for the links of its sections."""
    for shape, pose in zip(builder.robot.shapes, scene.deformed, strict=True):
        colour = np.clip(shape.colour, 0.0, 1.0)
        if shape.inflated_link is not None:
            colour[:3] = WRINKLING_COLOURS[scene.wrinkling[shape.inflated_link] if scene.wrinkling else 0][1]
        elif shape.of_section:
            continue
        corners, sides, _ = triangles(shape.geometry)
        yield corners @ pose[:3, :3].T + pose[:3, 3], sides, colour
    for segment in scene.segments:
        yield *segment.thinned(0.5 * segment.radius).surface(), np.array(appearance.TUBE_COLOUR)
    for obstacle in scene.obstacles:
        corners, sides, _ = triangles(obstacle.geometry)
        yield corners @ obstacle.pose[:3, :3].T + obstacle.pose[:3, 3], sides, np.array(appearance.OBSTACLE_COLOUR)


def _coarse(corners: FloatArray, sides: Any, spacing: float) -> tuple[FloatArray, Any]:
    """A surface whose corners in one cell of a grid are one; triangles that vanish so are left out."""
    _, kept, cell = np.unique(np.rint(corners / spacing), axis=0, return_index=True, return_inverse=True)
    sides = cell.ravel()[sides]
    whole = (sides != np.roll(sides, 1, axis=1)).all(axis=1)
    _, first = np.unique(np.sort(sides[whole], axis=1), axis=0, return_index=True)
    return corners[kept], sides[whole][first]


def _draw_forces(axes: Any, scene: Scene, size: float) -> FloatArray:
    """Draw forces, and the points of contacts; return the ends of the arrows, shape (n, 3) [m]."""
    colours = FORCE, CONTACT
    for contact in scene.contacts.values():
        axes.plot(*contact.point[:, None], ls="", marker="o", ms=5, color=colours[1], zorder=6)
    largest = max((arrow.force for arrow in scene.arrows.values()), default=1.0)
    ends = [np.zeros((0, 3))]
    for arrow in scene.arrows.values():
        along = appearance.ARROW_LENGTH * size * arrow.force / largest * arrow.pose[:3, 1]
        start = arrow.pose[:3, 3] - along * arrow.of_contact
        axes.quiver(*start, *along, color=colours[arrow.of_contact], lw=2.2, zorder=6)
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


def _add_legend(figure: Any, pose: _Pose) -> int:
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
