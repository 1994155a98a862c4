"""Tables, results, documents and commands that are damaged or made to do harm: an error of ours at once, or a valid answer."""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import pickle
import re
import select
import struct
import threading
import time
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots import inflated_beam
from softrobots.core import csv_table, npz_file, result_file
from softrobots.core.result_file import KINDS
from softrobots.helix import ActuatorTable
from softrobots.robots.parameter_file import LARGEST_FILE, read_parameters
from softrobots.view.live import input as live_input
from softrobots.view.live.input import Keys, Lines, WatchedFile
from softrobots.view.live.keys import KeyMoves
from softrobots.view.live.loop import LiveView, follow
from tests.conftest import CHECKOUT, load_script
from tests.support import hostile_data as data
from tests.support.hostile import HOSTILE_NUMBERS
from tests.support.laws import law
from tests.support.tables import each_row

SECONDS = 1.0
"""CPU time of a refusal [s]. Measured: 0.1 s at most, in the largest YAML file."""

MEMORY = 20e6
"""Memory of a refusal [bytes]. Measured: 8 MB at most, a first line of 400 000 names."""

PATH = "t,x,y,z\n0,1,2,3\n1,1,2,4\n"
TABLE = "pressure_Pa,contraction\n0,0.5\n1,0.6\n"
BENDING = "angle [rad],moment [N m]\n0.01,1.7\n0.02,3.4\n0.03,5.1\n"
DEEP = 100_000
"""How many brackets are inside each other; Python's own readers recurse."""


def resident(field: str) -> float:
    """Memory of this process in the physical one [bytes], now (VmRSS) or at most (VmHWM); 0 where the system does not tell."""
    status = Path("/proc/self/status")
    lines = status.read_text(encoding="utf-8").splitlines() if status.is_file() else []
    return sum(1024.0 * float(line.split()[1]) for line in lines if line.startswith(f"{field}:"))


def refused(read: Callable[[Path], object], file: Path, message: str = "") -> str:
    """A reader refuses a file in bounded memory and time; what it says."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")  # the most memory is counted anew
    start, before = time.process_time(), resident("VmRSS")
    with pytest.raises(sr.SoftRobotsError, match=message or None) as caught:
        read(file)
    assert time.process_time() - start < SECONDS
    assert resident("VmHWM") - before < MEMORY
    assert len(str(caught.value)) < 3000
    return str(caught.value)


@pytest.mark.study
@pytest.mark.parametrize("reader", data.READERS)
@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_damaged_files_are_refused_or_valid(reader: str, seed: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A few of the cases of scripts/fuzz_readers.py, which has thousands."""
    corpus, damage, read, ending = data.READERS[reader]
    rng = np.random.default_rng(seed)
    file = tmp_path_factory.getbasetemp() / f"damaged{ending}"
    file.write_bytes(damage(corpus()[rng.integers(len(corpus()))], rng))
    start = time.process_time()
    try:
        read(file)  # raises something else if what it has read is not valid
    except sr.SoftRobotsError as error:
        assert str(error)
    assert time.process_time() - start < SECONDS


@pytest.mark.study
@each_row("reader", data.READERS)
def test_what_is_not_damaged_is_read(reader: str, tmp_path: Path) -> None:
    corpus, _, read, ending = data.READERS[reader]
    for content in corpus():
        (tmp_path / f"a{ending}").write_bytes(content)
        read(tmp_path / f"a{ending}")


# --- What is no file, or no text

PLACES: dict[str, Callable[[Path], Path]] = {
    "nothing": lambda folder: folder / "nothing",
    "a folder": lambda folder: folder,
    "a device without end": lambda _: Path("/dev/zero"),
    "a pipe that nobody writes to": lambda folder: pipe(folder / "pipe"),
    "a name too long": lambda folder: folder / ("a" * 300),
    "a name with a NUL": lambda folder: folder / "a\0b",
    "a loop of links": lambda folder: loop(folder / "loop"),
}


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def loop(path: Path) -> Path:
    path.symlink_to(path)
    return path


@each_row("place", PLACES)
@each_row("read", [sr.read_waypoints, sr.load_result, read_parameters, inflated_beam.read_characterisation])
def test_what_is_no_file_is_refused_at_once(read: Callable[[Path], object], place: str, tmp_path: Path) -> None:
    refused(read, PLACES[place](tmp_path), "^cannot read |are read|the most that is read|it names nothing")


@each_row("encoding", ["utf-16", "utf-16-le", "utf-32", "cp037"])
@each_row(
    ("read", "name", "text"),
    [
        (sr.read_waypoints, "a.csv", PATH),
        (ActuatorTable.read_csv, "a.csv", TABLE),
        (inflated_beam.read_characterisation, "a.csv", BENDING),
        (read_parameters, "a.yaml", "radius: 0.05\n"),
        (read_parameters, "a.json", '{"radius": 0.05}'),
    ],
)
def test_other_encodings_than_utf_8_are_refused(
    read: Callable[[Path], object], name: str, text: str, encoding: str, tmp_path: Path
) -> None:
    file = tmp_path / name
    file.write_bytes(text.encode(encoding))
    refused(read, file, "UTF-8|utf-8|NUL|not JSON|no YAML|mapping|required")
    file.write_bytes(text.encode("utf-8-sig"))
    read(file)


