"""A test that ends for want of an optional package is skipped, and fails in CI; nothing else is skipped."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import CHECKOUT

TESTS = {
    "test_at_import.py": "import dask.nothing_of_this_name\n",
    "test_of_ours.py": "import softrobots.nothing_of_this_name\n",
    "test_inside.py": """
import sys
import pytest
import softrobots as sr

def test_imports(): import mujoco.nothing_of_this_name
def test_is_told(): raise sr.MissingDependency("mujoco", "interop")
def test_is_told_by_another_error():
    try:
        import viser.nothing_of_this_name
    except ImportError as error:
        raise ValueError from error
def test_command():
    print("error: matplotlib is not installed; it is part of an extra: pip install ...", file=sys.stderr)
    assert 2 == 0
def test_wrong(): assert 1 == 0
def test_standard_library(): import json.nothing_of_this_name
def test_right():
    with pytest.raises(sr.MissingDependency):
        raise sr.MissingDependency("mujoco", "interop")
""",
}


@pytest.mark.system
@pytest.mark.parametrize(
    ("ci", "told"), [("", "2 failed, 1 passed, 5 skipped, 1 error"), ("true", "6 failed, 1 passed, 2 errors")]
)
def test_what_is_missing_is_skipped_but_in_ci(ci: str, told: str, tmp_path: Path) -> None:
    for name, text in TESTS.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    asked = [sys.executable, "-m", "pytest", "-p", "tests.conftest", "-p", "no:cacheprovider", "--rootdir", str(tmp_path)]
    asked += ["--continue-on-collection-errors", "--import-mode=importlib", str(tmp_path)]
    variables = {**os.environ, "CI": ci, "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run(asked, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False)
    assert told in done.stdout.splitlines()[-1], done.stdout
