"""One inflated link: beam theory and pseudo-rigid links against the geometrically exact beam."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots import inflated_beam
from softrobots.inflated_beam import MEAN_STIFFNESS, TABLE_3

TUBE = {"length": 0.6, "radius": 0.055, "wall_thickness": 0.0005}
"""The prototype link [m]."""
LENGTH, HINGE = TUBE["length"], 0.03
"""Length of a link and the paper's distance of its hinge from the clamp [m]."""
SHOWN = 50e3
"""Pressure of the arm and of the curves over the load [Pa]."""
TWISTING = "two hinges that twist"
"""The only lumped link that twists."""
LIMITS = (1.0, 5.0)
"""Differences whose lines are drawn [%]."""


class Hinges(NamedTuple):
    """How a link is lumped: its hinges, all alike."""

    places: tuple[float, ...]
    """Distances from the clamp [m]."""
    stiffness: float
    """Of each spring [N m/rad]."""
    twist: float | None = None
    """Of the spring that twists the link [N m/rad]."""
    pressure: float = SHOWN
    """Of the link [Pa]; two hinges stand where it has them."""

    def robot(self, links: int) -> sr.InflatableArm:
        """An arm of such links."""
        lengths = (LENGTH,) * links
        if len(self.places) == 1:
            (place,) = self.places
            return sr.InflatableArm(link_lengths=lengths, hinge_offset=place, stiffness=self.stiffness, pressure=self.pressure)
        return sr.InflatableArm(
            link_lengths=lengths,
            link_model="two_hinges",
            torsion=self.twist is not None,
            stiffness=self.stiffness,
            pressure=self.pressure,
        )


def modulus() -> float:
    """Modulus of the wall: the mean over the six pressures of Table 3 of what the mean stiffness implies by (1) [Pa]."""
    found = [inflated_beam.young_modulus_from_stiffness(MEAN_STIFFNESS, pressure=row.pressure, **TUBE) for row in TABLE_3]
    return float(np.mean(found))


def lumped(rod: Any, pressure: float = SHOWN) -> dict[str, Hinges]:
    """Ways to lump a beam that bends with B and shears with A; under a small tip force F it deflects v F and turns t F.

    - as in the paper: hinge at l1, mean stiffness;
    - its hinge, k by (1): `l2^2 / v`, so that the deflection is right;
    - one hinge: at `L - v / t`, `k = v / t^2`, so that deflection and rotation under a force are right;
    - two hinges: at `L/2 -+ sqrt(L^2/12 + B/A)`, `k = 2 B / L` each, so that both are right under a force and a moment;
    - two hinges that twist, with `C / L`, if the beam twists.
    """
    deflection, rotation = LENGTH**3 / (3.0 * rod.bending) + LENGTH / rod.shear, LENGTH**2 / (2.0 * rod.bending)
    lever, apart = deflection / rotation, math.sqrt(LENGTH**2 / 12.0 + rod.bending / rod.shear)
    two = Hinges((LENGTH / 2.0 - apart, LENGTH / 2.0 + apart), 2.0 * rod.bending / LENGTH, pressure=pressure)
    twisting = {} if rod.twisting is None else {TWISTING: two._replace(twist=rod.twisting / LENGTH)}
    return {
        "as in the paper": Hinges((HINGE,), MEAN_STIFFNESS),
        "its hinge, k by (1)": Hinges((HINGE,), (LENGTH - HINGE) ** 2 / deflection),
        "one hinge by (1)": Hinges((LENGTH - lever,), lever / rotation),
        "two hinges by (1)": two,
        **twisting,
    }


def exact_link(rods: ModuleType, rod: Any, loads: Sequence[float]) -> np.ndarray:
    """Deflection [m] and rotation [rad] of the tip by the boundary-value solve, shape (loads, 2)."""
    found = [rods.solve_inflated_chain([rod], [(1, 0, 0, 0)], (0.0, load, 0.0), tol=1e-7) for load in loads]
    return np.array([(one.position[1], math.atan2(one.rotation[1, 0], one.rotation[0, 0])) for one in found])


def linear_link(rod: Any, pressure: float, loads: Sequence[float]) -> np.ndarray:
    """The same by (1), with the rotation of the section, F L^2 / 2 B."""
    at = {"pressure": pressure, "young_modulus": modulus(), **TUBE}
    return np.array([(float(inflated_beam.deflection(LENGTH, f, **at)), f * LENGTH**2 / (2.0 * rod.bending)) for f in loads])


def lumped_link(hinges: Hinges, loads: Sequence[float]) -> np.ndarray:
    """The same of a pseudo-rigid link."""
    model = sr.load_model(hinges.robot(1))
    poses = [sr.solve_equilibrium(model, np.zeros(2), (0.0, load, 0.0)).transform_tip_to_world for load in loads]
    return np.array([(one.translation[1], math.atan2(one.rotation[1, 0], one.rotation[0, 0])) for one in poses])


def link_at(rods: ModuleType, pressure: float, loads: Sequence[float]) -> dict[str, Any]:
    """Compare the models of one link at a pressure: differences from the exact beam [%] over the load."""
    rod = rods.InflatedRod.tube(pressure=pressure, young_modulus=modulus(), **TUBE).planar()
    exact = exact_link(rods, rod, loads)
    found = {"(1)": linear_link(rod, pressure, loads)}
    found |= {name: lumped_link(hinges, loads) for name, hinges in lumped(rod, pressure).items()}
    moment = inflated_beam.wrinkling_moment(pressure, TUBE["radius"])
    return {
        "pressure_Pa": float(pressure),
        "wrinkling_moment_Nm": moment,
        "wrinkles_at_N": moment / (LENGTH - HINGE),
        "stiffness_by_1_Nm": inflated_beam.stiffness_from_young_modulus(modulus(), pressure=pressure, **TUBE),
        "deflection_m": exact[:, 0].tolist(),
        "rotation_rad": exact[:, 1].tolist(),
        "percent": {name: (100.0 * (poses / exact - 1.0)).T.tolist() for name, poses in found.items()},
    }


def reached(loads: Sequence[float], percent: Sequence[float], limit: float) -> float | None:
    """Load at which a difference first exceeds a limit [N]; 0 if it does so from the start, None if it does not."""
    force, size = np.asarray(loads, dtype=float), np.abs(percent)
    above = np.flatnonzero(size > limit)
    if not above.size:
        return None
    i = int(above[0])
    if i == 0:
        return 0.0
    return float(force[i - 1] + (force[i] - force[i - 1]) * (limit - size[i - 1]) / (size[i] - size[i - 1]))


def study_link(rods: ModuleType, pressures: Sequence[float], loads: Sequence[float]) -> dict[str, Any]:
    """Compare the models of one link over pressure and load."""
    rows = [link_at(rods, pressure, loads) for pressure in tqdm(pressures, "one link", unit="pressure")]
    for row in rows:
        row["leaves_at_N"] = {
            name: [[reached(loads, values, limit) for limit in LIMITS] for values in both]
            for name, both in row["percent"].items()
        }
    return {"modulus_Pa": modulus(), "loads_N": [float(load) for load in loads], "rows": rows}