def test_a_pipe_that_somebody_writes_to_is_read(tmp_path: Path) -> None:
    file = pipe(tmp_path / "pipe")
    descriptor = os.open(file, os.O_RDWR)  # or opening it for writing would wait for the reader
    os.write(descriptor, PATH.encode())

    def close_once_read() -> None:  # what nobody has read is lost with the last descriptor
        while select.select([descriptor], [], [], 0.0)[0]:
            time.sleep(0.01)
        os.close(descriptor)

    threading.Thread(target=close_once_read, daemon=True).start()
    assert sr.read_waypoints(file).positions[1].tolist() == [1.0, 2.0, 4.0]


# --- CSV


@each_row(
    ("text", "message"),
    [
        (PATH + "2,1,2,5\0\n", "a NUL character"),
        (PATH + "x" * 2_000_000, "a line of more than"),
        (PATH + '"' + "x" * 200_000, "field larger than field limit"),
        (PATH + '"' + "1,2\n" * 100_000, "field larger than field limit"),  # a quote that is never closed
        (
            "x,y,z" + ",a" * 400_000 + "\n" + "1,2,3\n" * 100_000,
            "3 cells; 400003 are required",
        ),  # each row of 400003, if filled up
        (PATH + "2,1_0,2,3\n", r"line 4: x = '1_0'; a finite number"),  # Python's own float() takes it for ten
        (PATH + "2,\u0661,2,3\n", "line 4: x"),  # and this for one
        (PATH + "2,1,2,3,\n", "line 4: 5 cells; 4 are required"),
        (PATH + "2,1,5,2,3\n", r"line 4: 5 cells; 4 are required \(a decimal comma makes two"),
        ("t;x;y;z\n0;1;2;3\n1;1;2;3\n", "line 1: its cells are parted by semicolons; commas are required, and points"),
        ('"t"\t"x"\t"y"\t"z"\n0\t1\t2\t3\n', "line 1: its cells are parted by tabs; commas are required"),
        (PATH + '2,"1,5",2,3\n', "line 4: x = '1,5'; a finite number is required with a point, not a comma"),
        (PATH + '2,"1,5,5",2,3\n', "line 4: x = '1,5,5'; a finite number is required"),
        ("t,t,x,y,z\n0,0,1,2,3\n1,1,1,2,3\n", "at most once"),
        (PATH + "2," + "9" * 400 + ",2,3\n", "a finite number is required"),
        (PATH + "2,1e31,2,3\n", "at most 1e"),
        (PATH + "1,1,2,3\n", "increasing"),
    ],
)
def test_tables_that_are_made_to_do_harm(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    refused(sr.read_waypoints, tmp_path / "a.csv", message)


@each_row("number", [number for number in HOSTILE_NUMBERS if not number.strip(" +0123456789.e-")])
def test_a_number_is_what_a_table_says_or_refused(number: str, tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f'x,y,z\n1,2,"{number}"\n1,2,3\n', encoding="utf-8")
    try:
        value = float(number)
    except ValueError:
        value = np.inf
    if abs(value) <= 1e30:
        assert sr.read_waypoints(file).positions[0, 2] == value
    else:
        refused(sr.read_waypoints, file)


def test_no_more_rows_and_characters_than_a_limit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text(PATH + "".join(f"{k},0,0,0\n" for k in range(2, 100)), encoding="utf-8")
    assert len(sr.read_waypoints(file).times) == 100
    monkeypatch.setattr(csv_table, "MOST_ROWS", 99)
    refused(sr.read_waypoints, file, "line 101: more than 99 rows")
    monkeypatch.setattr(csv_table, "LARGEST_FILE", 500)
    refused(sr.read_waypoints, file, "more than 500 characters")


# --- JSON

JSON_READERS: dict[str, tuple[Callable[[Path], object], str]] = {
    "design": (sr.load_result, "a.json"),
    "benchmark": (data.read_bench, "a.json"),
    "parameters": (read_parameters, "a.json"),
    "live": (data.read_wanted, "a.txt"),
}


@pytest.mark.parametrize("reader", JSON_READERS)
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * DEEP, ""),
        ('{"a": ' * DEEP, ""),
        ('{"a": ' + "[" * 60 + "]" * 60 + "}", "40 deep"),  # not so deep that Python gives up
        ('{"radius": NaN}', "NaN is not a number in JSON"),
        ('{"force": [0, 0, -Infinity]}', "-Infinity is not a number in JSON"),
        ('{"radius": 1e999}', "a number is larger"),
        ('{"radius": ' + "9" * 400 + "}", "a number is larger"),
        ('{"radius": ' + "9" * 5000 + "}", ""),
        ('{"radius": 1, "radius": 2}', "two members called 'radius'"),
        ('{"radius": 1} {"radius": 2}', "Extra data"),
        ('{"radius": 1', "delimiter"),
        ("{'radius': 1}", "quotes"),
    ],
    ids=range(12),
)
def test_json_that_python_takes_or_dies_of(reader: str, text: str, message: str, tmp_path: Path) -> None:
    read, name = JSON_READERS[reader]
    if reader == "live" and not text.startswith("{"):
        text = '{"force": ' + text
    (tmp_path / name).write_text(text, encoding="utf-8")
    refused(read, tmp_path / name, message)


