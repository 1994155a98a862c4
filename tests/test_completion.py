"""`softrobots completion`: what a shell offers once it has read the script."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import softrobots as sr
from softrobots.cli.main import COMMANDS
from softrobots.export.formats import FORMATS
from tests.conftest import missing

Complete = Callable[..., set[str]]

NAMES = {command.__name__.rpartition(".")[2] for command in COMMANDS}

ASK = """
ask() {
  COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()
  _shtab_softrobots "$1" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
  printf '%s\\n' "${COMPREPLY[@]}" --
}
"""
CASES = {
    "commands": ("",),
    "a command": ("so",),
    "robots and files": ("solve", ""),
    "a robot": ("solve", "infl"),
    "a robot behind an option": ("solve", "--force", "0", "0", "1", "infl"),
    "a robot that may be left out": ("urdf", "helix_tube_"),
    "a file in the place of a robot": ("ik", "some"),
    "a file in a folder": ("solve", "sub/"),
    "options": ("solve", "inflatable_arm", "--m"),
    "options behind numbers": ("solve", "inflatable_arm", "--motors", "0.1", "0.2", "--fo"),
    "choices": ("solve", "inflatable_arm", "--method", ""),
    "choices of another command": ("load", "inflatable_arm", "--method", ""),
    "formats": ("export", "inflatable_arm", "--format", ""),
    "a file of waypoints": ("ik", "inflatable_arm", "--waypoints", ""),
    "a file to write": ("ik", "inflatable_arm", "-o", "some"),
    "shells": ("completion", ""),
    "nothing": ("solve", "inflatable_arm", "--met", "no such"),
}


@pytest.fixture(scope="module")
def offered(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """What bash offers for each of `CASES`, in a folder with some files."""
    bash = shutil.which("bash")
    if bash is None:
        missing("bash is not installed")
    folder = tmp_path_factory.mktemp("completion")
    (folder / "some path.csv").touch()
    (folder / "some.urdf").touch()
    (folder / "sub").mkdir()
    (folder / "sub" / "inner.urdf").touch()
    with pytest.MonkeyPatch.context() as patch:
        printed: list[str] = []
        patch.setattr("sys.stdout.write", printed.append)
        from softrobots.cli.main import main

        assert main(["completion", "bash"]) == 0
    quoted = ("ask " + " ".join(f"'{word}'" for word in ("softrobots", *words)) for words in CASES.values())
    script = "\n".join(["set -u", "".join(printed), ASK, *quoted, "complete -p softrobots"])
    # Nothing on stderr: compopt complains outside of a real completion, and shtab keeps that to itself.
    done = subprocess.run([str(bash), "--norc"], input=script, capture_output=True, text=True, check=True, cwd=folder)
    assert done.stderr == ""
    *answers, registered = done.stdout.split("--\n")
    assert registered == "complete -o bashdefault -F _shtab_softrobots softrobots\n"
    return {case: set(answer.splitlines()) - {""} for case, answer in zip(CASES, answers, strict=True)}


def test_bash_completes_commands(offered: dict[str, set[str]]) -> None:
    assert offered["commands"] == NAMES
    assert offered["a command"] == {"solve"}
    assert offered["shells"] == {"bash", "zsh", "tcsh"}


def test_bash_completes_robots_and_files(offered: dict[str, set[str]]) -> None:
    assert offered["robots and files"] == {*sr.ROBOTS, "some path.csv", "some.urdf", "sub"}
    assert offered["a robot"] == {"inflatable_arm", "inflatable_arm_two_hinges"}
    assert offered["a robot behind an option"] == {"inflatable_arm", "inflatable_arm_two_hinges"}
    assert offered["a robot that may be left out"] == {"helix_tube_lumped"}
    assert offered["a file in the place of a robot"] == {"some path.csv", "some.urdf"}
    assert offered["a file in a folder"] == {"sub/inner.urdf"}
    assert offered["a file of waypoints"] == {"some path.csv", "some.urdf", "sub"}
    assert offered["a file to write"] == {"some path.csv", "some.urdf"}


def test_bash_completes_options_and_choices(offered: dict[str, set[str]]) -> None:
    assert offered["options"] == {"--motors", "--moment", "--method", "--muscles"}
    assert offered["options behind numbers"] == {"--force"}
    assert offered["choices"] == {"newton", "fixed_point"}
    assert offered["choices of another command"] == {"newton", "alternation"}
    assert offered["formats"] == set(FORMATS)
    assert offered["nothing"] == set()


@pytest.mark.parametrize(
    ("shell", "marks"),
    [
        ("zsh", ("#compdef softrobots", "'robots:robot:(inflatable_arm ", "_files", "--waypoints")),
        ("tcsh", ("complete softrobots", "n/solve/(inflatable_arm ", "n/--waypoints/f/")),
    ],
)
def test_other_shells(shell: str, marks: tuple[str, ...], told, tmp_path: Path) -> None:
    """Their text; a shell that is installed also reads it (`-n`: without doing it)."""
    status, out, err = told("completion", shell)
    assert (status, err) == (0, "")
    for mark in (*marks, *NAMES):
        assert mark in out
    if shutil.which(shell):
        (tmp_path / "script").write_text(out, encoding="utf-8")
        subprocess.run([shell, "-n", str(tmp_path / "script")], check=True)


@pytest.mark.parametrize(("words", "message"), [((), "required: SHELL"), (("fish",), "invalid choice: 'fish'")])
def test_completion_refuses(words: tuple[str, ...], message: str, told) -> None:
    status, out, err = told("completion", *words)
    assert (status, out) == (2, "")
    assert message in err
