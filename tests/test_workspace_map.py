"""Maps of reach, payload and required pressure: against Pinocchio, closed forms, and themselves on a cluster that breaks."""

from __future__ import annotations

import builtins
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots import inflated_beam
from softrobots.compiled.sweeps import TargetGrid, WorkspaceMap, arm_solver, map_workspace, mapping, scheduling
from softrobots.compiled.sweeps.scheduling import run_blocks
from softrobots.view.figures import workspaces
from tests.support.laws import law
from tests.support.load_cases import fingerprint
from tests.support.scripts import run_script
from tests.support.tables import each_row

DOWN = np.array([0.0, 0.0, -1.0])
LOADS = (0.0, 8.0, 16.0, 24.0, 32.0, 40.0)


def few(model: sr.SoftModel, x: Any, z: Any, loads: Any = LOADS, **options: Any) -> WorkspaceMap:
    return map_workspace(model, TargetGrid(x, (0.0,), z), loads, backend="python", **options)


@pytest.fixture(scope="module")
def weighed(arm: sr.SoftModel) -> WorkspaceMap:
    """A coarse map of the arm under its own weight."""
    return few(arm, (0.15, 0.5, 0.85, 1.1, 1.18), (-1.0, -0.4, 0.1, 0.7), gravity=sr.EARTH_GRAVITY)


def needed(equilibrium: sr.Equilibrium) -> float:
    """Pressure at which no link of an equilibrium on Pinocchio wrinkles, axial forces neglected as by maps [Pa]."""
    moments = zip(equilibrium.link_moments, equilibrium.model.spring_groups, strict=True)
    return max(inflated_beam.required_pressure(moment, group.radius) for moment, group in moments)


def two_elbows(model: sr.SoftModel, target: Any, force: Any, gravity: Any) -> list[float]:
    """Pressures that both elbows need, by the inverse kinematics on Pinocchio."""
    return [needed(sr.solve_ik(model, target, force, gravity=gravity, elbow=side).equilibrium) for side in ("up", "down")]


@pytest.mark.study
def test_a_map_says_what_pinocchio_says(arm: sr.SoftModel, weighed: WorkspaceMap) -> None:
    grid, tried = weighed.grid, 0
    for place in np.argwhere(weighed.reached):
        x, y, z, level = place
        if (x + z + level) % 3:
            continue
        tried += 1
        force, target = weighed.loads[level] * DOWN, (grid.x[x], grid.y[y], grid.z[z])
        there = sr.solve_equilibrium(arm, weighed.q_motors[tuple(place)], force, gravity=sr.EARTH_GRAVITY)
        assert there.stable
        assert there.within_limits
        assert np.linalg.norm(there.tip_position - target) <= 1.01e-9  # the tolerance of the map
        # The tip is within 1e-9 m, so the pressure is within 1e-9 m * 40 N / (4.1e-4 m^3) = 1e-4 Pa.
        assert needed(there) == pytest.approx(weighed.required_pressure[tuple(place)], rel=1e-9, abs=1e-3)
        assert (needed(there) > max(group.pressure for group in arm.spring_groups)) == weighed.wrinkled[tuple(place)]
    assert tried > 20


@pytest.mark.study
@law("compiled.sweeps.map_workspace", "compiled.sweeps.WorkspaceMap")
@settings(max_examples=5)
@given(st.floats(0.1, 1.3), st.floats(-1.2, 1.2), st.floats(0.0, 60.0))
def test_what_a_map_says_of_a_target_holds(arm: sr.SoftModel, x: float, z: float, load: float) -> None:
    """Reached: an equilibrium on Pinocchio has the tip there. Not reached: Pinocchio's solver does not get there."""
    found: WorkspaceMap = map_workspace(arm, TargetGrid((x,), (0.0,), (z,)), (0.0, load + 1.0), backend="python")
    for level, weight in enumerate(found.loads):
        place = (0, 0, 0, level)
        if found.reached[place]:
            there = sr.solve_equilibrium(arm, found.q_motors[place], weight * DOWN)
            assert np.linalg.norm(there.tip_position - (x, 0.0, z)) <= 1.01e-9
            assert needed(there) == pytest.approx(found.required_pressure[place], rel=1e-9, abs=1e-3)
        else:
            assert np.isinf(found.required_pressure[place])
            with pytest.raises(sr.TargetUnreachable):
                sr.solve_ik(arm, (x, 0.0, z), weight * DOWN)
    unloaded = 0.05 < np.hypot(x, z) < 1.15  # well within the ring of the arm, whose links are 0.59 m long
    assert found.reached[0, 0, 0, 0] or not unloaded


