"""A plugin of pytest for scripts/mutation.py: the quickest test first, and no search for the simplest failure."""

import gc
import json
import os
from pathlib import Path

import pytest
from hypothesis import Phase, settings

settings.register_profile("mutation", derandomize=True, deadline=None, phases=(Phase.explicit, Phase.generate))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the tests by the time that each took when mutmut ran all of them."""
    file = Path("mutmut-stats.json")
    times = json.loads(file.read_text(encoding="utf-8"))["duration_by_test"] if file.is_file() else {}
    items.sort(key=lambda item: times.get(item.nodeid, 0.0))


def pytest_sessionfinish() -> None:
    """Keep what is loaded before the processes of the changes begin out of their garbage collection."""
    if not os.environ.get("MUTANT_UNDER_TEST"):
        gc.collect()
        gc.freeze()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note which tests fail without a change: mutmut does not tell."""
    if report.failed and os.environ.get("MUTANT_UNDER_TEST", "") in ("", "stats"):
        with Path("failed.txt").open("a", encoding="utf-8") as file:
            file.write(f"{report.nodeid}\n")
