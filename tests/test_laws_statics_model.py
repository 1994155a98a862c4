"""Laws of models, results and pages: what is put in comes out, in every robot, thread, file and picture."""

from __future__ import annotations

import dataclasses
import math
import pickle
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.export.sidecar import to_json
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import Load
from softrobots.view.meshcat_page.page_commands import RESOLUTION
from tests.support.law_robots import ROBOTS, Case, cases, model, triples
from tests.support.laws import law
from tests.support.oracles import flexible_table
from tests.support.packed_pages import scene_of

# Larger angles look like degrees.
angles = st.tuples(*[st.one_of(st.sampled_from([0.0, math.pi, -math.pi / 2]), st.floats(-7.0, 7.0))] * 3)

# --- Models


@law("SoftModel", "SoftModel.configuration")
@given(motors=angles, springs=st.tuples(*[st.floats(-1.5, 1.5)] * 4))
@settings(max_examples=25)
def test_a_configuration_is_the_papers_table(motors: tuple, springs: tuple) -> None:
    """[Troise 2021] Table 2 with the seven angles in its own order: the pose of the tip to rounding."""
    robot = model("arm")
    assert isinstance(robot, sr.SoftModel)
    data = robot.pinocchio.createData()
    pin.framesForwardKinematics(robot.pinocchio, data, robot.configuration(motors, springs))
    found = data.oMf[robot.pinocchio.getFrameId("tip")]
    table = flexible_table(np.array([motors[0], motors[1], springs[0], springs[1], motors[2], springs[2], springs[3]]))[-1]
    assert np.abs(found.translation - table[:3, 3]).max() < 1e-14
    assert np.abs(found.rotation[:, 0] - table[:3, 0]).max() < 1e-14


@law("SoftModel.embed", "SoftModel.configuration")
@pytest.mark.parametrize("kind", ROBOTS)
@given(seed=st.integers(0, 2**32 - 1), whole=st.integers(-3, 3))
@settings(max_examples=5)
def test_embedding_joints_is_going_there(kind: str, seed: int, whole: int) -> None:
    """From zero, by Pinocchio's own integration; whole turns of a continuous joint lead to the same place."""
    robot, random = model(kind), np.random.default_rng(seed)
    pinocchio = robot.pinocchio
    joints = random.uniform(-1.5, 1.5, pinocchio.nv)
    expected = pin.integrate(pinocchio, pin.neutral(pinocchio), joints)
    assert np.allclose(robot.embed(joints), expected, rtol=0.0, atol=1e-14)
    circles = np.array([joint.nq == 2 for joint in pinocchio.joints[1:]])
    assert np.allclose(robot.embed(joints + 2.0 * math.pi * whole * circles), expected, rtol=0.0, atol=1e-13)
    rest = robot.configuration(robot.relaxed_motors)  # springs may have rest angles
    assert np.array_equal(rest, robot.configuration(robot.relaxed_motors, robot.rest))


@law("SoftModel.checked_motors")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases(), place=st.integers(0, 5), wrong=st.sampled_from([math.nan, math.inf, -math.inf, 1e31]))
@settings(max_examples=4)
def test_motors_are_copied_or_refused(kind: str, case: Case, place: int, wrong: float) -> None:
    robot = model(kind)
    motors = case.motors(robot)
    kept, checked = motors.copy(), robot.checked_motors(motors.tolist())
    assert np.array_equal(checked, motors)
    motors += 1.0
    assert np.array_equal(checked, kept)
    assert np.array_equal(robot.checked_motors(checked), kept)
    if robot.n_motors:
        kept[place % robot.n_motors] = wrong
        with pytest.raises(sr.ParameterError, match="angles"):
            robot.checked_motors(kept, "angles")
    for other in (checked[:-1] if len(checked) else [0.0], [*checked, 0.0]):
        with pytest.raises(sr.ParameterError):
            robot.checked_motors(other)


