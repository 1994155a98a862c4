"""What is written: whole or not at all, on a full disk, by a process that is killed, through links, by several at once."""

from __future__ import annotations

import ast
import contextlib
import os
import re
import resource
import signal
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.cli.main import main
from softrobots.core.checkpoint import Checkpoint
from softrobots.core.files import make_folder, new_file, write_atomically, write_bytes, write_text
from softrobots.view.figures import canvas
from studies.papers import trajectory_pictures
from studies.shared.folders import free_folder
from tests.conftest import CHECKOUT, missing
from tests.support.scripts import run_script


@contextlib.contextmanager
def little_space(size: int = 2000) -> Iterator[None]:
    """No file of this process may grow beyond a size [bytes]; the system refuses as it does on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    usual = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # as Python itself has it
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, usual)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# --- A full disk


@pytest.fixture(scope="module")
def path(arm: sr.SoftModel) -> sr.Trajectory:
    return sr.follow_trajectory(arm, [(0.8, 0.01 * n, 0.2) for n in range(25)], (0, 5, -5))


def _viewer(arm: sr.SoftModel, file: Path) -> object:
    with sr.view(arm) as viewer:
        return viewer.write_html(file, overwrite=True)


def _picture(path: sr.Trajectory, file: Path) -> object:
    return canvas.write_png(trajectory_pictures.tip_errors({"way": path.tip_error}, path.times), file, overwrite=True)


WRITERS: dict[str, Callable[[sr.Trajectory, Path], object]] = {
    "npz": lambda path, file: sr.save_result(path, file, overwrite=True),
    "csv": lambda path, file: sr.save_csv(path, file, overwrite=True),
    "png": _picture,
    "html": lambda path, file: _viewer(path.model, file),
    "xml": lambda path, file: sr.export.export_model(path.model, file, overwrite=True),
    "svg": lambda _, file: sr.helix.write_template(
        sr.helix.pinch_pattern(sr.helix.design_antenna(0.07, 0.18, diameter=0.0331, turns=3), 0.05), file, overwrite=True
    ),
}


@pytest.mark.study
@pytest.mark.parametrize("kind", WRITERS)
def test_a_full_disk_is_an_error_and_the_old_file_stays(kind: str, path: sr.Trajectory, tmp_path: Path) -> None:
    file = tmp_path / f"result.{kind}"
    file.write_bytes(b"old")
    with little_space(), pytest.raises(sr.OutputError, match=r"cannot write .*result\.\w+: .*File too large"):
        WRITERS[kind](path, file)
    assert names(tmp_path) == [file.name]
    assert file.read_bytes() == b"old"
    WRITERS[kind](path, file)
    assert file.stat().st_size > 2000  # so that there was no room for it


def test_a_full_disk_leaves_no_new_file(tmp_path: Path) -> None:
    with little_space(), pytest.raises(sr.OutputError, match="File too large"):
        write_text(tmp_path / "a.txt", "x" * 3000, overwrite=False)
    assert names(tmp_path) == []


def test_a_full_disk_keeps_the_blocks_that_are_done(tmp_path: Path) -> None:
    folder = tmp_path / "blocks"
    kept, kind = Checkpoint(folder, {"job": "test"}), {"a": (np.float64, (1000,))}
    numbers = np.arange(1000.0)
    kept.keep(0, {"a": numbers})
    with little_space(), pytest.raises(sr.OutputError, match="File too large"):
        kept.keep(1, {"a": numbers})
    assert names(folder) == ["block_000000.npz", "case.json"]
    found = Checkpoint(folder, {"job": "test"}).block(0, kind)
    assert found is not None
    assert found["a"].tolist() == numbers.tolist()


# --- Output that cannot be written


@contextlib.contextmanager
def standard_output(descriptor: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Print into something else for a while."""
    with open(descriptor, "w", encoding="utf-8") as stream, monkeypatch.context() as changed:
        changed.setattr(sys, "stdout", stream)
        yield


