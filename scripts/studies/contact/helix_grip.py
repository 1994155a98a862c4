"""The instrumented cylinder of [Blumenschein 2018], two halves with a gap between them, in the grip of a helical tube.

The tube is a chain of constant-strain sections with a real, elastic actuator: pressure acts on its cross-section, the wall
resists stretch along two lines, bending and twist. Half a turn at the base leads to the cylinder, which the others are around.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import softrobots as sr
from softrobots.environment.gaps import Surroundings
from softrobots.statics.kinematics import frame_placement

CYLINDER = sr.helix.PAPER_CYLINDER
LEAD = 0.5  # turns before the cylinder
LENGTH = 0.6  # of the halves: beyond the tip of the tube [m]
TIGHTENING = np.linspace(1.2, 1.0, 9)
"""Length of the actuator over its own while it closes around the cylinder."""
GAPS = (0.001, 0.002, 0.003)  # the last one is the paper's [m]


@dataclass(frozen=True, eq=False)
class HelixGrip:
    """A tube whose free shape is a given helix, and where that stands."""

    tube: sr.HelixTube
    free: sr.Equilibrium
    """Without obstacles: a uniform helix."""
    centre: Any
    """A point of its axis [m]."""
    axis: Any
    """Direction of the axis, towards the tip."""
    inward: Any
    """Direction from the base to the axis."""
    inner_radius: float
    """Radius of the cylinder around the axis that its capsules touch [m]."""
    turn_height: float
    """Rise per turn [m]."""

    @classmethod
    def of(cls, tube: sr.HelixTube) -> HelixGrip:
        """Solve the free tube."""
        model = sr.load_model(tube)
        free = sr.solve_equilibrium(model, tube.q_motors)
        start, (kx, ky, twist, stretch) = frame_placement(model, free.q, "segment_1_start"), free.strains[0]
        turning = np.array([kx, ky, twist])
        axis = start.rotation @ turning / np.linalg.norm(turning)
        centre = start.act(np.cross(turning, [0.0, 0.0, stretch]) / (turning @ turning))
        inward = centre - start.translation
        rod = sr.Cylinder(radius=1e-3, length=10.0, position=centre, rotation=frame_along(axis))
        gaps = np.sort(Surroundings(model, sr.Environment([rod])).at(free.q, 0.1).values)
        inner = 1e-3 + float(np.median(gaps[: len(gaps) // 3]))  # the middles of the capsules, which are nearest
        height = 2.0 * math.pi * stretch * twist / (turning @ turning)
        return cls(tube, free, centre, axis, inward / np.linalg.norm(inward), inner, float(height))

    def halves(self, gap: float, azimuth: float) -> sr.Environment:
        """The halves of the cylinder around the axis, a gap [m] apart in the direction of an angle about the axis [rad]."""
        way = self.opening(azimuth)
        middle = self.centre + (LEAD * self.turn_height + 0.5 * LENGTH) * self.axis
        shape: dict[str, Any] = {"radius": CYLINDER.object_radius, "length": LENGTH, "rotation": frame_along(self.axis)}
        sides = {"left": -0.5 * gap, "right": 0.5 * gap}
        return sr.Environment([sr.Cylinder(position=middle + by * way, name=name, **shape) for name, by in sides.items()])

    def opening(self, azimuth: float) -> Any:
        """Direction in which the halves move apart."""
        return math.cos(azimuth) * np.cross(self.axis, self.inward) + math.sin(azimuth) * self.inward

    def around(self, gaps: Any, azimuth: float) -> list[sr.Equilibrium]:
        """Equilibria around the halves, ending before a gap at which there is none or the tube lets go.

        The actuator, longer at first so that the free tube is wider than the cylinder, tightens at the first gap; then the
        halves move apart, gap by gap. The tube has let go if it presses with less than half of its force before.
        """
        last, found, most = self.free, list[sr.Equilibrium](), 0.0
        lengths = np.tile(self.tube.q_motors, (len(TIGHTENING), 1))
        lengths[:, 0] *= TIGHTENING
        steps = [(gaps[0], motors) for motors in lengths] + [(gap, self.tube.q_motors) for gap in gaps]
        for number, (gap, motors) in enumerate(steps):
            halves = self.halves(gap, azimuth) if number else None  # free, and wide, at first
            try:
                last = sr.solve_equilibrium(last.model, motors, q_springs0=last.q_springs, environment=halves)
            except sr.EquilibriumNotFound:
                break
            if number >= len(lengths):
                force = sum(self.force(last, azimuth))
                if force < 0.5 * most:
                    break
                found, most = [*found, last], max(force, most)
        return found

    def force(self, equilibrium: sr.Equilibrium, azimuth: float) -> tuple[float, float]:
        """Force with which the tube presses each half towards the other [N]; they differ by what the base holds."""
        way, parts = self.opening(azimuth), []
        for name, sign in (("left", 1.0), ("right", -1.0)):
            touching = [contact for contact in equilibrium.contacts if contact.obstacle == name]
            parts.append(sign * float(sr.contact_wrench(touching)[:3] @ way))
        return parts[0], parts[1]


def fitted_grip(deflection: float, *, sections: int, **wall: Any) -> HelixGrip:
    """The tube whose free helix has the paper's rise per turn and an inner radius smaller than the cylinder by a deflection.

    Contraction and angle of its actuator are those of the closed form at first, then corrected for the stiffness of the wall,
    by Newton with differences.

    Args:
        deflection: Radius of the cylinder minus the inner radius [m].
        sections: Sections of the chain.
        wall: Other fields of the tube.
    """
    inner, height = CYLINDER.object_radius - deflection, CYLINDER.turn_height
    pitch = height / (2.0 * math.pi)
    contraction, angle, _ = sr.helix.inverse(sr.helix.HelixShape(*np.array([inner + CYLINDER.diameter, inner, pitch])))
    turns = CYLINDER.turns + LEAD
    actuator = np.array([float(contraction), float(angle)])

    def made(given: Any) -> HelixGrip:
        length = 2.0 * math.pi * turns * math.hypot(inner, pitch) / given[0] * math.cos(given[1])
        shape = {"length": length, "contraction": float(given[0]), "angle": float(given[1]), "diameter": CYLINDER.diameter}
        return HelixGrip.of(sr.HelixTube(actuator="elastic", elastic_sections=sections, **shape, **wall))

    def missing(grip: HelixGrip) -> Any:
        return np.array([grip.inner_radius - inner, grip.turn_height - height])

    grip = made(actuator)
    for _ in range(20):
        if np.abs(missing(grip)).max() < 1e-9:
            return grip
        slopes = [(missing(made(actuator + step)) - missing(grip)) / step.sum() for step in 1e-5 * np.eye(2)]
        actuator = actuator - np.clip(np.linalg.solve(np.transpose(slopes), missing(grip)), -0.03, 0.03)
        grip = made(actuator)
    raise sr.TargetUnreachable("no actuator gives this helix", best=grip, residual=np.abs(missing(grip)).max(), iterations=20)


def frame_along(axis: Any) -> Any:
    """A rotation whose z axis is a unit vector, shape (3, 3)."""
    across = np.linalg.svd(np.reshape(axis, (1, 3)))[2][1]
    return np.column_stack([across, np.cross(axis, across), axis])
