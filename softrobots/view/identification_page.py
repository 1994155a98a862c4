"""A fitted robot in the poses that were measured: what the instruments saw beside what is predicted, row by row."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, instance_of, positive_integer
from softrobots.core.errors import ParameterError
from softrobots.identification.derivatives.rows_and_states import States
from softrobots.identification.identification import Comparison, Identification
from softrobots.identification.measured_robot import load_cases
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor
from softrobots.view.animation_frames import FRAME_RATE
from softrobots.view.appearance import DOT_SIZE, rgb
from softrobots.view.legend import LegendEntry
from softrobots.view.scene import Scene
from softrobots.view.viewer import Viewer

_COLOURS = {"measured": 0xD55E00, "predicted": 0x0072B2}
_LINE, _PAPER = 0x1A1A1A, 0xFFFFFF
_POINT, _AXIS = 0.008, 0.06  # radius of the point and length of the axes of the row that is shown, of the size of the robot
_WORST = 5  # rows that are always shown
_TOLD = 3  # of them in the legend


class IdentificationPage(Viewer):
    """A page that steps through measured rows, one a second: the predicted robot, and each measured point or frame.

    All measured and predicted points are dots with a line between the two, true to scale; those of the row that is shown are
    balls, or three axes if the rotation was measured. Everything stands in the frame of the robot's base.
    """

    def __init__(self, result: Identification, *, most_rows: int = 40, aside: bool = False, port: int | None = None) -> None:
        """Start a server on loopback and draw the rows.

        Args:
            result: The fit.
            most_rows: How many rows to step through at most: the five worst, and others evenly spread.
            aside: Show the rows that were kept aside for validation, not those that were fitted.
            port: Port of the page; by default the first free one from 7000.

        Raises:
            ParameterError: If it is no fit, no positions or poses of such rows were measured, or an argument does not fit.
            ViewerError: If the server does not start, or a shape cannot be drawn.
        """
        instance_of("result", result, Identification, "an Identification")
        most, shown = positive_integer("most_rows", most_rows), result.validation if aside else result.fitted
        lengths = [] if shown is None else [np.linalg.norm(shown.residuals[key][:, :3], axis=1) for key in _places(shown)]
        if shown is None or not lengths:
            raise ParameterError("result", result, "a fit with such rows in which positions or poses were measured")
        if aside and shown.states is None and result.model.structure.friction is not None:
            raise ParameterError("aside", aside, "False of a file of a robot with dry friction: what came before is not told")
        distances = np.max(np.nan_to_num(lengths), axis=0)
        rows = _chosen(distances, most)
        super().__init__(result.model, port=port)
        try:
            parameters = ParameterSet.of(self._model, result.names, shown.measurements.markers)
            states = shown.states or Predictor(parameters, shown.measurements, gaps=True).at(result.solution).at.states
            scenes = self._rows(states.rows(rows))
            self._robot.show(next(iter(scenes.values())))
            animation = self._robot.animate(scenes)
            base = pin.SE3(pin.exp3(parameters.base(result.solution)[1]), parameters.base(result.solution)[0])
            points = self._draw(shown, np.array(base.inverse().homogeneous), rows, animation)
            self._page.set_animation(animation, play=True, repetitions=1000)
            self.look_from(*_camera(np.vstack([points, self._scenes.extent.base])))
            self._robot.notes += [LegendEntry(colour, name) for name, colour in _COLOURS.items()]
            where = shown.measurements.where
            for row in np.argsort(-distances, kind="stable")[:_TOLD].tolist():
                text = f"at {rows.tolist().index(row)} s: {where(row)}, {1e3 * distances[row]:.1f} mm off"
                self._robot.notes.append(LegendEntry(_PAPER, text))
            self._show_legend()
        except BaseException:
            self.close()
            raise

    def _rows(self, states: States) -> dict[int, Scene]:
        """The predicted robot in the rows, by number of frame: at the begin and the end of a second each."""
        scenes: dict[int, Scene] = {}
        for place, load in enumerate(load_cases(states.loads, len(states.q_motors))):
            tensions = states.actuator_loads[place, self._model.n_motors - len(self._model.muscles) :]
            scene = self._scenes.state(states.q_motors[place], states.q_springs[place], load, tensions)
            scenes |= dict.fromkeys((place * FRAME_RATE, (place + 1) * FRAME_RATE - 1), scene)
        return scenes

    def _draw(self, shown: Comparison, to_base: FloatArray, rows: NDArray[np.int_], animation: Any) -> FloatArray:
        """Draw every point, and animate those of the rows; return the predicted points, shape (n, 3) [m]."""
        import meshcat.geometry as geometry

        size, root = self._scenes.extent.size, self._page["softrobots/points"]
        points: dict[str, list[FloatArray]] = {name: [] for name in _COLOURS}
        for key in _places(shown):
            counted = np.isfinite(shown.residuals[key])
            there, turned = np.asarray(counted[:, :3].all(axis=1)), counted.shape[1] == 6
            for name, values in (("measured", shown.measurements.measured[key]), ("predicted", shown.predicted[key])):
                poses = to_base @ _poses(values)
                points[name].append(poses[there, :3, 3])
                node = root[f"{key}/{name}"]
                _put_point(node, geometry.MeshLambertMaterial(color=_COLOURS[name]), size, turned)
                seen = {node: there} | ({node["axes"]: np.asarray(counted.all(axis=1))} if turned else {})
                _animate(animation, node, poses[rows], {one: visible[rows] for one, visible in seen.items()})
        clouds = {name: np.concatenate(some) for name, some in points.items()}
        for name, cloud in clouds.items():
            colours = np.tile(np.array(rgb(_COLOURS[name]))[:, None] / 255.0, (1, len(cloud)))
            dots = geometry.PointCloud(cloud.T.astype(np.float32), colours.astype(np.float32), size=0.8 * DOT_SIZE * size)
            root[f"all/{name}"].set_object(dots)
        ends = np.stack(list(clouds.values()), axis=1).reshape(-1, 3)
        lines = geometry.LineSegments(geometry.PointsGeometry(ends.T.astype(np.float32)), geometry.LineBasicMaterial(_LINE))
        root["all/errors"].set_object(lines)
        return clouds["predicted"]


def _put_point(node: Any, paint: Any, size: float, turned: bool) -> None:
    """Draw a point of a robot of a size [m], with axes if it has a rotation."""
    import meshcat.geometry as geometry

    node["ball"].set_object(geometry.Sphere(_POINT * size), paint)
    for axis in range(3 * turned):
        sides, place = np.full(3, 0.5 * _POINT * size), np.eye(4)
        sides[axis], place[axis, 3] = _AXIS * size, 0.5 * _AXIS * size
        node[f"axes/{axis}"].set_object(geometry.Box(sides.tolist()), paint)
        node[f"axes/{axis}"].set_transform(place)


def _animate(animation: Any, node: Any, poses: FloatArray, seen: Mapping[Any, NDArray[np.bool_]]) -> None:
    """Place a node at each pose for the frames of that row, shape (n, 4, 4), and show nodes where they are seen, shape (n,)."""
    for number, pose in enumerate(poses):
        for frame in (number * FRAME_RATE, (number + 1) * FRAME_RATE - 1):
            animation.at_frame(node, frame).set_transform(pose)
            for one, visible in seen.items():
                animation.at_frame(one, frame).set_property("visible", "boolean", bool(visible[number]))


def _camera(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where a camera is that sees all points, shape (n, 3) [m], and the point that it looks at."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    along = centre - points[-1]
    azimuth = np.arctan2(along[1], along[0]) - np.deg2rad(65.0)
    away = np.array([0.87 * np.cos(azimuth), 0.87 * np.sin(azimuth), 0.5])
    return centre + 1.85 * float(np.linalg.norm(points - centre, axis=1).max()) * away, centre


def _places(shown: Comparison) -> Iterator[str]:
    """Names of measured positions and poses."""
    return (key for key in shown.residuals if key.startswith(("positions.", "poses.")))


def _poses(values: FloatArray) -> FloatArray:
    """Positions, shape (n, 3), or poses, as poses; what is missing is that of the base."""
    poses = np.tile(np.eye(4), (len(values), 1, 1))
    place = np.s_[:] if values.ndim == 3 else np.s_[:, :3, 3]
    poses[place] = np.where(np.isfinite(values), values, poses[place])
    return poses


def _chosen(distances: FloatArray, most: int) -> NDArray[np.int_]:
    """Rows to show, in order: the worst, and others evenly spread."""
    if len(distances) <= most:
        return np.arange(len(distances))
    worst = np.argsort(-distances, kind="stable")[: min(_WORST, most)]
    others = np.setdiff1d(np.arange(len(distances)), worst)
    spread = others[np.linspace(0, len(others) - 1, most - len(worst)).round().astype(int)]
    return np.sort(np.concatenate([worst, spread]))
