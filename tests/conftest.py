"""Shared fixtures, and the rule about tools that may be missing: with CI=true a missing one fails its test."""

from __future__ import annotations

import gc
import importlib.util
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import settings

import softrobots as sr
from softrobots.description.third_party import UR5, robot_file

# The same examples in every run: a failure is a failure of the code, not of the day.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

CHECKOUT = Path(__file__).resolve().parent.parent
PATIENCE = 120.0
"""How long a test waits for what other processes and threads do in a moment on free cores [s]: a guard against hanging."""


JOBS = {
    "study": "of scripts/: the project's studies, tables and pages; proofs by thousands of random cases; what takes seconds",
    "system": "in a real browser, notebook or documentation site, of code in guides, or with a C compiler",
}
"""Marks of tests that run in jobs of their own, and what these tests are."""
SYSTEM_FIXTURES = {"browser", "site"}
"""Fixtures that make a test one of the system."""
SHORTENED = "shortened(gate, all): a study by random cases: how many the gate tries, and how many --all-cases does"
"""The mark of studies that the fixture `cases` asks."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the studies that the gate shortens try all their cases."""
    parser.addoption("--all-cases", action="store_true", help="studies try all their cases, as scripts/long_proofs.py does")


def pytest_configure(config: pytest.Config) -> None:
    """Leave out what has a job of its own, unless files or marks are named; one thread of linear algebra a process."""
    for mark, meaning in JOBS.items():
        config.addinivalue_line("markers", f"{mark}: {meaning}")
    config.addinivalue_line("markers", SHORTENED)
    if config.args_source != pytest.Config.ArgsSource.ARGS and not config.option.markexpr:
        config.option.markexpr = f"not ({' or '.join(JOBS)})"
    if getattr(config.option, "numprocesses", None):
        os.environ.setdefault("OMP_NUM_THREADS", "1")  # before the processes start
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's job in the background; ours would inherit it
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_report_header(config: pytest.Config) -> str | None:
    """Say which tests are left out."""
    if config.option.markexpr != f"not ({' or '.join(JOBS)})":
        return None
    return f"left out: tests marked {' and '.join(JOBS)}, which .ci/run runs; python -m pytest tests runs all"


@pytest.hookimpl(tryfirst=True)  # before pytest looks at marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that use a browser or the site; each test has one mark."""
    for item in items:
        if SYSTEM_FIXTURES & set(getattr(item, "fixturenames", ())) and item.get_closest_marker("study") is None:
            item.add_marker("system")


def pytest_collection_finish() -> None:
    """Look for garbage more rarely, and not among the modules and tests, which stay: a twentieth of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


def load_script(name: str, folder: str = "scripts") -> ModuleType:
    """A file of the checkout that belongs to no package, as a module."""
    spec = importlib.util.spec_from_file_location(name, CHECKOUT / folder / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses ask for it
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[name]
    return module


def missing(reason: str) -> None:
    """Fail in CI, skip elsewhere, with the reason."""
    if os.environ.get("CI") == "true":
        pytest.fail(f"{reason} (CI must have it)")
    pytest.skip(reason)


OPTIONAL = re.compile(
    r"(PIL|build|control|dask|daqp|distributed|example_robot_data|ikpy|latex2mathml|matplotlib|mcap|mcap_ros2|mkdocs|mujoco|mypy"
    r"|nbclient|nbformat|numba|pandas|pink|playwright|pybullet|pydrake|roboticstoolbox|twine|urchin|uv|viser)\b"
)
"""What the extras bring besides `test`, as imported."""
_TOLD = re.compile(r"\S+ is not installed; it is part of an extra")


def _lacking(error: BaseException | None) -> str | None:
    """What is missing, if a test or its module ended for want of an optional package."""
    while error is not None and not isinstance(error, (sr.MissingDependency, ModuleNotFoundError)):
        error = error.__cause__
    known = isinstance(error, sr.MissingDependency) or OPTIONAL.match(getattr(error, "name", None) or "")
    return str(error) if known else None


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    """Skip a module that imports an optional package; not in CI."""
    report = yield
    call = getattr(report, "call", None)
    lacking = _lacking(call.excinfo.value) if call is not None and call.excinfo is not None else None
    if lacking is not None and os.environ.get("CI") != "true":
        report.outcome, report.longrepr = "skipped", (str(collector.path), 0, f"Skipped: {lacking}")
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(call: pytest.CallInfo, item: pytest.Item) -> Iterator[None]:
    """Skip a test that ends for want of an optional package; not in CI."""
    report = yield
    if call.excinfo is not None and report.outcome == "failed" and os.environ.get("CI") != "true":
        told = _TOLD.search(f"{report.longreprtext}\n{report.capstderr}")  # by a command
        lacking = told[0] if told else _lacking(call.excinfo.value)
        if lacking is not None:
            report.outcome, report.longrepr = "skipped", (str(item.path), 0, f"Skipped: {lacking}")
    return report


@pytest.fixture
def tool() -> Callable[[str], ModuleType]:
    """Import an optional tool, or fail or skip the test."""

    def load(name: str) -> ModuleType:
        try:
            return importlib.import_module(name)
        except ImportError:
            missing(f"{name} is not installed")
            raise

    return load


def skip_without_bullet_wheels() -> None:
    """PyBullet has wheels for some Pythons only; that is not missing in CI."""
    if sys.version_info >= (3, 12):
        pytest.skip("pybullet has no wheels above Python 3.11")


@pytest.fixture
def bullet(tool: Callable[[str], ModuleType]) -> ModuleType:
    """The module pybullet, where it has wheels."""
    skip_without_bullet_wheels()
    return tool("pybullet")


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    """A headless Chromium, one for all tests of a module; Playwright's synchronous API runs once at a time."""
    from studies.shared.browser import open_browser

    with ExitStack() as stack:
        try:
            opened = stack.enter_context(open_browser())
        except (sr.MissingDependency, sr.ViewerError) as error:
            missing(str(error))
            raise
        yield opened


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run the command `softrobots` in this process: its status, what it printed, what it said on stderr."""
    from softrobots.cli.main import main

    def run(*words: str) -> tuple[int, str, str]:
        try:
            status = main(words)
        except SystemExit as ended:  # argparse's way out
            status = int(ended.code or 0)
        return status, *capsys.readouterr()

    return run


@pytest.fixture
def cases(request: pytest.FixtureRequest, record_property: Callable[[str, object], None]) -> int:
    """How many cases a study that is marked `shortened` tries; reports of the tests say so, too."""
    gate, every = request.node.get_closest_marker("shortened").args
    for name, number in (("gate", gate), ("all", every)):
        record_property(name, number)
    return every if request.config.getoption("--all-cases") else gate


@pytest.fixture(scope="session")
def arm() -> sr.SoftModel:
    """The paper's arm: two links, three motors, four springs."""
    return sr.load_model(sr.InflatableArm())


@pytest.fixture(scope="session")
def odd_arm() -> sr.SoftModel:
    """Three links that differ in everything, with rest angles."""
    return sr.load_model(
        sr.InflatableArm(
            link_lengths=(0.5, 0.4, 0.3),
            hinge_offset=(0.03, 0.05, 0.02),
            radius=(0.06, 0.05, 0.04),
            stiffness=(250.0, 120.0, 80.0),
            rest_side=(0.05, -0.02, 0.0),
            rest_up=(-0.1, 0.03, 0.06),
            pressure=(60e3, 50e3, 40e3),
        )
    )


@pytest.fixture(scope="session")
def ur5() -> Path:
    try:
        return robot_file(UR5)
    except sr.MissingDependency as error:
        missing(str(error))
        raise


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20210312)
