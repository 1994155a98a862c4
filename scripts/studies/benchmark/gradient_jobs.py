"""Jobs of derivatives: gradients of batches of equilibria by actuators, loads and parameters, against the batches."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import numpy as np

import softrobots as sr
from softrobots.identification.parameters import ParameterSet
from softrobots.learning.differentiable import Differentiable
from studies.benchmark.arm_baselines import CHECKED, batch_name, compiled_batch, expected_springs
from studies.benchmark.cases import LoadCases, standard_cases
from studies.benchmark.comparison import Comparison, Outcome, Settings
from studies.benchmark.measurement import Workload, require_agreement
from studies.benchmark.results import AT_MOST

PARAMETERS = ("link[*].stiffness", "hinge_offset", "link[*].wall_thickness", "motor[*].offset")
_PLAIN, _VALUES, _GRADIENT = batch_name("numba"), "numbers of the robot as inputs", "gradient"
_OWN_VALUES, _OWN_BOTH = "values, parameters of each case", "values and gradient, parameters of each case"
_ROWS = 256  # cases with parameters of their own
_JAX_VALUES, _JAX_BOTH = "JAX, values", "JAX, values and gradient"


def gradients(settings: Settings) -> Outcome:
    """The height of the tip by motors, force and seven parameters, weightless."""
    comparison = Comparison(settings, "gradients")
    cases = standard_cases(settings.batch)
    comparison.add(_PLAIN, partial(compiled_batch, _PLAIN, "numba", cases, expected_springs(cases, None), None))
    comparison.add(_VALUES, partial(_values, cases))
    comparison.add(_GRADIENT, partial(_gradient, cases))
    comparison.add(_OWN_VALUES, partial(_of_each_case, cases, gradient=False))
    comparison.add(_OWN_BOTH, partial(_of_each_case, cases, gradient=True))
    comparison.add(_JAX_VALUES, partial(_by_jax, cases, gradient=False))
    comparison.add(_JAX_BOTH, partial(_by_jax, cases, gradient=True))
    comparison.run()
    job = "gradient of a batch of equilibria, seven parameters"
    rows = [
        comparison.costlier(job, _VALUES, _PLAIN),
        comparison.costlier(job, _GRADIENT, _PLAIN, AT_MOST, 2.0),
        comparison.costlier(job, _OWN_BOTH, _OWN_VALUES, AT_MOST, 3.0),
        comparison.costlier(job, _JAX_BOTH, _JAX_VALUES),
    ]
    return Outcome(rows)


@lru_cache(maxsize=1)
def _solver() -> Differentiable:
    options: dict[str, Any] = dict(gravity=None, backend="numba", threads=1, failed="nan")
    return Differentiable("equilibrium", sr.InflatableArm(), PARAMETERS, **options)


def _values(cases: LoadCases) -> Workload:
    solver = _solver()
    found = solver.solve(*cases.first(CHECKED), solver.present)[0]
    require_agreement(_VALUES, found, expected_springs(cases, None)[: len(found)], 1e-8, "rad")
    return Workload(len(cases.forces), lambda: solver.solve(*cases, solver.present))


def _gradient(cases: LoadCases) -> Workload:
    """Checked against the elastostatic Jacobian and the compliance of `solve_equilibrium`."""
    solver, count = _solver(), len(cases.forces)
    inputs = [*cases, solver.present]
    results = solver.solve(*inputs)
    weights = [np.zeros_like(results[0]), np.tile([0.0, 0.0, 1.0], (count, 1))]
    shapes: list[tuple[int, ...]] = [(count,), (count,), ()]
    by_motors, by_force, _ = solver.pull(inputs, results, weights, shapes)
    found = [sr.solve_equilibrium(solver.model, *pair, tolerance=1e-13) for pair in zip(*cases.first(CHECKED), strict=True)]
    motors = np.array([sr.elastostatic_jacobian(solver.model, one)[2] for one in found])
    force = np.array([sr.compliance(solver.model, one)[2, :3] for one in found])
    require_agreement(_GRADIENT, np.asarray(by_motors)[: len(found)], motors, 1e-7, "m/rad")
    require_agreement(_GRADIENT, np.asarray(by_force)[: len(found)], force, 1e-7, "m/N")
    return Workload(count, lambda: solver.pull(inputs, results, weights, shapes))


def _of_each_case(cases: LoadCases, *, gradient: bool) -> Workload:
    """At values of the parameters that no run before has seen; the first ones are compared with those of loaded robots."""
    solver, random, some = _solver(), np.random.default_rng(0), cases.first(_ROWS)
    count, parameters = len(some.forces), ParameterSet.of(sr.InflatableArm(), PARAMETERS)

    def run() -> Any:
        values = solver.present + 0.01 * random.uniform(-1.0, 1.0, (count, len(solver.present))) * (solver.present + 0.01)
        results = solver.solve(*some, values)
        if gradient:
            weights = [np.zeros_like(results[0]), np.tile([0.0, 0.0, 1.0], (count, 1))]
            solver.pull([*some, values], results, weights, [(count,)] * 3)
        return values, results

    values, results = run()
    for row in range(min(3, count)):
        motors = some.q_motors[row] + parameters.motor_offsets(values[row])
        found = sr.solve_equilibrium(parameters.model(values[row]), motors, some.forces[row], tolerance=1e-13)
        require_agreement(_OWN_VALUES, results[0][row], found.q_springs, 1e-8, "rad")
    return Workload(count, run)


def _by_jax(cases: LoadCases, *, gradient: bool) -> Workload:
    try:
        import jax
    except ImportError as error:
        raise sr.MissingDependency("jax", "jax") from error
    jax.config.update("jax_enable_x64", True)
    equilibrium = sr.jax.equilibrium(sr.InflatableArm(), PARAMETERS, backend="numba", failed="nan")

    def height(motors: Any, forces: Any, parameters: Any) -> Any:
        return jax.numpy.nansum(equilibrium(motors, forces, parameters)[1][:, 2])

    run = jax.jit(jax.value_and_grad(height, argnums=(0, 1, 2)) if gradient else height)
    given = [jax.numpy.asarray(one) for one in (*cases, equilibrium.values)]
    return Workload(len(cases.forces), lambda: jax.block_until_ready(run(*given)))
