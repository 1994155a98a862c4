"""The simulators that are asked for the equilibrium: what each gets, how, and how near it must come to Pinocchio."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from softrobots.cli.tools.known_tools import find_tool
from softrobots.core.errors import NameNotFound, NotConverged
from softrobots.export.mjcf import to_mjcf
from softrobots.export.sdf import to_sdf
from softrobots.export.snippets import to_pybullet
from studies.interop import bullet_statics, drake_statics, mujoco_statics
from studies.interop.cases import WELDED, EquilibriumCase
from studies.interop.outcomes import Outcome, Question

STATIC_TOLERANCE = 1e-9
"""Largest difference from Pinocchio's coordinates where the forces balance [rad or m]."""
SIMULATED_TOLERANCE = 1e-6
"""Largest difference from Pinocchio's coordinates after a simulation [rad or m]."""


@dataclass(frozen=True)
class Simulator:
    """A tool that knows springs, or is told of them."""

    name: str
    """What it is called, as of `softrobots.cli.tools.known_tools.TOOLS`."""
    how: str
    """What it gets from us and how it loads it."""
    simulated: str
    """How it simulates."""
    export: Callable[[EquilibriumCase], str]
    """Writes what it gets."""
    static: Callable[[Question], Outcome] | None
    """Where its own forces balance; None if it does not tell them."""
    simulate: Callable[[Question], Outcome]
    """Where its simulation comes to rest."""
    static_tolerance: float = STATIC_TOLERANCE
    """Largest difference of the first [rad or m]."""
    simulated_tolerance: float = SIMULATED_TOLERANCE
    """Largest difference of the second [rad or m]."""

    @property
    def version(self) -> str | None:
        """The installed version, or None."""
        return find_tool(self.name).version


_TABLE = (
    Simulator(
        "MuJoCo",
        "MJCF of `to_mjcf`, by `MjModel.from_xml_string`",
        "60 s at the defaults: 2 ms, contacts on",
        lambda case: to_mjcf(case.model, case.expected.q_motors, actuators=WELDED, gravity=case.gravity),
        mujoco_statics.static_equilibrium,
        mujoco_statics.simulate,
    ),
    Simulator(
        "Drake",
        "SDF of `to_sdf`, by `Parser.AddModelsFromString`",
        f"60 s at {1e3 * drake_statics.TIME_STEP:g} ms, contacts on",
        lambda case: to_sdf(case.model, case.expected.q_motors, actuators=WELDED),
        drake_statics.static_equilibrium,
        drake_statics.simulate,
    ),
    Simulator(
        "PyBullet",
        "Python file of `to_pybullet`, with URDF and spring torques",
        "1/240 s, until it rests",
        lambda case: to_pybullet(case.model, case.expected.q_motors, actuators=WELDED),
        None,
        bullet_statics.simulate,
        simulated_tolerance=1e-3,
    ),
)

SIMULATORS: Mapping[str, Simulator] = {simulator.name: simulator for simulator in _TABLE}
"""Every simulator by its name."""


@dataclass(frozen=True)
class EquilibriumRow:
    """What a simulator makes of a case."""

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
    """Largest difference from Pinocchio where its forces balance [rad or m]; None if it was not asked or does not tell."""
    static_time: float | None = None
    """How long that took [s]."""
    simulated_difference: float | None = None
    """Largest difference from Pinocchio after the simulation [rad or m]; None if it was not asked."""
    simulated_time: float | None = None
    """How long that took [s]."""
    final_speed: float | None = None
    """Largest speed of a joint at its end [rad/s or m/s]."""
    contacts: int | None = None
    """Most contacts that were seen."""
    problem: str = ""
    """Why it has no answer; empty if it has."""

    @property
    def agrees(self) -> bool:
        """Whether it answers, and comes as near to Pinocchio as it must."""
        simulator = find_simulator(self.tool)
        pairs = (
            (self.static_difference, simulator.static_tolerance),
            (self.simulated_difference, simulator.simulated_tolerance),
        )
        return not self.problem and all(difference is None or difference <= tolerance for difference, tolerance in pairs)


def find_simulator(name: str) -> Simulator:
    """The simulator of that name.

    Raises:
        NameNotFound: If there is none.
    """
    if name not in SIMULATORS:
        raise NameNotFound("simulator", name, SIMULATORS)
    return SIMULATORS[name]


def compare_equilibrium(case: EquilibriumCase, tool: str, *, static: bool = True, simulated: bool = True) -> EquilibriumRow:
    """Ask a simulator for the equilibrium of a case.

    It gets the file that our exporter writes, and the force; nothing else of this package stands on its side.

    Args:
        case: The case.
        tool: Name of the simulator, of `SIMULATORS`.
        static: Whether to ask where its forces balance.
        simulated: Whether to simulate, which takes seconds.

    Returns:
        What it says, beside Pinocchio's answer.

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
            found = simulator.static(question)
            row = replace(
                row, static_difference=case.difference(found.joints), static_time=found.wall_time, contacts=found.contacts
            )
        if simulated:
            found = simulator.simulate(question)
            row = replace(
                row,
                simulated_difference=case.difference(found.joints),
                simulated_time=found.wall_time,
                final_speed=found.speed,
                contacts=found.contacts,
            )
    except NotConverged as error:
        return replace(row, problem=str(error))
    return row
