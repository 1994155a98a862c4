"""The PCC arm where it hurts: loads beyond its range, hostile starts and files, limits of lengths and tensions, threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.loads import Load
from tests.support.oracles import central_difference

LENGTHS = np.array((0.50, 0.53, 0.55, 0.54, 0.51, 0.52))


@pytest.fixture(scope="module")
def pcc() -> sr.SoftModel:
    return sr.load_model(sr.PccArm())


@pytest.fixture(scope="module")
def pulled() -> sr.SoftModel:
    return sr.load_model(sr.PccArm(), muscles="forces")


def test_a_load_beyond_the_range_is_an_error_that_names_the_section(pcc: sr.SoftModel, tmp_path: Path) -> None:
    """One section a segment under a load that twists it by half a turn; and a load of 14 kN."""
    pure = sr.load_model(sr.PccArm(elastic_sections=1))
    lengths = [0.512, 0.4664, 0.5714, 0.5068, 0.58, 0.5077]
    for model, motors, force in ((pure, lengths, (29.612, 26.8231, -27.9203)), (pcc, pcc.relaxed_motors, (1e4, 1e4, 0))):
        with pytest.raises(sr.EquilibriumNotFound, match=r"section_\d_\d.*end of its range.*more sections may help") as caught:
            sr.solve_equilibrium(model, motors, force, gravity=sr.EARTH_GRAVITY)
        best = caught.value.best
        assert np.isfinite(best.residual)
        assert np.isfinite(best.q_springs).all()
        loaded = sr.load_result(sr.save_result(best, tmp_path / f"{force[0]}.npz"))
        assert np.array_equal(loaded.q_springs, best.q_springs)


@pytest.mark.parametrize("options", [{}, {"method": "fixed_point"}, {"wrench": (0, 0, 0, 0, 0, 1.0)}])
def test_a_start_out_of_range_is_refused(pcc: sr.SoftModel, options: dict) -> None:
    with pytest.raises(sr.ParameterError, match="within the range of every section") as caught:
        sr.solve_equilibrium(pcc, LENGTHS, (5, 0, -5), q_springs0=np.full(pcc.n_springs, 50.0), **options)
    assert caught.value.field == "q_springs0"


@pytest.mark.parametrize("length", [1e-4, 1e-3])
def test_lengths_that_leave_no_length_are_refused(pcc: sr.SoftModel, length: float) -> None:
    for refuse in (sr.solve_equilibrium, lambda model, motors: model.configuration(motors)):
        with pytest.raises(sr.ParameterError, match="leave segment 1 a length") as caught:
            refuse(pcc, np.full(6, length))
        assert caught.value.field == "q_motors"


def test_limits_count_lengths_and_tensions(pcc: sr.SoftModel, pulled: sr.SoftModel) -> None:
    """Lengths within limits that need more than 400 N; tensions within limits that stretch beyond 1.15 of the rest length."""
    strong = sr.solve_equilibrium(pcc, np.full(6, 0.524), (400, 0, 0))
    assert np.abs(strong.muscle_forces).max() > 400.0
    assert not strong.within_limits
    assert sr.solve_equilibrium(pcc, np.full(6, 0.524), (5, 0, 0)).within_limits
    long = sr.solve_equilibrium(pulled, np.full(6, -200.0))  # each pushes with 200 N: 600 N over EA = 2400 N
    assert np.allclose(long.muscle_lengths, 1.25 * 0.524, atol=1e-9)
    assert not long.within_limits
    assert sr.solve_equilibrium(pulled, np.zeros(6)).within_limits


def test_given_tensions_cannot_be_led_by_the_papers_loop_nor_feel_a_load(pulled: sr.SoftModel) -> None:
    with pytest.raises(sr.ParameterError, match="tensions are given"):
        sr.follow_trajectory(pulled, [(0.1, 0, 1.0), (0.2, 0, 1.0)], method="paper", times=(0, 1))
    with pytest.raises(sr.ParameterError, match="given forces feel no load"):
        sr.estimate_load(pulled, np.zeros(6), np.zeros(6))


def test_an_alternation_that_leaves_the_range_finds_no_load(pcc: sr.SoftModel) -> None:
    with pytest.raises(sr.LoadNotFound):
        sr.estimate_load(pcc, pcc.relaxed_motors, [1e4, -1e4, 3, 1e5, 2, 1.0], method="alternation")


def test_saved_solutions_and_workspaces_are_checked(pcc: sr.SoftModel, tmp_path: Path) -> None:
    solution = sr.solve_ik(pcc, (0.3, 0.2, 0.85), orientation=(1, 0, 0.5))
    fields = dict(np.load(sr.save_result(solution, tmp_path / "s.npz")))
    bad = {
        "orientation": [np.zeros((3, 3)), 5.0 * np.eye(3), np.zeros(3)],
        "target": [solution.target + 1.0],
        "alternatives": [np.full((1, 6), 7e29), np.full((1, 6), -0.5)],
    }
    for name, values in bad.items():
        for number, value in enumerate(values):
            path = tmp_path / f"{name}_{number}.npz"
            np.savez(path, **(fields | {name: value}))
            with pytest.raises(sr.FileFormatError):
                sr.load_result(path)
    reach = sr.sample_workspace(pcc, 4, force=(0, 0, -2))
    fields = dict(np.load(sr.save_result(reach, tmp_path / "w.npz")))
    empty = {name: fields[name][:0] for name in ("q_motors", "q_springs", "tip_positions", "manipulability")}
    changes = [{"manipulability": -reach.manipulability}, {"refused": np.array(-4)}, empty]
    changes.append({"q_springs": reach.q_springs + 1e-3})
    for number, change in enumerate(changes):
        np.savez(tmp_path / f"w{number}.npz", **(fields | change))
        with pytest.raises(sr.FileFormatError):
            sr.load_result(tmp_path / f"w{number}.npz")


def test_a_robot_of_motors_springs_and_sections_in_one_has_right_derivatives(rng: np.random.Generator) -> None:
    """Two motors, one of them endless, and a spring hinge before a PCC arm: one residual, one tangent, one coupling."""
    text = sr.PccArm(segment_lengths=(0.3,), elastic_sections=2).urdf()
    inertia = '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/>'
    body = '<link name="{0}"><inertial><mass value="0.1"/>' + inertia + "</inertial></link>"
    joint = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="0 0 0.1"/>'
    joint += '<axis xyz="{4}"/>{5}{6}</joint>'
    limit = '<limit lower="-3" upper="3" effort="9" velocity="9"/>'
    spring = '<softrobots:role value="spring"/><softrobots:spring stiffness="40.0" rest="0.05"/>'
    head, tail = text.split('<link name="base_link">', 1)
    extra = "".join(body.format(name) for name in ("world", "turntable", "shoulder"))
    extra += joint.format("yaw", "continuous", "world", "turntable", "0 0 1", "", "")
    extra += joint.format("pitch", "revolute", "turntable", "shoulder", "0 1 0", limit, "")
    extra += joint.format("hinge", "revolute", "shoulder", "base_link", "1 0 0", limit, spring)
    head = head[: head.index('<link name="world"/>')]
    mixed = sr.load_model(head + extra + '<link name="base_link">' + tail)
    assert mixed.motor_joints == ("yaw", "pitch", "muscle_1_1", "muscle_1_2", "muscle_1_3")
    load = Load.of(mixed, (3, -2, 1), wrench={"segment_1": (1, 2, -1, 0.1, 0.2, -0.1)}, gravity=sr.EARTH_GRAVITY)
    motors = np.r_[0.4, -0.3, 0.29, 0.31, 0.305]
    springs = mixed.rest + 0.05 * rng.normal(size=mixed.n_springs)
    state = elastic_state(mixed, motors, springs, load)
    tangent = central_difference(lambda y: elastic_state(mixed, motors, y, load).residual, springs)
    coupling = -central_difference(lambda u: elastic_state(mixed, u, springs, load).residual, motors)
    # Differences of torques of about 10 N m with steps of 1e-6: 1e-9.
    assert np.allclose(state.tangent, tangent, atol=2e-7 * np.abs(tangent).max())
    assert np.allclose(state.load.coupling, coupling, atol=2e-7 * np.abs(coupling).max())
    found = sr.solve_equilibrium(mixed, motors, (3, -2, 1), gravity=sr.EARTH_GRAVITY)
    assert found.stable
    assert sr.solve_ik(mixed, found.tip_position, (3, -2, 1), gravity=sr.EARTH_GRAVITY, starts=4).error <= 1e-9


@pytest.mark.study
def test_threads_give_identical_bytes() -> None:
    """Also above the size from which BLAS is kept on one thread."""
    rod = sr.load_model(sr.PccArm(muscle_azimuths=(), elastic_sections=10, segment_lengths=(0.3, 0.3)))
    assert rod.n_springs == 80

    def solve(number: int) -> bytes:
        return sr.solve_equilibrium(rod, (), (0.5 * number, 0.3, -0.2)).q_springs.tobytes()

    alone = [solve(number) for number in range(6)]
    with ThreadPoolExecutor(6) as pool:
        assert list(pool.map(solve, range(6))) == alone


def test_measured_stiffness_is_given_once() -> None:
    for fields, field in (({"bending_stiffness": 3.0}, "bending_stiffness"), ({"segment_lengths": ()}, "segment_lengths")):
        with pytest.raises(sr.ParameterError) as caught:
            sr.PccArm.measured(bending=3.7, torsion=2.4, axial=4580, **fields)
        assert caught.value.field == field


def test_azimuths_too_close_to_fix_an_arc_are_refused() -> None:
    with pytest.raises(sr.ParameterError, match="do not all lie close together"):
        sr.PccArm(muscle_azimuths=(0.0, 1e-5, 2e-5))


def test_one_blas_thread_is_given_back() -> None:
    import threadpoolctl

    from softrobots.core.blas_threads import one_blas_thread

    def counts() -> list[int]:
        """Threads of NumPy's BLAS and of SciPy's."""
        paths = {
            info["filepath"]: info["num_threads"] for info in threadpoolctl.threadpool_info() if info["user_api"] == "blas"
        }
        return [paths[path] for path in sorted(paths) if "numpy" in path or "scipy" in path]

    with one_blas_thread(500):
        pass
    import scipy.linalg  # noqa: F401  # loaded after the first limit, it is limited, too

    before = counts()
    assert before
    with one_blas_thread(500):
        assert set(counts()) == {1}
        with one_blas_thread(500):
            assert set(counts()) == {1}
        assert set(counts()) == {1}
    assert counts() == before
    with one_blas_thread(4):
        assert counts() == before


@pytest.mark.parametrize("force", [(0.0, 10.0, -20.0), (1.0, 10.0, -20.0)])
def test_the_descent_leaves_a_saddle_that_it_cannot_settle_on(pcc: sr.SoftModel, force: tuple[float, float, float]) -> None:
    """Beside this saddle rounding keeps the residual above the tolerance; below it there is a stable equilibrium."""
    found = sr.solve_equilibrium(pcc, pcc.relaxed_motors, force, gravity=sr.EARTH_GRAVITY)
    assert found.stable
    assert found.residual <= found.tolerance
    assert np.linalg.eigvalsh(found.tangent_stiffness)[0] > 0.0


def test_no_critical_load_is_sought_of_an_arm_that_has_no_equilibrium_before(pcc: sr.SoftModel) -> None:
    with pytest.raises(sr.ParameterError, match=r"gravity.*stable before it is pushed"):
        sr.critical_load(pcc, pcc.relaxed_motors, (0, 0, -1), gravity=(3e4, 3e4, 0))
