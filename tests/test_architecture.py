"""The picture of the rooms shows the imports that there are, and the page of the architecture names files that exist."""

from __future__ import annotations

import json
import re
import shutil
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

from tests.conftest import CHECKOUT, load_script

PAGE = CHECKOUT / "docs" / "architecture.md"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    """The script, which reads each package once."""
    script = load_script("draw_architecture")
    script.read_rooms = cache(script.read_rooms)
    return script


def test_the_picture_is_current(script: ModuleType, capsys: pytest.CaptureFixture) -> None:
    status = script.main(["--check"])
    assert status == 0, f"python scripts/draw_architecture.py draws it anew: {capsys.readouterr().out}"


@pytest.mark.study
def test_a_picture_is_drawn_and_checked(script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    first, second = tmp_path / "a.png", tmp_path / "b.png"
    assert script.main(["--output", str(first)]) == script.main(["--output", str(second)]) == 0
    assert first.read_bytes() == second.read_bytes()
    assert script.main(["--check", "--output", str(first)]) == 0
    rooms = script.read_rooms()
    older = rooms | {"motion": rooms["statics"]}
    older["view"] = rooms["view"]._replace(imports=())
    older["core"] = rooms["core"]._replace(lines=2 * rooms["core"].lines)
    assert [line.partition(":")[0] for line in script.differences(older, first)] == ["motion", "core", "view"]
    shutil.copy(CHECKOUT / "docs/images/pcc_arm.png", second)
    assert script.main(["--check", "--output", str(second)]) == 2
    assert "no picture of this script" in capsys.readouterr().err


def test_a_package_is_read_by_its_imports(script: ModuleType, tmp_path: Path) -> None:
    for room, text in {
        "low": '"""Low."""',
        "middle": '"""Middle; more."""\nimport softrobots.low.part',
        "top": '"""Top."""\ndef f():\n    from softrobots import low\n    from softrobots.middle import x\n',
    }.items():
        (tmp_path / room).mkdir()
        (tmp_path / room / "__init__.py").write_text(text + "\n", encoding="utf-8")
    rooms = script.read_rooms(tmp_path)
    assert rooms["middle"] == script.Room("Middle", 1, 2, ("low",))
    assert rooms["top"].imports == ("low", "middle")
    assert script.arrows(rooms) == [("middle", "low"), ("top", "middle")]
    assert [script.level(rooms, name) for name in rooms] == [0, 1, 2]
    assert json.dumps([room._asdict() for room in rooms.values()])


def test_the_page_names_what_is_there() -> None:
    text = PAGE.read_text(encoding="utf-8")
    files = re.findall(r"`((?:\w+/)+[\w*]*\.\w+)`", text)
    assert len(files) > 10
    for name in files:
        root = CHECKOUT if (CHECKOUT / name.partition("/")[0]).is_dir() else CHECKOUT / "softrobots"
        assert list(root.glob(name)), name
    modules = "\n".join(path.read_text(encoding="utf-8") for path in (CHECKOUT / "softrobots").rglob("*.py"))
    for name, file in re.findall(r"`(?:\w+\.)?(\w+)` \(`([\w/]+\.py)`\)", text):
        assert f"def {name}(" in (CHECKOUT / "softrobots" / file).read_text(encoding="utf-8"), (name, file)
    for name in ("AppliedLoad", "RobotTags", "RigidTree", "Springs", "SoftModel", "Equilibrium"):
        assert f"class {name}" in modules
        assert name in text
