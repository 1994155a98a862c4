"""The simulators: the exported file, how each loads it, and the tolerance against Pinocchio."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from softrobots.core.errors import NameNotFound, NotConverged
from softrobots.export.mjcf import to_mjcf
from softrobots.export.sdf import to_sdf
from softrobots.export.snippets import to_pybullet
from studies.interop import bullet_statics, drake_statics, mujoco_statics
from studies.interop.cases import WELDED, EquilibriumCase
from studies.interop.outcomes import Outcome, Question
from studies.interop.tools import find_tool

STATIC_TOLERANCE = 1e-9
"""Largest difference from Pinocchio's coordinates where the forces balance [rad or m]."""
SIMULATED_TOLERANCE = 1e-6
"""Largest difference from Pinocchio's coordinates after a simulation [rad or m]."""


@dataclass(frozen=True)
class Simulator:
    """A simulator with joint springs, its own or as torques."""

    name: str
    """Name in `studies.interop.tools.TOOLS`."""
    how: str
    """The exported file, and how it is loaded."""
    simulated: str
    """Settings of the simulation."""
    export: Callable[[EquilibriumCase], str]
    """Writes the file."""
    static: Callable[[Question], Outcome] | None
    """Finds where its own forces balance; None if it does not expose them."""
    simulate: Callable[[Question], Outcome]
    """Simulates until rest."""
    static_tolerance: float = STATIC_TOLERANCE
    """Tolerance of `static` [rad or m]."""
    simulated_tolerance: float = SIMULATED_TOLERANCE
    """Tolerance of `simulate` [rad or m]."""

    @property
    def version(self) -> str | None:
        """The installed version, or None."""
        return find_tool(self.name).version


_TABLE = (
    Simulator(
        "MuJoCo",
        "MJCF of `to_mjcf`, by `MjModel.from_xml_string`",
        "60 s at the defaults: 2 ms, contacts on",
        lambda case: to_mjcf(case.model, case.expected.q_motors, actuators=WELDED, damping="critical", gravity=case.gravity),
        mujoco_statics.static_equilibrium,
        mujoco_statics.simulate,
    ),
    Simulator(
        "Drake",
        "SDF of `to_sdf`, by `Parser.AddModelsFromString`",
        f"60 s at {1e3 * drake_statics.TIME_STEP:g} ms, contacts on",
        lambda case: to_sdf(case.model, case.expected.q_motors, actuators=WELDED, damping="critical"),
        drake_statics.static_equilibrium,
        drake_statics.simulate,
    ),
    Simulator(
        "PyBullet",
        "Python file of `to_pybullet`, with URDF and spring torques",
        "1/240 s, until it rests",
        lambda case: to_pybullet(case.model, case.expected.q_motors, actuators=WELDED, damping="critical"),
        None,
        bullet_statics.simulate,
        simulated_tolerance=1e-3,
    ),
)

SIMULATORS: Mapping[str, Simulator] = {simulator.name: simulator for simulator in _TABLE}
"""Every simulator by its name."""


@dataclass(frozen=True)
class EquilibriumRow:
    """Result of a simulator for a case."""

    tool: str
    """Name of the simulator."""
    version: str
    """Its version."""
    robot: str
    """Name of the robot."""
    pose: str
    """Name of the pose."""
    gravity: bool
    """Whether there is gravity."""
    static_difference: float | None = None
    """Largest difference from Pinocchio where its forces balance [rad or m]; None if not computed."""
    static_time: float | None = None
    """Time of that [s]."""
    simulated_difference: float | None = None
    """Largest difference from Pinocchio after the simulation [rad or m]; None if not computed."""
    simulated_time: float | None = None
    """Time of that [s]."""
    final_speed: float | None = None
    """Largest speed of a joint at the end of the simulation [rad/s or m/s]."""
    contacts: int | None = None
    """Largest number of contacts."""
    problem: str = ""
    """Why there is no answer; empty if there is one."""

    @property
    def agrees(self) -> bool:
        """Whether there is an answer within the tolerance."""
        simulator = find_simulator(self.tool)
        pairs = (
            (self.static_difference, simulator.static_tolerance),
            (self.simulated_difference, simulator.simulated_tolerance),
        )
        return not self.problem and all(difference is None or difference <= tolerance for difference, tolerance in pairs)


def find_simulator(name: str) -> Simulator:
    """Return the simulator of a name.

    Raises:
        NameNotFound: If there is none.
    """
    if name not in SIMULATORS:
        raise NameNotFound("simulator", name, SIMULATORS)
    return SIMULATORS[name]


def compare_equilibrium(case: EquilibriumCase, tool: str, *, static: bool = True, simulated: bool = True) -> EquilibriumRow:
    """Compare a simulator's equilibrium of a case with Pinocchio's.

    The simulator gets the exported file and the force, and nothing else of this package.

    Args:
        case: The case.
        tool: Name of the simulator, of `SIMULATORS`.
        static: Whether to find where its forces balance.
        simulated: Whether to simulate, which takes seconds.

    Returns:
        The differences from Pinocchio.

    Raises:
        NameNotFound: If there is no such simulator.
        MissingDependency: If it is not installed.
        ParameterError: If its joints are not the spring joints of the robot.
    """
    simulator = find_simulator(tool)
    question = Question(simulator.export(case), case.model.tip, case.force, case.gravity)
    row = EquilibriumRow(tool, str(simulator.version), case.robot, case.pose, case.gravity is not None)
    try:
        if static and simulator.static is not None:
            outcome = simulator.static(question)
            row = replace(
                row, static_difference=case.difference(outcome.joints), static_time=outcome.wall_time, contacts=outcome.contacts
            )
        if simulated:
            outcome = simulator.simulate(question)
            row = replace(
                row,
                simulated_difference=case.difference(outcome.joints),
                simulated_time=outcome.wall_time,
                final_speed=outcome.speed,
                contacts=outcome.contacts,
            )
    except NotConverged as error:
        return replace(row, problem=str(error))
    return row