@law("SoftModel.frame_id")
@pytest.mark.parametrize("kind", ROBOTS)
@given(words=st.text(max_size=12))
@settings(max_examples=5)
def test_every_frame_is_found_by_its_name_and_no_other(kind: str, words: str) -> None:
    robot = model(kind)
    frames = {frame.name for frame in robot.pinocchio.frames}
    assert all(robot.pinocchio.frames[robot.frame_id(name)].name == name for name in frames)
    if words not in frames:
        with pytest.raises(sr.NameNotFound, match="tip" if "tip" in frames else "finger"):
            robot.frame_id(words)


@law("SoftModel.workspace")
@pytest.mark.parametrize("kind", ["arm", "helix"])
@given(several=st.lists(triples, min_size=1, max_size=12))
@settings(max_examples=4)
def test_each_gravity_has_a_workspace_of_its_own(kind: str, several: list) -> None:
    """However many there were, it has the gravity asked for, and none changes the model."""
    robot = model(kind)
    before = robot.pinocchio.gravity.linear.copy()
    plain, _ = robot.workspace(None)
    for gravity in several:
        made, data = robot.workspace(gravity)
        assert np.array_equal(made.gravity.linear, gravity)
        assert robot.workspace(gravity) == (made, data)
    assert robot.workspace(None)[0] is plain
    assert np.array_equal(robot.pinocchio.gravity.linear, before)


