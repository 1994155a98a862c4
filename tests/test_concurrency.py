"""Models and compiled models shared by threads, sent to processes, and made at the same time: the same bytes as one by one."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import multiprocessing
import pickle
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.core import blas_threads
from softrobots.core.blas_threads import one_blas_thread
from softrobots.robots import fields
from tests.conftest import missing
from tests.support import solver_mix
from tests.support.foreign import INERTIAL, joint

THREADS = 8
CHAIN = f'<robot name="chain"><link name="{{}}">{INERTIAL}</link>{{}}</robot>'


@pytest.fixture(scope="module")
def mix() -> tuple[Any, ...]:
    return solver_mix.robots()


@pytest.fixture(scope="module")
def alone(mix: tuple[Any, ...]) -> list[bytes]:
    """Every job of the mix, one after the other in this thread."""
    return [solver_mix.as_bytes(job) for job in solver_mix.jobs(*mix)]


@pytest.fixture
def racing() -> Iterator[None]:
    """Threads change places at every chance."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


def in_threads(jobs: Sequence[Callable[[], Sequence[Any]]]) -> list[bytes]:
    """What jobs give, as bytes, in eight threads that change places again and again, at calls of functions."""
    calls = itertools.count()

    def change_places(*_: Any) -> None:
        if next(calls) % 9 == 0:
            time.sleep(0.0)

    def run(job: Callable[[], Sequence[Any]]) -> bytes:
        sys.setprofile(change_places)
        try:
            return solver_mix.as_bytes(job)
        finally:
            sys.setprofile(None)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(run, jobs))


def at_once(job: Callable[[], Any], count: int = THREADS) -> list[Any]:
    """What a job gives in threads that start together."""
    together = threading.Barrier(count)

    def run(_: int) -> Any:
        together.wait()
        return job()

    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(run, range(count)))


@pytest.mark.study
@pytest.mark.usefixtures("racing")
def test_eight_threads_share_models(mix: tuple[Any, ...], alone: list[bytes]) -> None:
    assert in_threads(solver_mix.jobs(*mix)) == alone


@pytest.mark.usefixtures("racing")
def test_threads_begin_with_a_model_that_nobody_has_used(alone: list[bytes]) -> None:
    """Whatever it makes on first use is made by several at once."""
    fresh = sr.load_model(sr.InflatableArm())
    first = at_once(lambda: sr.solve_equilibrium(fresh, solver_mix.MOTORS, solver_mix.FORCE).q_springs.tobytes())
    assert len(set(first)) == 1
    fast = at_once(lambda: sr.compile(fresh, backend="python"), 3)
    compiled = at_once(lambda: fast[0].equilibrium(solver_mix.MOTORS, solver_mix.FORCE).q_springs.tobytes())
    assert {*compiled, fast[1].equilibrium(solver_mix.MOTORS, solver_mix.FORCE).q_springs.tobytes()} == {alone[-4]}


@pytest.mark.usefixtures("racing")
def test_the_race_is_one() -> None:
    """With one Pinocchio workspace for all threads solves go wrong: the tests above could see it."""
    model, random = sr.load_model(sr.InflatableArm()), np.random.default_rng(3)

    def settle(motors: Any, force: Any) -> Sequence[Any]:
        try:
            return (sr.solve_equilibrium(model, motors, force).q_springs,)
        except sr.SoftRobotsError:
            return ()

    jobs = [functools.partial(settle, random.uniform(-1, 1, 3), random.normal(size=3) * 5) for _ in range(40)]
    alone = [solver_mix.as_bytes(job) for job in jobs]
    assert in_threads(jobs) == alone
    pair = model.workspace(None)
    numbers = {name: getattr(model.data, name) for name in ("frame_ids", "circles", "q_indices")}
    object.__setattr__(model, "data", SimpleNamespace(at=lambda _: pair, **numbers))  # of all threads
    assert any(in_threads(jobs) != alone for _ in range(50))  # threads meet by chance: nearly every time


def _in_process(sent: bytes | None) -> list[bytes]:
    """The mix in another process, in two threads: with models that came over, or loaded there."""
    robots = solver_mix.robots() if sent is None else pickle.loads(sent)
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(solver_mix.as_bytes, solver_mix.jobs(*robots)))