@pytest.mark.study
def test_the_posture_is_the_better_elbow(arm: sr.SoftModel, weighed: WorkspaceMap) -> None:
    for x, z, level in ((1, 1, 2), (0, 2, 3), (2, 3, 1)):
        target = (weighed.grid.x[x], 0.0, weighed.grid.z[z])
        both = two_elbows(arm, target, weighed.loads[level] * DOWN, sr.EARTH_GRAVITY)
        assert weighed.required_pressure[x, 0, z, level] == pytest.approx(min(both), rel=1e-7)
        assert abs(both[0] - both[1]) > 1.0  # [Pa]: the elbows do differ


@pytest.mark.study
def test_at_the_payload_the_required_pressure_is_that_of_the_arm(arm: sr.SoftModel, weighed: WorkspaceMap) -> None:
    assert weighed.payload[0].max() == 40.0  # near the axis all loads are carried
    for x, z in ((2, 1), (3, 2)):
        payload = float(weighed.payload[x, 0, z])
        level = int(np.searchsorted(weighed.loads, payload))
        below, above = weighed.required_pressure[x, 0, z, level - 1 : level + 1]
        assert below < 50e3 < above
        both = two_elbows(arm, (weighed.grid.x[x], 0.0, weighed.grid.z[z]), payload * DOWN, sr.EARTH_GRAVITY)
        assert min(both) == pytest.approx(50e3, rel=1e-7)  # 1e-3 Pa is asked for


def planar_postures(target: tuple[float, float], lengths: tuple[float, float]) -> list[tuple[float, float]]:
    """Shoulder and elbow angle of a rigid planar arm, both elbows; empty out of reach."""
    first, second = lengths
    cosine = (target[0] ** 2 + target[1] ** 2 - first**2 - second**2) / (2.0 * first * second)
    if abs(cosine) > 1.0:
        return []
    elbows = (np.arccos(cosine), -np.arccos(cosine))
    towards = np.arctan2(target[1], target[0])
    return [(towards - np.arctan2(second * np.sin(e), first + second * np.cos(e)), e) for e in elbows]


@pytest.mark.study
def test_a_stiff_arm_reaches_the_ring_and_carries_what_statics_says() -> None:
    """Closed form: the springs do not move, the moment is the force times the horizontal distance from the spring."""
    lengths, hinge = (0.7, 0.4), 0.05
    stiff = sr.load_model(sr.InflatableArm(link_lengths=lengths, stiffness=1e8, hinge_offset=hinge))
    grid = TargetGrid.plane(1.15, 9)
    made = map_workspace(stiff, grid, LOADS, backend="python")
    limit = inflated_beam.wrinkling_moment(50e3, 0.055)
    for x, r in enumerate(grid.x):
        for z, height in enumerate(grid.z):
            postures = planar_postures((r, height), lengths)
            assert (made.reached[x, 0, z] == bool(postures)).all()
            assert bool(postures) == (0.3 < np.hypot(r, height) < 1.1)
            arms = [
                max(abs(r - hinge * np.cos(a)), abs(r - lengths[0] * np.cos(a) - hinge * np.cos(a + e))) for a, e in postures
            ]
            carried = min(limit / min(arms), 40.0) if arms else 0.0
            assert made.payload[x, 0, z] == pytest.approx(carried, rel=1e-5)  # springs turn by 20 N m / 1e8 N m/rad


@pytest.mark.study
def test_limited_motors_reach_what_their_limits_leave() -> None:
    """Closed form: elbow and shoulder within a right angle, motor 1 too: behind the base only by leaning over the back."""
    held = sr.load_model(sr.InflatableArm(motor_limit=np.pi / 2))
    made = few(held, np.linspace(-1.1, 1.1, 8), np.linspace(-1.15, 1.15, 8), (0.0,))
    expected = [
        [any(max(map(abs, both)) <= np.pi / 2 for both in planar_postures((x, z), (0.6, 0.6))) for z in made.grid.z]
        for x in made.grid.x
    ]
    assert made.reached[:, 0, :, 0].tolist() == expected
    assert 0 < made.reached[:4].sum() < made.reached[4:].sum()


