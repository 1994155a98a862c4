"""Maps of reach, payload and required pressure of a loaded arm over a grid of targets and loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import (
    FloatArray,
    finite_array,
    finite_number,
    increasing,
    positive_integer,
    positive_number,
    read_only,
    unit_vector,
)
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Summarised
from softrobots.inflated_beam import required_pressure
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import elastic_state, largest_residual
from softrobots.statics.equilibrium import equilibrium_from_state
from softrobots.statics.loads import Load

CLOSE = 1e-3
"""Missing pressure that is neglected [Pa]."""

BoolArray = NDArray[np.bool_]

_ARRAYS = ("direction", "loads", "reached", "required_pressure", "payload", "q_motors", "q_springs")
_CHECKED = 100  # cases of a map from a file that are recomputed


@dataclass(frozen=True, eq=False)
class TargetGrid:
    """Target positions at all combinations of three coordinates, the last one fastest.

    Raises:
        ParameterError: If a list of coordinates is empty, not finite, or does not increase.
    """

    x: FloatArray
    """First coordinates, shape (nx,) [m]; in a plane the distance from the axis of motor 1."""
    y: FloatArray
    """Second coordinates, shape (ny,) [m]; in a plane only 0."""
    z: FloatArray
    """Heights, shape (nz,) [m]."""

    def __post_init__(self) -> None:
        """Check the coordinates and keep read-only copies."""
        for name in ("x", "y", "z"):
            values = increasing(name, finite_array(name, getattr(self, name), (None,), "m"), "m")
            positive_integer(f"number of coordinates {name}", len(values), 100_000)
            object.__setattr__(self, name, read_only(values))

    @classmethod
    def plane(cls, reach: Any, cells: Any) -> TargetGrid:
        """Centres of square cells in the half plane y = 0, x > 0: radius by height.

        An arm whose motor 1 turns about the vertical reaches the same in every such half plane under vertical loads.

        Args:
            reach: Radius of the plane, and half its height [m].
            cells: Number of cells along the radius; there are twice as many along the height.

        Returns:
            The grid.

        Raises:
            ParameterError: If an argument is not positive.
        """
        across = _centres(positive_number("reach", reach, "m"), positive_integer("cells", cells, 10_000))
        return cls(across[len(across) // 2 :], np.zeros(1), across)

    @classmethod
    def box(cls, reach: Any, cells: Any) -> TargetGrid:
        """Centres of cubic cells in a box around the base.

        Args:
            reach: Half the width of the box [m].
            cells: Number of cells along half the width.

        Returns:
            The grid.

        Raises:
            ParameterError: If an argument is not positive.
        """
        across = _centres(positive_number("reach", reach, "m"), positive_integer("cells", cells, 500))
        return cls(across, across, across)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of coordinates along each axis."""
        return len(self.x), len(self.y), len(self.z)

    @property
    def targets(self) -> FloatArray:
        """All target positions, shape (nx * ny * nz, 3) [m]."""
        return np.stack(np.meshgrid(self.x, self.y, self.z, indexing="ij"), axis=-1).reshape(-1, 3)


def _centres(reach: float, cells: int) -> FloatArray:
    """Centres of `2 * cells` cells between `-reach` and `reach`; none is zero, and they are exactly symmetric."""
    half = (np.arange(cells) + 0.5) * (reach / cells)
    return np.concatenate([-half[::-1], half])


@dataclass(frozen=True, eq=False, repr=False)
class WorkspaceMap(Summarised):
    """Reach, payload and required pressure of an arm; can be saved with `softrobots.save_result`.

    The first three axes of every array are those of the grid, `grid.shape`.
    """

    model: SoftModel
    """The arm."""
    grid: TargetGrid
    """Target positions of the tip."""
    direction: FloatArray
    """Unit vector of the load, world axes, shape (3,)."""
    loads: FloatArray
    """Sizes of the load, increasing, shape (n_loads,) [N]."""
    gravity: tuple[float, float, float] | None
    """Gravity on the arm itself, world axes [m/s^2]; None: weightless."""
    tolerance: float
    """Largest distance of the tip from a target that counts as reached [m]."""
    reached: BoolArray
    """Whether the loaded tip reaches the target, stable and within the limits of motors and springs, shape (..., n_loads)."""
    required_pressure: FloatArray
    """Smallest gauge pressure at which no link wrinkles, in the best posture found, shape (..., n_loads) [Pa].

    [Troise 2021] (3), axial forces neglected. Infinite where the target is not reached.
    """
    payload: FloatArray
    """Largest load up to which the target is reached and no link wrinkles at its own pressure, shape (...) [N].

    In one posture, up to whole turns of a motor. At most the last of `loads`; 0 where not even the first one is carried.
    """
    q_motors: FloatArray
    """Motor angles of the posture that needs the least pressure, shape (..., n_loads, 3) [rad]; 0 where not reached."""
    q_springs: FloatArray
    """Springs in equilibrium there, shape (..., n_loads, n_springs) [rad]; 0 where not reached."""

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name in _ARRAYS:
            getattr(self, name).setflags(write=False)

    @property
    def wrinkled(self) -> BoolArray:
        """Whether the target is reached with a link that needs more than its own pressure, shape (..., n_loads).

        Axial forces are neglected, unlike in `Equilibrium.wrinkled`. In the stored posture, which needs the least pressure.
        Where links differ in pressure, another posture may still carry the load: `payload` includes that one.
        """
        own = np.array([group.pressure for group in self.model.spring_groups])
        springs = self.q_springs.reshape(-1, self.model.n_springs)
        lacking = (required_pressures(self.model, springs) > own + CLOSE).any(axis=1)
        return np.asarray(self.reached & lacking.reshape(self.reached.shape))