@pytest.mark.study
def test_two_processes_give_the_same_bytes(mix: tuple[Any, ...], alone: list[bytes]) -> None:
    """This one and another, in which models came over or are loaded."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        found = [pool.submit(_in_process, sent) for sent in (pickle.dumps(mix), None)]
        assert [future.result() for future in found] == [alone, alone]


@pytest.mark.study
@pytest.mark.usefixtures("racing")
def test_robots_are_described_and_loaded_at_the_same_time(mix: tuple[Any, ...]) -> None:
    """Xacro keeps its state in module globals; nothing of one robot may get into another."""
    fields._expanded.cache_clear()
    made = [
        sr.InflatableArm(link_lengths=(0.3,)),
        sr.InflatableArm(link_lengths=(0.4,)),
        sr.PccArm(segment_lengths=(0.5,), elastic_sections=1),
    ]
    with ThreadPoolExecutor(THREADS) as pool:
        models = list(pool.map(sr.load_model, made * 2))
    fields._expanded.cache_clear()
    assert models == [sr.load_model(robot) for robot in made] * 2


@pytest.mark.usefixtures("racing")
def test_threads_that_compile_the_same_robot_share_what_is_made(
    tool: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One file, whole, and one module of it: numba compiles each function once for all, when it is first called."""
    tool("numba")
    monkeypatch.setenv("SOFTROBOTS_CACHE", str(tmp_path))
    model = sr.load_model(CHAIN.format("a", joint("m", "a", "b", "0 0 1") + joint("s", "b", "c", "0 1 0")), springs={"s": 5.0})
    settle = [run.settle for run in at_once(lambda: sr.compile(model, backend="numba")._run(False))]
    assert len({id(one) for one in settle}) == 1
    (file,) = [path for path in tmp_path.iterdir() if path.is_file()]
    assert sys.modules[file.stem].settle_alone is settle[0]


@pytest.mark.study
def test_a_compiled_model_survives_pickling() -> None:
    muscles = sr.load_model(sr.PccArm(elastic_sections=2), muscles="forces")
    fast = sr.compile(muscles, backend="python", locked_strains=("twist", "stretch"))
    twin = pickle.loads(pickle.dumps(fast))
    assert (twin.model, twin.backend, twin.source()) == (fast.model, fast.backend, fast.source())
    one, other = (each.equilibrium((3, 5, 8, 2, 4, 6), (1, 2, -3)).q_springs for each in (fast, twin))
    assert one.tobytes() == other.tobytes()


# --- Linear algebra on several threads


@pytest.fixture
def two_blas_threads() -> Iterator[None]:
    """BLAS on two threads, as in a process that says nothing; skip where it has no such thing."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=2, user_api="blas") as limits:
        if limits.get_original_num_threads()["blas"] is None:
            missing("a BLAS whose threads can be set is needed")
        yield


@pytest.mark.usefixtures("two_blas_threads")
def test_bytes_do_not_depend_on_what_other_threads_do() -> None:
    """BLAS rounds large matrices differently on one thread, on which another thread may hold it at the time."""
    count = 128  # from there on a linear system solved on two threads differs
    joints = "".join(joint(f"s{i}", f"l{i}", f"l{i + 1}", "0 1 0" if i % 2 else "0 0 1") for i in range(count))
    springs = {f"s{i}": 500.0 for i in range(1, count)}
    large = sr.load_model(CHAIN.format("l0", joints), springs=springs, motors=["s0"])
    state = sr.solve_equilibrium(large, (0.3,), (0.0, 0.1, -0.1))

    def asked() -> list[bytes]:
        again = dataclasses.replace(state)  # it keeps its eigenvalues
        found = [sr.compliance(large, state), sr.elastostatic_jacobian(large, state), again.eigenvalues]
        return [array.tobytes() for array in found]

    free = asked()
    with one_blas_thread(large.n_springs):  # as if another thread were solving
        assert asked() == free


def test_blas_is_free_again_after_the_last_user(monkeypatch: pytest.MonkeyPatch) -> None:
    """Users that come and go in any order; a limit that cannot be set counts nobody in."""
    limits: list[str] = []

    class Limiter:
        def restore_original_limits(self) -> None:
            limits.append("free")

    class Controller:
        def limit(self, **_: Any) -> Limiter:
            limits.append("one")
            return Limiter()

    monkeypatch.setattr(blas_threads._Limit, "controller", Controller())
    monkeypatch.setattr(blas_threads._Limit, "scipy", "scipy.linalg" in sys.modules)
    first, second = one_blas_thread(100), one_blas_thread(100)
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert limits == ["one"]
    second.__exit__(None, None, None)
    assert limits == ["one", "free"]
    monkeypatch.setattr(Controller, "limit", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError), one_blas_thread(100):
        pass
    monkeypatch.undo()
    with one_blas_thread(100):
        assert blas_threads._Limit.users == 1
    assert blas_threads._Limit.users == 0
