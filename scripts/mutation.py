"""Change the statics and the closed forms in small ways, one at a time, and see whether a test notices (mutation testing).

mutmut makes the changes: another sign, operator, number, comparison, text or argument; None for a value; a branch never taken.
It does so in a copy of the checkout with an environment of its own, and runs for each change the tests that call the changed
function until one fails. Functions with a decorator other than staticmethod and classmethod, and constants of modules, stay
as they are.

A change that no test notices must be explained in docs/validation/mutants_explained.json, or be one of the wording of an
error. Prints a table of the modules; the exit status is 1 if a change is not explained, or if an explanation explains nothing
any more. Takes about half an hour on two quiet cores for all modules (estimated from parts).
"""

from __future__ import annotations

import argparse
import configparser
import io
import json
import os
import re
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import IO, NamedTuple

from tqdm import tqdm

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import positive_integer
from softrobots.core.files import make_folder, write_text
from studies.mutation.mutants import SURVIVED, TIMED_OUT, Explanation, Mutant, Verdict, judge, read_explanations, read_mutants
from studies.shared.clean_checkout import copy_checkout, find_uv, make_environment
from studies.shared.folders import free_folder
from studies.shared.recorded_run import FOLDER, check_page, write_record

CHECKOUT = Path(__file__).resolve().parent.parent
MUTMUT = "mutmut==3.8.1"
"""Its files are read: another version may have others."""
EXPLAINED = FOLDER / "mutants_explained.json"
"""The table of explanations, in a checkout."""


class Part(NamedTuple):
    """Modules that are changed, and the tests that are to notice."""

    modules: tuple[str, ...]
    """Files of the package."""
    tests: tuple[str, ...]
    """Files in tests/, without `test_` and `.py`."""