@each_row("text", ["", "null", "[]", "3", '"robot"', "true"])
@each_row("reader", ["design", "benchmark", "parameters"])
def test_json_that_is_no_object(reader: str, text: str, tmp_path: Path) -> None:
    read, name = JSON_READERS[reader]
    (tmp_path / name).write_text(text, encoding="utf-8")
    refused(read, tmp_path / name)


@pytest.mark.parametrize("figure", ["-1e300", "1e300", "1" + "0" * 300])
def test_figures_that_no_unit_can_tell_are_refused(figure: str, tmp_path: Path) -> None:
    """In nanoseconds they would be infinite."""
    text = data.bench_corpus()[0].decode()
    assert text.count('"our_seconds": 1e-06') == 2
    (tmp_path / "a.json").write_text(text.replace('"our_seconds": 1e-06', f'"our_seconds": {figure}', 1), encoding="utf-8")
    refused(data.read_bench, tmp_path / "a.json", "no results of this benchmark")


# --- YAML


@each_row(
    ("text", "message"),
    [
        ("a: &a [1, 1]\nb: &b [*a, *a]\n", "line 1: no anchors"),  # a few lines more make billions
        ("a: *a\n", "line 1: no anchors"),
        ("<<: {a: 1}\n", "a number, a word, a truth value"),
        ("a: !!python/object/apply:os.system [exit]\n", "line 1: no tags"),
        ("!!python/name:os.system\n", "no tags"),
        ("radius: !!float 1\n", "no tags"),
        ("--- {a: 1}\n--- {b: 1}\n", "line 2: one document"),
        ("radius: 1\nstiffness: 2\nradius: 3\n", "line 3: radius is there twice"),
        ("a: " + "[" * 90_000, "4 deep"),
        ("- " * 45_000, "4 deep"),
        ("{a: " * 20_000, "4 deep"),
        ("a: [" + "1, " * (LARGEST_FILE // 3 - 5) + "]", "at most 5000 names and values"),
        ("a: 1\n" * (LARGEST_FILE // 5), "there twice"),
        ("".join(f"a{k}: 1\n" for k in range(10_000)), "at most 5000 names and values"),
        ("#" * (LARGEST_FILE + 1), "more than 100000 bytes"),
        ("#" * LARGEST_FILE, "a mapping"),
        ("a: " + '"' + "x" * (LARGEST_FILE - 10), "unexpected end"),
        ("a: " + "9" * (LARGEST_FILE - 10), "no finite number"),
        ("a: 1e999\n", "line 1: 1e999 is no finite number"),
        ("a:\n\t- 1\n", r"line 2: .*\\t"),
        ("? [1]\n: 2\n", "line 1: a name is required"),
        ("? {a: 1}\n: 2\n", "line 1: a name is required"),
        (": 2\n", "expected <block end>"),
        ("a: {b: 1}\n", "a: a number, a word"),
        ("a: [{b: {c: 1}}]\n", "a: a number, a word"),
        ("a: [[{b: 1}]]\n", "a: a number, a word"),
        ("robot: [1]\n", "robot: the name of a robot"),
        ("- 1\n- 2\n", "a mapping"),
        ("word", "a mapping"),
        ("", "a mapping"),
        ("{}", "a mapping"),
        ("robot: inflatable_arm\n\x00", "no YAML"),
        ("\x1b[2J: 1\n", "no YAML"),
        ("%YAML 9.9\n---\na: 1\n", "incompatible"),
        ("a: 'b\n", "unexpected end"),
        ("a: b: c\n", "not allowed here"),
    ],
)
def test_parameter_files_that_are_made_to_do_harm(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text, encoding="utf-8")
    told = refused(read_parameters, tmp_path / "a.yaml", message)
    assert told.isprintable()


# --- NPZ


def member(array: Any, **options: Any) -> bytes:
    content = io.BytesIO()
    np.lib.format.write_array(content, np.asarray(array), **options)
    return content.getvalue()


def with_header(header: str, content: bytes = b"", version: bytes = b"\1\0") -> bytes:
    return b"\x93NUMPY" + version + struct.pack("<H", len(header)) + header.encode() + content


def archive(path: Path, members: Sequence[tuple[str, bytes]], packed: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", packed) as made:
        for name, content in members:
            made.writestr(name, content)
    return path


def described(shape: str, descr: str = "'<f8'") -> str:
    return f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n"


def opens(path: Path) -> Any:
    """What a pickle in a file would call."""
    return path.write_text("a pickle was loaded", encoding="utf-8")


class Harm:
    """An object whose pickle writes a file when it is loaded."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return opens, (self.path,)


@each_row(
    ("content", "message"),
    [
        (with_header(described("(10000000000000,)")), "is not that of an array"),
        (with_header(described("(1000000000, 1000000000, 1000000000, 1000000000, 1000000000)")), "is not that of an array"),
        (with_header(described("(-1,)"), bytes(8)), "is not that of an array"),
        (with_header(described("(3.0,)"), bytes(24)), "shape is not valid"),
        (with_header(described("()", "'|O'"), b"x"), "holds object"),
        (with_header(described("()", "[('a', '<f8')]"), bytes(8)), "holds"),
        (with_header(described("()", "'<c16'"), bytes(16)), "holds complex128"),
        (with_header(described("()", "'<M8[s]'"), bytes(8)), "holds datetime64"),
        (with_header(described("()", "'|V8'"), bytes(8)), "holds"),
        (with_header("(" * 900), ""),
        (with_header("{" * 60_000), "Header info length"),
        (with_header("__import__('os').system('exit')"), ""),
        (with_header(described("()"), bytes(8), version=b"\3\0"), "version"),
        (with_header(described("()"), bytes(16)), "is not that of an array"),
        (b"", ""),
        (b"\x93NUMPY", ""),
        (b"not an array", ""),
    ],
)
def test_arrays_that_claim_what_they_are_not(content: bytes, message: str, tmp_path: Path) -> None:
    file = archive(
        tmp_path / "a.npz", [("kind.npy", member("equilibrium")), ("format.npy", member(1)), ("q_motors.npy", content)]
    )
    refused(sr.load_result, file, message)


def test_a_pickle_is_never_loaded(tmp_path: Path) -> None:
    proof = tmp_path / "proof"
    harm = np.array([Harm(proof)], dtype=object)
    for name, content in (("kind.npy", member(harm, allow_pickle=True)), ("kind.npy", pickle.dumps(Harm(proof)))):
        refused(sr.load_result, archive(tmp_path / "a.npz", [(name, content)]))
    (tmp_path / "b.npz").write_bytes(pickle.dumps(Harm(proof)))
    refused(sr.load_result, tmp_path / "b.npz", "not an NPZ archive")
    assert not proof.exists()
    pickle.loads(pickle.dumps(Harm(proof)))
    assert proof.exists()  # it is one that does harm


@each_row("name", ["../../outside.npy", "/outside.npy", "a/b.npy", "a.txt", "a", "..npy", "C:\\a.npy", "a\nb.npy"])
def test_names_that_lead_elsewhere_are_refused(name: str, tmp_path: Path) -> None:
    file = archive(tmp_path / "a.npz", [("kind.npy", member("equilibrium")), (name, member(1.0))])
    refused(sr.load_result, file, "is not an array, or occurs twice")
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_a_small_file_does_not_become_a_large_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight MB of zeros in eight kB: refused by what the archive says, by what the array says, and where both lie."""
    zeros = member(np.zeros(1_000_000))
    file = archive(
        tmp_path / "a.npz", [("kind.npy", member("equilibrium")), ("format.npy", member(1)), ("q_motors.npy", zeros)]
    )
    assert file.stat().st_size < 10_000
    monkeypatch.setattr(npz_file, "LARGEST", 1_000_000)
    refused(sr.load_result, file, "bytes; at most 1000000 are read")
    monkeypatch.setattr(npz_file, "LARGEST", 2**30)
    monkeypatch.setattr(result_file, "LARGEST_OF_ONE", 1_000_000)  # an equilibrium has no such arrays
    refused(sr.load_result, file, "bytes; at most 1000000 are read")
    small = struct.pack("<I", 1000)
    honest = file.read_bytes()
    lying = honest.replace(struct.pack("<I", len(zeros)), small)
    assert lying.count(small) == 2  # before the member, and in the list at the end
    file.write_bytes(lying)
    refused(sr.load_result, file)
    header = described("(109,)").encode()  # 1000 bytes with it
    assert len(zeros[:128]) + 8 * 109 == 1000
    shorter = zeros[:10] + header.ljust(118)[:-2] + b" \n" + zeros[128:]
    file = archive(tmp_path / "b.npz", [("kind.npy", member("equilibrium")), ("q_motors.npy", shorter)])
    file.write_bytes(file.read_bytes().replace(struct.pack("<I", len(shorter)), small))
    refused(sr.load_result, file)


def test_archives_with_long_lists_are_refused_before_those_are_read(tmp_path: Path) -> None:
    many = archive(tmp_path / "many.npz", [(f"a{k}.npy", b"") for k in range(70)])
    refused(sr.load_result, many, "more than 64 arrays")
    content = many.read_bytes()
    few = content[:-12] + struct.pack("<HI", 3, 1 << 31) + content[-6:]  # three members whose list has two GB
    many.write_bytes(few)
    refused(sr.load_result, many, "more than 64 arrays")
    good = archive(tmp_path / "good.npz", [("a.npy", member(1.0))]).read_bytes()
    for content, message in (
        (
            good[:-22] + b"PK\x06\x07" + bytes(16) + good[-22:],
            "more than 64 arrays, or is too large",
        ),  # the list of large files
        (good[:-2] + b"\x04\x00note", "not an NPZ archive"),
        (good + b"after it", "not an NPZ archive"),
        (good[:-1], "not an NPZ archive"),
        (b"PK\x05\x06" + bytes(18), "has no 'kind'"),  # an archive of nothing
    ):
        many.write_bytes(content)
        refused(sr.load_result, many, message)


@pytest.mark.parametrize("packed", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_archives_that_are_packed_otherwise_are_refused(packed: int, tmp_path: Path) -> None:
    refused(
        sr.load_result, archive(tmp_path / "a.npz", [("a.npy", member(np.zeros(99)))], packed), "not compressed by deflation"
    )


def test_encrypted_and_doubled_members_are_refused(tmp_path: Path) -> None:
    file = archive(tmp_path / "a.npz", [("a.npy", member(1.0))])
    content = bytearray(file.read_bytes())
    for signature, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(signature) + place] |= 1
    file.write_bytes(content)
    refused(sr.load_result, file, "encrypted")
    with pytest.warns(UserWarning, match="Duplicate name"):
        archive(file, [("a.npy", member(1.0)), ("a.npy", member(2.0))])
    refused(sr.load_result, file, "or occurs twice")


def saved(tmp_path: Path, kind: str, changes: dict[str, Any]) -> Path:
    with np.load(io.BytesIO(data.result_corpus()[list(data.results()).index(kind)])) as file:
        fields = {**file, **changes}
    np.savez(tmp_path / "a.npz", **{name: value for name, value in fields.items() if value is not None})
    return tmp_path / "a.npz"


def test_the_robot_of_a_result_is_text_and_no_other_file(tmp_path: Path) -> None:
    """A text that is no description is a path where `load_model` is called by people."""
    robot = tmp_path / "robot.urdf"
    robot.write_text(sr.InflatableArm().urdf(), encoding="utf-8")
    assert sr.load_model(str(robot)).n_springs == 4
    refused(sr.load_result, saved(tmp_path, "equilibrium", {"urdf": np.array(str(robot))}), "its urdf is not URDF text")
    refused(sr.load_result, saved(tmp_path, "equilibrium", {"urdf": np.array("/dev/zero")}), "its urdf is not URDF text")


@each_row(
    ("kind", "changes", "message"),
    [
        ("equilibrium", {"kind": None}, "has no 'kind'"),
        ("equilibrium", {"kind": np.array("e" * 10_000)}, "holds 'eeee"),
        ("equilibrium", {"format": np.array(np.nan)}, "format|NaN"),
        ("equilibrium", {"q_springs": None}, "has no 'q_springs'"),
        ("equilibrium", {"q_springs": np.full((1, 4), np.nan)}, "finite"),
        ("equilibrium", {"q_springs": np.full((1, 4), 1e200)}, "at most 1e"),
        ("equilibrium", {"q_springs": np.array([["a", "b", "c", "d"]])}, "finite numbers"),
        ("equilibrium", {"urdf": np.array(3.0)}, "urdf is not a text"),
        ("equilibrium", {"urdf": np.array(["<robot/>"] * 3)}, "urdf is not a text"),
        ("equilibrium", {"model": np.array("[" * DEEP)}, "not JSON"),
        ("equilibrium", {"model": np.array('{"springs": {"a": [NaN, 0]}}')}, "NaN is not a number"),
        ("equilibrium", {"load": np.array('{"wrenches": {}, "wrenches": {}}')}, "two members"),
        ("equilibrium", {"iterations": np.array([-1])}, "must be an array of non-negative integers"),
        ("equilibrium", {"iterations": np.array([1.5])}, "must be an array of non-negative integers"),
        ("equilibrium", {"solver": np.array(["magic"])}, "solver must be one of"),
        ("equilibrium", {"residual": np.array([np.nan])}, "finite"),
        ("load_estimate", {"estimation": np.array("magic")}, "estimation must be one of"),
        ("characterisation", {"stiffness": np.array(-1.0)}, "not those of a fit"),
        ("characterisation", {"stiffness": None}, "has no 'stiffness'"),
        ("characterisation", {"wrinkling_moment": None}, "has no 'wrinkling_moment'"),
        ("characterisation", {"stiffness_interval": np.array([300.0, 400.0])}, "not those of a fit"),
        ("characterisation", {"n_saturated": np.array(0)}, "not those of a fit"),
        ("characterisation", {"angle_offset": np.array(np.nan)}, "finite"),
        ("trajectory", {"following": np.array("x" * 81)}, "following must be 1 to 80 printable"),
        ("workspace", {"refused": np.array(-1)}, "must be an array of non-negative integers"),
        ("workspace_map", {"grid_x": np.array([0.8, 0.6])}, "increasing"),
        ("branches", {"labels": np.array([1, 2])}, "labels is not a text"),
        ("branches", {"ends": np.array(["\n", "lost"])}, "ends must be 1 to 80 printable"),
        ("branches", {"n_crossings": np.array([-1, 2])}, "must be an array of non-negative integers"),
        ("branches", {"frame": np.array("nowhere")}, "nowhere"),
        ("vibration_modes", {"frequencies": np.full(7, 3.0)}, "not those of its equilibrium"),
        ("vibration_modes", {"mass_damping": np.array(-1.0)}, "zero or positive"),
        ("motion", {"interrupted": np.array(2)}, "say whether it was interrupted"),
        ("motion", {"q_springs": np.full((3, 4), 1e200)}, "at most 1e"),
        ("measurements", {"columns": np.array("[" * DEEP)}, "not JSON"),
        ("measurements", {"columns": np.array("{}")}, "entry 'actuators'"),
        ("measurements", {"numbers": np.full((2, 5), np.inf)}, "finite"),
        ("measurements", {"names": np.array(["a"])}, "zip"),
        ("measurements", {"labels": np.array(["a", "b\n"])}, "printable"),
        ("identification", {"robot": np.array('{"Robot": {}}')}, "Robot"),
        ("identification", {"robot": np.array('{"PccArm": {}}')}, "not that of its model"),
        ("identification", {"parameters": np.array("[]")}, "at least one"),
        ("identification", {"rows_covariance": np.full((2, 2), np.nan)}, "finite"),
        ("identification", {"fitted_counted_0": np.ones((2, 3))}, "truth values"),
        ("identification", {"outliers": np.array([7])}, "do not fit"),
        ("cross_validation", {"errors": np.ones((2, 3))}, "shape"),
        ("cross_validation", {"errors": -np.ones((2, 2))}, "not errors"),
        ("cross_validation", {"facts": np.array("[" * DEEP)}, "not JSON"),
        ("cross_validation", {"facts": np.array('{"sets": {"k": [7]}, "families": ["a", "b"], "unit": "m"}')}, "7 is no name"),
        ("cross_validation", {"facts": np.array('{"sets": [], "families": [], "unit": "m"}')}, "items"),
        ("contact_path", {"force": np.full((2, 3), 1.0)}, "cone of friction|residual"),
        ("contact_path", {"point": np.zeros((2, 3))}, "not where its robot touches"),
        ("contact_path", {"status": np.array(["sticks", "glued"])}, "status must be one of"),
        ("contact_path", {"dissipation": np.array([0.0, np.nan])}, "finite"),
        ("contact_path", {"parameters": np.array([0.0])}, "dissipation must be"),
        ("ik_solution", {"steps": np.array(2.5)}, "must be an array of non-negative integers"),
    ],
)
def test_results_that_claim_what_they_are_not(kind: str, changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    refused(sr.load_result, saved(tmp_path, kind, changes), message)


@each_row("kind", KINDS)
def test_cut_off_anywhere_a_result_is_refused(kind: str, tmp_path: Path) -> None:
    content = data.result_corpus()[list(data.results()).index(kind)]
    for end in range(0, len(content), len(content) // 12):
        (tmp_path / "a.npz").write_bytes(content[:end])
        with pytest.raises(sr.FileFormatError, match="it is not an NPZ archive"):
            sr.load_result(tmp_path / "a.npz")


def test_what_could_not_be_read_again_is_not_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(npz_file, "LARGEST", 50_000)
    with pytest.raises(sr.ParameterError, match="of at most 50000 bytes, the most that is read again"):
        sr.save_result(data.results()["trajectory"], tmp_path / "a.npz")
    assert list(tmp_path.iterdir()) == []


# --- Live input


class Shown:
    """A page that shows nothing."""

    serving = True

    def show(self, equilibrium: sr.Equilibrium) -> None:
        """Show nothing."""
        assert np.all(np.isfinite(equilibrium.q))

    def mark(self, target: Any) -> None:
        """Mark nothing."""


@settings(max_examples=20)
@given(typed=st.binary(max_size=60) | st.text("xXyYzZ+-<>tfgr123?:q \n\x1b[ABCD56~", max_size=30).map(str.encode))
def test_any_keys_are_followed_or_told(arm: sr.SoftModel, typed: bytes) -> None:
    reading, writing = os.pipe()
    try:
        os.write(writing, typed + b"\nq")  # the line that `:` may have begun ends; then everything
        os.close(writing)
        told: list[str] = []
        live = LiveView(Shown(), sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0.0, 0.0, -5.0)))
        terminal: Any = SimpleNamespace(lines=contextlib.nullcontext)
        follow(live, Keys(reading, told.append, terminal, KeyMoves(live.equilibrium)), told.append, told.append)
    finally:
        os.close(reading)
    assert np.all(np.isfinite(live.equilibrium.q))


def test_steps_of_keys_stay_numbers(arm: sr.SoftModel) -> None:
    """Whoever leans on a key: a thousand doublings would make a step infinite, and a thousand halves none."""
    held = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8))
    start = LiveView(Shown(), held).start
    for key in "<>":
        moves = KeyMoves(held)
        for _ in range(1500):
            moves.press(key, start, start, held)
        wanted = moves.press("x", moves.press("+", start, start, held), start, held)
        moves.press("f", start, start, held)
        pushed = moves.press("y", wanted, start, held)
        for numbers in (wanted.target, wanted.motors, pushed.force):
            assert np.all(np.isfinite(numbers))
        assert not np.array_equal(pushed.force, start.force)


@law("view.live.loop.LiveView")
@settings(max_examples=25)
@given(sent=st.binary(max_size=200) | st.text('targetmotorsforcegravityon {}[]:,"0123456789.e-\n', max_size=80).map(str.encode))
def test_any_lines_of_a_pipe_are_followed_or_told(arm: sr.SoftModel, sent: bytes) -> None:
    reading, writing = os.pipe()
    try:
        os.write(writing, sent)
        os.close(writing)
        told: list[str] = []
        live = LiveView(Shown(), sr.solve_equilibrium(arm, (0.3, 0.6, -0.8)))
        follow(live, Lines(reading, told.append), told.append, told.append)
    finally:
        os.close(reading)
    assert all("\x1b" not in line for line in told)  # or what comes through a pipe would move the cursor


def test_a_watched_file_may_lie_about_its_size(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Files of the kernel have no size until they are read, and some have no end."""
    monkeypatch.setattr(live_input, "_LARGEST", 1000)
    live = LiveView(Shown(), sr.solve_equilibrium(arm, (0.3, 0.6, -0.8)))
    endless = Path("/proc/kallsyms")
    if not endless.is_file():
        pytest.skip("only Linux has such files")
    assert endless.stat().st_size == 0
    with pytest.raises(sr.FileFormatError, match="a file of at most 1000 bytes"):
        WatchedFile(endless, lambda _: None).read(live)


# --- The command line


@each_row(
    ("words", "message"),
    [
        (["link_lengths=[" + "1," * 20_000 + "]"], "at most 1000"),
        (["link_lengths=" + "[" * 20_000], "link_lengths"),
        (["stiffness=" + "9" * 5000], "stiffness"),
        (["stiffness=1e999"], "stiffness"),
        (["stiffness=nan"], "stiffness"),
        (["stiffness=9**9**9**9"], "stiffness"),
        (["stiffness=__import__('os').getcwd()"], "stiffness"),
        (["stiffness={1: 2}"], "stiffness"),
        (["stiffness=1j"], "stiffness"),
        (["stiffness=True"], "stiffness"),
        (["stiffness=[[1],[2]]"], "stiffness"),
        (["radius=$(arg stiffness)"], "radius"),
        (["radius=${1+1}"], "radius"),
        (["rgba=[1,2,3,4]"], "rgba"),
    ],
)
def test_values_of_parameters_that_are_made_to_do_harm(words: list[str], message: str, told) -> None:
    start = time.process_time()
    status, out, err = told("urdf", "inflatable_arm", "--set", *words)
    assert (status, out) == (2, "")
    assert message in err
    assert time.process_time() - start < SECONDS


def test_robots_too_large_for_statics_are_refused_before_they_are_made(told) -> None:
    start = time.process_time()
    lengths = "[" + ",".join(["0.1"] * 400) + "]"
    status, _, err = told("solve", "inflatable_arm", "--set", f"link_lengths={lengths}", "--motors", "0")
    assert status == 2
    assert "at most 300 joints, not 1201" in err
    with pytest.raises(sr.ParameterError, match="elastic_sections must be a positive integer, at most 2"):
        sr.PccArm(segment_lengths=(0.1,) * 1000, offset=0.0, elastic_sections=3)
    assert time.process_time() - start < SECONDS


# --- Nothing that is read is run

RUNS = {"exec", "eval", "compile", "__import__", "ast.literal_eval", "literal_eval", "os.system", "os.popen"}
RUNS |= {f"{module}.{call}" for module in ("np", "numpy", "json", "yaml", "torch") for call in ("load", "loads")}
RUNS |= {f"yaml.{call}" for call in ("load_all", "unsafe_load", "full_load", "unsafe_load_all", "full_load_all")}
FORBIDDEN = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
ALLOWED = {
    ("scripts/studies/benchmark/processes.py", "json.loads"): "what a process of ours prints",
    ("softrobots/cli/bench.py", "json.loads"): "the text that was made just before",
    ("softrobots/cli/options/robot_parameters.py", "ast.literal_eval"): "values behind --set: literals only",
    ("scripts/studies/interop/bullet_statics.py", "compile"): "the exported file is run as PyBullet's users run it",
    ("scripts/studies/interop/bullet_statics.py", "exec"): "the same",
    ("softrobots/core/json_text.py", "json.loads"): "the reader of all JSON",
    ("softrobots/compiled/run/backends.py", "compile"): "code that compiled/ has generated",
    ("softrobots/compiled/run/backends.py", "exec"): "the same",
    ("scripts/environments.py", "json.loads"): "what pip prints",
    ("scripts/studies/fuzzing/worker.py", "json.loads"): "what a process of its own prints",
    ("scripts/measure_coverage.py", "json.loads"): "what coverage writes",
    ("scripts/draw_architecture.py", "json.loads"): "what the picture of the checkout records",
}


def uses_of(file: Path) -> set[str]:
    """What a module uses of what runs or loads things: calls, modules that pickle, shells."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            found |= {f"import {name}" for name in names if name.split(".")[0] in FORBIDDEN}
        if isinstance(node, ast.Call):
            found |= {ast.unparse(node.func)} & RUNS
            for option in node.keywords:
                if option.arg == "shell" or (option.arg == "allow_pickle" and ast.unparse(option.value) != "False"):
                    found.add(option.arg)
    return found


@pytest.mark.study
def test_nothing_that_is_read_is_run() -> None:
    """No pickle, no eval, no shell, no reader of YAML that makes objects: every use of such a thing has its reason."""
    words = re.compile(r"exec|eval|compile\(|__import__|system|popen|load|shell|pickle|marshal|shelve|dill")
    files = [file for folder in ("softrobots", "scripts") for file in (CHECKOUT / folder).rglob("*.py")]
    files = [file for file in files if words.search(file.read_text(encoding="utf-8"))]
    assert {(str(file.relative_to(CHECKOUT)), use) for file in files for use in uses_of(file)} <= set(ALLOWED)


def test_the_scan_sees_what_it_looks_for(tmp_path: Path) -> None:
    file = tmp_path / "a.py"
    file.write_text(
        "import pickle\nfrom marshal import loads\nnp.load(f, allow_pickle=True)\nrun(c, shell=True)\neval(x)\nyaml.load(f)\n",
        encoding="utf-8",
    )
    assert uses_of(file) == {"import pickle", "import marshal", "np.load", "allow_pickle", "shell", "eval", "yaml.load"}


# --- No reader is forgotten

DOORS = {"opened", "read_bytes", "read_text", "read_json", "arrays_of_json", "read_xml", "read_arrays", "read_table"}
"""Names of functions that bring in what a file says."""
DOORWAYS = {
    "core.bounded_reading": "the door itself",
    "core.csv_table": "the door itself",
    "core.json_text": "the door itself",
    "core.npz_file": "the door itself",
    "core.xml_input": "the door itself",
    "description.sources": ("URDF", "MJCF", "SDF"),
    "description.readers.mjcf_limits": ("MJCF",),
    "description.expansion": ("xacro",),
    "cli.tools.kinematics": ("URDF",),
    "description.collada_check": ("DAE",),
    "statics.time_law": ("waypoints CSV",),
    "helix.actuators": ("actuator CSV",),
    "inflated_beam.characterisation": ("characterisation CSV",),
    "identification.measurement_table": ("measurements CSV",),
    "identification.measurement_columns": ("columns YAML",),
    "core.result_file": ("results NPZ", "results JSON", "design JSON"),
    "core.checkpoint": ("checkpoint JSON", "checkpoint NPZ"),
    "studies.benchmark.results": ("benchmark JSON",),
    "environment.world_files": ("environment YAML", "environment JSON", "world URDF", "world MJCF", "world SDF"),
    "robots.parameter_file": ("parameters YAML", "parameters JSON"),
    "view.live.input": ("watched file",),
    "export.meshes": ("STL",),
    "cli.simulate": "tables of numbers, through the same door as tables of measurements",
    "studies.shared.recorded_run": "a page of the checkout",
    "studies.measured.comparison": "tables of the checkout",
    "studies.measured.recorded_arm": "runs recorded in the checkout",
    "studies.mutation.mutants": "what the tool has just written",
    "compiled.translate.c": "a file of ours in C",
    "compiled.browser.script": "a file of ours in JavaScript",
    "compiled.run.backends": "compares a file with what is generated, byte for byte",
    "export.python_text": "a template of ours",
    "studies.shared.machine": "a file of the kernel",
    "studies.fuzzing.worker": "a file of the kernel",
    "studies.interop.results": "a page of the checkout, and the results that the study itself wrote",
    "studies.benchmark.processes": "a file of the kernel",
    "view.interactive.text": "scripts and a template of ours",
    "view.meshcat_page.server_process": "a page of ours",
    "view.meshcat_page.page_text": "a template of ours",
}
"""Modules that read files, and the readers of the campaign that go through them, or why there is none."""


def readers_in(text: str) -> bool:
    """Whether a module reads files: by one of the doors, or a file opened for reading."""
    calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
    names = {ast.unparse(call.func).rpartition(".")[2] for call in calls}
    modes = [
        argument.value
        for call in calls
        for argument in call.args[:2]
        if ast.unparse(call.func).rpartition(".")[2] == "open" and isinstance(argument, ast.Constant)
    ]
    return bool(names & DOORS) or "rb" in modes or "r" in modes


@pytest.mark.study
def test_every_module_that_reads_files_is_tried() -> None:
    script = load_script("fuzz_readers")
    package, scripts = CHECKOUT / "softrobots", CHECKOUT / "scripts"
    files = {file: ".".join(file.relative_to(package).with_suffix("").parts) for file in package.rglob("*.py")}
    files |= {file: ".".join(file.relative_to(scripts).with_suffix("").parts) for file in (scripts / "studies").rglob("*.py")}
    found = {name for file, name in files.items() if readers_in(file.read_text(encoding="utf-8"))}
    assert found == set(DOORWAYS)
    tried = {reader for told in DOORWAYS.values() if isinstance(told, tuple) for reader in told}
    assert tried <= set(script.READERS)
    # The rest go through these doors with another caller: text instead of a file, meshes by their library, lines of a pipe.
    assert set(script.READERS) - tried == {"URDF text", "mount", "OBJ", "typed lines"}


def test_json_is_checked_as_python_reads_it(tmp_path: Path) -> None:
    """What is accepted is what Python's own reader makes of it."""
    said = {"robot": "pcc_arm", "radius": 0.05, "hinges": 12, "torsion": True, "offset": [0.0, 1e-3]}
    (tmp_path / "a.json").write_text(json.dumps(said), encoding="utf-8")
    read = read_parameters(tmp_path / "a.json")
    assert {"robot": read.robot, **read.values} == {**said, "offset": (0.0, 1e-3)}