def required_pressures(model: SoftModel, q_springs: FloatArray) -> FloatArray:
    """Gauge pressure at which each link just wrinkles, from its `SpringGroup.moments`: [Troise 2021] (3).

    Axial forces are neglected (`LinkLimits.required_pressures` has them). Springs at coordinates of shape (n, n_springs) [rad]
    give pressures of shape (n, n_links) [Pa].
    """
    torques = model.springs.torques(q_springs)
    moments = [group.moments(torques).max(axis=-1) for group in model.spring_groups]
    return np.asarray(required_pressure(np.stack(moments, axis=1), [group.radius for group in model.spring_groups]))


def packed(result: WorkspaceMap) -> dict[str, Any]:
    """Return the arrays of a map by name, without its robot, for `unpacked`."""
    grid = {f"grid_{axis}": getattr(result.grid, axis) for axis in "xyz"}
    return grid | {name: getattr(result, name) for name in _ARRAYS} | {"tolerance": result.tolerance}


def unpacked(model: SoftModel, gravity: tuple[float, float, float] | None, fields: Mapping[str, Any]) -> WorkspaceMap:
    """Check the arrays of a map, by name as `packed` gives them, and return the map.

    Raises:
        ParameterError: If shapes do not fit, or one of a hundred cases, computed again, differs.
    """
    grid = TargetGrid(*(fields[f"grid_{axis}"] for axis in "xyz"))
    direction, loads = unit_vector("direction", fields["direction"]), finite_array("loads", fields["loads"], (None,), "N")
    cases = (*grid.shape, len(increasing("loads", loads, "N")))
    reached = np.asarray(fields["reached"])
    if reached.shape != cases or reached.dtype != np.bool_:
        raise ParameterError("reached", reached, f"truth values of shape {cases}")
    required = np.array(fields["required_pressure"])
    if required.dtype.kind not in "fiu" or required.shape != cases:
        raise ParameterError("required_pressure", required, f"numbers of shape {cases} [Pa]")
    if not np.array_equal(required < np.inf, reached) or (required < 0.0).any():
        raise ParameterError("required_pressure", required, "zero or above, infinite where not reached [Pa]")
    payload = finite_array("payload", fields["payload"], grid.shape, "N")
    if payload.min() < 0.0 or payload.max() > loads[-1]:
        raise ParameterError("payload", payload, f"between 0 and {loads[-1]} N")
    if ((loads <= payload[..., None]) & ~reached)[payload > 0.0].any():
        raise ParameterError("payload", payload, "0, or such that the target is reached at every load up to it")
    result = WorkspaceMap(
        model=model,
        grid=grid,
        direction=direction,
        loads=loads,
        gravity=gravity,
        tolerance=positive_number("tolerance", finite_number("tolerance", fields["tolerance"]), "m"),
        reached=reached,
        required_pressure=required.astype(np.float64),
        payload=payload,
        q_motors=finite_array("q_motors", fields["q_motors"], (*cases, model.n_motors), "rad"),
        q_springs=finite_array("q_springs", fields["q_springs"], (*cases, model.n_springs), "rad"),
    )
    places = np.argwhere(reached)
    for number in np.unique(np.linspace(0, len(places) - 1, min(len(places), _CHECKED)).astype(int)):
        _check_case(result, tuple(places[number].tolist()))
    return result


def _check_case(result: WorkspaceMap, place: tuple[int, ...]) -> None:
    """Recompute a reached case on Pinocchio.

    Raises:
        ParameterError: If it is not in balance, its tip is elsewhere, or it needs another pressure.
    """
    model, (x, y, z, level) = result.model, place
    load = Load.of(model, result.direction * result.loads[level], gravity=result.gravity)
    state = elastic_state(model, result.q_motors[place], result.q_springs[place], load)
    if state.error > largest_residual(model, state.scale, 1e-9):
        raise ParameterError("q_springs", result.q_springs[place], f"in balance; case {place} is not")
    equilibrium = equilibrium_from_state(model, result.q_motors[place], load, state, method="newton", iterations=0)
    off = np.linalg.norm(equilibrium.tip_position - (result.grid.x[x], result.grid.y[y], result.grid.z[z]))
    if off > result.tolerance + 1e-12 * model.reach:
        raise ParameterError(
            "q_motors", result.q_motors[place], f"such that the tip is at the target; in case {place} it is {off:.3g} m away"
        )
    needed = max(map(required_pressure, equilibrium.link_moments.tolist(), (group.radius for group in model.spring_groups)))
    if abs(needed - result.required_pressure[place]) > 1e-9 * needed + 1e-6:
        raise ParameterError("required_pressure", result.required_pressure[place], f"{needed} Pa in case {place}")
