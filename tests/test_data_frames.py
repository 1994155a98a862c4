"""Results as pandas tables: the columns and numbers of their CSV files, and measurements that come back from them."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from tests.support.hostile_data import results

Tool = Callable[[str], ModuleType]


@cache
def paper_arm() -> sr.SoftModel:
    return sr.load_model(sr.InflatableArm())


def motion() -> sr.Motion:
    return sr.simulate(paper_arm(), 0.05, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY, time_step=0.005)


def batch() -> Any:
    return sr.compile(paper_arm(), backend="python").equilibria([(0.3, 0.6, -0.8), (0.1, np.nan, 0.2)], [(0, 0, -5), (1, 2, 3)])


def motions() -> Any:
    compiled = sr.compile(paper_arm(), backend="python")
    return compiled.simulations(0.01, [(0.3, 0.6, -0.8), (0.1, 0.2, 0.3)], time_step=0.005, output_step=0.005)


def measured(labels: Any = ("a", "b", "c")) -> sr.Measurements:
    places = np.array([(0.9, 0.1, 0.2), (np.nan, np.nan, np.nan), (0.8, 0.3, 0.1)])
    return sr.Measurements(
        np.arange(9.0).reshape(3, 3) / 7.0,
        gravity=sr.EARTH_GRAVITY,
        mass=[0.1, 0.2, 0.3],
        positions={"tip": places},
        poses={"ball": np.tile(np.eye(4), (3, 1, 1))},
        std={"positions.tip": 1e-3, "poses.ball": (1e-3, 1e-2)},
        labels=labels,
        mask=[True, False, True],
    )


RESULTS: dict[str, Callable[[], Any]] = {
    "motion": motion,
    "modes": lambda: sr.vibration_modes(paper_arm(), sr.solve_equilibrium(paper_arm(), (0.3, 0.6, -0.8))),
    "equilibrium": lambda: sr.solve_equilibrium(paper_arm(), (0.3, 0.6, -0.8), (0, 10, -15)),
    "solution": lambda: sr.solve_ik(paper_arm(), (0.9, 0.2, 0.3), (0, 0, -5)),
    "estimate": lambda: sr.estimate_load(paper_arm(), (0.3, 0.6, -0.8), (1.0, -2.0, 3.0)),
    "displacement": lambda: results()["imposed_displacement"],
    "branches": lambda: results()["branches"],
    "branch": lambda: results()["branches"][0],
    "map": lambda: results()["workspace_map"],
    "motions": motions,
    "workspace": lambda: sr.sample_workspace(paper_arm(), 5),
    "measurements": measured,
    "batch": batch,
}


@pytest.mark.study
@pytest.mark.parametrize("name", list(RESULTS))
def test_a_table_is_the_csv_file_as_pandas_reads_it(tmp_path: Path, tool: Tool, name: str) -> None:
    pandas, result = tool("pandas"), RESULTS[name]()
    frame = sr.to_dataframe(result)
    file = sr.save_csv(result, tmp_path / "table.csv")
    again = pandas.read_csv(
        io.StringIO(file.read_text()), comment="#", dtype=str
    )  # its own numbers lack digits before pandas 3
    assert list(frame) == list(again)
    for column in frame:
        words = frame[column].dtype.kind not in "fiu"
        read = again[column].to_numpy() if words else again[column].astype(float)
        np.testing.assert_array_equal(frame[column].to_numpy(), read)


def test_columns_have_the_numbers_of_the_result_and_their_units(tool: Tool) -> None:
    tool("pandas")
    space = sr.sample_workspace(paper_arm(), 5)
    frame = sr.to_dataframe(space)
    np.testing.assert_array_equal(frame[[f"tip {axis} [m]" for axis in "xyz"]].to_numpy(), space.tip_positions)
    np.testing.assert_array_equal(frame["motor_2 [rad]"], space.q_motors[:, 1])
    many = batch()
    frame = sr.to_dataframe(many)
    assert frame["status"].tolist() == many.status.tolist()
    np.testing.assert_array_equal(frame[[f"spring {number} [rad or m]" for number in range(1, 5)]], many.q_springs)
    np.testing.assert_array_equal(frame["residual [N m]"], many.residual)
    moved = motions()
    frame = sr.to_dataframe(moved)
    assert len(frame) == len(moved.status) * len(moved.time)
    last = frame[frame["case"] == 1].iloc[-1]
    assert last["time [s]"] == moved.time[-1]
    assert last[[f"tip {axis} [m]" for axis in "xyz"]].tolist() == moved.tip_position[1, -1].tolist()
    assert last["spring velocity 2 [rad/s or m/s]"] == moved.velocities[1, -1, 1]


@pytest.mark.study
def test_a_solve_is_one_row_and_what_has_several_has_one_each(tool: Tool) -> None:
    tool("pandas")
    held = RESULTS["equilibrium"]()
    (row,) = sr.to_dataframe(held).to_dict("records")
    assert [row[f"{name} [rad]"] for name in held.model.actuator_names] == held.q_motors.tolist()
    assert [row[f"{name} load [N m]"] for name in held.model.actuator_names] == held.motor_torques.tolist()
    assert (row["tip z [m]"], row["stable"]) == (held.tip_position[2], 1)
    (row,) = sr.to_dataframe(RESULTS["solution"]()).to_dict("records")
    assert (row["target x [m]"], row["target y [m]"], row["target z [m]"]) == (0.9, 0.2, 0.3)
    (row,), found = sr.to_dataframe(RESULTS["estimate"]()).to_dict("records"), RESULTS["estimate"]()
    assert [row[f"force {axis} [N]"] for axis in "xyz"] == found.force.tolist()
    branches = RESULTS["branches"]()
    frame = sr.to_dataframe(branches)
    for branch in branches:
        rows = frame[frame["branch"] == branch.label]
        assert rows["force [N]"].tolist() == branch.forces.tolist()
        assert rows["tip x [m]"].tolist() == [one.tip_position[0] for one in branch.equilibria]
    space = RESULTS["map"]()
    frame = sr.to_dataframe(space)
    for number, place in enumerate(np.ndindex(*space.reached.shape)):
        target, row = (space.grid.x[place[0]], space.grid.y[place[1]], space.grid.z[place[2]]), frame.iloc[number]
        assert tuple(row[[f"target {axis} [m]" for axis in "xyz"]]) == target
        assert (row["load [N]"], row["reached"]) == (space.loads[place[3]], space.reached[place])
        assert row["required pressure [Pa]"] == space.required_pressure[place]


@pytest.mark.parametrize("labels", [("a", "b", "c"), None])
def test_measurements_come_back_from_their_table(tool: Tool, labels: Any) -> None:
    """Also after rows were chosen and columns of the user's own added."""
    tool("pandas")
    rows = measured(labels)
    frame = sr.to_dataframe(rows)
    frame["note"] = "mine"
    again, some = sr.Measurements.from_dataframe(frame), sr.Measurements.from_dataframe(frame.iloc[1:])
    for one, other in ((again, rows), (some, rows[1:])):
        np.testing.assert_array_equal(one.q_motors, other.q_motors)
        assert one.labels == other.labels
        np.testing.assert_array_equal(one.mask, other.mask)
        for group in ("loads", "measured", "std"):
            assert list(getattr(one, group)) == list(getattr(other, group))
            for key, values in getattr(other, group).items():
                np.testing.assert_array_equal(getattr(one, group)[key], values)


def test_what_is_no_table_and_a_missing_package_are_told(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    pandas = tool("pandas")
    with pytest.raises(sr.ParameterError, match=r"Trajectory.*Workspace.*Measurements"):
        sr.to_dataframe(paper_arm())
    with pytest.raises(sr.ParameterError, match="a mapping, because the table is not one that to_dataframe made"):
        sr.Measurements.from_dataframe(pandas.DataFrame({"a": [1.0]}))
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(sr.MissingDependency, match=r"softrobots\[pandas\]"):
        sr.to_dataframe(measured())
