"""Readers of tables, results, documents and commands: valid files of each to be damaged, and what is to be true of them."""

from __future__ import annotations

import dataclasses
import io
import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin

import softrobots as sr
from softrobots import inflated_beam
from softrobots.compiled.run.motion_batch import MotionBatch
from softrobots.compiled.sweeps import TargetGrid, WorkspaceMap, map_workspace
from softrobots.core.checkpoint import CASE, Checkpoint
from softrobots.core.yaml_text import parse_yaml
from softrobots.environment.obstacle_fields import obstacle_fields
from softrobots.helix import ActuatorTable, HelixDesign, design_grasp
from softrobots.identification.measurement_columns import read_columns
from softrobots.robots.parameter_file import read_parameters, read_robot, write_parameters
from softrobots.view.live.commands import Wanted, read_commands
from softrobots.view.live.input import WatchedFile
from studies.benchmark.results import Curve, Results, Row, as_json, read_results
from tests.support.hostile import HOSTILE_NUMBERS, HOSTILE_TEXTS, Damage, damaged_bytes

START = Wanted(np.zeros(3), None, np.zeros(3), None)
"""Where commands begin."""


def finite(*arrays: Any) -> None:
    """Refuse to call an answer valid that is not finite."""
    if not all(np.all(np.isfinite(np.asarray(array, dtype=float))) for array in arrays):
        raise ArithmeticError("an answer with a number that is not finite")


def waypoint_corpus() -> list[bytes]:
    """With and without times, with other columns, quoted, with a byte order mark."""
    return [
        b"t,x,y,z\n0,0.1,0.2,0.3\n0.5,0.15,0.2,0.3\n1,0.2,0.2,0.35\n",
        b"\xef\xbb\xbfx, y, z\r\n1,2,3\r\n\r\n1e-3,-2.5,+3.\r\n",
        b'name,z,"y",x\n"a, b",1,2,3\nc,1,2,4\n',
    ]


def read_path(file: Path) -> None:
    """Waypoints."""
    path = sr.read_waypoints(file)
    finite(path.times, path.positions)
    if not np.all(np.diff(path.times) > 0.0) or path.positions.shape != (len(path.times), 3):
        raise ArithmeticError("a path that is none")


def bending_corpus() -> list[bytes]:
    """Angles and moments, ways and forces, both."""
    return [
        b"angle [deg],moment [N m]\n1,2.9\n2,5.8\n3,8.9\n4,12\n",
        b"note,displacement_mm,force_N\na,5.1,3.5\nb,-10.2,-7.1\nc,15,10.4\n",
        b"angle_mrad,moment_Nmm,displacement [m],force [N]\n10,1.7e3,0,0\n20,3.4e3,0,0\n30,5.1e3,0,0\n",
    ]


def read_bending(file: Path) -> None:
    """Points of a bending test."""
    points = inflated_beam.read_characterisation(file)
    finite(*points)
    if points.angle.shape != points.moment.shape or np.any(np.abs(points.angle) >= 0.5 * np.pi):
        raise ArithmeticError("points that are none")


def table_corpus() -> list[bytes]:
    """Rising and falling."""
    rising = b"pressure_Pa,contraction\n0,0.66\n10000,0.7\n20000.0,0.8\n3e4,1\n"
    return [rising, b"contraction,note,pressure_Pa\n1.0,a,-5e4\n0.9,b,0\n0.7,,5e4\n"]


def read_table(file: Path) -> None:
    """A table of an actuator, and what it is asked for."""
    table = ActuatorTable.read_csv(file)
    shares = table.contraction_at(table.pressure)
    finite(shares, table.pressure_for(shares))
    if not np.all((shares > 0.0) & (shares <= 1.0)):
        raise ArithmeticError("a contraction that is none")


@cache
def measurement_corpus() -> list[bytes]:
    """Files that tell their own columns: with gaps, labels and standard deviations, and with poses."""
    poses = np.tile(np.eye(4), (2, 1, 1))
    rows = (
        results()["measurements"],
        sr.Measurements(
            np.ones((2, 1)), damping_ratios=[[0.1], [0.2]], poses={"tip": poses}, mass=[0.0, 1.0], gravity=(0, 0, -9.8)
        ),
    )
    with TemporaryDirectory() as folder:
        return [one.to_csv(Path(folder) / f"{k}.csv").read_bytes() for k, one in enumerate(rows)]


def read_measurements(file: Path) -> None:
    """Measured rows."""
    rows = sr.Measurements.from_csv(file)
    finite(rows.q_motors, *rows.loads.values(), *rows.std.values())
    if any(np.isinf(values).any() for values in rows.measured.values()):
        raise ArithmeticError("an infinite measurement")