@law("SoftModel", "solve_equilibrium")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases())
@settings(max_examples=2)
def test_a_model_that_was_sent_elsewhere_gives_the_same_bytes(kind: str, case: Case) -> None:
    """Pickled, as to another process; it is equal, and not equal to a robot that is stiffer by the least that there is."""
    robot, force = model(kind), case.force(kind)
    other = pickle.loads(pickle.dumps(robot))
    assert isinstance(other, sr.SoftModel)
    assert (other, hash(other)) == (robot, hash(robot))
    one, two = (sr.solve_equilibrium(each, case.motors(robot), force, gravity=case.gravity) for each in (robot, other))
    for name in ("q_springs", "motor_torques", "tangent_stiffness", "tip_position"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    if robot.spring_table:
        name, (stiffness, rest) = next(iter(robot.spring_table.items()))
        table = robot.spring_table | {name: (math.nextafter(stiffness, math.inf), rest)}
        options = {"motors": robot.structure.motor_joints, "tip": robot.tip, "muscles": robot.muscle_input}
        if kind not in ("limp", "slack"):  # the springs of a link with a law of its own must be equal
            assert sr.load_model(robot.urdf, springs=table, **options) != robot


@law("with_points")
@pytest.mark.parametrize("kind", ["arm", "two_hinges", "pcc", "helix_lumped", "mounted", "foreign"])
@given(case=cases(), point=st.lists(st.floats(-0.3, 0.3), min_size=3, max_size=3), share=st.floats(0.3, 0.9))
@settings(max_examples=2)
def test_a_force_at_a_point_is_a_force_and_its_moment_at_the_link(kind: str, case: Case, point: list, share: float) -> None:
    """Where a force at a point of a link is in equilibrium, so is the force at the link with the moment of its lever."""
    robot, force = model(kind), 0.3 * case.force(kind)
    links = [frame.name for frame in robot.pinocchio.frames if frame.type == pin.FrameType.BODY]
    link = links[int(share * len(links))]
    other = sr.with_points(robot, {"touched here": (link, point)})
    assert (other.spring_table, other.motor_joints, other.tip, other.n_springs) == (
        robot.spring_table,
        robot.motor_joints,
        robot.tip,
        robot.n_springs,
    )
    found = sr.solve_equilibrium(other, case.motors(other), force, frame="touched here", gravity=case.gravity)
    pose = frame_placement(robot, found.q, link)
    assert np.allclose(frame_placement(other, found.q, "touched here").translation, pose.act(np.array(point)), atol=1e-14)
    wrench = np.concatenate([force, np.cross(pose.rotation @ point, force)])
    load = Load.of(robot, wrench=wrench, frame=link, gravity=case.gravity)
    state = elastic_state(robot, found.q_motors, found.q_springs, load)
    assert state.error <= found.residual + 1e-13 * state.scale  # rounding of the lever
    assert np.allclose(state.load.motors, found.motor_torques, rtol=0.0, atol=1e-13 * max(state.scale, 1.0))


@pytest.mark.study
@law("with_springs")
@pytest.mark.parametrize(
    "kind", ["arm", "limp", "three_links", "two_hinges", "pcc_lumped", "helix_lumped", "mounted", "foreign"]
)
@given(case=cases(), factor=st.floats(0.5, 2.0), rests=st.lists(st.floats(-0.2, 0.2), min_size=3, max_size=3))
@settings(max_examples=2)
def test_a_model_with_other_springs_is_the_one_loaded_anew(kind: str, case: Case, factor: float, rests: list[float]) -> None:
    """With these springs in the text, or beside it: the same model, equilibrium and files; the first model stays as it is."""
    robot, force = model(kind), case.force(kind)
    before, table = robot.spring_table, dict(robot.spring_table)
    changed = list(table)[: 2 * len(rests)] if kind != "limp" else list(table)  # a link with a plateau has equal springs
    for place, name in enumerate(changed):
        table[name] = (factor * table[name][0], rests[place % len(rests)])
    other = sr.with_springs(robot, {name: table[name] for name in changed})
    assert robot.spring_table == before
    assert other.spring_table == table
    options = {"motors": robot.structure.motor_joints, "tip": robot.tip, "muscles": robot.muscle_input}
    anew = sr.load_model(robot.urdf, springs=table, **options)
    assert (other, hash(other), other.joint_roles, to_json(other)) == (anew, hash(anew), anew.joint_roles, to_json(anew))
    assert (other == robot) == (table == before)
    found = [sr.solve_equilibrium(each, case.motors(each), force, gravity=case.gravity) for each in (other, anew)]
    if kind != "foreign":  # its file has no springs
        text = robot.urdf
        for name in changed:
            tag = rf'(<joint name="{name}".*?<softrobots:spring )[^>]*/>'
            numbers = 'stiffness="{!r}" rest="{!r}"/>'.format(*table[name])
            text = re.sub(tag, rf"\g<1>{numbers}", text, count=1, flags=re.DOTALL)
        written = sr.load_model(text, **options)
        assert set(written.joint_roles.values()) <= {"motor", "spring", "section"}
        found.append(sr.solve_equilibrium(written, case.motors(written), force, gravity=case.gravity))
    for one in found[1:]:
        for name in ("q_springs", "motor_torques", "tangent_stiffness", "tip_position"):
            assert getattr(one, name).tobytes() == getattr(found[0], name).tobytes()
    with TemporaryDirectory() as folder:
        loaded = sr.load_result(sr.save_result(found[0], Path(folder) / "a.npz"))
    assert loaded.model == other
    if kind in ("arm", "three_links"):
        compiled = sr.compile(other, backend="python").equilibrium(case.motors(other), force, gravity=case.gravity)
        assert np.allclose(compiled.q_springs, found[0].q_springs, rtol=0.0, atol=1e-9)


# --- Results


@law("Equilibrium", "SpringGroup")
@pytest.mark.parametrize("kind", ["arm", "limp", "three_links"])
@given(case=cases(0.5))
@settings(max_examples=6)
def test_an_equilibrium_says_of_its_links_what_their_springs_carry(kind: str, case: Case) -> None:
    """Moments are those of both springs together; a link wrinkles from (3) on, with its axial force."""
    robot = model(kind)
    found = sr.solve_equilibrium(robot, case.motors(robot), case.force(kind), gravity=case.gravity)
    assert isinstance(found, sr.Equilibrium)
    assert found.converged
    moments = np.hypot(found.spring_torques[0::2], found.spring_torques[1::2])
    assert np.allclose(found.link_moments, moments, rtol=1e-14)
    limits = []
    for group in robot.spring_groups:
        assert group == sr.SpringGroup(group.springs, group.radius, group.pressure, None, group.max_moment)
        assert group.wrinkling_moment == pytest.approx(math.pi**2 / 4.0 * group.pressure * group.radius**3, rel=1e-14)
        axial = found.link_limits.axial_forces[len(limits)]
        limits.append(math.pi / 4.0 * max(group.pressure * math.pi * group.radius**2 + axial, 0.0) * group.radius)
    beyond = found.link_moments >= limits
    assert found.wrinkled == (bool(beyond.any()) or any(found.saturated))
    assert found.stable == (found.eigenvalues[0] > 1e-9 * robot.stiffness.min()) or kind == "limp"


def parts(result: Any) -> Iterator[tuple[str, Any]]:
    """Every number and array in a result, however deep, by its path; models by what they are equal by."""
    if isinstance(result, sr.SoftModel):
        yield "", (result.urdf, tuple(result.spring_table.items()), result.motor_joints)
    elif isinstance(result, Mapping):
        for key, value in result.items():
            yield from ((f"[{key}]{path}", part) for path, part in parts(value))
    elif isinstance(result, tuple | list) and not all(isinstance(value, int | float | str) for value in result):
        for place, value in enumerate(result):
            yield from ((f"[{place}]{path}", part) for path, part in parts(value))
    elif dataclasses.is_dataclass(result):
        for field in dataclasses.fields(result):
            yield from ((f".{field.name}{path}", part) for path, part in parts(getattr(result, field.name)))
    elif isinstance(result, np.ndarray):
        yield "", (result.shape, result.tolist())  # +0 and -0 are equal
    else:
        yield "", result


@pytest.mark.study
@law("save_result", "load_result", "IkSolution", "ImposedDisplacement", "LoadEstimate", "Trajectory", "Workspace")
@pytest.mark.parametrize("kind", ["arm", "pcc"])
@given(case=cases(0.1), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=2)
def test_every_kind_of_result_comes_back_from_its_file_to_the_last_digit(kind: str, case: Case, seed: int) -> None:
    robot, force, down = model(kind), case.force(kind), case.gravity
    motors = case.motors(robot)
    made = sr.solve_equilibrium(robot, motors, force, gravity=down)
    tips = [made.tip_position, sr.solve_equilibrium(robot, motors + 0.01 * robot.motor_scale, force, gravity=down).tip_position]
    results = {
        sr.Equilibrium: made,
        sr.IkSolution: sr.solve_ik(robot, made.tip_position, force, gravity=down, q_motors0=motors, starts=2),
        sr.Trajectory: sr.follow_trajectory(robot, tips, force, gravity=down, q_motors0=motors),
        sr.Workspace: sr.sample_workspace(robot, 3, force=force, gravity=down, seed=seed),
        sr.ImposedDisplacement: sr.solve_imposed_displacement(robot, motors, 1e-3, direction=(1, 2, 3), gravity=down),
        sr.Motion: sr.simulate(robot, 2e-3, motors, start=made, gravity=down, time_step=1e-3),
    }
    try:
        results[sr.LoadEstimate] = sr.estimate_load(robot, motors, made.motor_torques, gravity=down, torque_std=0.1)
    except sr.LoadNotFound as error:
        results[sr.LoadEstimate] = error.best
    with TemporaryDirectory() as folder:
        for expected, result in results.items():
            assert isinstance(result, expected)
            for suffix in ("npz", "json"):
                again = sr.load_result(sr.save_result(result, Path(folder) / f"{expected.__name__}.{suffix}"))
                assert isinstance(again, expected)
                differing = [path for (path, one), (_, other) in zip(parts(result), parts(again), strict=True) if one != other]
                assert differing == [], expected


# --- Pages


@pytest.fixture(scope="module")
def page() -> Iterator[sr.Viewer]:
    with sr.Viewer(model("arm")) as viewer:
        yield viewer


@pytest.fixture(scope="module")
def growing() -> Iterator[sr.Viewer]:
    with sr.Viewer(model("helix")) as viewer:
        yield viewer


def drawn(text: str) -> list[dict]:
    """The commands of a page."""
    return [umsgpack.unpackb(command) for command in scene_of(text)[1]]


def places(text: str) -> dict[str, np.ndarray]:
    """Where a page draws what: position by path."""
    return {
        told["path"].removeprefix("/meshcat/softrobots/"): np.array(told["matrix"][12:15])
        for told in drawn(text)
        if told["type"] == "set_transform"
    }


@law("Viewer", "Viewer.show", "Viewer.mark", "Viewer.trace", "Viewer.html")
@given(one=cases(), other=cases(), target=triples, dots=st.lists(triples, min_size=1, max_size=4))
@settings(max_examples=3)
def test_a_page_is_what_was_shown_last(page: sr.Viewer, one: Case, other: Case, target: tuple, dots: list) -> None:
    """Whatever was there before: the same bytes; and marks and forces are where they were put, to the resolution of pages."""
    robot = model("arm")
    made = [sr.solve_equilibrium(robot, case.motors(robot), case.force("arm") + [0.0, 0.0, 1.0]) for case in (one, other)]
    page.trace(dots)
    page.mark(None)
    page.show(made[0])
    first = page.html()
    page.show(sr.solve_equilibrium(robot, one.motors(robot)))
    bare = places(page.html())
    assert not any(path.startswith("load") for path in bare)
    page.trace(np.array(dots) + 1.0)
    page.mark(target)
    page.show(made[1])
    assert np.abs(places(page.html())["target"] - target).max() <= RESOLUTION
    assert np.abs(places(page.html())["load/tip"] - made[1].tip_position).max() <= RESOLUTION
    page.trace(dots)
    page.mark(None)
    page.show(made[0])
    assert page.html() == first
    assert isinstance(page, sr.Viewer)
    assert page.serving


@law("view", "Viewer.close", "Viewer.html")
@given(case=cases(0.1))
@settings(max_examples=2)
def test_view_draws_what_the_viewer_would(page: sr.Viewer, case: Case) -> None:
    """A robot with its load where the viewer puts it; closed, the page is gone, and closing again does nothing."""
    robot = model("arm")
    found = sr.solve_equilibrium(robot, case.motors(robot), case.force("arm"))
    viewer = sr.view(robot, found)
    try:
        seen = places(viewer.html())
    finally:
        viewer.close()
    viewer.close()
    assert not viewer.serving
    with pytest.raises(sr.ViewerError, match="closed"):
        viewer.html()
    page.mark(None)
    page.show(found)
    page.look_at(found.tip_position)
    other = places(page.html())
    for path, position in seen.items():
        assert np.array_equal(position, other[path]), path


@law("Viewer.look_at", "Viewer.look_from", "Viewer.write_html", "Viewer.inline")
@given(eye=triples, centre=triples, title=st.text(st.characters(codec="ascii", categories=["L", "N", "P"]), max_size=10))
@settings(max_examples=3)
def test_where_one_looks_from_moves_the_camera_only(page: sr.Viewer, eye: tuple, centre: tuple, title: str) -> None:
    """And what is written to a file, or into a notebook, is the page."""
    page.look_at(np.array(centre))
    before = places(page.html())
    assume(np.linalg.norm(np.subtract(eye, centre)) > 1e-6)
    page.look_from(eye, centre)
    text = page.html(title)
    after = places(text)
    assert {path for path in before if not np.array_equal(before[path], after[path])} <= {"/meshcat/softrobots"}
    with TemporaryDirectory() as folder:
        file = page.write_html(Path(folder) / "page.html", title=title)
        assert file.read_text(encoding="utf-8") == text
        with pytest.raises(sr.OutputExists):
            page.write_html(file)
    assert page.inline(title=title).page == text


@law("Viewer.animate", "Viewer.animate_growth")
@given(seconds=st.floats(0.1, 0.3), case=cases(0.1))
@settings(max_examples=2)
def test_an_animation_lasts_as_long_as_it_was_told(page: sr.Viewer, growing: sr.Viewer, seconds: float, case: Case) -> None:
    """The last key of every track is at that time, to half a frame."""
    robot = model("arm")
    motors = case.motors(robot)
    tips = [sr.solve_equilibrium(robot, motors + step, case.force("arm")).tip_position for step in (0.0, 0.02 * np.ones(3))]
    page.animate(sr.follow_trajectory(robot, tips, case.force("arm"), q_motors0=motors), duration=seconds)
    growing.animate_growth(sr.HelixTube(length=0.3, elastic_sections=3, hinges=4), duration=seconds)
    for shown in (page, growing):
        (told,) = [command for command in drawn(shown.html()) if command["type"] == "set_animation"]
        rate = told["animations"][0]["clip"]["fps"]
        last = max(key["time"] for row in told["animations"] for track in row["clip"]["tracks"] for key in track["keys"])
        assert abs(last / rate - seconds) <= 0.5 / rate + 1e-9
