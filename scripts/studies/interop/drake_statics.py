"""Equilibria in Drake, from SDF text: where its own generalised forces balance, and where its simulation comes to rest."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NotConverged
from softrobots.export.sdf_parts import SURROUNDINGS
from studies.interop.newton import balance_point
from studies.interop.outcomes import ITSELF, SECONDS, Outcome, Question
from studies.interop.tools import find_tool

TIME_STEP = 1e-2
"""Time step of the discrete plant [s]; where it comes to rest does not depend on it."""


def static_equilibrium(question: Question) -> Outcome:
    """Find where Drake's force elements (springs, weight) and the force at the tip are in balance.

    In balance `CalcInverseDynamics` finds no torque for zero speed and acceleration. The search starts at Drake's default
    position.

    Args:
        question: An SDF file, and the load.

    Returns:
        The equilibrium.

    Raises:
        MissingDependency: If Drake is not installed.
        NotConverged: If the forces do not come into balance.
    """
    find_tool("Drake").load()
    from pydrake.multibody.math import SpatialForce
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import MultibodyForces

    plant = MultibodyPlant(time_step=0.0)
    _fill(plant, question)
    context = plant.CreateDefaultContext()
    tip, forces = plant.GetBodyByName(question.tip), MultibodyForces(plant)
    still, load = np.zeros(plant.num_velocities()), SpatialForce(np.zeros(3), np.array(question.force))

    def balance(q: FloatArray) -> FloatArray:
        plant.SetPositions(context, q)
        plant.CalcForceElementsContribution(context, forces)
        tip.AddInForceInWorld(context, load, forces)
        return -np.asarray(plant.CalcInverseDynamics(context, still, forces))

    began = time.perf_counter()
    q, iterations = balance_point(balance, plant.GetPositions(context))
    elapsed = time.perf_counter() - began
    return Outcome(_joints(plant, q), 0.0, 0, iterations, elapsed)


def simulate(question: Question, seconds: float = SECONDS) -> Outcome:
    """Simulate the discrete plant from Drake's default position at rest, contacts on.

    Args:
        question: An SDF file, and the load.
        seconds: How long [s].

    Returns:
        Where it ends.

    Raises:
        MissingDependency: If Drake is not installed.
        NotConverged: If the simulation runs out of numbers.
    """
    find_tool("Drake").load()
    from pydrake.common.value import Value
    from pydrake.multibody.math import SpatialForce
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ExternallyAppliedSpatialForce
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.primitives import ConstantValueSource

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=TIME_STEP)
    _fill(plant, question)
    load = ExternallyAppliedSpatialForce()
    load.body_index = plant.GetBodyByName(question.tip).index()
    load.p_BoBq_B = np.zeros(3)
    load.F_Bq_W = SpatialForce(np.zeros(3), np.array(question.force))
    source = builder.AddSystem(ConstantValueSource(Value([load])))
    builder.Connect(source.get_output_port(0), plant.get_applied_spatial_force_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
    simulator.Initialize()
    began = time.perf_counter()
    simulator.AdvanceTo(seconds)
    elapsed = time.perf_counter() - began
    q, speed = np.array(plant.GetPositions(context)), float(np.abs(plant.GetVelocities(context)).max(initial=0.0))
    if not (np.isfinite(q).all() and np.isfinite(speed)):
        message = f"Drake's simulation ran out of numbers in {seconds:g} s"
        raise NotConverged(message, best=_joints(plant, q), residual=float("inf"), iterations=round(seconds / TIME_STEP))
    results = plant.get_contact_results_output_port().Eval(context)
    contacts = results.num_point_pair_contacts() + results.num_hydroelastic_contacts()
    return Outcome(_joints(plant, q), speed, contacts, round(seconds / TIME_STEP), elapsed, _obstacle_forces(plant, results))


def _obstacle_forces(plant: Any, results: Any) -> dict[str, FloatArray]:
    """Forces of what touches the robot, see `Outcome.forces`; obstacles are links of a model of their own."""
    forces: dict[str, FloatArray] = {}
    for number in range(results.num_point_pair_contacts()):
        contact = results.point_pair_contact_info(number)
        bodies = [plant.get_body(index) for index in (contact.bodyA_index(), contact.bodyB_index())]
        names = [body.name() if _is_obstacle(plant, body) else "" for body in bodies]
        on_second = np.asarray(contact.contact_force())
        force = on_second if names[0] else -on_second if names[1] else np.array([np.linalg.norm(on_second)])
        name = names[0] or names[1] or ITSELF
        forces[name] = forces.get(name, 0.0) + force
    return forces


def _is_obstacle(plant: Any, body: Any) -> bool:
    return bool(plant.GetModelInstanceName(body.model_instance()).endswith(SURROUNDINGS))


def _fill(plant: Any, question: Question) -> None:
    from pydrake.multibody.parsing import Parser

    Parser(plant).AddModelsFromString(question.text, "sdf")
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3) if question.gravity is None else np.array(question.gravity))
    plant.Finalize()


def _joints(plant: Any, q: FloatArray) -> dict[str, float]:
    joints = (plant.get_joint(index) for index in plant.GetJointIndices())
    return {joint.name(): float(q[joint.position_start()]) for joint in joints if joint.num_positions() == 1}
