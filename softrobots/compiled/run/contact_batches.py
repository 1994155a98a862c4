"""Equilibria of many cases in contact: robot and obstacles as arrays for compiled code, and the plain solver for hard cases."""

from __future__ import annotations

import inspect
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.contact import balance, candidates, joints, programme, search, surfaces
from softrobots.compiled.program.generated_module import functions_of
from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.backends import jitted
from softrobots.compiled.run.batches import gravity_vector
from softrobots.compiled.run.results import CompiledEquilibrium, EquilibriumBatch
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, finite_array, positive_integer
from softrobots.core.errors import EquilibriumNotFound, ParameterError
from softrobots.core.summary import Part, facts, field_facts
from softrobots.environment.cores import cores_of
from softrobots.environment.environment import Environment, check_environment, fixed_environment
from softrobots.environment.obstacle_fields import obstacle_transforms
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere
from softrobots.environment.standing import check_base
from softrobots.model.serial_chain import ChainJoint
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.stability import NEUTRAL

_GOOD = np.zeros(1, dtype=np.bool_)
_CHUNK = 64  # cases that a thread takes at a time
_KINDS = {HalfSpace: surfaces.HALF_SPACE, Box: surfaces.ROUNDED_BOX, Sphere: surfaces.ROUNDED_BOX}
_KINDS |= {Capsule: surfaces.ROUNDED_BOX, Cylinder: surfaces.CYLINDER}


@lru_cache(maxsize=1)
def _compiled() -> Any:
    """Functions of the search, which numba compiles on first use and keeps on disk."""
    modules = (surfaces, joints, candidates, balance, programme, search)
    constants = {name: value for module in modules for name, value in vars(module).items() if name.isupper()}
    functions = [function for module in modules for function in functions_of(module)]
    head = "\n".join(f"{name} = {value!r}" for name, value in constants.items())
    return jitted(head, "\n\n\n".join(map(inspect.getsource, functions)), "settle_batch")


@dataclass(frozen=True, eq=False, repr=False)
class ContactBatch(EquilibriumBatch):
    """Equilibria of many cases in contact without friction."""

    obstacle_forces: FloatArray
    """Force of each obstacle on the robot, shape (n, n_obstacles, 3) [N], world axes, in the order of the environment."""
    penetration: FloatArray
    """Depth of the deepest penetration, shape (n,) [m]."""
    handed_over: Any
    """Mask of the cases that `softrobots.solve_equilibrium` solved, shape (n,): slower, with the same certificate."""


class ContactEquilibrium(CompiledEquilibrium):
    """An equilibrium in contact without friction, certified stable or neutral."""

    __slots__ = ("handed_over", "obstacle_forces", "penetration")

    def __init__(self, workspace: Any, run: Any, actuation: Actuation, motors: FloatArray, found: ContactBatch) -> None:
        """Take a workspace of code without contact, and the only case of a batch."""
        layout = run.layout
        for place, numbers in ((layout.unknown, found.q_springs), (layout.tip, found.tip_positions)):
            run.put(workspace, place, numbers[0])
        run.put(workspace, layout.single("error"), found.residual**2)
        super().__init__(workspace, layout, actuation, motors, Status(int(found.status[0])))
        self.obstacle_forces: FloatArray = found.obstacle_forces[0]
        """Force of each obstacle on the robot, shape (n_obstacles, 3) [N], world axes, in the order of the environment."""
        self.penetration = float(found.penetration[0])
        """Depth of the deepest penetration [m]."""
        self.handed_over = bool(found.handed_over[0])
        """Whether `softrobots.solve_equilibrium` solved it."""

    def summary_parts(self) -> list[Part]:
        """Return the equilibrium, and the forces of the obstacles."""
        return [*super().summary_parts(), facts(field_facts(self, "obstacle_forces", "penetration"))]