@pytest.mark.study
def test_maps_have_the_symmetries_of_the_arm(arm: sr.SoftModel) -> None:
    x, z = (-0.9, -0.4, 0.4, 0.9), (-0.6, -0.2, 0.2, 0.6)
    down = few(arm, x, z)
    up = few(arm, x, z, direction=(0.0, 0.0, 1.0))
    # Both sides of a mirror are searched from starts of their own, to 1e-9 m: 1e-3 Pa in the pressure, 1e-6 N in the payload.
    for name, close in (("required_pressure", 1e-2), ("payload", 1e-5)):
        one, other = getattr(down, name), getattr(up, name)
        assert np.allclose(one, one[::-1], rtol=0.0, atol=close)  # turned by half a turn about the vertical
        assert np.allclose(one, other[:, :, ::-1], rtol=0.0, atol=close)  # turned upside down
    sideways = map_workspace(arm, TargetGrid((0.0,), (0.4, 0.9), z), LOADS, backend="python")
    assert np.allclose(sideways.payload[0], down.payload[2:, 0], rtol=0.0, atol=1e-5)


def test_nothing_out_of_reach_is_reached(arm: sr.SoftModel) -> None:
    made = few(arm, (1.3, 5.0), (0.0, 4.0))
    assert not made.reached.any()
    assert np.isinf(made.required_pressure).all()
    assert not made.payload.any()


@pytest.mark.study
def test_loads_in_any_direction_bend_sideways(arm: sr.SoftModel) -> None:
    made = few(arm, (0.7,), (0.3,), (10.0,), direction=(0.0, 3.0, -4.0))
    place = (0, 0, 0, 0)
    there = sr.solve_equilibrium(arm, made.q_motors[place], (0.0, 6.0, -8.0))
    assert np.linalg.norm(there.tip_position - (0.7, 0.0, 0.3)) <= 1.01e-9
    assert abs(there.q_motors[0]) > 0.01
    assert made.required_pressure[place] == pytest.approx(needed(there), rel=1e-7)


def test_a_map_is_saved_and_loaded_whole(weighed: WorkspaceMap, tmp_path: Path) -> None:
    files = [sr.save_result(weighed, tmp_path / name) for name in ("one.npz", "two.npz")]
    assert files[0].read_bytes() == files[1].read_bytes()
    again = sr.load_result(files[0])
    assert again.model == weighed.model
    assert again.gravity == weighed.gravity
    assert fingerprint(again) == fingerprint(weighed)
    with pytest.raises(ValueError, match="read-only"):
        again.payload[0] = 1.0
    with pytest.raises(sr.OutputExists):
        sr.save_result(weighed, files[0])


@each_row(
    ("name", "change", "message"),
    [
        ("q_springs", lambda a: a + 1e-6, "in balance"),
        ("q_motors", lambda a: a + [1e-6, 0.0, 0.0], "the tip is at the target"),
        ("required_pressure", lambda a: a * 1.001, "required_pressure"),
        ("required_pressure", lambda a: np.zeros_like(a), "infinite where not reached"),
        ("reached", lambda a: a.astype(int), "truth values"),
        ("payload", lambda a: a + 1.0, "between 0 and 40"),
        ("payload", lambda a: a[:1], "shape"),
        ("loads", lambda a: a[::-1], "increasing"),
        ("tolerance", lambda a: -a, "positive"),
    ],
)
def test_a_changed_file_is_refused(
    name: str, change: Callable[[Any], Any], message: str, weighed: WorkspaceMap, tmp_path: Path
) -> None:
    file = sr.save_result(weighed, tmp_path / "map.npz")
    with np.load(file) as fields:
        held = dict(fields)
    held[name] = change(held[name])
    np.savez(tmp_path / "changed.npz", **held)
    with pytest.raises(sr.FileFormatError, match=message):
        sr.load_result(tmp_path / "changed.npz")


@each_row(
    ("options", "message"),
    [
        ({"loads": (0.0, 5.0, 5.0)}, "loads must be increasing"),
        ({"loads": (-1.0, 5.0)}, "loads must be zero or positive"),
        ({"loads": ()}, "number of loads"),
        ({"loads": (0.0, np.inf)}, "loads"),
        ({"direction": (0.0, 0.0, 0.0)}, "direction"),
        ({"gravity": (0.0, 9.81)}, "gravity"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"threads": 0}, "threads"),
        ({"grid": [(0.5, 0.0, 0.0)]}, "a TargetGrid"),
        ({"model": "arm.urdf"}, "a SoftModel"),
        ({"backend": "fortran"}, "backend"),
        ({"grid": TargetGrid.plane(1.2, 2000)}, r"number of cases = 48000000.* at most 16\d{6}$"),  # more than a file holds
    ],
)
def test_bad_input_is_refused(options: dict[str, Any], message: str, arm: sr.SoftModel) -> None:
    given = {"model": arm, "grid": TargetGrid.plane(1.2, 2), "loads": LOADS} | options
    with pytest.raises(sr.ParameterError, match=message):
        map_workspace(**given)


