"""The quick start of each robot runs, shows what is stored in it, and is small; its page needs neither a server nor a port."""

from __future__ import annotations

import ast
import contextlib
import io
import json
import re
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import CHECKOUT, missing
from tests.support.documentation import differences

FOLDER = CHECKOUT / "docs" / "notebooks"
NAMES = tuple(sorted(path.stem for path in FOLDER.glob("*.ipynb")))
LARGEST = 300_000  # [bytes] of a file with its outputs
NOT_RUN = "page"
"""The cell with sliders, whose output is not stored: it is larger than all the rest."""


def cells_of(name: str) -> list[dict[str, Any]]:
    """The cells of code of a notebook, as they are in the checkout."""
    notebook = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    assert notebook["metadata"]["kernelspec"]["name"] == "python3"
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def told(cell: dict[str, Any]) -> str:
    """What a cell printed and the text of its value, as they are stored."""
    parts = [output.get("text") or output["data"]["text/plain"] for output in cell["outputs"]]
    return "\n".join("".join(part).rstrip("\n") for part in parts)


def run(cell: dict[str, Any], names: dict[str, Any]) -> tuple[str, Any]:
    """Run a cell in this process as a kernel does; what it prints with the text of its value, and the value."""
    tree = ast.parse(re.sub(r"^%.*", "", "".join(cell["source"]), flags=re.MULTILINE))
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, cell["id"], "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), cell["id"], "eval"), names)
    shown = "" if value is None else repr(value)
    return "\n".join(part.rstrip("\n") for part in (printed.getvalue(), shown) if part), value


def test_each_robot_has_one_that_stores_what_it_shows() -> None:
    assert NAMES == ("helix_tube", "inflatable_arm", "pcc_arm", "tendon_arm")
    for name in NAMES:
        assert (FOLDER / f"{name}.ipynb").stat().st_size < LARGEST
        cells = cells_of(name)
        assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
        for cell in cells:
            assert bool(cell["outputs"]) == (cell["id"] != NOT_RUN), cell["id"]
            kinds = [output["output_type"] for output in cell["outputs"]]
            assert set(kinds) <= {"stream", "execute_result"}, "a warning, an error"
        drawn = [cell for cell in cells for output in cell["outputs"] if "image/png" in output.get("data", {})]
        assert "picture" in [cell["id"] for cell in drawn]
        assert all(len(cell["metadata"]["alt"]) > 20 for cell in drawn)
    tables = [output["data"] for cell in cells_of("inflatable_arm") for output in cell["outputs"] if "data" in output]
    assert sum("<table" in "".join(data.get("text/html", "")) for data in tables) >= 2


@pytest.mark.study
@pytest.mark.parametrize("name", NAMES)
def test_it_runs_and_shows_what_is_stored(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process: a kernel for each would take seconds. All but residuals, which are rounding."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        missing("matplotlib is not installed")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for cell in cells_of(name):
        text, value = run(cell, names)
        if cell["id"] == NOT_RUN:
            page = value._repr_html_()
            assert "srcdoc=" in page
            assert "127.0.0.1:7" not in page
            continue
        pair = [re.sub(r"^residual .*$|residual=[^,]+|<Figure .*>", "", one, flags=re.MULTILINE) for one in (told(cell), text)]
        assert differences(*pair) == [], cell["id"]