class ContactSolver:
    """A robot as arrays for compiled code."""

    def __init__(self, model: SoftModel, unknowns: Unknowns, backend: str) -> None:
        """Take a robot whose elastic coordinates are joints with linear springs.

        Raises:
            ParameterError: If it has sections, muscles, slack walls, or strains that are locked.
            DescriptionError: If it has nothing to touch obstacles with.
        """
        chain = model.chain()
        elements: Any = chain.elements
        simple = all(isinstance(one, ChainJoint) for one in elements)
        if not simple or unknowns.locked or chain.actuators or chain.slack_hinges:
            requirement = "None for robots with sections, muscles, slack walls or locked strains; solve_equilibrium takes them"
            raise ParameterError("environment", model.pinocchio.name, requirement)
        places = [[-1 if place is None else place for place in (one.motor, one.strain)] for one in elements]
        self._chain = (
            np.array([one.rotation for one in elements]).reshape(-1, 9),
            np.array([one.translation for one in elements]),
            np.array([one.slides for one in elements], dtype=np.int64),
            *np.array(places, dtype=np.int64).T.copy(),
            np.array([[one.body.mass, *one.body.first_moment] for one in elements]),
            np.array(chain.tip_translation),
            np.array(chain.stiffness),
            np.array([model.reach, model.rounding]),
            np.array(chain.rest),
        )
        self._model, self._capsules = model, _capsules(model, elements)
        self._around: tuple[Any, FloatArray] = (None, np.zeros((0, 0, surfaces.ROW)))  # the last environments, as numbers
        self._run: Any = _compiled if backend == "numba" else lambda: search

    def equilibrium(
        self, actuation: Actuation, run: Any, q_motors: Any, force: Any, gravity: Any, environment: Any
    ) -> ContactEquilibrium:
        """Settle one case, see `CompiledStatics.equilibrium`; what is known of the last environment is kept."""
        motors, load = actuation.checked(q_motors), finite_array("force", force, (3,), "N")
        wrench = np.concatenate([load, gravity_vector(gravity)])
        found = self.settle(motors[None], wrench[None], _GOOD, check_environment(environment), 1)
        return ContactEquilibrium(actuation.workspace(run, motors, force=load), run, actuation, motors, found)

    def settle(self, motors: FloatArray, loads: FloatArray, bad: Any, environment: Any, threads: int) -> ContactBatch:
        """Settle cases, each from rest; see `CompiledStatics.equilibria`."""
        around = (environment,) if isinstance(environment, Environment) else tuple(environment)
        if len(motors) == 1:
            motors, loads, bad = (each.repeat(len(around), 0) for each in (motors, loads, bad))
        n, names = len(motors), {fixed_environment(one).names for one in around}
        if len(around) not in (1, n) or len(names) > 1:
            requirement = f"one, or {n} with obstacles of the same names, one a case"
            raise ParameterError("environment", f"{len(around)} environments", requirement)
        threads = positive_integer("threads", threads)
        known, bodies = self._around
        if around != known:
            check_base(self._model, around)
            bodies = np.array([bodies_of(one) for one in around])
            self._around = around, bodies
        springs, tips = np.tile(self._model.rest, (n, 1)), np.zeros((n, 3))
        pushes, told, done = np.zeros((n, 3 * bodies.shape[1])), np.zeros((n, 2)), np.zeros(n, dtype=np.bool_)
        given = self._chain, self._capsules, bodies, motors, loads, springs, tips, pushes, told, done

        def settled(first: int) -> None:
            with np.errstate(all="ignore"):
                self._run().settle_batch(*given, first, min(n, first + starts.step))

        starts = range(0, n, _CHUNK if threads > 1 else max(n, 1))
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(settled, starts) if threads > 1 else map(settled, starts))
        statuses, forces = np.where(done, Status.CERTIFIED, Status.UNSETTLED).astype(np.uint8), pushes.reshape(n, -1, 3)
        handed = ~done & ~bad
        for case in handed.nonzero()[0].tolist():
            scene = around[case if len(around) > 1 else 0]
            try:
                found = solve_equilibrium(
                    self._model, motors[case], loads[case, :3], gravity=loads[case, 3:], environment=scene
                )
            except EquilibriumNotFound as error:
                found = error.best
            springs[case], tips[case], forces[case] = found.q_springs, found.tip_position, 0.0
            told[case] = found.residual, max((-one.gap for one in found.contacts), default=0.0)
            for one in found.contacts:
                forces[case, scene.names.index(one.obstacle)] += one.force
            if found.converged:
                unstable = Status.NEUTRAL if found.stability.kind == NEUTRAL else Status.UNSTABLE
                statuses[case] = Status.CERTIFIED if found.stable else unstable
        springs[bad], tips[bad], forces[bad], told[bad, 0], told[bad, 1] = 0.0, 0.0, 0.0, np.inf, 0.0
        statuses[bad] = Status.NOT_A_NUMBER
        return ContactBatch(springs, statuses, told[:, 0].copy(), tips, forces, np.maximum(told[:, 1], 0.0), handed)


def _capsules(model: SoftModel, elements: Any) -> tuple[Any, ...]:
    """Capsules of a robot as arrays: carriers, ends, radii, lengths, numbers of ends, ends, and ends at the base."""
    cores, pinocchio = cores_of(model), model.pinocchio
    place = {pinocchio.getJointId(one.name): row for row, one in enumerate(elements)}
    axes = {pinocchio.getJointId(one.name): one.axes for one in elements}
    base_of = np.full(len(cores.single_ends), -1, dtype=np.int64)
    base_of[cores.at_base] = cores.bases
    return (
        np.array([place[one.joint] for one in cores.capsules], dtype=np.int64),
        *(np.array([axes[one.joint].T @ end for one, end in zip(cores.capsules, ends, strict=True)]).reshape(-1, 3)
          for ends in ([one.start for one in cores.capsules], [one.end for one in cores.capsules])),
        np.array(cores.radii),
        np.array(cores.lengths),
        np.array(cores.end_numbers, dtype=np.int64),
        np.stack([cores.end_capsules, cores.end_features], axis=1).astype(np.int64),
        base_of,
    )  # fmt: skip


def bodies_of(environment: Environment) -> FloatArray:
    """Obstacles as rows of numbers; `softrobots.compiled.contact.surfaces` tells what they are.

    Raises:
        ParameterError: If one is a mesh, or the robot may touch itself.
    """
    rows = np.zeros((len(environment), surfaces.ROW))
    if environment.self_contact:
        raise ParameterError("environment", environment, "one without self_contact; solve_equilibrium takes it")
    for row, one, transform in zip(rows, environment, obstacle_transforms(environment), strict=True):
        if type(one) not in _KINDS:
            raise ParameterError(
                "environment", one.name, "half-spaces, boxes, spheres, cylinders, capsules; solve_equilibrium takes meshes"
            )
        row[0], row[1:10], row[10:13] = _KINDS[type(one)], transform[:3, :3].ravel(), transform[:3, 3]
        if isinstance(one, Box):
            row[13:16] = 0.5 * np.asarray(one.size)
        elif isinstance(one, (Cylinder, Capsule)):
            row[13 if isinstance(one, Cylinder) else 15] = 0.5 * one.length
        row[16] = getattr(one, "radius", 0.0)
    return rows
