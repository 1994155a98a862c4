"""A case in a simulator, against ours: forces of obstacles and place of the tip where the simulation comes to rest."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.export.mjcf import to_mjcf
from softrobots.export.sdf import to_sdf
from softrobots.statics.equilibrium_result import Equilibrium
from studies.contact_forces.cases import ContactCase
from studies.interop import drake_statics, mujoco_statics
from studies.interop.outcomes import ITSELF, Outcome, Question
from studies.shared.markdown import line

SIMULATORS = ("MuJoCo", "Drake")
FORCE_TOLERANCE = 1e-3
"""Largest difference of the force of an obstacle, relative to it."""
TIP_TOLERANCE = 1e-5
"""Largest difference of the place of the tip, relative to the reach."""
REST = 1e-5
"""Largest speed of a joint that counts as rest [rad/s or m/s]."""
SECONDS = 20.0
"""How long the robots settle, damped critically [s]."""


class Row(NamedTuple):
    """A case in a simulator."""

    case: str
    """Name of the case."""
    simulator: str
    """Name of the simulator."""
    forces: dict[str, list[float]]
    """Our force of what presses, as `Outcome.forces` has them [N]."""
    force_error: float
    """Largest difference of a force, relative to ours."""
    tip_error: float
    """Difference of the place of the tip, relative to the reach."""
    speed: float
    """Largest speed of a joint at the end [rad/s or m/s]."""

    @property
    def agrees(self) -> bool:
        """Whether it came to rest with our forces and our tip."""
        return self.force_error <= FORCE_TOLERANCE and self.tip_error <= TIP_TOLERANCE and self.speed <= REST


def forces_of(found: Equilibrium) -> dict[str, FloatArray]:
    """Return our forces of what presses, as `Outcome.forces` has them."""
    forces: dict[str, FloatArray] = {}
    obstacles = found.environment.names if found.environment is not None else ()
    for contact in found.contacts:
        name = contact.obstacle if contact.obstacle in obstacles else ITSELF
        force = np.array([contact.normal_force]) if name == ITSELF else contact.force
        if contact.normal_force > 0.0:
            forces[name] = forces.get(name, 0.0) + force
    return forces


def settled(case: ContactCase, simulator: str, seconds: float = SECONDS) -> Outcome:
    """Let a simulator settle from the relaxed springs.

    Raises:
        ParameterError: If there is no such simulator.
        MissingDependency: If it is not installed.
        NotConverged: If it does not stay finite.
    """
    if simulator == "MuJoCo":
        text = to_mjcf(
            case.model,
            case.q_motors,
            actuators="welded",
            damping="critical",
            gravity=case.gravity,
            environment=case.environment,
        )
        return mujoco_statics.simulate(Question(text, case.model.tip, case.force, case.gravity), seconds)
    if simulator == "Drake":
        with tempfile.TemporaryDirectory() as folder:
            text = to_sdf(
                case.model,
                case.q_motors,
                actuators="welded",
                damping="critical",
                environment=case.environment,
                mesh_folder=folder,
            )
            return drake_statics.simulate(Question(text, case.model.tip, case.force, case.gravity), seconds)
    raise ParameterError("simulator", simulator, f"one of {', '.join(SIMULATORS)}")


def compare(name: str, case: ContactCase, simulator: str) -> Row:
    """Compare where a simulation settles with our equilibrium.

    Raises:
        ParameterError: If other obstacles press in the simulator.
        SoftRobotsError: As `settled` and `solve_equilibrium`.
    """
    ours, theirs = case.solve(), settled(case, simulator)
    forces = forces_of(ours)
    if forces.keys() != theirs.forces.keys():
        raise ParameterError("case", name, f"pressed by {', '.join(forces)} in {simulator}, too ({', '.join(theirs.forces)})")
    errors = [float(np.linalg.norm(theirs.forces[one] - force) / np.linalg.norm(force)) for one, force in forces.items()]
    tip = float(np.linalg.norm(case.tip(theirs.joints) - ours.tip_position)) / case.model.reach
    told = {obstacle: force.tolist() for obstacle, force in forces.items()}
    return Row(name, simulator, told, max(errors), tip, theirs.speed)


def table(rows: Sequence[Row]) -> str:
    """The rows as Markdown."""
    lines = [line(["case", "simulator", "forces of the obstacles [N]", "force off by", "tip off by", "speed left"])]
    lines.append("|---|---|---|---:|---:|---:|")
    for row in rows:
        sizes = ", ".join(f"{name} {np.linalg.norm(force):.4g}" for name, force in row.forces.items())
        lines.append(
            line([row.case, row.simulator, sizes, f"{row.force_error:.0e}", f"{row.tip_error:.0e}", f"{row.speed:.0e}"])
        )
    allowed = ["allowed", "", "", f"{FORCE_TOLERANCE:g}", f"{TIP_TOLERANCE:g}", f"{REST:g}"]
    return "\n".join([*lines, line(allowed)])


def as_data(rows: Sequence[Row]) -> Mapping[str, object]:
    """The rows for JSON."""
    return {"rows": [row._asdict() for row in rows]}
