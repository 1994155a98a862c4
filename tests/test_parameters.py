"""Names of parameters: which numbers of a robot they set, and what is refused."""

from __future__ import annotations

import dataclasses
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.identification.parameter_names import Registry
from softrobots.identification.parameters import ParameterSet
from tests.support.laws import law

ARM = sr.InflatableArm(stiffness=(150.0, 190.0), hinge_offset=(0.03, 0.05))
PCC = sr.PccArm(kind="elastic", muscle_pretension=(8.0, 12.0), elastic_sections=1)
EACH = replace(PCC, muscle_pretension=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
TUBE = sr.HelixTube(length=0.3, elastic_sections=5)


@pytest.mark.parametrize(
    ("robot", "name", "names", "values", "made"),
    [
        (ARM, "stiffness", ["stiffness"], [170.0], {"stiffness": (7.0, 7.0)}),
        (ARM, "link[2].stiffness", ["link[2].stiffness"], [190.0], {"stiffness": (150.0, 7.0)}),
        (ARM, "stiffness[1]", ["stiffness[1]"], [150.0], {"stiffness": (7.0, 190.0)}),
        (ARM, "link[1,2].hinge_offset", ["link[1,2].hinge_offset"], [0.04], {"hinge_offset": (0.07, 0.07)}),
        (ARM, "link[*].stiffness", ["link[1].stiffness", "link[2].stiffness"], [150.0, 190.0], {"stiffness": (7.0, 8.0)}),
        (ARM, "base_mass", ["base_mass"], [2.0], {"base_mass": 7.0}),
        (replace(ARM, payload=0.5), "payload", ["payload"], [0.5], {"payload": (7.0, 0.0, 0.0, 0.0)}),
        (PCC, "offset", ["offset"], [np.pi / 3], {"offset": (0.0, 7.0)}),
        (PCC, "muscle_azimuths[2]", ["muscle_azimuths[2]"], [-2 * np.pi / 3], {"muscle_azimuths": (0.0, 0.7, 2 * np.pi / 3)}),
        (PCC, "segment[2].muscle_pretension", ["segment[2].muscle_pretension"], [12.0], {"muscle_pretension": (8.0, 7.0)}),
        (
            PCC,
            "muscle[4].muscle_pretension",
            ["muscle[4].muscle_pretension"],
            [12.0],
            {"muscle_pretension": (8.0, 8.0, 8.0, 7.0, 12.0, 12.0)},
        ),
        (
            EACH,
            "segment[2].muscle_pretension",
            ["segment[2].muscle_pretension"],
            [5.0],
            {"muscle_pretension": (1.0, 2.0, 3.0, 7.0, 7.0, 7.0)},
        ),
        (TUBE, "diameter", ["diameter"], [0.0331], {"diameter": 0.04}),
    ],
)
def test_a_name_sets_these_numbers_of_the_robot(robot: Any, name: str, names: Any, values: Any, made: dict[str, Any]) -> None:
    found = ParameterSet.of(robot, name)
    assert list(found.names) == names
    np.testing.assert_allclose(found.values, values, rtol=1e-15)  # a mean
    new = [0.7] if 0.7 in np.ravel(list(made.values())) else [0.07] if 0.07 in np.ravel(list(made.values())) else [7.0, 8.0]
    new = [0.04] if robot is TUBE else new[: len(names)]
    changed = found.robot(new)
    assert {field: getattr(changed, field) for field in made} == made
    assert changed == replace(robot, **made)
    assert found.model(new) == sr.load_model(changed)
    assert found.model(new).robot == changed


def test_units_bounds_and_scales_are_those_of_the_fields() -> None:
    found = ParameterSet.of(ARM, ["stiffness", "rest_up", "cap_mass"])
    assert found.units == ("N m/rad", "rad", "kg")
    np.testing.assert_array_equal(found.lower, [0.0, -np.pi / 2, 0.0])
    np.testing.assert_array_equal(found.upper, [np.inf, np.pi / 2, np.inf])
    assert found.logarithmic.tolist() == [True, False, False]  # a mass of zero is a mass
    tube = ParameterSet.of(TUBE, "contraction")
    assert (tube.lower[0], tube.upper[0]) == (0.0, 1.0)


def test_every_field_of_numbers_of_every_robot_is_a_parameter() -> None:
    for robot in (ARM, PCC, sr.TendonArm(elastic_sections=1), TUBE):
        names, present = [], []
        for field in dataclasses.fields(robot):
            value = getattr(robot, field.name)
            numbers = value if isinstance(value, tuple) else (value,)
            if field.name != "rgba" and all(isinstance(number, float) for number in numbers):
                names.append(f"{field.name}[*]" if isinstance(value, tuple) else field.name)
                present += numbers
        found = ParameterSet.of(robot, names)
        assert found.values.tolist() == present
        assert found.robot(found.values) == robot


def test_the_assumed_stiffness_is_where_a_fit_starts() -> None:
    robot = sr.InflatableArm()
    found = ParameterSet.of(robot, "stiffness")
    assert found.values.tolist() == [172.71]  # mean of the paper's Table 3
    assert found.model(found.values).stiffness.tolist() == sr.load_model(robot).stiffness.tolist()


@law("identification.parameters.ParameterSet")
@given(st.tuples(*(st.floats(*ends) for ends in ((50, 900), (50, 900), (0.01, 0.1), (0.2, 0.9), (-0.2, 0.2)))))
@settings(max_examples=10)
def test_a_model_has_the_values_of_its_parameters(values: tuple[float, ...]) -> None:
    first, second, offset, length, rest = values
    names = ("link[*].stiffness", "hinge_offset", "link_lengths[2]", "joint[spring_1_up].rest")
    found = ParameterSet.of(ARM, names)
    wanted = replace(ARM, stiffness=(first, second), hinge_offset=offset, link_lengths=(0.6, length))
    assert found.robot(values) == wanted
    mine = found.model(values)
    other = sr.load_model(wanted, springs={"spring_1_up": (first, rest)})
    assert mine.spring_table == other.spring_table
    assert mine.urdf == other.urdf


def test_pose_of_base_markers_and_offsets_leave_the_model_as_it_is() -> None:
    names = ["base.position", "base.rotation.z", "marker.led.1.offset", "motor[*].offset", "motor[1,3].offset", "stiffness"]
    with pytest.raises(sr.ParameterError, match="no other names"):
        ParameterSet.of(ARM, names, {"led.1": "tip"})
    names[3] = "motor[2].offset"
    found = ParameterSet.of(ARM, names, {"led.1": "tip"})
    values = np.arange(1.0, 11.0)
    assert found.names[:4] == ("base.position.x", "base.position.y", "base.position.z", "base.rotation.z")
    assert found.of_model.tolist() == [False] * 9 + [True]
    position, rotation = found.base(values)
    assert position.tolist() == [1, 2, 3]
    assert rotation.tolist() == [0, 0, 4]
    assert found.marker_offset(values, "led.1").tolist() == [5, 6, 7]
    assert found.motor_offsets(values).tolist() == [9, 8, 9]
    others = ParameterSet.of(ARM, names[:-1], {"led.1": "tip"})
    assert others.model(np.zeros(9)) is others.present


def test_joint_springs_of_a_file_and_of_a_robot() -> None:
    told = {"spring_1_side": (120.0, 0.02)}
    for source in (ARM, ARM.urdf()):
        model = sr.load_model(source, springs=told, motors=["motor_1", "motor_2"], tip="link_2")
        found = ParameterSet.of(model, ("joint[spring_1_side].rest", "joint[spring_2_up,spring_2_side].stiffness"))
        assert found.units == ("rad", "N m/rad")
        assert found.values.tolist() == [0.02, 190.0]
        made = found.model([0.05, 200.0])
        springs = {"spring_1_side": (120.0, 0.05), "spring_2_up": 200.0, "spring_2_side": 200.0}
        assert made == sr.load_model(source, springs=springs, motors=["motor_1", "motor_2"], tip="link_2")
    mixed = ParameterSet.of(sr.load_model(ARM, springs=told, tip="link_2"), ("stiffness", "joint[spring_2_up].rest"))
    assert mixed.model([180.0, 0.1]) == sr.load_model(
        replace(ARM, stiffness=180.0), springs={**told, "spring_2_up": (180.0, 0.1)}, tip="link_2"
    )


def test_a_model_knows_its_robot() -> None:
    model = sr.load_model(ARM)
    assert model.robot is ARM
    assert sr.with_springs(model, {"spring_1_up": 99.0}).robot is ARM
    assert pickle.loads(pickle.dumps(model)).robot == ARM
    assert sr.load_model(ARM.urdf()).robot is None


def test_loads_and_actuators_are_parameters_of_derivatives() -> None:
    found = ParameterSet.of(sr.load_model(PCC), ("force", "wrench", "gravity", "motor[2]"))
    assert found.units == ("N",) * 3 + ("N",) * 3 + ("N m",) * 3 + ("m/s^2",) * 3 + ("m",)
    assert found.names[3] == "wrench.force.x"
    assert ParameterSet.of(ARM, "force.z").places("force")[0][1].place.parts == (2,)


@pytest.mark.parametrize(
    ("robot", "names", "kind", "words"),
    [
        (ARM, "stifness", sr.NameNotFound, r"did you mean 'stiffness'.*joint\[spring_1_up\].rest.*motor\[\*\].offset"),
        (ARM, "segment[1].stiffness", sr.NameNotFound, r"link\[\*\].stiffness"),
        (ARM, "link[3].stiffness", sr.NameNotFound, "available: 1, 2"),
        (ARM, "link[0].stiffness", sr.NameNotFound, "available: 1, 2"),
        (ARM, "link[1,1].stiffness", sr.ParameterError, "named once"),
        (ARM, "base_mass[1]", sr.NameNotFound, "base_mass"),
        (ARM, "motor[4].offset", sr.NameNotFound, "available: 1, 2, 3"),
        (ARM, "marker.tip.offset", sr.NameNotFound, "base.position"),
        (ARM, "base.position.w", sr.NameNotFound, "base.position"),
        (ARM, "joint[spring_9_up].rest", sr.NameNotFound, "spring_1_side"),
        (ARM, "young_modulus", sr.ParameterError, "left out where stiffness|give the robot young_modulus"),
        (sr.InflatableArm(young_modulus=1.4e8), "stiffness", sr.ParameterError, "left out where stiffness"),
        (ARM, "torsion", sr.ParameterError, "no word, truth value or count; it is False"),
        (ARM, "rgba", sr.ParameterError, "real numbers"),
        (PCC, "elastic_sections", sr.ParameterError, "no word, truth value or count; it is 1"),
        (PCC, "muscle_azimuths", sr.ParameterError, r"muscle_azimuths\[\*\]"),
        (ARM, ("stiffness", "link[1].stiffness"), sr.ParameterError, "no other names, as stiffness does"),
        (ARM, ("stiffness", "stiffness"), sr.ParameterError, "there once"),
        (ARM, ("motor[1].offset", "motor[*].offset"), sr.ParameterError, "named once"),
        (ARM, (), sr.ParameterError, "hinge_offset"),
        (ARM.urdf(), "stiffness", sr.NameNotFound, r"joint\[spring_1_up\].stiffness"),  # a robot without a dataclass
        (sr.InflatableArm, "stiffness", sr.ParameterError, "a SoftModel"),
        (sr.load_model(ARM.urdf()), "stiffness", sr.NameNotFound, r"joint\[spring_1_up\].stiffness"),
    ],
)
def test_what_is_no_parameter_is_refused(robot: Any, names: Any, kind: type[Exception], words: str) -> None:
    with pytest.raises(kind, match=words):
        ParameterSet.of(robot, names)


def test_a_value_out_of_bounds_is_refused_by_the_robot() -> None:
    found = ParameterSet.of(ARM, "hinge_offset")
    for value in (-0.1, 0.61):
        with pytest.raises(sr.ParameterError, match="hinge_offset"):
            found.model([value])


@pytest.mark.parametrize("robot", [sr.InflatableArm(), PCC, TUBE])
def test_every_name_that_is_listed_is_accepted(robot: Any) -> None:
    """Also of fields whose numbers in force are told by others, and of robots without actuators."""
    model = sr.load_model(robot)
    names = Registry(robot, model, {}).names()
    assert len(names) > 10
    for name in names:
        assert ParameterSet.of(model, name).names
