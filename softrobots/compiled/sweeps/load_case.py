"""Robot, loads and options of a sweep, as plain data that can be sent to another process."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from xml.dom import minidom

from softrobots.core.checks import FloatArray
from softrobots.description.renaming import children
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.version import __version__

_FREE = 6.0 * math.pi  # [rad]


@dataclass(frozen=True)
class SweepCase:
    """Robot, loads and options of the solver; equal cases make equal solvers."""

    urdf: str
    """Description of the robot."""
    springs: tuple[tuple[str, float, float], ...]
    """Name, stiffness [N m/rad] and rest [rad] of the springs."""
    motors: tuple[str, ...]
    """Names of the motor joints."""
    tip: str
    """Frame that carries the load."""
    direction: tuple[float, float, float]
    """Unit vector of the load, world axes."""
    loads: tuple[float, ...]
    """Sizes of the load, increasing [N]."""
    gravity: tuple[float, float, float] | None
    """Gravity, world axes [m/s^2]; None: weightless."""
    tolerance: float
    """Largest distance of the tip from its target [m]."""
    backend: str
    """Back end of the compiled solver: the same one on all workers, because the last digits differ."""
    version: str = __version__
    """Version of softrobots that made the case."""

    @classmethod
    def of(cls, model: SoftModel, direction: FloatArray, loads: FloatArray, **fields: Any) -> SweepCase:
        """Take the robot from a model; the other arguments are the fields."""
        x, y, z = direction.tolist()
        springs = tuple((name, *tag) for name, tag in model.spring_table.items())
        return cls(model.urdf, springs, model.motor_joints, model.tip, (x, y, z), tuple(loads.tolist()), **fields)

    def model(self) -> SoftModel:
        """The robot."""
        return self._load(self.urdf)

    def free_model(self) -> SoftModel:
        """The robot with motor limits of several turns either way."""
        document = minidom.parseString(self.urdf)
        for joint in (part for robot in children(document) for part in children(robot)):
            if joint.tagName == "joint" and joint.getAttribute("name") in self.motors:
                for limit in joint.getElementsByTagName("limit"):
                    limit.setAttribute("lower", repr(-_FREE))
                    limit.setAttribute("upper", repr(_FREE))
        return self._load(document.toxml())

    def _load(self, urdf: str) -> SoftModel:
        springs = {name: (stiffness, rest) for name, stiffness, rest in self.springs}
        return load_model(urdf, springs=springs, motors=self.motors, tip=self.tip)
