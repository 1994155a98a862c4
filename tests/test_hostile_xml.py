"""Hostile descriptions and meshes: refused within a second and little memory, or read as a valid robot; and why that is needed.

What is damaged, and how, is in tests/hostile.py and tests/hostile_descriptions.py; scripts/fuzz_readers.py tries many more.
"""

from __future__ import annotations

import importlib.util
import json
import math
import os
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.core.xml_input import DEEPEST, LARGEST_FILE, MOST_ATTRIBUTES, MOST_TAGS, number_in, parse_xml
from softrobots.description.collada_check import collada_problem
from softrobots.description.expansion import expand
from softrobots.description.mesh_files import LARGEST_MESH, MissingMeshWarning, find_mesh
from softrobots.description.readers.mjcf_limits import MOST_ELEMENTS
from softrobots.description.sources import read_source
from softrobots.description.tag_reader import read_tags
from softrobots.description.third_party import UR5, robot_file
from softrobots.description.urdf_structure import MOST_LINKS
from softrobots.view.robot_shapes import RobotShapes
from tests.conftest import CHECKOUT, missing
from tests.support.foreign import BRANCHED, INERTIAL, SPRINGS
from tests.support.hostile import HOSTILE_NUMBERS, Damage, damaged_bytes, damaged_xml
from tests.support.hostile_descriptions import (
    XACRO,
    dae,
    drawn,
    mjcf_corpus,
    mounted_corpus,
    obj,
    read_description,
    read_mesh,
    read_mounted,
    read_text,
    sdf_corpus,
    stl,
    urdf_corpus,
)
from tests.support.hostile_xml_cases import BOMB, REFUSED, ROBOT, VALID, fixed, mjcf
from tests.support.tables import each_row

Corpus = Callable[[], list[bytes]]
Read = Callable[[Path], None]

SECONDS = 3.0
"""CPU time that a refusal may take here [s]. A second is promised, which scripts/fuzz_readers.py counts; beside other tests the
same work takes up to three times as long, as two threads of a core share its units and caches."""
MEGABYTES = 150.0
"""Memory that it may take in addition [MB]: fifteen times the largest file that is read."""


SUFFIX = {
    "URDF": "urdf",
    "URDF text": "txt",
    "MJCF": "xml",
    "SDF": "sdf",
    "xacro": "xacro",
    "STL": "stl",
    "OBJ": "obj",
    "DAE": "dae",
}


