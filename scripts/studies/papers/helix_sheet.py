"""Helices as shaded tubes on a sheet: rows and columns of one scale, seen from the front and a little above.

Needs matplotlib (extra `plot`). The tubes are projected and shaded here, because matplotlib's 3D axes would scale each helix
differently.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots import helix
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.view.body import tube
from softrobots.view.figures.canvas import new_figure

_SIDES = 24
WALL, WALL_IN_CONTACT = (0.86, 0.87, 0.89), (0.94, 0.72, 0.28)
"""Red, green, blue of the wall of a tube, and of one that runs into itself."""
ACTUATOR, OPPOSITE = (0.0, 0.33, 0.60), (0.88, 0.42, 0.16)
"""Red, green, blue of the actuator, and of the line opposite."""

_MOST_RINGS = 4000
_COARSEST = 0.3  # turn from ring to ring: a side of the tube [rad]
_ELEVATION = math.radians(25.0)
_TO_LIGHT = np.array([-0.40, -0.62, 0.68])
_PAGE = (9.0, 8.4)  # inches that rows and columns of helices share
_CAPTION = (1.5, 0.95)  # width and height of a caption, inches
_NARROWEST = 8.2  # width of title and key, inches


@dataclass(frozen=True, eq=False)
class DrawnTube:
    """One tube, projected and shaded."""

    faces: FloatArray
    """Corners on the screen of the visible triangles, far ones first, shape (n, 3, 2) [m]."""
    colours: FloatArray
    """Their colours, shape (n, 3)."""
    caption: str
    """The caption below."""
    touches: bool
    """Whether the tube runs into itself."""

    @property
    def low(self) -> FloatArray:
        """Lower left corner [m]."""
        return np.asarray(self.faces.min((0, 1)))

    @property
    def size(self) -> FloatArray:
        """Width and height [m]."""
        return np.asarray(np.ptp(self.faces, axis=(0, 1)))


def draw(share: float, tilt: float, diameter: float, length: float, handedness: str) -> DrawnTube:
    """Project a tube and shade it.

    Args:
        share: Contraction `lambda` of its actuator, in (0, 1] [-].
        tilt: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter of the tube [m].
        length: Length of the uninflated tube [m].
        handedness: "right" or "left".

    Returns:
        The visible triangles, and the caption.

    Raises:
        ParameterError: If an argument is out of range, or the tube has more windings than can be drawn.
        StraightTube: At contraction 1 and angle 0, where no helix exists.
    """
    shape = helix.forward(share, tilt, diameter)
    turns = float(helix.turns(shape, tilt, length))
    touches = bool(helix.self_contact(shape, turns).touches)
    bend, twist = helix.curvature_torsion(shape)
    centre = float(helix.centre_length(share, tilt, length))
    turning = centre * math.hypot(float(bend), float(twist))
    if turning > _MOST_RINGS * _COARSEST:
        most = _MOST_RINGS * _COARSEST / turning * length
        raise ParameterError(
            "length", length, f"at most {most:.3g} m at an angle of {tilt:.4g} rad: more windings cannot be drawn"
        )
    rings = min(_MOST_RINGS, 2 + math.ceil(max(centre / (0.15 * diameter), turning / 0.12)))
    # The middle of the tube is in front.
    poses = helix.frames(shape, np.linspace(-np.pi * turns, np.pi * turns, rings), "centre", handedness)
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotations, centres = quarter @ poses[:, :3, :3], poses[:, :3, 3] @ quarter.T
    corners, triangles = tube(rotations, centres, 0.5 * diameter, _SIDES)
    sides = triangles % _SIDES
    wall = np.all(triangles < rings * _SIDES, axis=1)
    colours = np.tile(WALL_IN_CONTACT if touches else WALL, (len(triangles), 1))
    colours[wall & np.any(sides == 0, axis=1)] = ACTUATOR
    colours[wall & np.any(sides == _SIDES // 2, axis=1)] = OPPOSITE
    at = corners[triangles]
    normals = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    sine, cosine = math.sin(_ELEVATION), math.cos(_ELEVATION)
    seen = normals @ np.array([0.0, -cosine, sine]) > 0.0
    light = np.clip(normals @ (_TO_LIGHT / np.linalg.norm(_TO_LIGHT)), 0.0, 1.0)
    colours = colours * (0.42 + 0.58 * light)[:, None]
    far = at.mean(1) @ np.array([0.0, cosine, -sine])
    order = np.argsort(-far[seen])
    flat = np.stack([at[..., 0], at[..., 1] * sine + at[..., 2] * cosine], axis=-1)
    caption = f"$R_o$ = {100 * float(shape.outer_radius):.3g} cm\n$b$ = {100 * float(shape.pitch):.3g} cm/rad\n"
    caption += f"{turns:.2f} turns" + ("\nin contact" if touches else "")
    return DrawnTube(flat[seen][order], colours[seen][order], caption, touches)


def sheet(drawn: list[list[DrawnTube]], shares: FloatArray, tilts: FloatArray, title: str) -> Any:
    """Put tubes into rows and columns on a figure that fits them, with their names and a bar of the scale.

    Args:
        drawn: Rows of tubes, all of one length.
        shares: Contraction of each column, shape (n,) [-].
        tilts: Angle of each row, shape (m,) [rad].
        title: Title of the sheet.

    Returns:
        The figure.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    widths = np.array([[one.size[0] for one in row] for row in drawn]).max(0)
    heights = np.array([[one.size[1] for one in row] for row in drawn]).max(1)
    # In inches: columns are as wide as tube or caption, rows have room for the caption. Many of them make a larger sheet.
    room = (
        max(_PAGE[0] - 0.4 * len(widths), 0.6 * len(widths)),
        max(_PAGE[1] - _CAPTION[1] * len(heights), 0.8 * len(heights)),
    )
    scale = float(min(room[0] / np.sum(widths), room[1] / np.sum(heights)))
    across, up = np.maximum(scale * widths + 0.4, _CAPTION[0]), scale * heights + _CAPTION[1]
    margin = max(0.0, 0.5 * (_NARROWEST - 0.9 - float(np.sum(across))))
    size = (0.9 + 2.0 * margin + float(np.sum(across)), 1.6 + float(np.sum(up)))
    small = min(12.0, 1.265 * size[0])  # seven pixels on a picture 400 pixels wide, and not wider than the column of a caption
    figure = new_figure(size)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, size[0]), ylim=(0.0, size[1]))
    axes.set_axis_off()
    middles = 0.8 + margin + np.cumsum(across) - 0.5 * across
    for middle, share in zip(middles, shares, strict=True):
        axes.text(middle, size[1] - 0.75, rf"$\lambda$ = {share:.4g}", ha="center", va="center", fontsize=max(11.0, small))
    top = size[1] - 1.0
    for row, tilt, height in zip(drawn, tilts, up, strict=True):
        at = top - 0.5 * (height - _CAPTION[1])
        axes.text(0.15 + margin, at, rf"$\theta$ = {np.degrees(tilt):.4g}°", ha="left", va="center", fontsize=max(11.0, small))
        for one, middle in zip(row, middles, strict=True):
            _paint(axes, one, scale, np.array([middle, at]))
            axes.text(middle, top - height + _CAPTION[1] - 0.1, one.caption, ha="center", va="top", fontsize=small)
        top -= height
    axes.text(0.5 * size[0], size[1] - 0.3, title, ha="center", va="center", fontsize=13)
    _key(axes, scale, small, any(one.touches for row in drawn for one in row))
    return figure