def column_corpus() -> list[bytes]:
    """Every entry of a mapping of columns."""
    whole = b"""actuators: {columns: [a, b], unit: [deg, mm], relative: false, scale: [-1, 1]}
gravity: {columns: [gx, gy, gz], unit: m/s^2}
mass: {columns: m, unit: g}
wrench: {tip: {columns: [fx, fy, fz, mx, my, mz], unit: [N, N mm]}}
positions: {tip: {columns: [x, y, z], unit: mm, std: [1.0, 1, s]}}
poses: {elbow: {columns: [u, v, w], unit: m, roll_pitch_yaw: [r, p, q], angle_unit: deg, std: [0.001, 0.5]}}
labels: {column: pattern, without_suffix: _hold}
markers: {ball: elbow}
mask: used
"""
    return [whole, b"actuators: {columns: a, unit: Pa}\ngravity: [0, 0, -9.81]\nlabels: b\n"]


def read_column_file(file: Path) -> None:
    """A mapping of columns, and a row that it reads."""
    layout = read_columns(file)
    row = {name: np.ones(1) for name in layout.numbers}
    layout.arguments(row.__getitem__, lambda _: ["word"])


@cache
def design_corpus() -> list[bytes]:
    """With a wish, and without."""
    grasp = design_grasp(0.020, 0.080, diameter=0.0331, turns=1.5)
    plain = HelixDesign(grasp.contraction, grasp.angle, grasp.diameter, grasp.turns)
    with TemporaryDirectory() as folder:
        return [sr.save_result(design, Path(folder) / f"{k}.json").read_bytes() for k, design in enumerate((grasp, plain))]


def read_design(file: Path) -> None:
    """A design of a helix."""
    design = sr.load_result(file)
    finite(design.tube_length, design.contraction, design.angle)


@cache
def bench_corpus() -> list[bytes]:
    """Two rows and a curve."""
    row = Row("job", "ours", "theirs", "s", 1.0, 0.9, 1.1, "at least", 0.5, 1e-6, None)
    skipped = dataclasses.replace(row, value=None, skipped="not here")
    machine = {"processor": "p", "system": "s", "Python": "3.11"}
    curve = Curve("sizes", "ours", (1, 2), (1e-6, 2e-6))
    return [
        as_json(Results(machine, {"rounds": 5, "jobs": ["job"], "quick": False}, (row, skipped), (curve,), ("n",))).encode()
    ]


def read_bench(file: Path) -> None:
    """Results of the benchmark, and the table that is made of them."""
    from studies.benchmark.results import machine_text, table

    results = read_results(file)
    if "<" in table(results.rows) or len(table(results.rows).splitlines()) != 2 + len(results.rows):
        raise ArithmeticError("a table with more in it than cells")
    machine_text(results)


@cache
def parameter_corpus() -> list[bytes]:
    """In blocks and in braces, quoted and not, with comments; complete, as it is written."""
    small = (
        b"robot: inflatable_arm\nlink_lengths: [0.5, 0.4]  # m\nstiffness: 1.5e2\nmax_moment: null\nrest_up:\n  - 0\n  - -0.1\n"
    )
    flow = b'{robot: "inflatable_arm", radius: 0.05, rgba: [0.1, 0.2, 0.3, 1]}'
    with TemporaryDirectory() as folder:
        robot = sr.PccArm()
        values = dataclasses.asdict(robot)
        whole = write_parameters(Path(folder) / "a.yaml", "pcc_arm", values).read_bytes()
    return [small, flow, whole]


@cache
def parameter_json_corpus() -> list[bytes]:
    """The same as JSON."""
    return [json.dumps({"robot": "inflatable_arm", "link_lengths": [0.5, 0.4], "stiffness": 2e2, "max_moment": None}).encode()]


def read_parameter_file(file: Path) -> None:
    """Parameters, and the robot that they make."""
    values = read_parameters(file).values
    finite(*(item for value in values.values() for item in np.ravel(np.array(value, dtype=object)) if isinstance(item, float)))
    robot = read_robot(file)
    if getattr(robot, "n_joints", 0) > 12_000:
        raise MemoryError("a robot of many thousand joints")