def test_other_robots_are_refused(odd_arm: sr.SoftModel, arm: sr.SoftModel) -> None:
    grid = TargetGrid.plane(1.2, 2)
    with pytest.raises(sr.ParameterError, match="three motors"):
        map_workspace(odd_arm, grid, LOADS)
    plain = sr.load_model(arm.urdf, springs=dict.fromkeys(arm.spring_joints) | {"spring_1_up": 100.0}, motors=arm.motor_joints)
    with pytest.raises(sr.ParameterError, match="inflated links"):
        map_workspace(plain, grid, LOADS)
    sideways = arm.urdf.replace('<axis xyz="0.0 0.0 1.0"/>', '<axis xyz="1.0 0.0 0.0"/>', 1)
    assert sideways != arm.urdf
    with pytest.raises(sr.ParameterError, match="about the vertical"):
        map_workspace(sr.load_model(sideways), grid, LOADS)


@pytest.mark.parametrize(("x", "message"), [((), "number of coordinates x"), ((0.2, 0.1), "x must be increasing"), (0.3, "x")])
def test_a_grid_needs_increasing_coordinates(x: Any, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        TargetGrid(x, (0.0,), (0.0,))


def test_grids_cover_their_plane_and_box() -> None:
    plane, box = TargetGrid.plane(1.2, 3), TargetGrid.box(1.2, 2)
    assert plane.x.tolist() == pytest.approx([0.2, 0.6, 1.0])
    assert plane.z.tolist() == pytest.approx([-1.0, -0.6, -0.2, 0.2, 0.6, 1.0])
    assert plane.targets.shape == (18, 3)
    assert plane.targets[7].tolist() == pytest.approx([0.6, 0.0, -0.6])
    assert box.shape == (4, 4, 4)
    assert np.array_equal(box.x, -box.x[::-1])
    for make in (TargetGrid.plane, TargetGrid.box):
        with pytest.raises(sr.ParameterError, match="cells"):
            make(1.2, 0)
        with pytest.raises(sr.ParameterError, match="reach"):
            make(-1.0, 3)


GRID = TargetGrid.plane(1.2, 6)  # 72 targets


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapping, "BLOCK", 3)  # 24 blocks


@pytest.mark.study
@pytest.mark.usefixtures("small_blocks")
def test_threads_give_the_same_bytes(arm: sr.SoftModel) -> None:
    one, two = (map_workspace(arm, GRID, LOADS[::2], backend="python", threads=count) for count in (1, 2))
    assert fingerprint(one) == fingerprint(two)
    assert 0 < one.reached.sum() < one.reached.size