def _paint(axes: Any, one: DrawnTube, scale: float, middle: FloatArray) -> None:
    """Draw a helix with its middle at a place [inches]."""
    from matplotlib.collections import PolyCollection

    faces = scale * (one.faces - one.low - 0.5 * one.size) + middle
    style: dict[str, Any] = {"facecolors": one.colours, "edgecolors": one.colours, "linewidths": 0.3, "rasterized": True}
    axes.add_collection(PolyCollection(list(faces), **style))


def _key(axes: Any, scale: float, small: float, contact: bool) -> None:
    """Bar of the scale and what the colours are, at the lower edge."""
    from matplotlib.patches import Patch

    bar = 10.0 ** math.floor(math.log10(1.8 / scale))
    bar *= next(number for number in (5, 2, 1) if number * bar * scale <= 1.8)
    axes.plot([0.4, 0.4 + scale * bar], [0.38, 0.38], color="black", lw=3.0, solid_capstyle="butt")
    axes.text(0.4 + 0.5 * scale * bar, 0.32, f"{100 * bar:.3g} cm", ha="center", va="top", fontsize=small)
    colours = {"actuator, contracts": ACTUATOR, "line opposite, keeps its length": OPPOSITE}
    if contact:
        colours["in contact: the tube runs into itself"] = WALL_IN_CONTACT
    patches = [Patch(color=colour, label=text) for text, colour in colours.items()]
    axes.legend(handles=patches, loc="lower right", ncols=2, fontsize=small, frameon=False)