@cache
def environment_corpus() -> list[bytes]:
    """Every kind of obstacle, as it is written, and by hand."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    round_ones = [sr.Cylinder(0.1, 0.5, rotation=turn), sr.Capsule(0.1, 0.5, (1, 2, 3)), sr.Sphere(0.2, (0, 1, 0), name="ball")]
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    all_kinds = sr.Environment([sr.HalfSpace((0, 0, 1), -0.5), sr.Box((1, 2, 3), rotation=turn), *round_ones, sr.Mesh(corners)])
    by_hand = (
        b"# a shelf\nobstacles:\n- kind: box\n  size: [1, 0.5, 2e-2]\n  name: shelf\n- {kind: half_space, normal: [0, 0, 1]}\n"
    )
    return [all_kinds.to_yaml().encode(), by_hand, b"obstacles: []\nself_contact: true\n"]


@cache
def environment_json_corpus() -> list[bytes]:
    """The same as JSON."""
    return [json.dumps(parse_yaml(text.decode(), deepest=6)).encode() for text in environment_corpus()]


def read_environment_file(file: Path) -> None:
    """Obstacles, and their distances from a point."""
    environment = sr.Environment.from_file(file)
    for field, _ in obstacle_fields(environment):
        finite(*field.at_least(np.array([[3.0, 2.0, 1.0]])))


def command_corpus() -> list[bytes]:
    """Lines, and an object."""
    lines = b"# a comment\ntarget 0.9 0.3 0.2\nforce 0 10 -15\ngravity on\nmotors 0.3 0.6 -0.8\ngravity 0 0 -9.81\nreset\n"
    return [
        lines,
        b'{"motors": [0.3, 0.6, -0.8], "force": [0, 10, -15], "gravity": true}',
        b'{"target": [1, 0, 0], "gravity": null}',
    ]


def read_wanted(file: Path) -> None:
    """A file that is watched."""
    wanted = WatchedFile(file, lambda _: None).read(SimpleNamespace(start=START, wanted=START))  # type: ignore[arg-type]
    if wanted is not None:
        finite(wanted.motors, wanted.force, () if wanted.target is None else wanted.target)


def read_typed(file: Path) -> None:
    """The same text as lines that somebody types."""
    wanted = read_commands(file.read_bytes().decode("utf-8", "replace"), START)
    finite(wanted.motors, wanted.force, () if wanted.gravity is None else wanted.gravity)


JOB = {"robot": "<robot/>", "loads": [0.0, 5.0], "seed": 3, "gravity": None}
"""What the blocks of a long job depend on."""
_BLOCK = {"payload": np.array([1.0, np.inf, 2.5]), "reached": np.array([True, False, True])}
_ARRAYS = {name: (array.dtype.type, array.shape) for name, array in _BLOCK.items()}


@cache
def _kept(name: str) -> bytes:
    """A file of a folder with one finished block."""
    with TemporaryDirectory() as folder:
        Checkpoint(folder, JOB).keep(0, _BLOCK)
        return (Path(folder) / name).read_bytes()


def read_case(file: Path) -> None:
    """What a folder of finished blocks says of its job."""
    with TemporaryDirectory() as folder:
        (Path(folder) / CASE).write_bytes(file.read_bytes())
        try:
            Checkpoint(folder, JOB)
        except sr.SoftRobotsError as error:
            if not str(error).isprintable() or len(str(error)) > 3000:
                raise ArithmeticError("an error that is long, or moves the cursor") from error
            raise


def read_block(file: Path) -> None:
    """A finished block; one that is none is computed again."""
    with TemporaryDirectory() as folder:
        (Path(folder) / CASE).write_bytes(_kept(CASE))
        (Path(folder) / "block_000000.npz").write_bytes(file.read_bytes())
        held = Checkpoint(folder, JOB).block(0, _ARRAYS)
    if held is None:
        raise sr.FileFormatError("a block that is computed again")
    if any((held[name].dtype.type, held[name].shape) != kind for name, kind in _ARRAYS.items()) or len(held) != len(_ARRAYS):
        raise ArithmeticError("a block with other arrays than were asked for")


@cache
def results() -> dict[str, Any]:
    """A result of every kind, of a small arm."""
    model = sr.load_model(sr.InflatableArm())
    held = sr.solve_equilibrium(model, (0.3, 0.6, -0.8), (0.0, 10.0, -15.0))
    wristed, down = sr.load_model(sr.InflatableArm(wrist=(0.08, 0.12))), pin.rpy.rpyToMatrix(0.1, 1.2, 0.2)
    poses = [pin.SE3(down, np.array(position)) for position in ((0.7, 0.1, 0.3), (0.9, 0.0, 0.3))]
    path = sr.straight_line(*poses, 1.0, 2)
    grid = TargetGrid((0.6, 0.8), (0.0,), (0.3,))
    angle = np.linspace(0.01, 0.2, 20)
    robot = sr.InflatableArm(stiffness=150.0)
    tips = [[1.17, 0.1, -0.02], [1.15, 0.2, 0.01], [1.1, 0.3, np.nan]]
    rows = sr.Measurements(np.eye(3) * 0.2, force=np.eye(3), tip_position=tips, labels=["a", "b", "c"])
    return {
        "characterisation": inflated_beam.fit_characterisation(
            angle, np.minimum(170.0 * angle, 20.0), pressure=5e4, radius=0.055
        ),
        "vibration_modes": sr.vibration_modes(model, held, servo_stiffness=(900.0, 800.0, 700.0)),
        "equilibrium": held,
        "ik_solution": sr.solve_ik(
            model, (0.9, 0.3, 0.2), (0, 0, -5), environment=sr.Environment([sr.HalfSpace((0, 0, 1), -0.3)])
        ),
        "imposed_displacement": sr.solve_imposed_displacement(model, (0.3, 0.6, -0.8), 0.01, direction=(0, 0, -1)),
        "load_estimate": sr.estimate_load(model, held.q_motors, held.motor_torques, torque_std=0.1),
        "trajectory": sr.follow_trajectory(wristed, path.targets, (0, 0, -5), times=path.times),
        "workspace": sr.sample_workspace(model, 5, force=(0, 0, -5)),
        "workspace_map": map_workspace(model, grid, (0.0, 5.0), backend="python"),
        "branches": sr.post_buckling_branches(model, (0, 0, 0), (-1, 0, 0), max_force=115.0, largest_step=0.5)[:2],
        "motion": sr.simulate(
            model, 0.02, (0.3, 0.6, -0.8), start=held, gravity=(0, 0, -9.81), time_step=0.01, output_step=0.01
        ),
        "motion_batch": sr.compile(model, backend="python").simulations(0.02, [(0.3, 0.6, -0.8)] * 2, time_step=0.01),
        "linear_model": sr.linearize(model, held),
        "measurements": sr.Measurements(
            np.array([[0.1, 0.2], [0.3, 0.4]]), tip_position=[[1.0, 2.0, np.nan], [3.0, 4.0, 5.0]], std=0.1, labels=["a", "b"]
        ),
        "identification": sr.identify(robot, rows, ("stiffness", "base.position.z"), validation="b"),
        "contact_path": sr.follow_contact(
            model,
            (0.3, -0.2, 0.3),
            [(0, 0, -20), (0, 9, -20)],
            environment=sr.Environment([sr.HalfSpace((0, 0, 1), -0.1)]),
            friction=0.3,
        ),
        "cross_validation": sr.CrossValidation(
            {"k": ("stiffness",), "all": ("stiffness", "base.position.x")}, ("a", "b"), np.array([[2.0, 3.0], [1.0, 1.5]]), "m"
        ),
        "helix_design": design_grasp(0.020, 0.080, diameter=0.0331, turns=1.5),
    }


@cache
def result_corpus() -> list[bytes]:
    """A result of every kind, saved."""
    with TemporaryDirectory() as folder:
        return [sr.save_result(result, Path(folder) / f"{kind}.npz").read_bytes() for kind, result in results().items()]


@cache
def result_json_corpus() -> list[bytes]:
    """Some of them as JSON."""
    with TemporaryDirectory() as folder:
        chosen = {kind: results()[kind] for kind in ("equilibrium", "trajectory", "branches")}
        return [sr.save_result(result, Path(folder) / f"{kind}.json").read_bytes() for kind, result in chosen.items()]


def read_result(file: Path) -> None:
    """A saved result."""
    result: Any = sr.load_result(file)
    if isinstance(result, inflated_beam.Characterisation):
        finite(result.stiffness, result.stiffness_std, result.stiffness_interval, result.angle_offset, result.wrinkling_moment)
        return
    if isinstance(result, sr.Motion):
        finite(result.time, result.q_springs, result.velocities, result.tip_position, result.energy.balance)
        return
    if isinstance(result, MotionBatch):
        finite(result.q_springs, result.velocities, result.tip_position)
        return
    if isinstance(result, sr.LinearModel):
        finite(result.A, result.B, result.C, result.D)
        return
    if isinstance(result, WorkspaceMap):
        finite(result.payload, result.q_motors, result.q_springs)
        return
    if isinstance(result, sr.Identification):
        finite(result.solution, result.covariance, result.history.cost, *result.predicted.values())
        return
    if isinstance(result, sr.Measurements):
        finite(result.q_motors, *result.loads.values(), *result.std.values())
        return
    if isinstance(result, sr.CrossValidation):
        finite(result.errors, result.means, result.standard_errors)
        return
    if isinstance(result, HelixDesign):
        finite(result.tube_length, result.contraction, result.angle)
        return
    if isinstance(result, tuple):
        finite(*(branch.forces for branch in result), *(branch.energy for branch in result))
        return
    for held in getattr(result, "equilibria", (getattr(result, "equilibrium", result),)):
        finite(held.q_motors, held.q_springs)


def damaged_archive(data: bytes, rng: np.random.Generator) -> bytes:
    """An archive whose members are damaged and whose sums are right: one array changed, gone, renamed, or of another kind.

    One in four is damaged as bytes, too.
    """
    with np.load(io.BytesIO(data)) as file:
        fields = dict(file)
    name = str(rng.choice(list(fields)))
    with np.errstate(invalid="ignore"):  # infinity as an integer is damage, too
        changed = _CHANGES[rng.integers(len(_CHANGES))](fields[name], rng)
    content = io.BytesIO()
    if changed is None:
        del fields[name]
        fields[str(rng.choice([*fields, "surplus", "../../outside"]))] = np.zeros(2)
    else:
        fields[name] = changed
    np.savez(content, **fields)
    return damaged_bytes(content.getvalue(), rng) if rng.random() < 0.25 else content.getvalue()


def _other_text(array: np.ndarray, rng: np.random.Generator) -> Any:
    if array.dtype.kind != "U" or array.shape:
        return _other_number(array, rng)
    return np.array(damaged_bytes(str(array).encode(), rng).decode("utf-8", "replace").replace("\0", ""))


def _other_number(array: np.ndarray, rng: np.random.Generator) -> Any:
    if array.dtype.kind not in "fiu" or not array.size:
        return np.array(HOSTILE_TEXTS[rng.integers(len(HOSTILE_TEXTS))])
    made = array.astype(float).ravel()
    numbers = [float(word) for word in HOSTILE_NUMBERS if re.fullmatch(r"-?(nan|inf|[0-9.e+-]+)", word) and _is_number(word)]
    made[rng.integers(made.size)] = numbers[rng.integers(len(numbers))]
    return (
        made.reshape(array.shape)
        if array.dtype.kind == "f"
        else np.nan_to_num(made, posinf=1e18, neginf=-1e18).reshape(array.shape)
    )


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


_CHANGES: tuple[Any, ...] = (
    _other_text,
    _other_text,
    _other_number,
    _other_number,
    lambda array, rng: None,
    lambda array, rng: array.ravel()[: rng.integers(array.size + 1)],
    lambda array, rng: np.repeat(array.ravel(), int(2.0 ** rng.uniform(0.0, 12.0))),
    lambda array, rng: array[None],
    lambda array, rng: (
        array.astype([">f8", "c16", "i1", "U3", "?", "f2"][rng.integers(6)]) if array.dtype.kind in "fiu" else array
    ),
    lambda array, rng: np.array([{"a": 1}], dtype=object),
)


READERS: dict[str, tuple[Callable[[], list[bytes]], Damage, Callable[[Path], object], str]] = {
    "waypoints CSV": (waypoint_corpus, damaged_bytes, read_path, ".csv"),
    "actuator CSV": (table_corpus, damaged_bytes, read_table, ".csv"),
    "characterisation CSV": (bending_corpus, damaged_bytes, read_bending, ".csv"),
    "measurements CSV": (measurement_corpus, damaged_bytes, read_measurements, ".csv"),
    "columns YAML": (column_corpus, damaged_bytes, read_column_file, ".yaml"),
    "results NPZ": (result_corpus, damaged_archive, read_result, ".npz"),
    "results JSON": (result_json_corpus, damaged_bytes, read_result, ".json"),
    "design JSON": (design_corpus, damaged_bytes, read_design, ".json"),
    "benchmark JSON": (bench_corpus, damaged_bytes, read_bench, ".json"),
    "parameters YAML": (parameter_corpus, damaged_bytes, read_parameter_file, ".yaml"),
    "parameters JSON": (parameter_json_corpus, damaged_bytes, read_parameter_file, ".json"),
    "environment YAML": (environment_corpus, damaged_bytes, read_environment_file, ".yaml"),
    "environment JSON": (environment_json_corpus, damaged_bytes, read_environment_file, ".json"),
    "checkpoint JSON": (lambda: [_kept(CASE)], damaged_bytes, read_case, ".json"),
    "checkpoint NPZ": (lambda: [_kept("block_000000.npz")], damaged_archive, read_block, ".npz"),
    "watched file": (command_corpus, damaged_bytes, read_wanted, ".txt"),
    "typed lines": (command_corpus, damaged_bytes, read_typed, ".txt"),
}
"""Valid files, how they are damaged, how they are read, and what their names end with, by name of a reader."""
