"""Long jobs go on from their finished blocks: after kill -9, with damaged blocks, not with those of another case."""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled.sweeps import TargetGrid, WorkspaceMap, map_workspace, mapping
from softrobots.core.checkpoint import CASE, Checkpoint
from softrobots.statics import workspace
from studies.shared.command_line import blocks_beside
from studies.shared.folders import discard
from tests.conftest import CHECKOUT
from tests.support.load_cases import fingerprint
from tests.support.scripts import run_script
from tests.support.tables import each_row

GRID = TargetGrid.plane(1.2, 3)  # 18 targets
LOADS = (0.0, 20.0)
ARRAYS = {"a": (np.float64, (3,)), "b": (np.bool_, (2, 1))}
BLOCK = {"a": np.array([1.0, 2.0, -0.0]), "b": np.array([[True], [False]])}


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapping, "BLOCK", 3)  # 6 blocks
    monkeypatch.setattr(workspace, "_BLOCK", 5)


def mapped(arm: sr.SoftModel, folder: Path | None, **options: Any) -> WorkspaceMap:
    return map_workspace(arm, **({"grid": GRID, "loads": LOADS, "backend": "python", "checkpoint": folder} | options))


def solved(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Targets of each block that is solved from now on."""
    seen: list[Any] = []
    solve = mapping.solve_block

    def counted(case: Any, targets: Any) -> Any:
        seen.append(targets)
        return solve(case, targets)

    monkeypatch.setattr(mapping, "solve_block", counted)
    return seen


class Stopped(Exception):
    """An interruption."""


def stop_at(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupt whatever keeps its blocks when it comes to one."""
    keep = Checkpoint.keep

    def interrupted(self: Checkpoint, which: int, arrays: Any) -> None:
        if which == number:
            raise Stopped
        keep(self, which, arrays)

    monkeypatch.setattr(Checkpoint, "keep", interrupted)


# --- Killed


def killed_after_first_block(words: list[str], folder: Path, block: str) -> None:
    """Run the script of the maps in another process, in blocks of three targets, and kill it when a block appears.

    It waits at the fourth block, or it might be done before we look.
    """
    script = CHECKOUT / "scripts" / "workspace_map.py"
    code = (
        f"import runpy, sys, time; sys.path.insert(0, {str(script.parent)!r}); from softrobots.core import checkpoint\n"
        "from softrobots.compiled.sweeps import mapping; mapping.BLOCK = 3\n"
        "keep = checkpoint.Checkpoint.keep\n"
        "checkpoint.Checkpoint.keep = lambda self, n, block: time.sleep(300) if n == 3 else keep(self, n, block)\n"
        f"sys.exit(runpy.run_path({str(script)!r})['main'](sys.argv[1:]))"
    )
    process = subprocess.Popen([sys.executable, "-c", code, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    give_up = time.monotonic() + 240.0
    while not (folder / block).exists() and process.poll() is None and time.monotonic() < give_up:
        time.sleep(0.002)
    process.kill()
    _, said = process.communicate()
    assert process.returncode == -signal.SIGKILL, said.decode()


@pytest.mark.study
def test_a_killed_run_goes_on_to_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(mapping, "BLOCK", 3)
    words = ["--cells", "4", "--loads", "2", "--gravity", "--backend", "python", "--no-plots", "--output"]
    assert run_script("workspace_map", [*words, str(tmp_path / "whole.npz")]) == 0
    output, blocks = tmp_path / "killed.npz", tmp_path / "killed.npz.blocks"
    killed_after_first_block([*words, str(output)], blocks, "block_000000.npz")
    done = len(list(blocks.glob("block_*.npz")))
    assert 1 <= done <= 3
    assert not output.exists()
    capsys.readouterr()
    assert run_script("workspace_map", [*words, str(output)]) == 2
    assert "holds the finished blocks of an interrupted run: --resume goes on from there" in capsys.readouterr().err
    seen = solved(monkeypatch)
    assert run_script("workspace_map", [*words, str(output), "--resume"]) == 0
    assert len(seen) == 11 - done  # of 32 targets
    assert f"{done}/11" in capsys.readouterr().err  # where the progress bar begins
    assert output.read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir() if path.suffix != ".part") == ["killed.npz", "whole.npz"]


# --- Interrupted


@pytest.mark.study
@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("threads", [1, 2])
def test_a_map_goes_on_from_what_is_done(
    threads: int, arm: sr.SoftModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = mapped(arm, None)
    with monkeypatch.context() as changed:
        stop_at(4, changed)
        with pytest.raises(Stopped):
            mapped(arm, tmp_path / "blocks", threads=threads)
    seen = solved(monkeypatch)
    again = mapped(arm, tmp_path / "blocks", threads=threads)
    assert len(seen) == 2 if threads == 1 else 1 <= len(seen) <= 5
    assert fingerprint(again) == fingerprint(whole)
    seen.clear()
    assert fingerprint(mapped(arm, tmp_path / "blocks", scheduler="tcp://127.0.0.1:9")) == fingerprint(whole)  # nobody is asked
    assert seen == []


@pytest.mark.usefixtures("small_blocks")
def test_samples_go_on_from_what_is_done(arm: sr.SoftModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = sr.sample_workspace(arm, 17, force=(0, 30, -60))
    with monkeypatch.context() as changed:
        stop_at(2, changed)
        with pytest.raises(Stopped):
            sr.sample_workspace(arm, 17, force=(0, 30, -60), checkpoint=tmp_path)
    assert len(list(tmp_path.glob("block_*"))) == 2
    tried: list[Any] = []
    sample = workspace._sample
    monkeypatch.setattr(workspace, "_sample", lambda *given: tried.append(given) or sample(*given))
    again = sr.sample_workspace(arm, 17, force=(0, 30, -60), checkpoint=tmp_path)
    assert len(tried) == 7
    for name in ("q_motors", "q_springs", "tip_positions", "manipulability"):
        assert getattr(again, name).tobytes() == getattr(whole, name).tobytes()
    assert again.refused == whole.refused
    with pytest.raises(sr.ParameterError, match="; there seed was 0 and is 1 now"):
        sr.sample_workspace(arm, 17, force=(0, 30, -60), seed=1, checkpoint=tmp_path)


def test_the_script_of_samples_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(workspace, "_BLOCK", 5)
    words = ["--samples", "12", "--segments", "1", "--no-plots", "--output", str(tmp_path / "out")]
    with monkeypatch.context() as changed:
        stop_at(1, changed)
        with pytest.raises(Stopped):
            run_script("pcc_workspace", words)
    blocks = tmp_path / "out.blocks"
    assert f"the finished blocks are kept in {blocks}: --resume --output {tmp_path / 'out'} goes on" in capsys.readouterr().err
    assert run_script("pcc_workspace", words) == 2
    assert "--resume" in capsys.readouterr().err
    assert run_script("pcc_workspace", [*words, "--resume"]) == 0
    assert "5/12" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert run_script("pcc_workspace", ["--resume"]) == 2
    assert "--resume must be given with --output" in capsys.readouterr().err


# --- Blocks of another case, and damaged ones


@pytest.mark.parametrize(
    ("options", "messages"),
    [
        ({"loads": (0.0, 21.0)}, [r"; there loads was \[0\.0, 20\.0\] and is \[0\.0, 21\.0\] now$"]),
        (
            {
                "grid": TargetGrid.plane(1.2, 4),
                "gravity": sr.EARTH_GRAVITY,
                "tolerance": 1e-8,
                "direction": (0.0, 0.0, 1.0),
                "model": None,
            },
            [r"x was \[", r"z was \[", r"gravity was null and is \[0\.0, 0\.0, -9\.81\]", "tolerance was 1e-09 and is 1e-08"]
            + [
                "targets of a block was 512 and is 4; ",
                "direction was",
                r"urdf was .*springs was \[\[.spring_1_side., 172\.71",
            ],
        ),
    ],
    ids=["loads", "all the rest"],
)
def test_blocks_of_another_case_are_refused(
    options: dict[str, Any], messages: list[str], arm: sr.SoftModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkpoint = Checkpoint(tmp_path, _identity(arm))
    checkpoint.keep(0, BLOCK)
    before = (tmp_path / CASE).read_bytes()
    model = sr.load_model(sr.InflatableArm(stiffness=170.0)) if "model" in options else arm
    given = {name: value for name, value in options.items() if name != "model"}
    if len(messages) > 1:
        monkeypatch.setattr(mapping, "BLOCK", 4)
    with pytest.raises(sr.ParameterError, match="a new folder, or one with blocks of the same case") as caught:
        mapped(model, tmp_path, **given)
    for message in messages:
        assert re.search(message, str(caught.value)), message
    assert (tmp_path / CASE).read_bytes() == before


def _identity(arm: sr.SoftModel) -> dict[str, Any]:
    """What a map says of its case."""
    told: list[dict[str, Any]] = []

    class Listening(Exception):
        pass

    def listen(_: Any, case: dict[str, Any]) -> None:
        told.append(case)
        raise Listening

    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(mapping, "Checkpoint", listen)
        with pytest.raises(Listening):
            mapped(arm, Path("nowhere"))
    return told[0]


def damaged(content: bytes, place: int) -> bytes:
    return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]


@each_row(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:-1],
        lambda content: content[: len(content) // 2],
        lambda content: damaged(content, content.index(np.float64(2.0).tobytes())),  # a bit of a number
        lambda content: damaged(content, content.index(b"NUMPY")),
    ],
)
def test_a_damaged_block_is_no_block(damage: Callable[[bytes], bytes], tmp_path: Path) -> None:
    kept = Checkpoint(tmp_path, {"job": "test"})
    kept.keep(7, BLOCK)
    assert set(kept.block(7, ARRAYS) or {}) == {"a", "b"}
    (file,) = tmp_path.glob("block_*")
    file.write_bytes(damage(file.read_bytes()))
    assert kept.block(7, ARRAYS) is None
    kept.keep(7, BLOCK)  # computed again
    assert (kept.block(7, ARRAYS) or {})["a"].tobytes() == BLOCK["a"].tobytes()


@pytest.mark.usefixtures("small_blocks")
def test_a_damaged_block_is_computed_again(arm: sr.SoftModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = mapped(arm, tmp_path)
    file = tmp_path / "block_000002.npz"
    right = file.read_bytes()
    file.write_bytes(right[:-20])
    seen = solved(monkeypatch)
    assert fingerprint(mapped(arm, tmp_path)) == fingerprint(whole)
    assert [targets.tolist() for targets in seen] == [GRID.targets[6:9].tolist()]
    assert file.read_bytes() == right


def test_only_blocks_of_the_same_case_number_and_arrays_count(tmp_path: Path) -> None:
    kept = Checkpoint(tmp_path / "one", {"job": "test"})
    assert kept.block(0, ARRAYS) is None
    assert not (tmp_path / "one").exists()  # it is made with the first block
    kept.keep(0, BLOCK)
    assert kept.block(1, ARRAYS) is None
    os.link(tmp_path / "one" / "block_000000.npz", tmp_path / "one" / "block_000001.npz")
    assert kept.block(1, ARRAYS) is None  # it says that it is number 0
    other = Checkpoint(tmp_path / "two", {"job": "another test"})
    other.keep(1, BLOCK)
    os.link(tmp_path / "one" / "block_000000.npz", tmp_path / "two" / "block_000000.npz")
    assert other.block(0, ARRAYS) is None
    assert kept.block(0, ARRAYS | {"a": (np.float64, (4,))}) is None
    assert kept.block(0, ARRAYS | {"a": (np.int64, (3,))}) is None
    assert kept.block(0, {"a": ARRAYS["a"]}) is None


@each_row(
    ("content", "message"),
    [
        (b"", "not JSON"),
        (b"[1]", "not the description"),
        (b'{"job": 3}', "not the description"),
        (b"\xff", "UTF-8"),
        (b'{"job": ', "not JSON"),
    ],
)
def test_a_case_that_cannot_be_read_is_refused(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / CASE).write_bytes(content)
    with pytest.raises(sr.FileFormatError, match=message):
        Checkpoint(tmp_path, {"job": "test"})


def test_of_two_cases_that_begin_at_once_the_second_is_refused(tmp_path: Path) -> None:
    """Both find the folder new; the one that keeps a block first has it."""
    one, same, other = (Checkpoint(tmp_path, {"job": job}) for job in ("one", "one", "other"))
    one.keep(0, BLOCK)
    with pytest.raises(sr.ParameterError, match='there job was "one" and is "other" now'):
        other.keep(0, BLOCK)
    same.keep(1, BLOCK)
    assert all(Checkpoint(tmp_path, {"job": "one"}).block(number, ARRAYS) for number in (0, 1))


@pytest.mark.parametrize(
    "theirs",
    [
        {"\x1b[2J\nname": "\x1b[31m"},
        {f"name {number}": "x" * 1000 for number in range(90)},
        {"x" * 50_000: "1"},
    ],
    ids=["escapes", "many", "long"],
)
def test_what_differs_is_told_in_a_line(theirs: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / CASE).write_text(json.dumps(theirs), encoding="utf-8")
    with pytest.raises(sr.ParameterError, match="blocks of the same case") as caught:
        Checkpoint(tmp_path, {"job": "test"})
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 1500
    assert 'job was nothing and is "test"' in str(caught.value)
    assert ("; and 85 more now" in str(caught.value)) == (len(theirs) == 90)


def test_other_folders_are_refused(tmp_path: Path, arm: sr.SoftModel) -> None:
    (tmp_path / "thesis.tex").write_bytes(b"")
    with pytest.raises(sr.OutputExists, match=r"contains thesis\.tex and no case\.json"):
        mapped(arm, tmp_path)
    with pytest.raises(sr.OutputExists, match=r"contains thesis\.tex"):
        sr.sample_workspace(arm, 3, checkpoint=tmp_path)
    with pytest.raises(sr.OutputExists, match="is a file"):
        Checkpoint(tmp_path / "thesis.tex", {})
    with pytest.raises(sr.OutputError, match="cannot read the folder"):
        Checkpoint(tmp_path / ("x" * 300), {})
    for nothing in (3, ""):
        with pytest.raises(sr.ParameterError, match="checkpoint must be a path"):
            Checkpoint(nothing, {})
        with pytest.raises(sr.ParameterError, match="checkpoint must be a path"):
            discard(nothing)


def test_more_samples_than_a_file_holds_are_refused(arm: sr.SoftModel) -> None:
    with pytest.raises(sr.ParameterError, match=r"samples must be a positive integer, at most 11\d{6}$"):
        sr.sample_workspace(arm, 10**8)


def test_half_files_of_a_killed_run_are_nothing(tmp_path: Path) -> None:
    """Killed before it said what its case is."""
    (tmp_path / f".{CASE}.0123456789ab.part").write_bytes(b"{")
    kept = Checkpoint(tmp_path, {"job": "test"})
    kept.keep(0, BLOCK)
    assert json.loads((tmp_path / CASE).read_text(encoding="utf-8"))["job"] == '"test"'
    discard(tmp_path)
    assert not tmp_path.exists()


def test_nothing_but_blocks_is_discarded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Checkpoint(tmp_path / "a", {"job": "test"}).keep(0, BLOCK)
    (tmp_path / "a" / "notes.txt").write_bytes(b"mine")
    discard(tmp_path / "a")
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["notes.txt"]
    discard(tmp_path / "a")  # no blocks: nothing happens
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["notes.txt"]
    discard(tmp_path / "nowhere")
    Checkpoint(tmp_path / "b", {"job": "test"}).keep(0, BLOCK)

    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError(13, "not yours")

    monkeypatch.setattr(Path, "unlink", refuse)
    with pytest.raises(sr.OutputError, match="cannot delete the blocks"):
        discard(tmp_path / "b")
    monkeypatch.undo()


def test_the_blocks_of_a_folder_without_a_name_are_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    with blocks_beside(Path(), argparse.Namespace(resume=False, output=Path())) as blocks:
        assert blocks == tmp_path / "empty.blocks"


def test_blocks_that_were_refused_are_not_recommended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "a.npz"
    Checkpoint(tmp_path / "a.npz.blocks", {"job": "one"}).keep(0, BLOCK)
    resumed = argparse.Namespace(resume=True, output=output)
    with pytest.raises(sr.ParameterError, match="blocks of the same case"), blocks_beside(output, resumed) as blocks:
        Checkpoint(blocks, {"job": "other"})
    assert capsys.readouterr().err == ""
    with pytest.raises(Stopped), blocks_beside(output, resumed):
        raise Stopped
    assert "--resume --output" in capsys.readouterr().err