PRINTED = [
    ["solve", "inflatable_arm", "--motors", "0.3", "0.6", "-0.8"],
    ["solve", "inflatable_arm", "--motors", "0.3", "0.6", "-0.8", "--json"],
    ["pcc", "forward", "0.50", "0.53", "0.55", "0.54", "0.51", "0.52"],
    ["helix", "forward", "--help"],
    ["--version"],
]


@pytest.mark.parametrize("words", PRINTED, ids=" ".join)
def test_a_full_disk_behind_the_output_is_an_error(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if not Path("/dev/full").exists():
        missing("/dev/full is needed")
    with standard_output(os.open("/dev/full", os.O_WRONLY), monkeypatch):
        assert main(words) == 2
    assert capsys.readouterr().err == "error: cannot write the answer: [Errno 28] No space left on device\n"


@pytest.mark.parametrize("words", [PRINTED[0], PRINTED[3]], ids=" ".join)
def test_output_that_nobody_reads_ends_in_silence(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with standard_output(writer, monkeypatch):
        assert main(words) == 141
    assert capsys.readouterr().err == ""


def test_a_script_tells_of_a_full_disk_behind_its_output(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """What it writes into files is there all the same."""
    if not Path("/dev/full").exists():
        missing("/dev/full is needed")
    file = tmp_path / "rates.json"
    words = ["--cases", "1", "--loads", "5", "--estimation-loads", "5", "--json", str(file)]
    with standard_output(os.open("/dev/full", os.O_WRONLY), monkeypatch):
        assert run_script("solver_rates", words) == 2
    assert "error: cannot write the answer: [Errno 28] No space left on device\n" in capsys.readouterr().err
    assert '"cases": 1' in file.read_text(encoding="utf-8")


def test_every_script_ends_as_the_commands_do() -> None:
    scripts = sorted((CHECKOUT / "scripts").glob("*.py"))
    assert len(scripts) > 15
    assert [file.name for file in scripts if "exit_status(" not in file.read_text(encoding="utf-8")] == []


# --- A process that is killed


@pytest.mark.study
def test_a_killed_process_leaves_the_old_file(tmp_path: Path) -> None:
    """Its half of a file is hidden, and in nobody's way."""
    file = tmp_path / "a.txt"
    file.write_bytes(b"old")
    code = (
        "import os, pathlib, signal, softrobots.core.files as files\n"
        "def half(file): file.write(b'half'); file.flush(); os.kill(os.getpid(), signal.SIGKILL)\n"
        f"files.write_atomically(pathlib.Path({str(file)!r}), half)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == -signal.SIGKILL
    assert file.read_bytes() == b"old"
    (part,) = [name for name in names(tmp_path) if name != "a.txt"]
    assert re.fullmatch(r"\.a\.txt\.[0-9a-f]{12}\.part", part)
    write_text(file, "new", overwrite=True)
    assert file.read_bytes() == b"new"


def test_the_content_is_on_the_disk_before_the_file_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a power failure a name without content would be worse than none."""
    file, seen = tmp_path / "a.txt", []
    sync = os.fsync

    def fsync(handle: int) -> None:
        folder = stat.S_ISDIR(os.fstat(handle).st_mode)
        seen.append((folder, file.exists(), 0 if folder else os.fstat(handle).st_size))
        sync(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    write_text(file, "12345", overwrite=False)
    assert seen == [(False, False, 5), (True, True, 0)]


# --- Several writers


def test_of_several_writers_of_a_new_file_one_wins(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"

    def write(number: int) -> int | None:
        try:
            write_atomically(file, lambda part: part.write(b"%d" % number * 5000), overwrite=False)
        except sr.OutputExists:
            return None
        return number

    with ThreadPoolExecutor(8) as pool:
        won = [number for number in pool.map(write, range(8)) if number is not None]
    assert len(won) == 1
    assert file.read_bytes() == b"%d" % won[0] * 5000
    assert names(tmp_path) == ["a.txt"]


def test_of_several_writers_that_replace_a_file_each_is_whole(tmp_path: Path) -> None:
    file = write_text(tmp_path / "a.txt", "0" * 5000, overwrite=False)
    with ThreadPoolExecutor(8) as pool:
        written = [pool.submit(write_bytes, file, b"%d" % number * 5000, overwrite=True) for number in range(8)]
        while not all(one.done() for one in written):
            content = file.read_bytes()
            assert len(content) == 5000
            assert len(set(content)) == 1
    assert all(one.result() == file for one in written)
    assert names(tmp_path) == ["a.txt"]


def test_a_file_that_appears_meanwhile_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the file system has no hard links."""
    for linked in (True, False):
        file = tmp_path / f"{linked}.txt"
        if not linked:
            monkeypatch.setattr(os, "link", lambda *_: (_ for _ in ()).throw(PermissionError(1, "no hard links here")))
        with pytest.raises(sr.OutputExists, match="exists"):
            write_atomically(file, lambda part, file=file: (part.write(b"mine"), file.write_bytes(b"theirs")), overwrite=False)
        assert file.read_bytes() == b"theirs"
    write_text(tmp_path / "b.txt", "mine", overwrite=False)
    assert names(tmp_path) == ["False.txt", "True.txt", "b.txt"]


# --- What stands where a file is to be written


def test_permissions_are_those_of_any_file(tmp_path: Path) -> None:
    usual = os.umask(0o027)
    try:
        file = write_text(tmp_path / "a.txt", "new", overwrite=False)
        assert stat.S_IMODE(file.stat().st_mode) == 0o640
        file.chmod(0o600)  # a secret stays one
        write_text(file, "newer", overwrite=True)
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
    finally:
        os.umask(usual)


def test_a_link_stays_and_the_file_behind_it_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "1.txt").write_bytes(b"old")
    link = tmp_path / "latest.txt"
    link.symlink_to(Path("runs") / "1.txt")
    with pytest.raises(sr.OutputExists, match=r"latest\.txt exists"):
        write_text(link, "new", overwrite=False)
    assert write_text(link, "new", overwrite=True) == link
    assert link.is_symlink()
    assert (tmp_path / "runs" / "1.txt").read_bytes() == b"new"
    assert names(tmp_path / "runs") == ["1.txt"]


def test_a_link_into_nowhere_is_something_that_exists(tmp_path: Path) -> None:
    link = tmp_path / "a.txt"
    link.symlink_to(tmp_path / "b.txt")
    with pytest.raises(sr.OutputExists):
        write_text(link, "new", overwrite=False)
    assert not (tmp_path / "b.txt").exists()
    write_text(link, "new", overwrite=True)
    assert (tmp_path / "b.txt").read_bytes() == b"new"


def test_links_in_circles_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(sr.OutputError, match="cannot write"):
        write_text(tmp_path / "a", "new", overwrite=True)


def test_devices_and_pipes_are_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    (tmp_path / "link").symlink_to("/dev/null")
    for place in (pipe, tmp_path / "link", Path("/dev/null")):
        with pytest.raises(sr.OutputExists, match="is a device or a pipe"):
            write_text(place, "new", overwrite=True)
    assert pipe.is_fifo()
    assert Path("/dev/null").is_char_device()


def test_a_write_protected_file_stays(tmp_path: Path) -> None:
    file = write_text(tmp_path / "a.txt", "old", overwrite=False)
    file.chmod(0o444)
    with pytest.raises(sr.OutputError, match=r"a\.txt: it is write-protected"):
        new_file(file, overwrite=True)
    assert file.read_bytes() == b"old"


def test_a_folder_without_permission_is_refused_before_the_work() -> None:
    with tempfile.TemporaryDirectory() as name:  # one that others may enter
        folder = Path(name)
        folder.chmod(0o555)
        if os.geteuid() == 0:
            os.seteuid(65534)  # root may write everywhere
        try:
            with pytest.raises(sr.OutputError, match="no permission"):
                new_file(folder / "a.txt", overwrite=False)
            with pytest.raises(sr.OutputError, match="no permission"):
                free_folder(folder)
            with pytest.raises(sr.OutputError, match="no permission"):
                free_folder(folder / "results" / "today")
        finally:
            if os.getuid() == 0:
                os.seteuid(0)
            folder.chmod(0o755)


def test_the_longest_name_can_be_written(tmp_path: Path) -> None:
    assert names(write_text(tmp_path / ("x" * 251 + ".txt"), "new", overwrite=False).parent) == ["x" * 251 + ".txt"]
    with pytest.raises(sr.OutputError, match="cannot write"):
        write_text(tmp_path / ("x" * 300), "new", overwrite=False)


def test_text_without_utf_8_is_refused(tmp_path: Path) -> None:
    with pytest.raises(sr.OutputError, match=r"cannot write .*a\.txt"):
        write_text(tmp_path / "a.txt", "half of a pair: \udc80", overwrite=False)
    assert names(tmp_path) == []


# --- Nothing is written past softrobots.core.files

# Calls that write, and what they may be there for.
PLAIN_WRITES = {
    "softrobots/core/files.py": "where it is done",
    "scripts/studies/benchmark/processes.py": "a switch of the kernel",
    "softrobots/cli/options/command_line.py": "the null device",
    "softrobots/description/composition.py": "a temporary folder",
    "softrobots/cli/tools/kinematics.py": "a temporary folder",
    "scripts/studies/interop/springs_read.py": "a temporary folder, and the null device",
    "scripts/studies/shared/clean_checkout.py": "a copy of the checkout, made for one run",
    "scripts/environments.py": "the log of a program while it runs",
    "scripts/mutation.py": "the log of a program while it runs",
    "scripts/studies/fuzzing/worker.py": "a temporary folder, a switch of the kernel, and a pipe",
    "scripts/build_docs.py": "a temporary folder, which then becomes the site",
    "docs/site/generated_pages.py": "the folder in which the site is built",
}
WRITING = {
    "write_text", "write_bytes", "savefig", "savez", "savez_compressed", "savetxt", "tofile", "rename",
    "symlink_to", "hardlink_to", "mkstemp", "NamedTemporaryFile", "copy2", "copyfile", "copytree", "fdopen", "mkfifo",
}  # fmt: skip


def plain_writes(file: Path) -> set[str]:
    """Names of calls of a module that write a file, those into an open stream aside."""
    text = file.read_text(encoding="utf-8")
    if not re.search(rf"\b(?:{'|'.join([*WRITING, 'open', 'shutil'])})\b", text):
        return set()  # to parse all modules would take seconds
    tree = ast.parse(text)
    ours = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "softrobots.core.files"
        for alias in node.names
    }
    found = set()
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        shell = isinstance(node.func, ast.Attribute) and getattr(node.func.value, "id", "") == "shutil"
        if shell and name in ("copy", "move"):
            found.add(name)
        if name in WRITING and not (isinstance(node.func, ast.Name) and name in ours):
            first = getattr(node.args[0], "id", "") if node.args else ""
            if not (name.startswith("save") and first in ("file", "picture")):  # into an open stream
                found.add(name)
        modes = [a.value for a in [*node.args, *(k.value for k in node.keywords)] if isinstance(a, ast.Constant)]
        if name == "open" and any(
            isinstance(mode, str) and re.fullmatch(r"[rwxa]b?t?\+?b?t?", mode) and mode.strip("rbt") for mode in modes
        ):
            found.add(name)
    return found


def test_everything_is_written_by_the_module_that_writes() -> None:
    folders = [CHECKOUT / name for name in ("softrobots", "scripts", "docs/site")]
    files = [file for folder in folders for file in folder.rglob("*.py")]
    assert len(files) > 250
    found = {file.relative_to(CHECKOUT).as_posix() for file in files if plain_writes(file)}
    assert found == PLAIN_WRITES.keys()  # the search finds those that there are, and no leave outlives its need


def test_folders_are_made_once_or_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(sr.OutputError, match="cannot create the folder"):
        make_folder(tmp_path / "file" / "inner")
    assert make_folder(tmp_path / "a" / "b").is_dir()
    assert make_folder(tmp_path / "a" / "b").is_dir()
