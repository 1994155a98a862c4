r"""Tube with an actuator that varies along it: contraction `lambda(s)`, angle `theta(s)`; future work of [Blumenschein 2018].

`s` is the position on the axis of the uninflated tube. The frames have z along the centre line and x towards the actuator, like
those of a helix (`frames`). Per length of the uninflated tube they move along z by `v` and rotate by `omega`:

.. math:: v = \frac{|1 + \zeta|}{2\cos\theta}, \qquad
   \omega = \left(0,\; v\,\kappa_c,\; \sigma\,\frac{4\lambda\sin\theta}{D\,|1 + \zeta|}\right), \qquad
   \zeta = \lambda e^{2 i\theta}

which are the formulas of the constant actuator, applied locally (ours). With them the outer line keeps its length, the
actuator contracts to `lambda` and the two lines enclose the angle `2 theta` at each position, exactly, for any `lambda(s)` and
`theta(s)`: the constraints (6), (7) and (11) of the paper. Assumption: sections remain circles normal to the centre line, as
for an actuator that changes little over one diameter of the tube.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice, positive_integer, positive_number, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Summarised
from softrobots.helix.paths import actuator_curvature_torsion
from softrobots.helix.profiles import Profile, checked_profile
from softrobots.helix.shapes import PATHS, turning_sign

_MOST_ROTATION = 1e5  # rad along the tube, about 16000 turns: half a minute of integration
_EVALUATIONS, _EVALUATIONS_PER_RAD = 500_000, 50  # several times what smooth tubes need
_STEP_ERROR = 1e-12  # of a step of the integrator: of lengths relative to the tube's, of rotations in rad
_MOST_SAMPLES = 1_000_000


@dataclass(frozen=True, eq=False, repr=False)
class BentTube(Summarised):
    """Bent tube sampled from base to tip, as returned by `bent_tube`; the arrays are read-only."""

    rest_positions: FloatArray
    """Positions `s` of the samples on the axis of the uninflated tube, shape (n,) [m]."""
    poses: FloatArray
    """Frames on the centre line in that of the base, shape (n, 4, 4) [m]: z along the tube, x towards the actuator."""
    arc_length: FloatArray
    """Length of the centre line from the base, shape (n,) [m]."""
    contraction: FloatArray
    """Contraction `lambda`, shape (n,) [-]; at a jump the value after it."""
    angle: FloatArray
    """Angle `theta`, shape (n,) [rad]; at a jump the value after it."""
    curvature: FloatArray
    """Rotation about y per centre length, `kappa_c`, shape (n,) [1/m]."""
    torsion: FloatArray
    """Rotation about z per centre length, `tau_c`, signed by handedness, shape (n,) [1/m]: the torsion of the centre line where
    that is curved; on a straight piece the rotation of the actuator around the tube."""
    diameter: float
    """Diameter `D` of the tube [m]."""
    length: float
    """Length of the uninflated tube [m]."""
    handedness: str
    """Winding of the actuator: "right" or "left"."""

    def __post_init__(self) -> None:
        for name in ("rest_positions", "poses", "arc_length", "contraction", "angle", "curvature", "torsion"):
            object.__setattr__(self, name, read_only(np.array(getattr(self, name), dtype=np.float64)))

    def points(self, path: str = "centre") -> FloatArray:
        """Return points of one of `PATHS`, shape (n, 3) [m].

        Raises:
            ParameterError: If the path is unknown.
        """
        offset = {"inner": 0.5, "centre": 0.0, "outer": -0.5}[choice("path", path, PATHS)] * self.diameter
        return read_only(self.poses[:, :3, 3] + offset * self.poses[:, :3, 0])


def bent_tube(
    contraction: Any,
    angle: Any,
    diameter: float,
    length: float,
    *,
    handedness: str = "right",
    samples: int = 201,
) -> BentTube:
    """Integrate the shape of a tube with an actuator that varies along it; frames of the module, SciPy's DOP853.

    Contraction and angle are each a number, a function that takes a position [m] and returns a number, or a pair
    (positions, values): linear between them, with a jump where a position occurs twice. The integration restarts at the
    positions of tables. With functions its steps are at most the diameter, or 1/10000 of the tube if that is longer, so that it
    does not miss their changes. The tube starts at the origin along z, with the actuator on the side of x.
    It may be straight (contraction 1, angle 0) or have straight pieces. Self-contact is not checked.

    Args:
        contraction: Contracted over original length of the actuator `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive [m].
        length: Length of the uninflated tube, positive [m].
        handedness: "right" or "left".
        samples: Number of equally spaced samples including both ends, at least 2.

    Returns:
        The sampled tube.

    Raises:
        ParameterError: If an argument is out of range; a function raises or does not return one number in range (the error
            names the position); a table does not extend from 0 to the length; the tube turns by more than 1e5 rad; or the
            integrator does not converge, for a function that is not smooth.
    """
    diameter, length = positive_number("diameter", diameter, "m"), positive_number("length", length, "m")
    sign = turning_sign(handedness)
    contractions, angles = checked_profile("contraction", contraction, length), checked_profile("angle", angle, length)
    if positive_integer("samples", samples, _MOST_SAMPLES) < 2:
        raise ParameterError("samples", samples, "at least 2")
    positions = np.linspace(0.0, length, samples)
    ends = sorted({0.0, *contractions.knots, *angles.knots, length})
    pieces = [_Piece(contractions, angles, start, end, diameter, sign) for start, end in itertools.pairwise(ends)]
    piece_numbers = np.clip(np.searchsorted(ends, positions, side="right") - 1, 0, len(pieces) - 1)
    actuators = np.array([pieces[i].actuator(s) for i, s in zip(piece_numbers.tolist(), positions.tolist(), strict=True)])
    scale, rotation = _scale(pieces, positions, length, diameter)
    budget = _EVALUATIONS + int(_EVALUATIONS_PER_RAD * rotation) + _EVALUATIONS_PER_RAD * len(pieces)
    smooth = contractions.function is None and angles.function is None
    states = _integrate(
        [(piece, positions[piece_numbers == place]) for place, piece in enumerate(pieces)],
        scale=scale,
        longest=math.inf if smooth else max(diameter, 1e-4 * length),
        budget=budget,
    )
    curvature, torsion = actuator_curvature_torsion(actuators[:, 0], actuators[:, 1], diameter, "centre", handedness)
    return BentTube(
        rest_positions=positions,
        poses=_poses(states, scale),
        arc_length=scale * states[:, 7],
        contraction=actuators[:, 0],
        angle=actuators[:, 1],
        curvature=curvature,
        torsion=torsion,
        diameter=diameter,
        length=length,
        handedness=handedness,
    )


class _Piece:
    """The tube between two neighbouring knots of its tables."""

    def __init__(self, contractions: Profile, angles: Profile, start: float, end: float, diameter: float, sign: float) -> None:
        self.start, self.end = start, end
        self._contraction, self._angle = contractions.on_piece(start, end), angles.on_piece(start, end)
        self._diameter, self._sign = diameter, sign

    def actuator(self, position: float) -> tuple[float, float]:
        """Contraction and angle."""
        return self._contraction(position), self._angle(position)

    def rates(self, position: float) -> tuple[float, float, float]:
        """Per length of the uninflated tube: length of the centre line [-], rotation about y and about z [rad/m]."""
        contraction, angle = self.actuator(position)
        cosine = math.cos(angle)
        ratio = math.hypot(1.0 - contraction, 2.0 * math.sqrt(contraction) * cosine)  # |1 + zeta|
        scale = self._diameter * ratio
        bending = (1.0 - contraction) * (1.0 + contraction) / (scale * cosine)
        return ratio / (2.0 * cosine), bending, self._sign * 4.0 * contraction * math.sin(angle) / scale

    def change(self, position: float, state: FloatArray, scale: float) -> list[float]:
        """Derivative of the state: quaternion (w, x, y, z), position and centre length by `scale`."""
        w, x, y, z = state[:4].tolist()
        along, bending, twist = self.rates(min(max(float(position), self.start), self.end))
        share = along / scale
        step = share / (w * w + x * x + y * y + z * z)
        return [
            -0.5 * (y * bending + z * twist),
            0.5 * (y * twist - z * bending),
            0.5 * (w * bending - x * twist),
            0.5 * (w * twist + x * bending),
            2.0 * step * (x * z + w * y),
            2.0 * step * (y * z - w * x),
            step * (w * w - x * x - y * y + z * z),
            share,
        ]


def _scale(pieces: list[_Piece], positions: FloatArray, length: float, diameter: float) -> tuple[float, float]:
    """Estimate length [m] and rotation [rad] of the bent tube; raise ParameterError if it turns too much to be integrated."""
    total, rotation = 0.0, 0.0
    for piece in pieces:
        inside = positions[(positions > piece.start) & (positions < piece.end)].tolist()
        places = [piece.start, *inside, piece.end]
        samples = [(place, *piece.rates(place)) for place in places]
        for (start, *before), (end, *after) in itertools.pairwise(samples):
            total += 0.5 * (end - start) * (before[0] + after[0])
            rotation += 0.5 * (end - start) * (math.hypot(*before[1:]) + math.hypot(*after[1:]))
    if rotation > _MOST_ROTATION:
        raise ParameterError(
            "length",
            length,
            f"such that a tube {diameter!r} m thick turns by at most {_MOST_ROTATION:g} rad, not {rotation:.3g}",
        )
    return max(total, length), rotation


def _integrate(parts: list[tuple[_Piece, FloatArray]], *, scale: float, longest: float, budget: int) -> FloatArray:
    """States at the samples in each piece, shape (n, 8)."""
    from scipy.integrate import solve_ivp  # here, because importing it takes longer than all of this package

    evaluations = 0

    def stuck(place: float, why: str) -> ParameterError:
        return ParameterError("contraction and angle", place, f"smooth functions (stuck at this position [m]: {why})")

    state = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    states = [np.zeros((0, 8))]
    for piece, samples in parts:

        def counted(position: float, now: FloatArray, piece: _Piece = piece) -> list[float]:
            nonlocal evaluations
            evaluations += 1
            if evaluations > budget:
                raise stuck(float(position), f"more than {budget} evaluations")
            return piece.change(position, now, scale)

        times = samples if len(samples) and samples[-1] == piece.end else np.append(samples, piece.end)
        span = (piece.start, piece.end)
        solution = solve_ivp(counted, span, state, "DOP853", times, max_step=longest, rtol=_STEP_ERROR, atol=_STEP_ERROR)
        if not solution.success:
            raise stuck(piece.start, str(solution.message))
        states.append(solution.y.T[: len(samples)])
        state = solution.y[:, -1]
        state[:4] /= np.linalg.norm(state[:4])
    return np.vstack(states)


def _poses(states: FloatArray, scale: float) -> FloatArray:
    """Frames from states, shape (n, 4, 4)."""
    from scipy.spatial.transform import Rotation

    poses = np.zeros((len(states), 4, 4))
    poses[:, :3, :3] = Rotation.from_quat(np.roll(states[:, :4], -1, axis=1)).as_matrix()  # the real part last
    poses[:, :3, 3] = scale * states[:, 4:7]
    poses[:, 3, 3] = 1.0
    return poses