STATICS = ("elastostatics", "equilibrium", "stability", "saturation", "laws_statics")
CURVATURE = ("constant_curvature", "laws_constant_curvature", "argument_errors", "hostile_numbers")
HELIX = (
    *(f"helix_{name}" for name in ("shapes", "paths", "contact", "grasping", "fabrication")),
    *("laws_helix", "argument_errors", "hostile_numbers"),
)
PARTS = {
    "elastostatics": Part(("statics/elastic_state.py", "statics/elastostatics.py"), STATICS),
    "sensitivity": Part(("statics/sensitivity.py",), ("sensitivity", "laws_statics_loading")),
    "springs": Part(("model/springs.py",), ("saturation", "laws_other")),
    "sections": Part(
        tuple(f"constant_curvature/{name}.py" for name in ("stumpff", "screws", "strain_chain")), ("strain_chain", "laws_other")
    ),
    "inflated_beam": Part(
        tuple(f"inflated_beam/{name}.py" for name in ("beam", "bending_test", "characterisation")),
        ("inflated_beam", "laws_inflated_beam", "characterisation_fit", "argument_errors", "hostile_numbers"),
    ),
    "constant_curvature": Part(
        tuple(f"constant_curvature/{name}.py" for name in ("arcs", "jacobians", "muscles", "poses")), CURVATURE
    ),
    "helix": Part(tuple(f"helix/{name}.py" for name in ("shapes", "paths", "contact", "tube", "grasping", "pattern")), HELIX),
}
LEFT_OUT = {
    "10000": "ten thousand random cases; what they notice, others do",
    "fixed_point_converges_as_often": "the same",
    "any_numbers_give": "any number and any thing for every argument; what comes back is not looked at",
    "anything_else_gives": "the same",
}
"""Tests that are not run, by a part of their names, and why."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--module", nargs="+", choices=list(PARTS), metavar="NAME", help=f"of {', '.join(PARTS)} (all)")
    result.add_argument("--processes", type=int, default=os.cpu_count() or 1, metavar="N", help="at a time (%(default)s)")
    help_text = (
        "new or empty folder for results.json, the changes that survived, what mutmut said, and its copy of the checkout"
    )
    result.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    help_text = "go on in the folder of an earlier run: what is new or has survived is tested, with the files of today"
    result.add_argument("--resume", type=Path, metavar="FOLDER", help=help_text)
    help_text = "write the table of docs/validation.md in a checkout (this one); without --module"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def settings(parts: list[Part]) -> str:
    """What mutmut is told, as the text of setup.cfg."""
    tests = dict.fromkeys(f"tests/test_{name}.py" for part in parts for name in part.tests)
    options = ["-p", "tests.support.mutation_profile", "--hypothesis-profile=mutation", "-p", "no:cacheprovider", "--tb=no"]
    options += ["-p", "no:unraisableexception"]  # it collects garbage at every end: half of the time of a change
    summary = configparser.ConfigParser()
    summary["mutmut"] = {
        "source_paths": "softrobots",
        "only_mutate": "\n".join(["", *(f"softrobots/{file}" for part in parts for file in part.modules)]),
        "also_copy": "\n".join(["", "xacro", "urdf", "scripts", "docs", "README.md", "CHANGELOG.md"]),
        "pytest_add_cli_args_test_selection": "\n".join(["", *tests, "-k", " and ".join(f"not {name}" for name in LEFT_OUT)]),
        "pytest_add_cli_args": "\n".join(["", *options, "--override-ini=addopts=--import-mode=importlib"]),
        "process_isolation": "forkserver",  # each change in a process in which no test has run
        "track_dependencies": "false",
        "use_git_change_detection": "false",
        "on_dependency_change": "ignore",
        "timeout_multiplier": "10.0",
        "timeout_constant": "3.0",
    }
    text = io.StringIO()
    summary.write(text)
    return text.getvalue()


def test_changes(folder: Path, parts: list[Part], processes: int, *, again: bool) -> list[Mutant]:
    """Let mutmut make the changes and run the tests; what became of each.

    Args:
        folder: Folder of results; the copy of the checkout in it may be there.
        parts: What is changed.
        processes: How many changes are tested at a time.
        again: Whether changes that survived, or took too long, are tested once more.

    Raises:
        OutputError: If the environment cannot be made, or mutmut ends without a result.
    """
    copy, log = folder / "checkout", folder / "log.txt"
    copy_checkout(CHECKOUT, copy)
    write_text(copy / "setup.cfg", settings(parts), overwrite=True)
    with log.open("a", encoding="utf-8") as output:
        if not (copy / ".venv").is_dir():
            make_environment(copy, sys.executable, ["-e", ".[test,fast]", MUTMUT], output)
        (copy / "mutants" / "mutmut-stats.json").unlink(missing_ok=True)  # the tests may call other functions today
        for module in (copy / "mutants" / "softrobots" / file for part in parts for file in part.modules):
            if module.is_file() and "__mutmut_orig" not in module.read_text(encoding="utf-8"):
                module.unlink()  # copied for a run of other modules: taken for changed
        _mutmut(copy, processes, [], output)
        mutants = _read(copy, parts)
        retried = [mutant.name for mutant in mutants if mutant.status in (SURVIVED, TIMED_OUT)]
        if again and retried:
            _mutmut(copy, processes, retried, output)
            mutants = _read(copy, parts)
    return mutants


def _read(copy: Path, parts: list[Part]) -> list[Mutant]:
    files = [f"softrobots/{file}" for part in parts for file in part.modules]
    return [mutant for file in files for mutant in read_mutants(copy / "mutants", file)]


def _mutmut(copy: Path, processes: int, names: list[str], output: IO[str]) -> None:
    """Run mutmut with a progress bar.

    Raises:
        OutputError: If it fails.
    """
    (copy / "mutants" / "failed.txt").unlink(missing_ok=True)
    command = [str(copy / ".venv" / "bin" / "mutmut"), "run", "--max-children", str(processes), *names]
    variables = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
    with (
        subprocess.Popen(
            command, cwd=copy, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as running,
        tqdm(desc="changes once more" if names else "changes", unit="change", total=len(names) or None) as bar,
    ):
        for line in running.stdout or ():  # universal newlines: mutmut ends a line of its progress with a carriage return
            if found := re.search(r"(\d+)/(\d+) ", line):
                if names:  # mutmut counts all of them
                    bar.refresh()
                    continue
                bar.total = bar.total or int(found[2])
                bar.update(int(found[1]) - bar.n)
            else:
                output.write(line)
    if running.returncode:
        failed = copy / "mutants" / "failed.txt"  # tests/support/mutation_profile.py writes it
        text = failed.read_text(encoding="utf-8") if failed.is_file() else f"see {output.name}"
        raise sr.OutputError(f"mutmut ended with status {running.returncode}; tests that fail without a change: {text}")


def table(verdicts: list[Verdict]) -> str:
    """Format what became of the changes as Markdown."""
    rows = [(v.module, v.mutants, v.killed, v.timed_out, v.wording, v.explained, len(v.unexplained)) for v in verdicts]
    rows.append(("all", *(sum(column) for column in list(zip(*rows, strict=True))[1:])))
    head = ("module", "mutants", "killed", "timed out", "survived: wording", "survived: explained", "survived: not explained")
    lines = [f"| {' | '.join(head)} |", "|---" + "|---:" * (len(head) - 1) + "|"]
    return "\n".join([*lines, *(f"| {' | '.join(map(str, row))} |" for row in rows)])


def reasons(explanations: list[Explanation], verdicts: list[Verdict]) -> str:
    """Format the reasons of the table of explanations, with how many changes each is the reason of."""
    modules = {verdict.module for verdict in verdicts}
    counts = Counter(entry.reason for entry in explanations if entry.module in modules)
    return "\n".join(f"- {count}: {reason}" for reason, count in counts.most_common())


def run(arguments: argparse.Namespace) -> bool:
    """Do the whole job; tell whether every change is noticed or explained, and every explanation explains one."""
    find_uv()  # tells at once what is missing
    processes = positive_integer("--processes", arguments.processes)
    if arguments.docs is not None:
        if arguments.module is not None:
            raise sr.ParameterError("--docs", str(arguments.docs), "given without --module")
        check_page(arguments.docs, "mutation")
    explanations = read_explanations(CHECKOUT / EXPLAINED)
    folder = arguments.resume or free_folder(arguments.output or Path("output") / f"mutation_{time.strftime('%Y%m%d_%H%M%S')}")
    if arguments.resume is not None and (arguments.output is not None or not (folder / "checkout").is_dir()):
        raise sr.ParameterError("--resume", str(folder), "the folder of an earlier run, without --output")
    parts = [PARTS[name] for name in arguments.module or PARTS]
    mutants = test_changes(make_folder(folder).resolve(), parts, processes, again=arguments.resume is not None)
    verdicts, stale = judge(mutants, explanations)
    survivors = [mutant for verdict in verdicts for mutant in verdict.unexplained]
    record = "".join(f"{m.name}: {m.status}\n- {m.old}\n+ {m.new}\n\n" for m in survivors)
    write_text(folder / "survivors.txt", record, overwrite=True)
    result = {"mutmut": MUTMUT, "modules": [{**v._asdict(), "unexplained": len(v.unexplained)} for v in verdicts]}
    write_text(folder / "results.json", json.dumps(result, indent=1) + "\n", overwrite=True)
    print(record, end="")
    for entry in stale:
        print(f"{entry.module}: {entry.function}: nothing to explain: {entry.old} -> {entry.new}\n")
    print(f"{table(verdicts)}\n\nfolder: {folder}")
    good = not survivors and not stale
    if arguments.docs is not None and not good:
        print("not recorded: a change is neither noticed nor explained, or an explanation explains none", file=sys.stderr)
    elif arguments.docs is not None:
        shown = f"{table(verdicts)}\n\nReasons in `{EXPLAINED}`, with how many mutants each explains:\n\n"
        shown += reasons(explanations, verdicts)
        resumed = "" if arguments.resume is None else " --resume FOLDER"  # most verdicts are older than the tests of today
        write_record(arguments.docs, "mutation", shown, result, command=f"python scripts/mutation.py{resumed}")
    return good


def main(argv: list[str] | None = None) -> int:
    """Run from the command line: 1 if a change is not noticed and not explained, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
