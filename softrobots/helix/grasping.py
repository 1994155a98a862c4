r"""Grasp force of a pressurised helix around a cylinder of larger radius than its natural inner one.

[Blumenschein 2018] measures the force that closes a cylinder cut along its axis, and explains by virtual work why it is
linear in the pressure, `F = P dV/dL` (18); `L` is the gap between the two halves, 3 mm in the paper's test. It gives no volume.

A gap makes the path around both halves longer by `2 L`, like that around a cylinder of the radius `R0 = r + L/pi`, where `r`
is the radius of the halves. This cylinder is the object here; so a helix with the natural inner radius `r` is deflected too, by
`L/pi`.

The two bounds are ours, not the paper's; the force is the smaller one, because the tube yields in the easier way:

(a) *Unwrapping*. The inner line keeps its length and the helix its pitch. Opening by `dL`, which is `dR = dL/pi`, unwinds the
tube a little, and it loses volume:

.. math:: V(R) = \frac{\pi D^2}{4} L_i \sqrt{\frac{(R + D/2)^2 + b^2}{R^2 + b^2}}, \qquad
   L_i = 2\pi N\sqrt{R_0^2 + b^2}, \qquad F_a = -\frac{P}{\pi}\frac{dV}{dR}\Big|_{R_0}

(b) *Contact*. The object of radius `R0` flattens the wall by `delta`, the difference of `R0` and the natural inner radius. The
pressure acts on a strip along the inner line, as wide as the chord at depth `delta` of the circular section:

.. math:: F_b = 2 N P\,w \sqrt{R_0^2 + b^2}, \qquad w = 2\sqrt{\delta(D - \delta)}

Assumptions: the wall is inextensible, wrinkles without resistance and has no stiffness; sections are circles normal to the
centre line (in (b) except for the strip); pressure is constant; the object is a rigid circular cylinder along the axis of the
helix, without friction; the helix touches it along the whole inner line, at its natural pitch; ends have no effect; the force
is the mean over the position of the cut, so that turns need not be whole. Consequences: no force at `delta = 0`, but
some around the paper's cylinder at a deflection of 0 mm, where `delta = L/pi` (the paper measures some, and explains it by
the gap); force linear in the pressure, as measured; force increasing with `delta` up to (a) and constant from there, where the
paper reports only the increase. Its measured forces are not compared.

`L/pi` is a mean: the halves, moved out by `L/2`, press the wall in by `(L/2) cos phi` at the angle `phi` from their middle.
With a strip that is as wide as that makes it at each place, (b) of the paper's test is 8.57 instead of 8.15 N (0 mm, 10 kPa).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import (
    FloatArray,
    common_shape,
    finite_array,
    non_negative_array,
    positive_array,
    read_only,
    refuse_where,
)
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Summarised


class GraspTest(NamedTuple):
    """A grasp test: object and helices."""

    object_radius: float
    """Radius of the object, without the gap [m]."""
    turn_height: float
    """Rise of the helix per turn [m]."""
    turns: float
    """Turns around the object [-]."""
    deflections: tuple[float, ...]
    """Radius of the object minus the natural inner radius, of each helix tested [m]."""
    diameter: float
    """Diameter of the tube [m]."""
    gap: float = 0.0
    """Gap between the halves of the object [m]."""

    def force(self, pressure: Any, deflection: Any = None) -> GraspForce:
        """Return `grasp_force` of this test.

        Args:
            pressure: Gauge pressure [Pa].
            deflection: Radius of the object minus the natural inner radius [m]; by default `deflections`.

        Returns:
            The force and its bounds.

        Raises:
            ParameterError: If a number is out of range.
        """
        dimensions = self._asdict()
        tested = dimensions.pop("deflections")
        return grasp_force(pressure, deflection=tested if deflection is None else deflection, **dimensions)


PAPER_CYLINDER = GraspTest(
    object_radius=0.020, turn_height=0.080, turns=1.5, deflections=(0.0, 0.002, 0.004), diameter=0.0331, gap=0.003
)
"""[Blumenschein 2018] section III-C: a cylinder of 4.0 cm diameter in two halves, 3 mm apart. The text has helix radii up to
4.0 cm, but must mean half of it. It does not state the diameter of the tube; 3.31 cm, that of the shape tests, is our
assumption. The sensor between the halves measures up to 12 N, which the model reaches at 10.7 kPa (2 and 4 mm)."""


@dataclass(frozen=True, eq=False, repr=False)
class GraspForce(Summarised):
    """Result of `grasp_force`, with its arguments: read-only arrays of their common shape."""

    pressure: FloatArray
    """Gauge pressure of the tube [Pa]."""
    object_radius: FloatArray
    """Radius of the cylinder, without the gap [m]."""
    deflection: FloatArray
    """Radius of the cylinder minus the natural inner radius of the helix [m]."""
    turn_height: FloatArray
    """Rise of the helix per turn [m]."""
    turns: FloatArray
    """Turns around the cylinder [-]."""
    diameter: FloatArray
    """Diameter of the tube [m]."""
    gap: FloatArray
    """Gap between the halves of the cylinder [m]."""
    volume: FloatArray
    """Volume of the tube around the object [m^3]."""
    volume_slope: FloatArray
    """Derivative `dV/dL` of the volume with respect to the gap between the halves [m^2]; negative where the tube grips."""
    contact_width: FloatArray
    """Width of the flattened strip [m]."""
    unwrapping: FloatArray
    """Bound (a) [N]; zero on a helix so steep, `b^2 >= R0 (R0 + D/2)`, that opening increases the volume."""
    contact: FloatArray
    """Bound (b) [N]."""
    force: FloatArray
    """Grasp force, the smaller bound [N]: force of one half on the other."""

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            object.__setattr__(self, name, read_only(np.array(getattr(self, name), dtype=np.float64)))


def grasp_force(
    pressure: Any, *, object_radius: Any, deflection: Any, turn_height: Any, turns: Any, diameter: Any, gap: Any = 0.0
) -> GraspForce:
    """Return the force with which a pressurised helix closes a cylinder cut along its axis; see the module for the model.

    Args:
        pressure: Gauge pressure of the tube, zero or positive [Pa].
        object_radius: Radius of the cylinder, without the gap, positive [m].
        deflection: This radius minus the natural inner radius of the helix [m]; with `gap/pi` more from 0 to the smaller of the
            radii of tube and cylinder.
        turn_height: Rise of the helix per turn, `2 pi b`, zero or positive [m]; beyond one turn at least the diameter of the
            tube (the simple rule; `self_contact` is exact).
        turns: Turns around the cylinder, positive [-].
        diameter: Diameter of the tube, positive [m].
        gap: Gap between the halves of the cylinder, zero or positive [m].

    Returns:
        The force, its two bounds and the volume.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    pressures, depths = non_negative_array("pressure", pressure, "Pa"), finite_array("deflection", deflection, None, "m")
    radii, heights = positive_array("object_radius", object_radius, "m"), non_negative_array("turn_height", turn_height, "m")
    counts, diameters = positive_array("turns", turns, "-"), positive_array("diameter", diameter, "m")
    arrays = (pressures, radii, depths, heights, counts, diameters, non_negative_array("gap", gap, "m"))
    shape = common_shape("diameter", *(values.shape for values in arrays))
    given = [np.array(np.broadcast_to(values, shape)) for values in arrays]
    pressures, radii, depths, heights, counts, diameters, gaps = given
    wider = gaps / np.pi
    radii, depths = radii + wider, depths + wider
    deepest = np.minimum(0.5 * diameters, radii)
    room = deepest - (depths - wider)
    wide = (depths > deepest) & (wider > 0.5 * diameters) & (room > 0.0)
    refuse_where("gap", gap, wide, "below pi times the radius of the tube, less the deflection, {:.6g} m", np.pi * room)
    if np.any(depths < 0.0) or np.any(depths > deepest):
        least, less = f"{0.0 - wider.min():.6g}", ", less gap/pi" if wider.any() else ""
        requirement = f"from {least} to {(deepest - wider).min():.6g} m, the radius of the tube or that of the object{less}"
        raise ParameterError("deflection", deflection, requirement)
    if np.any((heights < diameters) & (counts > 1.0)):
        raise ParameterError(
            "turn_height", turn_height, f"at least the diameter of the tube {diameters.max():.6g} m, or the turns collide"
        )
    pitch = heights / (2.0 * np.pi)
    inner, centre = np.hypot(radii, pitch), np.hypot(radii + 0.5 * diameters, pitch)  # path length per turn angle
    area = 0.25 * np.pi * diameters**2
    volume = area * 2.0 * np.pi * counts * centre
    # d(centre/inner)/dR at a fixed inner length
    change = 0.5 * diameters * (pitch / inner * (pitch / centre) - radii / inner * ((radii + 0.5 * diameters) / centre))
    slope = 2.0 * counts * area * (change / inner)
    width = 2.0 * np.sqrt(depths * (diameters - depths))
    unwrapping, contact = pressures * np.maximum(-slope, 0.0), 2.0 * counts * pressures * width * inner
    force = np.minimum(unwrapping, contact)
    fields = [*given, volume, slope, width, unwrapping, contact, force]
    return GraspForce(*fields)
