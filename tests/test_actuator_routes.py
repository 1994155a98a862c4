"""Actuators on any routes: their lengths, the map of their tensions, their laws, slack and energy.

The oracles are a curve in a Cosserat rod integrated with 40 Gauss points and differentiated by complex steps, polylines through
the poses that Pinocchio gives, closed forms of a straight segment, and balances of energy.
"""

from __future__ import annotations

import itertools
import math
import pickle
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import softrobots as sr
from softrobots.model.actuator_laws import ActuatorLaws
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.loads import AppliedLoad, Load
from tests.support.oracles import central_difference
from tests.support.routed_arms import actuator, curve_length, routed

LENGTHS, TURN, SECTIONS = (0.3, 0.2), 0.4, 3
SPANS = [(1 + place // SECTIONS, LENGTHS[place // SECTIONS] / SECTIONS) for place in range(2 * SECTIONS)]
ROUTES = {
    "straight": [(1, (0.0, 0.3), (0.03, 0.03), (0.7, 0.7))],
    "from_base": [(1, (0.0, 0.3), (0.03, 0.03), (2.0, 2.0)), (2, (0.0, 0.2), (0.03, 0.03), (2.0 - TURN, 2.0 - TURN))],
    "helix": [(1, (0.0, 0.3), (0.03, 0.03), (0.0, 4.0)), (2, (0.0, 0.2), (0.03, 0.03), (4.0 - TURN, 7.0 - TURN))],
    "part": [(1, (0.13, 0.22), (0.02, 0.02), (-1.0, -1.0))],
    "table": [(2, (0.0, 0.02, 0.11, 0.15, 0.2), (0.027, 0.03, 0.01, 0.01, 0.016), (0.2, 0.3, 2.0, 2.0, 2.2))],
    "cone": [(1, (0.0, 0.3), (0.04, 0.01), (1.0, 1.0))],
}
KINDS = {
    "straight": {"kind": "pressure", "area": 4e-4},
    "from_base": {"kind": "elastic", "stiffness": 3000, "pretension": 4},
    "helix": {"kind": "elastic", "stiffness": 2000, "pretension": 1},
    "part": {"kind": "tension"},
    "table": {"kind": "mckibben", "diameter": 0.02, "braid_angle": 0.4},
    "cone": {"kind": "tension"},
}
INPUTS = np.array([2e4, 0.42, 0.45, 8.0, 3e4, -3.0])
FIELDS = {"segment_lengths": LENGTHS, "offset": TURN, "elastic_sections": SECTIONS, "hinges": SECTIONS}


@cache
def arm(chain: str = "sections") -> sr.SoftModel:
    return routed(*(actuator(name, *ROUTES[name], **KINDS[name]) for name in ROUTES), chain=chain, **FIELDS)


def strains(seed: int, size: float = 1.0) -> np.ndarray:
    """Section coordinates that bend by up to 1 rad a section, twist by 0.5 rad, and stretch by 10 %, shape (n, 4)."""
    z = np.random.default_rng(seed).uniform(-1.0, 1.0, (2 * SECTIONS, 4))
    return size * z * (0.7, 0.7, 0.5, 0.01)


# --- Geometry


@pytest.mark.parametrize("seed", range(5))
def test_lengths_are_those_of_curves_in_a_rod(seed: int) -> None:
    """To 1e-12 of the length: the number of points of each route is chosen for that."""
    model, z = arm(), strains(seed)
    lengths = model.structure.muscle_paths.rest + model.structure.muscle_paths.at(z.ravel()).change
    expected = [curve_length(route, SPANS, z) for route in ROUTES.values()]
    assert lengths == pytest.approx(expected, rel=1e-12)


def test_lengths_are_those_of_polylines_through_poses_of_pinocchio() -> None:
    """Straight pieces between points beside the backbone; two numbers of them, extrapolated: the error is of fourth order."""
    model, z = arm(), strains(11)
    q = model.configuration(INPUTS, z.ravel())
    starts = section_starts(model, q)

    def polyline(route: list, count: int) -> float:
        total = 0.0
        for segment, at, distances, azimuths in route:
            begin = 0.0
            for (number, length), (a, b, t, e), start in zip(SPANS, z, starts, strict=True):
                if number != segment:
                    continue
                ends = [max(at[0], begin), *(s for s in at if begin < s < begin + length), min(at[-1], begin + length)]
                for low, high in itertools.pairwise(ends):
                    if high <= low:
                        continue
                    s = np.linspace(low, high, count)
                    d, phi = np.interp(s, at, distances), np.interp(s, at, azimuths)
                    screw = np.array([[0, -t, b, 0], [t, 0, -a, 0], [-b, a, 0, length + e], [0, 0, 0, 0]]) / length
                    step, pose = expm(screw * (s[1] - s[0])), start @ expm(screw * (low - begin))
                    points = []
                    for radius, angle in zip(d, phi, strict=True):
                        points.append(pose[:3] @ (radius * np.cos(angle), radius * np.sin(angle), 0.0, 1.0))
                        pose = pose @ step
                    total += float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
                begin += length
        return total

    lengths = model.structure.muscle_paths.rest + model.structure.muscle_paths.at(z.ravel()).change
    for length, route in zip(lengths, ROUTES.values(), strict=True):
        coarse, fine = polyline(route, 33), polyline(route, 65)
        assert length == pytest.approx(fine + (fine - coarse) / 3.0, rel=2e-8)  # sixteenth of 64 pieces to the fourth power


def section_starts(model: sr.SoftModel, q: np.ndarray) -> list[np.ndarray]:
    """Poses at the start of each section, where its first joint is, shape (4, 4)."""
    rigid, data = model.pinocchio, model.pinocchio.createData()
    pin.forwardKinematics(rigid, data, q)
    joints = [rigid.getJointId(row.joint_names[0]) for row in model.structure.section_table]
    return [(data.oMi[rigid.parents[joint]] * rigid.jointPlacements[joint]).homogeneous for joint in joints]


@pytest.mark.parametrize("seed", range(3))
def test_the_actuator_map_is_the_transpose_of_the_jacobian_of_lengths(seed: int) -> None:
    model, z = arm(), strains(seed)
    jacobian = np.zeros((len(ROUTES), z.size))
    for place in range(z.size):
        shifted = z.astype(complex).ravel()
        shifted[place] += 1e-30j
        jacobian[:, place] = [curve_length(r, SPANS, shifted.reshape(-1, 4)).imag / 1e-30 for r in ROUTES.values()]
    load = Load.of(model, (0.0, 0.0, 0.0))
    state = elastic_state(model, INPUTS, z.ravel(), load)
    tensions = state.load.motors
    assert tensions[3] == INPUTS[3]
    assert np.all(tensions != 0.0)
    assert np.abs(state.load.elastic + tensions @ jacobian).max() < 1e-12 * np.abs(tensions @ np.abs(jacobian)).max()
    paths = model.structure.muscle_paths.at(z.ravel())
    assert np.abs(paths.arms - jacobian).max() < 1e-12
    rates = np.random.default_rng(seed).normal(size=z.size)
    second = [
        float((curve_length(r, SPANS, z + (1e-4 + 1e-30j) * way) - curve_length(r, SPANS, z - (1e-4 - 1e-30j) * way)).imag)
        for r in ROUTES.values()
        for way in [rates.reshape(-1, 4)]
    ]
    assert paths.second(rates) == pytest.approx(np.array(second) / 2e-34, rel=1e-4)  # (1e-4)^2 times the fourth derivative
    blocks = [rates @ paths.curvature(row) @ rates for row in np.eye(len(ROUTES))]
    assert blocks == pytest.approx(paths.second(rates), rel=1e-11)


@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_tangent_and_coupling_are_derivatives_of_the_residual(chain: str) -> None:
    """By central differences, of all kinds in one robot; the residual is the slope of the energy."""
    model = arm(chain)
    y = 0.3 * np.random.default_rng(2).uniform(-1.0, 1.0, model.n_springs) * np.where(model.springs.turning, 1.0, 0.02)
    load = Load.of(model, (1.0, -2.0, 1.5), gravity=(0.0, 0.0, -9.81))
    state = elastic_state(model, INPUTS, y, load)
    assert np.all(state.load.motors != 0.0)
    tangent = central_difference(lambda y: elastic_state(model, INPUTS, y, load).residual, y)
    slope = central_difference(lambda y: np.array([elastic_state(model, INPUTS, y, load).energy]), y)[0]
    assert np.abs(state.tangent - tangent).max() < 1e-7 * np.abs(tangent).max()
    assert np.abs(state.residual - slope).max() < 1e-7 * np.abs(state.residual).max()
    for place, scale in enumerate(model.motor_scale * 1e-6):
        step = np.zeros(len(INPUTS))
        step[place] = scale
        ahead, behind = (elastic_state(model, INPUTS + s * step, y, load) for s in (1.0, -1.0))
        coupling = (behind.residual - ahead.residual) / (2.0 * scale)
        assert np.abs(state.load.coupling[:, place] - coupling).max() < 1e-6 * np.abs(coupling).max()


# --- Laws


def test_energies_have_the_tensions_as_slopes() -> None:
    laws, elongations = ActuatorLaws(arm().muscles), np.array([0.01, 0.02, 0.04, -0.02, 0.03, 0.01])
    at = laws.at(elongations, INPUTS)
    for name, step in (("by_length", 1e-6), ("energy", 1e-6)):
        ahead, behind = laws.at(elongations + step, INPUTS), laws.at(elongations - step, INPUTS)
        column = "tension" if name == "by_length" else "energy"
        slope = (getattr(ahead, column) - getattr(behind, column)) / (2.0 * step)
        assert slope == pytest.approx(at.by_length if name == "by_length" else at.tension, rel=1e-7, abs=1e-7)
    steps = 1e-4 * INPUTS
    change = (laws.at(elongations, INPUTS + steps).tension - laws.at(elongations, INPUTS - steps).tension) / (2.0 * steps)
    assert at.by_input == pytest.approx(change, rel=1e-9)


def test_pressure_and_braid_stretch_a_straight_segment_by_their_closed_forms() -> None:
    """EA (nu - 1) = sum u A for chambers; and minus the sum of Chou and Hannaford's tension at nu for braided muscles."""
    pressure, area, diameter, angle, axial = 3e4, 5e-4, 0.02, 0.35, 3000.0
    fields = {"segment_lengths": (0.3,), "elastic_sections": 2, "axial_stiffness": axial}
    around = [(1, (0.0, 0.3), (0.03, 0.03), (phi, phi)) for phi in (0.1, 0.1 + 2 * math.pi / 3, 0.1 + 4 * math.pi / 3)]
    chambers = routed(*(actuator(f"c{n}", piece, kind="pressure", area=area) for n, piece in enumerate(around)), **fields)
    found = sr.solve_equilibrium(chambers, np.full(3, pressure))
    assert found.strains == pytest.approx(np.tile([0, 0, 0, 1.0 + 3 * pressure * area / axial], (2, 1)), abs=1e-12)
    assert found.muscle_forces == pytest.approx(-pressure * area)
    braid = {"kind": "mckibben", "diameter": diameter, "braid_angle": angle}
    braided = routed(*(actuator(f"m{n}", piece, **braid) for n, piece in enumerate(around)), **fields)

    def tension(nu: float) -> float:
        a, b = 3.0 / math.tan(angle) ** 2, 1.0 / math.sin(angle) ** 2
        return pressure * math.pi * diameter**2 / 4.0 * (a * nu**2 - b)

    nu = brentq(lambda nu: axial * (nu - 1.0) + 3.0 * tension(nu), 0.6, 1.0, xtol=1e-15)
    found = sr.solve_equilibrium(braided, np.full(3, pressure))
    assert found.strains[:, 3] == pytest.approx(nu, rel=1e-11)
    assert found.muscle_forces == pytest.approx(tension(nu), rel=1e-9)
    assert braided.actuators.units == ("Pa",) * 3


# --- Slack


def tendons(stiffness: float, pretension: float, kind: str = "elastic", **fields: object) -> sr.SoftModel:
    """Six tendons, of which three run from the base through both segments."""
    rows = []
    for segment in (1, 2):
        for number in range(3):
            azimuth = 2 * math.pi * number / 3
            pieces = [
                (k, (0.0, LENGTHS[k - 1]), (0.03, 0.03), (azimuth + (segment - k) * TURN,) * 2) for k in range(1, segment + 1)
            ]
            law = {"stiffness": stiffness, "pretension": pretension} if kind == "elastic" else {}
            rows.append(actuator(f"t{segment}{number}", *pieces, kind=kind, **law))
    return routed(*rows, **(FIELDS | {"bending_stiffness": 0.5, "torsional_stiffness": 0.4} | fields))


@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_tendons_are_taut_or_slack(chain: str) -> None:
    """T >= 0, and T is the pretension and what the spring adds, or that would push: complementarity to 1e-9 N."""
    stiffness, pretension = 4e3, 2.0
    model, random, slack = tendons(stiffness, pretension, chain=chain), np.random.default_rng(4), 0
    for _ in range(12):
        motors = model.relaxed_motors + random.uniform(-0.01, 0.01, 6)
        found = sr.solve_equilibrium(model, motors, random.normal(size=3), gravity=(0, 0, -9.81))
        pull = pretension + stiffness * (found.muscle_lengths - motors)
        tensions = found.muscle_forces
        assert found.stable
        assert np.all(tensions >= 0.0)
        assert np.abs(tensions * (tensions - pull)).max() <= 1e-9
        assert np.abs(tensions - np.maximum(pull, 0.0)).max() <= 1e-9
        slack += int((tensions == 0.0).sum())
    assert 12 < slack < 60


@pytest.mark.parametrize("stiffness", [4e3, 1e7, 1e8])
def test_a_tendon_at_the_edge_of_slack_stops_no_solver(stiffness: float) -> None:
    """Without pretension and load every tendon is at its knee; then one is pulled by less and less, also a very stiff one."""
    model = tendons(stiffness, 0.0)
    for pull in (0.0, 1e-3, 1e-6, 1e-9, 1e-12):
        motors = model.relaxed_motors - pull * np.eye(6)[2]
        found = sr.solve_equilibrium(model, motors)
        assert found.stable
        assert found.iterations < 20
        pulls = np.maximum(stiffness * (found.muscle_lengths - motors), 0.0)
        assert found.muscle_forces == pytest.approx(pulls, abs=1e-9 + stiffness * 2e-16)  # rounding of lengths
        assert (found.muscle_forces[2] > 0.0) == (pull > 0.0)


def test_a_push_at_the_edge_of_slack_is_not_certified_where_the_slack_side_buckles() -> None:
    """A column under more than its critical load, straight, with tendons of which each is about to pull."""
    model = tendons(4e3, 0.0)
    load = Load.of(model, (0.0, 0.0, -6.0))  # N: pi^2 EI / (4 L^2) is 4.9
    motors = model.relaxed_motors
    straight = elastic_state(model, motors, np.where(model.springs.turning, 0.0, -6.0 / model.stiffness), load)
    knee = motors + model.structure.muscle_paths.at(straight.q_springs).change
    at_knee = elastic_state(model, knee, straight.q_springs, load)
    assert at_knee.error < 1e-9
    assert np.linalg.eigvalsh(at_knee.tangent)[0] < 0.0
    taut = elastic_state(model, knee - 1e-9, straight.q_springs, load)
    assert np.linalg.eigvalsh(taut.tangent)[0] > 0.0


def test_work_of_the_motors_is_the_change_of_energy() -> None:
    """Along a path that makes tendons slack and taut again: -sum T du, by trapezoids of second order."""
    model = tendons(4e3, 2.0, elastic_sections=2)
    rest, z0 = model.relaxed_motors, None
    amplitude = np.array([0.012, -0.006, 0.004, -0.01, 0.008, 0.003])

    def energy(found: sr.Equilibrium) -> float:
        pull = np.maximum(2.0 + 4e3 * (found.muscle_lengths - found.q_motors), 0.0)
        return 0.5 * float(model.stiffness @ found.q_springs**2) + float((pull**2).sum()) / 8e3

    errors, slack = [], set()
    for count in (24, 96):
        work, before, first = 0.0, None, 0.0
        for phase in np.linspace(0.0, 0.8 * 2 * math.pi, count + 1):
            found = sr.solve_equilibrium(model, rest - amplitude * np.sin(phase), q_springs0=z0)
            z0 = found.q_springs
            slack |= {tuple(found.muscle_forces == 0.0)}
            if before is None:
                first = energy(found)
            else:
                work -= 0.5 * float((found.muscle_forces + before.muscle_forces) @ (found.q_motors - before.q_motors))
            before = found
        errors.append(abs(work - (energy(before) - first)))
    assert len(slack) > 2
    assert errors[1] < 1e-2 * abs(energy(before) - first)
    assert errors[1] < 0.2 * errors[0]  # second order: a sixteenth, were it not for the knees


# --- Given lengths


def held(names: list[str], chain: str = "sections", **fields: object) -> sr.SoftModel:
    return routed(*(actuator(name, *ROUTES[name], kind="length") for name in names), chain=chain, **(FIELDS | fields))


@pytest.mark.parametrize("names", [["from_base"], ["helix", "table", "part"], list(ROUTES)], ids=lambda names: str(len(names)))
def test_given_lengths_are_held_on_any_routes(names: list[str]) -> None:
    """The lengths are met, and tensions as multipliers balance the springs: `K z = -J^T T`, with lengths by another code."""
    model, random = held(names), np.random.default_rng(3)
    lengths = model.relaxed_motors + random.uniform(-0.004, 0.004, len(names))
    found = sr.solve_equilibrium(model, lengths)
    z = model.structure.strains(found.q_motors, found.q_springs)
    assert found.muscle_lengths == pytest.approx(lengths, abs=1e-12)
    assert [curve_length(ROUTES[n], SPANS, z.reshape(-1, 4)) for n in names] == pytest.approx(lengths, abs=1e-12)
    jacobian = np.zeros((len(names), z.size))
    for place in range(z.size):
        shifted = z.astype(complex)
        shifted[place] += 1e-30j
        jacobian[:, place] = [curve_length(ROUTES[n], SPANS, shifted.reshape(-1, 4)).imag / 1e-30 for n in names]
    carried = model.structure.strain_springs.stiffness * z
    assert carried == pytest.approx(-found.muscle_forces @ jacobian, abs=1e-9 * np.abs(carried).max())
    assert model.n_springs == z.size - len(names)


@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_derivatives_at_given_lengths_are_those_of_the_residual(chain: str) -> None:
    names = ["helix", "table", "part", "cone"]
    model, random = held(names, chain), np.random.default_rng(8)
    lengths = model.relaxed_motors + random.uniform(-0.002, 0.002, 4)
    y = 0.1 * random.uniform(-1.0, 1.0, model.n_springs) * np.where(model.springs.turning, 1.0, 0.02)
    load = Load.of(model, (1.0, -2.0, 1.5), gravity=(0.0, 0.0, -9.81))
    state = elastic_state(model, lengths, y, load)
    tangent = central_difference(lambda y: elastic_state(model, lengths, y, load).residual, y)
    coupling = -central_difference(lambda u: elastic_state(model, u, y, load).residual, lengths)
    tensions = central_difference(lambda u: elastic_state(model, u, y, load).load.motors, lengths)
    by_lengths, _ = state.point.motor_derivatives(AppliedLoad(model, load).at(state.q))
    assert np.abs(state.tangent - tangent).max() < 1e-7 * np.abs(tangent).max()
    assert np.abs(state.load.coupling - coupling).max() < 1e-6 * np.abs(coupling).max()
    assert np.abs(by_lengths - tensions).max() < 1e-6 * np.abs(tensions).max()


def test_tendons_from_the_base_hold_the_sums_over_each_segment() -> None:
    """Straight through whole segments, three for each: the coordinates and names are those of muscles segment by segment."""
    through = tendons(1.0, 0.0, "length", elastic_sections=2)
    apart = sr.load_model(sr.PccArm(segment_lengths=LENGTHS, offset=TURN, elastic_sections=2))
    assert through.spring_joints == apart.spring_joints
    found = sr.solve_equilibrium(through, through.relaxed_motors + [-0.01, 0.0, 0.01, 0.002, -0.01, 0.004], (0.2, 0.1, 0.0))
    short = [0, 1, 2], [3, 4, 5]
    assert found.stable
    for rows in short:
        assert found.muscle_lengths[rows] == pytest.approx(found.q_motors[rows], abs=1e-13)


def test_stiff_tendons_tend_to_given_lengths() -> None:
    """Of first order in 1 / stiffness, also where tendons are fewer than the strains that they could hold."""
    routes = {name: ROUTES[name] for name in ("from_base", "helix")}
    exact = held(list(routes))
    lengths, force = exact.relaxed_motors - (0.006, 0.004), (0.3, -0.2, 0.1)
    tip = sr.solve_equilibrium(exact, lengths, force).tip_position
    errors = []
    for stiffness in (1e5, 1e6, 1e7):
        soft = routed(*(actuator(n, *r, kind="elastic", stiffness=stiffness) for n, r in routes.items()), **FIELDS)
        found = sr.solve_equilibrium(soft, lengths, force)
        assert np.all(found.muscle_forces > 0.0)
        errors.append(float(np.linalg.norm(found.tip_position - tip)))
    assert errors[0] > 1e-6
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx(10.0, rel=0.05)


def test_lengths_that_no_shape_has_are_refused() -> None:
    """Two equal routes hold one direction: their lengths must agree; the nearest are their mean."""
    two = routed(*(actuator(name, *ROUTES["helix"], kind="length") for name in ("a", "b")), **FIELDS)
    rest = two.relaxed_motors
    assert two.n_springs == 2 * SECTIONS * 4 - 1
    with pytest.raises(
        sr.ParameterError, match=r"one shape of the robot explains; that of [ab] misses the nearest shape by 0\.001 m"
    ):
        sr.solve_equilibrium(two, rest + (0.0, 0.002))
    nearest = two.structure.muscle_lengths.consistent(rest + (0.0, 0.002))
    assert nearest == pytest.approx(rest + 0.001, abs=1e-12)
    found = sr.solve_equilibrium(two, nearest)
    assert found.muscle_forces[0] == pytest.approx(found.muscle_forces[1], rel=1e-9)  # the least tensions
    with pytest.raises(sr.ParameterError, match="a shape of the robot has"):
        sr.solve_equilibrium(two, 0.005 * rest)
    with pytest.raises(sr.ParameterError, match=r"segment 1 would bend by 3\.3"):
        sr.solve_equilibrium(two, rest + 1.0)


def test_given_lengths_beside_other_kinds_are_refused() -> None:
    tags = actuator("a", *ROUTES["helix"], kind="length"), actuator("b", *ROUTES["cone"], kind="pressure", area=1e-4)
    with pytest.raises(sr.DescriptionError, match="the lengths of a are given, and not those of b"):
        routed(*tags, **FIELDS)
    assert routed(*tags, muscles="forces", **FIELDS).actuators.units == ("N", "Pa")


@pytest.mark.parametrize("kind", ["length", "tension", "elastic"])
def test_kinds_are_kept_in_files_and_copies(kind: str, tmp_path: object) -> None:
    model = tendons(4e3, 2.0, kind)
    found = sr.solve_equilibrium(model, model.relaxed_motors + (3.0 if kind == "tension" else -1e-3), (0.1, 0.0, 0.0))
    path = tmp_path / "found.npz"
    sr.save_result(found, path)
    again = sr.load_result(path)
    assert again.model == model
    assert [tag.kind for tag in again.model.muscles] == [kind] * 6
    assert np.array_equal(again.motor_torques, found.motor_torques)
    assert pickle.loads(pickle.dumps(model)) == model
    other = sr.load_model(model.urdf, muscles="forces" if kind == "length" else "lengths")
    assert {tag.kind for tag in other.muscles} == {{"length": "tension", "tension": "length"}.get(kind, kind)}


# --- Inputs


def test_limits_units_and_rest_follow_the_kind() -> None:
    numbers = {
        "length": {"shortest": 0.2, "longest": 0.4},
        "tension": {"weakest": -2.0, "strongest": 50.0},
        "elastic": {"stiffness": 3e3, "shortest": 0.25, "strongest": 20.0},
        "pressure": {"area": 4e-4, "max_pressure": 1e5},
        "mckibben": {"diameter": 0.02, "braid_angle": 0.4},
    }
    expected = {
        "length": ("m", (0.2, 0.4), 0.3),
        "tension": ("N", (-2.0, 50.0), 0.0),
        "elastic": ("m", (0.25, math.inf), 0.3),
        "pressure": ("Pa", (0.0, 1e5), 0.0),
        "mckibben": ("Pa", (0.0, math.inf), 0.0),
    }
    for kind, (unit, limits, rest) in expected.items():
        model = routed(actuator("a", *ROUTES["straight"], kind=kind, **numbers[kind]), **FIELDS)
        assert (model.actuators.units, tuple(model.motor_limits[0])) == ((unit,), limits)
        assert model.relaxed_motors == pytest.approx([rest], abs=1e-15)
        drawn = model.actuators.draw(np.random.default_rng(1))
        assert drawn is None or limits[0] <= drawn[0] <= limits[1]
    stretched = sr.solve_equilibrium(routed(actuator("a", *ROUTES["straight"], kind="tension", strongest=5), **FIELDS), [6.0])
    assert not stretched.within_limits
    slack = sr.solve_equilibrium(routed(actuator("a", *ROUTES["straight"], kind="elastic", stiffness=3e3), **FIELDS), [0.32])
    assert slack.muscle_forces == [0.0]
    assert slack.within_limits
    for kind, value in (("elastic", -0.1), ("mckibben", -1.0), ("length", 0.0)):
        with pytest.raises(sr.ParameterError, match=r"positive|pressures of McKibben muscles >= 0"):
            sr.solve_equilibrium(routed(actuator("a", *ROUTES["straight"], kind=kind, **numbers[kind]), **FIELDS), [value])


@pytest.mark.parametrize("kind", ["length", "tension", "elastic", "pressure", "mckibben"])
@pytest.mark.parametrize("route", ["straight", "from_base", "helix"])
def test_the_scale_of_an_input_is_worth_about_a_radian(kind: str, route: str) -> None:
    """One part in a hundred of it bends a body that cannot stretch by about 0.01 rad; a helix also twists it."""
    law = {"elastic": {"stiffness": 3e3}, "pressure": {"area": 4e-4}, "mckibben": {"diameter": 0.02, "braid_angle": 0.4}}
    model = routed(actuator("a", *ROUTES[route], kind=kind, **law.get(kind, {})), **(FIELDS | {"axial_stiffness": 1e7}))
    found = sr.solve_equilibrium(model, model.relaxed_motors + 0.01 * model.motor_scale * (-1.0 if kind == "elastic" else 1.0))
    bend = float(np.hypot(*(found.strains[:, :2] * np.array([length for _, length in SPANS])[:, None]).T).sum())
    assert bend == pytest.approx(0.01, rel=0.3 if route == "helix" else 0.02)