def need_simulators() -> None:
    """MuJoCo and Drake, which read MJCF and SDF."""
    for name in ("mujoco", "pydrake"):
        if importlib.util.find_spec(name) is None:
            missing(f"{name} is not installed")


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict]:
    """What becomes of every file of `REFUSED` and `VALID`, all read by one process with little memory and time."""
    need_simulators()
    folder = tmp_path_factory.mktemp("hostile")
    os.mkfifo(folder / "pipe.xml")
    os.mkfifo(folder / "pipe.stl")
    (folder / "bomb.xml").write_text(BOMB + "<mujocoinclude>&j;</mujocoinclude>")
    (folder / "hundreds.xml").write_text(mjcf("<geom size='.1'/>" * 200))
    with (folder / "large.xml").open("wb") as file:
        file.truncate(90_000_000)  # a hole, which takes no place on the disk
    (folder / "huge.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + (100_000).to_bytes(4, "big") * 2 + b"\x08\x02\0\0\0")
    words = []
    for name, (reader, content, *_) in {
        **VALID,
        **REFUSED,
    }.items():  # what is imported for them is there when the hostile ones come
        made = content() if callable(content) else content
        file = folder / f"{name}.{SUFFIX.get(reader, reader.lower())}"
        file.write_bytes(made.encode() if isinstance(made, str) else made)
        words += ["--read", f"{reader}:{file}"]
    command = [sys.executable, str(CHECKOUT / "scripts" / "fuzz_readers.py"), *words, "--seconds", "20", "--megabytes", "2000"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "error::RuntimeWarning"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=500, cwd=CHECKOUT)
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    assert lines, done.stderr[-2000:]
    return {Path(line["file"]).stem: line for line in lines}


@each_row("name", REFUSED)
def test_hostile_file_is_refused_at_once(name: str, outcomes: dict[str, dict]) -> None:
    assert name in outcomes, f"the process ended before or at this file; read were {len(outcomes)}"
    outcome = outcomes[name]
    assert outcome["kind"] == "refused", outcome["message"]
    assert re.search(REFUSED[name][2], outcome["message"]), outcome["message"]
    assert outcome["seconds"] < SECONDS
    assert outcome["megabytes"] < MEGABYTES


@pytest.mark.parametrize("name", VALID)
def test_unusual_file_is_read(name: str, outcomes: dict[str, dict]) -> None:
    assert name in outcomes, f"the process ended before or at this file; read were {len(outcomes)}"
    assert (outcomes[name]["kind"], outcomes[name]["message"]) == ("valid", "")


# --- Damage at random


@pytest.mark.study
@each_row(
    ("corpus", "read", "damage", "cases"),
    [
        (urdf_corpus, read_description, damaged_xml, 30),
        (urdf_corpus, read_text, damaged_bytes, 20),
        (mjcf_corpus, read_description, damaged_xml, 25),
        (sdf_corpus, read_description, damaged_xml, 15),
        (mounted_corpus, read_mounted, damaged_xml, 10),
        (stl, read_mesh, damaged_bytes, 15),
        (obj, read_mesh, damaged_bytes, 15),
        (dae, read_mesh, damaged_xml, 15),
    ],
)
def test_damaged_file_is_refused_or_read(corpus: Corpus, read: Read, damage: Damage, cases: int, tmp_path: Path) -> None:
    """Anything else that is raised, a number that is not finite, and a reader that takes long, fails."""
    if corpus in (mjcf_corpus, sdf_corpus):
        need_simulators()
    suffix = {stl: ".stl", obj: ".obj", dae: ".dae", sdf_corpus: ".sdf"}.get(corpus, ".xml")
    valid = [text for text in corpus() if len(text) < 20_000]
    for file in valid[:1]:
        (tmp_path / "valid").with_suffix(suffix).write_bytes(file)
        read((tmp_path / "valid").with_suffix(suffix))
    refused = []

    @given(st.integers(0, 2**32 - 1), st.integers(0, len(valid) - 1))
    @settings(max_examples=cases, suppress_health_check=list(HealthCheck))
    def check(seed: int, number: int) -> None:
        file = tmp_path / f"damaged{suffix}"
        file.write_bytes(damage(valid[number], np.random.default_rng(seed)))
        start = time.process_time()
        try:
            read(file)
        except sr.SoftRobotsError:
            refused.append(seed)
        assert time.process_time() - start < SECONDS

    check()
    assert 0 < len(refused) < cases  # or nothing is damaged, or everything is refused


# --- What is read is what is written


@each_row("text", [*HOSTILE_NUMBERS, "1", "-1.5", ".5", "5.", "+2e-3", "1E5", " 3 "])
def test_numbers_are_read_as_xml_spells_them(text: str) -> None:
    """Python's own float() is the other reader: what it makes a number of is that number here, or none."""
    try:
        expected = float(text)
    except ValueError:
        expected = math.nan
    value = number_in(text)
    plain = re.fullmatch(r"\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)?\s*", text) is not None and len(text) < 400
    if plain and abs(expected) <= 1e30:
        assert value == expected
    else:
        assert math.isnan(value)


@each_row("value", ["nan", "inf", "1,5", "0x1", "", "1_0", "1e31", "1 2"])
def test_a_mass_that_is_none_is_not_left_out(value: str) -> None:
    """Pinocchio's own parser takes the link for one without mass, and says nothing: that is why it is looked at before."""
    text = BRANCHED.replace('mass value="0.5"', f'mass value="{value}"')
    if value not in ("0x1", "1e31", "1_0"):  # of those it takes what it understands
        assert sum(inertia.mass for inertia in pin.buildModelFromXML(text).inertias) == 0.0
    with pytest.raises(sr.DescriptionError, match=r"has value = '.*' in <mass>; a number up to 1e\+30 in size is required"):
        sr.load_model(text, springs={})


def test_links_in_a_circle_are_not_left_out() -> None:
    circle = '<link name="b"/><link name="c"/>' + fixed("b", "c") + fixed("c", "b", "y")
    assert [frame.name for frame in pin.buildModelFromXML(ROBOT % circle).frames] == ["universe", "root_joint", "a"][::2]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32", "iso-8859-1", "windows-1252"])
def test_names_survive_every_encoding(encoding: str, tmp_path: Path) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n{BRANCHED.replace("elbow", "Gelenk_ä")}'
    file = tmp_path / "robot.urdf"
    file.write_bytes(text.encode(encoding))
    model = sr.load_model(file, springs=SPRINGS, tip="finger")
    assert model.motor_joints == ("shoulder", "Gelenk_ä", "gripper")
    assert (
        sr.load_model(text, springs=SPRINGS, tip="finger").motor_joints == model.motor_joints
    )  # text is Unicode whatever it says
    whole = sr.load_model(sr.mount(file, "finger", sr.InflatableArm(link_lengths=(0.5,))), springs={})
    assert "Gelenk_ä" in whole.motor_joints


def test_xacro_reads_included_files_in_utf8(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Xacro itself reads in the encoding of the system."""
    (tmp_path / "part.xacro").write_bytes('<robot><link name="Glied_ä"/></robot>'.encode())
    file = tmp_path / "whole.xacro"
    include = '<xacro:include filename="part.xacro"/><xacro:include filename="none.xacro" optional="true"/>'
    file.write_text(f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{include}</robot>', encoding="utf-8")
    assert 'name="Glied_ä"' in expand(file)


@pytest.mark.parametrize(
    "body", ['<xacro:part n="1" p="b"><a/></xacro:part>' + "<a/>" * 500, "<xacro:insert_block name='o'/>" * 99]
)
def test_a_macro_that_copies_without_end_is_stopped(body: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Elements count that are copied, not only those that are reached: the first body ended at Python's depth of calls only."""
    monkeypatch.setattr("softrobots.description.expansion.MOST_STEPS", 5000)
    file = tmp_path / "much.xacro"
    block = f"<a>{'<b/>' * 99}</a>"
    file.write_text(XACRO.replace(INERTIAL, block).replace('<xacro:insert_block name="o"/>', body))
    with pytest.raises(sr.DescriptionError, match="goes through more than 5000 elements"):
        expand(file)


# --- Limits where they are


def test_limits_are_far_beyond_every_robot_that_is_known() -> None:
    """Every description of example-robot-data is read; the largest has a sixth of the tags, a fiftieth of the bytes."""
    try:
        folder = robot_file(UR5).parents[2]
    except sr.MissingDependency as error:
        missing(str(error))
    largest = tags = read = 0
    for file in sorted(folder.rglob("*.urdf")):
        text, _ = read_source(file)
        if "<link" not in text:  # of the UR3 there is no more than its name
            continue
        read_tags(text, str(file))
        largest, tags, read = max(largest, len(text)), max(tags, text.count("<")), read + 1
    assert read > 50
    assert 6 * tags < MOST_TAGS
    assert 40 * largest < LARGEST_FILE


def test_the_limits_are_those_of_the_guide() -> None:
    told = " ".join((CHECKOUT / "docs" / "other_tools.md").read_text(encoding="utf-8").split())
    sizes = [f"at most {size // 10**6} MB" for size in (LARGEST_FILE, LARGEST_MESH)]
    for number in (*sizes, f"{MOST_TAGS:,} tags", f"{DEEPEST} elements", f"{MOST_LINKS} links", f"{MOST_ELEMENTS:,} elements"):
        assert number.replace(",", " ") in told


def test_what_is_at_a_limit_is_read() -> None:
    element = "<a {}/>".format(" ".join(f"b{i}='1'" for i in range(MOST_ATTRIBUTES)))
    depth = DEEPEST - 1
    assert parse_xml(f"<r>{'<a>' * depth}{'</a>' * depth}{element}</r>", "it").tag == "r"
    with pytest.raises(sr.DescriptionError, match="nested more than"):
        parse_xml(f"<r>{'<a>' * (depth + 1)}{'</a>' * (depth + 1)}</r>", "it")


def test_a_huge_mesh_is_not_opened(tmp_path: Path) -> None:
    file = tmp_path / "huge.stl"
    with file.open("wb") as stream:
        stream.truncate(LARGEST_MESH)  # takes no room on the disk
    assert find_mesh(str(file)) == file
    os.truncate(file, LARGEST_MESH + 1)
    assert find_mesh(str(file)) is None
    assert find_mesh("a" * 5000) is None
    assert find_mesh(str(tmp_path)) is None


def test_a_mesh_of_another_kind_is_left_out_and_the_kinds_are_told(tmp_path: Path) -> None:
    file = tmp_path / "part.ply"
    file.write_text("ply\n")
    with pytest.warns(MissingMeshWarning, match=r"part\.ply \(\.obj, \.stl, \.dae files are read\)"):
        assert RobotShapes(sr.load_model(drawn(str(file)), springs={})).shapes == ()


@each_row(
    ("old", "new", "told"),
    [
        ("0 0 0 1 0 0", "0 0 0 1 0 zero", "another count of numbers"),
        ('count="12"', 'count="13"', "another count of numbers"),
        ('count="4" stride="3"', 'count="5" stride="3"', "beyond the end of its array"),
        ('count="4" stride="3"', 'count="-4" stride="3"', "has count = '-4' in <accessor>"),
        ('semantic="POSITION"', 'semantic="NORMAL"', "<vertices> without positions"),
        ('semantic="VERTEX"', 'semantic="NORMAL"', "<triangles> without corners"),
        ('url="#g"', 'url="#h"', "has url = '#h', which does not exist"),
        ('<source id="p">', '<source id="v">', "two elements with the id 'v'"),
        ("<p>0", "<p>-0", "text other than whole numbers"),
        ("<instance_geometry", '<instance_node url="#n"/><instance_geometry', "in a circle"),
        ("<asset>", "<asset>" + "<a>" * 100 + "</a>" * 100, "more than 100 deep"),
        ("<asset>", "<asset>&x;", "undefined entity"),
        ("<COLLADA", "<!DOCTYPE a><COLLADA", "document type"),
    ],
)
def test_collada_that_assimp_does_not_survive_is_told(old: str, new: str, told: str, tmp_path: Path) -> None:
    (text,) = dae()
    file = tmp_path / "part.dae"
    file.write_bytes(text)
    assert collada_problem(file) == ""
    assert old.encode() in text
    file.write_bytes(text.replace(old.encode(), new.encode(), 1))
    assert told in collada_problem(file)


def test_collada_of_the_ur5_is_read() -> None:
    try:
        folder = robot_file(UR5).parents[1] / "meshes"
    except sr.MissingDependency as error:
        missing(str(error))
    files = sorted(folder.rglob("ur5/**/*.dae"))
    assert files
    assert {collada_problem(file) for file in files} == {""}


def test_mjcf_that_is_text_includes_nothing() -> None:
    need_simulators()
    with pytest.raises(sr.DescriptionError, match="which has no folder; a path of a file is required"):
        sr.load_model(mjcf(before='<include file="a.xml"/>'))


# --- The script finds what there is


SEED, CASES = 37, 8
PLANTED = """
import importlib.util, os, pathlib, sys, time

sys.path.insert(0, str(pathlib.Path({script!r}).parent))

spec = importlib.util.spec_from_file_location("fuzz_readers", {script!r})
script = importlib.util.module_from_spec(spec)
spec.loader.exec_module(script)
script.SCRIPT = __file__
from studies.fuzzing import readers

def damage(data, rng):
    return (b"crash", b"hang", b"slow", b"large", b"other", b"refused", b"valid")[rng.integers(7)]

def read(file):
    text, start = file.read_bytes(), time.process_time()
    if text == b"crash":
        os.abort()
    while text == b"hang" or text == b"slow" and time.process_time() - start < 0.3:
        pass
    if text == b"large":
        bytearray(2**31)
    if text == b"other":
        raise ZeroDivisionError("planted")
    if text == b"refused":
        raise script.sr.DescriptionError("planted")

script.READERS["planted"] = readers.Reader(lambda: [b"valid"], damage, read, ".txt", 0.2)
"""
TOLD = {
    b"crash": "ended: signal SIGABRT",
    b"hang": "ended: too much CPU time",
    b"slow": "beyond: 0.3",
    b"large": "other: MemoryError",
    b"other": "other: ZeroDivisionError: planted",
}


@pytest.mark.study
def test_the_script_tells_crashes_hangs_and_other_exceptions_apart(tmp_path: Path) -> None:
    planted = PLANTED.format(script=str(CHECKOUT / "scripts" / "fuzz_readers.py"))
    names: dict[str, Any] = {"__file__": str(tmp_path / "planted.py")}
    exec(planted, names)
    contents = [names["script"].case("planted", number, SEED) for number in range(CASES)]
    assert set(contents) == {*TOLD, b"refused", b"valid"}  # the seed is chosen so
    (tmp_path / "planted.py").write_text(f"{planted}\nsys.exit(script.main())\n")
    found = tmp_path / "found.json"
    words = [
        "--reader",
        "planted",
        "--processes",
        "1",
        "--cases",
        str(CASES),
        "--seed",
        str(SEED),
        "--seconds",
        "0.6",
        "--output",
        str(found),
    ]
    command = [sys.executable, str(tmp_path / "planted.py"), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, cwd=CHECKOUT)
    assert done.returncode == 1, done.stderr[-2000:]
    result = json.loads(found.read_text())
    (row,) = result["readers"]
    counts = {kind: row[kind] for kind in ("inputs", "refused", "valid", "other", "ended", "beyond")}
    told = Counter(contents)
    assert counts == {
        "inputs": CASES,
        "refused": told[b"refused"],
        "valid": told[b"valid"],
        "other": told[b"large"] + told[b"other"],
        "ended": told[b"crash"] + told[b"hang"],
        "beyond": told[b"slow"],
    }
    for number, text in enumerate(contents):
        assert dict(result["found"]["planted"]).get(number, "").startswith(TOLD.get(text, ""))
    assert len(result["found"]["planted"]) == sum(told[text] for text in TOLD)