@pytest.mark.study
@pytest.mark.usefixtures("small_blocks")
def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(
    arm: sr.SoftModel, tool: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    distributed = tool("distributed")
    here = map_workspace(arm, GRID, LOADS[::2], backend="python")
    killed: list[tuple[int, int]] = []  # process, and blocks that it had been given
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:

        def kill_half_way(answers: Iterable[Any], *_: Any, **__: Any) -> Iterator[Any]:
            for number, answer in enumerate(answers):
                busy = max(cluster.scheduler.workers.values(), key=lambda worker: len(worker.processing))
                if number >= 2 and not killed and busy.processing:  # nearly all of them are still to come
                    killed.append((cluster.workers[busy.name].process.pid, len(busy.processing)))
                    os.kill(killed[0][0], signal.SIGKILL)
                yield answer

        monkeypatch.setattr(mapping, "with_progress", kill_half_way)
        options = {"backend": "python", "scheduler": cluster.scheduler_address, "checkpoint": tmp_path}
        there = map_workspace(arm, GRID, LOADS[::2], **options)
        (tmp_path / "block_000005.npz").unlink()
        again = map_workspace(arm, GRID, LOADS[::2], **options)  # only that one
    assert len(killed) == 1
    assert killed[0][1] > 0
    assert fingerprint(there) == fingerprint(again) == fingerprint(here)
    assert len(list(tmp_path.glob("block_*.npz"))) == 24


@pytest.mark.study
def test_a_scheduler_that_does_not_answer_is_named(tool: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> None:
    tool("distributed")
    monkeypatch.setattr(scheduling, "_PATIENCE", 0.3)
    with pytest.raises(sr.ClusterError, match=r"tcp://127\.0\.0\.1:9 "):
        list(run_blocks(abs, [1], scheduler="tcp://127.0.0.1:9"))


def test_without_distributed_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    original = builtins.__import__

    def without(name: str, *rest: Any, **options: Any) -> Any:
        if name.startswith("distributed"):
            raise ImportError(name)
        return original(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(sr.MissingDependency, match=r"softrobots\[cluster\]"):
        list(run_blocks(abs, [1], scheduler="tcp://127.0.0.1:8786"))


@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_in_a_block_comes_out(threads: int) -> None:
    def work(number: int) -> int:
        if number == 2:
            raise sr.ParameterError("number", number, "another")
        return number

    with pytest.raises(sr.ParameterError, match="number must be another"):
        list(run_blocks(work, range(5), threads=threads))


def test_another_version_of_softrobots_is_refused(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arm_solver, "__version__", "0.0.0")
    case = mapping.SweepCase.of(arm, DOWN, np.array(LOADS), gravity=None, tolerance=1e-9, backend="python", version="9.9.9")
    with pytest.raises(sr.ParameterError, match=r"version of softrobots = '0\.0\.0'"):
        mapping.solve_block(case, GRID.targets[:1])


def test_the_picture_shows_the_map(weighed: WorkspaceMap, tool: Callable[[str], ModuleType]) -> None:
    tool("matplotlib")
    figure = workspaces.workspace_maps(weighed, load=17.0)
    reach, payload, pressure, _, *bars = figure.axes
    assert "16 N" in reach.get_title()
    shown = reach.collections[0].get_array().reshape(4, 5).T
    assert shown.tolist() == workspaces.outcome(weighed, 2)[:, 0].tolist()
    assert {workspaces.NOT_REACHED, workspaces.CARRIED, workspaces.WRINKLED} == set(np.unique(shown).tolist())
    drawn = payload.collections[0].get_array().reshape(4, 5).T
    assert np.array_equal(np.isnan(drawn), ~weighed.reached[:, 0, :, 0])
    assert np.nanmax(np.abs(drawn - weighed.payload[:, 0])) == 0.0
    kilopascal = pressure.collections[0].get_array().reshape(4, 5).T
    kept = weighed.reached[:, 0, :, 2]
    assert np.allclose(kilopascal[kept], weighed.required_pressure[:, 0, :, 2][kept] / 1e3, rtol=1e-12)
    assert [bar.get_ylabel().rsplit(" ", 1)[1] for bar in bars] == ["[N]", "[kPa]"]
    with pytest.raises(sr.ParameterError, match="a WorkspaceMap"):
        workspaces.workspace_maps(None)
    with pytest.raises(sr.ParameterError, match="load"):
        workspaces.workspace_maps(weighed, load=np.nan)


@pytest.mark.study
def test_the_script_writes_map_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "map.npz"
    arguments = ["--cells", "4", "--loads", "3", "--max-load", "30", "--gravity", "--backend", "python", "--output", str(file)]
    assert run_script("workspace_map", arguments) == 0
    out, err = capsys.readouterr()
    assert "96 cases (32 targets, 3 loads)" in out
    assert "1/1" in err
    assert {path.name for path in tmp_path.iterdir()} == {"map.npz", "map.png"}
    made = sr.load_result(file)
    assert made.loads.tolist() == [0.0, 15.0, 30.0]
    assert made.gravity == sr.EARTH_GRAVITY
    assert f"{int(made.reached[..., 0].sum())}" in out
    before = file.read_bytes()
    assert run_script("workspace_map", arguments) == 2
    assert "exists" in capsys.readouterr().err
    assert run_script("workspace_map", [*arguments, "--overwrite", "--no-plots", "--threads", "2"]) == 0
    assert file.read_bytes() == before


@pytest.mark.study
@each_row(
    ("arguments", "message"),
    [
        (["--cells", "0"], "cells"),
        (["--loads", "0"], "--loads"),
        (["--max-load", "-1"], "--max-load"),
        (["--direction", "0", "0", "0"], "direction"),
        (["--gravity", "1"], "gravity"),
        (["--pressure", "-1"], "pressure"),
        (["--motor-limit", "0"], "motor_limit"),
        (["--threads", "0"], "threads"),
        (["--shown-load", "nan"], "shown"),
        (["--output", "map.png"], "ends in .npz"),
        (["--docs", "--no-plots"], "--docs"),
        (["--scheduler", "nowhere"], "scheduler = 'nowhere'"),
    ],
)
def test_the_script_refuses_bad_options(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_script("workspace_map", ["--cells", "2", "--loads", "2", "--backend", "python", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.rglob("*.*")) == []
