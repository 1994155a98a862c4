"""Files that ask for much by many things, each of which is let through: refused at once; and what people have is read."""

from __future__ import annotations

import time
import zipfile
from pathlib import Path

import pytest
from PIL import Image

import softrobots as sr
from softrobots.core.json_text import parse_json
from softrobots.core.npz_file import read_arrays
from softrobots.core.xml_input import parse_xml, read_xml
from softrobots.description.readers.mjcf_limits import check_mjcf
from softrobots.description.readers.sdf_text import with_found_meshes, without_drawings
from tests.conftest import missing

SECONDS = 3.0
"""CPU time that a refusal may take here [s]. A second is promised; a shared core counts twice or more."""


def mjcf(asset: str = "", body: str = "", top: str = "") -> str:
    return f"<mujoco>{top}<asset>{asset}</asset><worldbody><body>{body}</body></worldbody></mujoco>"


def many(number: int, text: str) -> str:
    return "".join(text.replace("#", str(place)) for place in range(number))


FLEX = '<flexcomp name="f#" type="grid" count="50 50 1" spacing=".1 .1 .1" dim="2"/>'
TOO_MUCH = {
    # 36 million looks at the file system: minutes
    "folders": (mjcf(many(6000, '<mesh file="m#.stl"/>'), top=many(6000, '<compiler meshdir="d#"/>')), "20 folders"),
    # each is 300 MB or 250 MB in MuJoCo
    "textures": (mjcf(many(6, '<texture name="t#" builtin="flat" width="3000" height="3000"/>')), "pixels in all"),
    "heights": (mjcf(many(20, '<hfield name="h#" nrow="4096" ncol="4096" size="1 1 1 1"/>')), "pixels in all"),
    "no number": (mjcf('<texture width="nan" height="2"/>'), "<texture width="),
    # MuJoCo takes more than 15 s
    "flexes": (mjcf(body=many(20, FLEX)), "20000 elements"),
    "flexes again": (mjcf(body=f'<replicate count="500">{FLEX}</replicate>'), "20000 elements"),
}


@pytest.mark.parametrize("name", TOO_MUCH)
def test_many_parts_of_mjcf_are_counted_together(name: str, tmp_path: Path) -> None:
    text, told = TOO_MUCH[name]
    start = time.process_time()
    with pytest.raises(sr.DescriptionError, match=told):
        check_mjcf(parse_xml(text, "it"), "it", tmp_path / "robot.xml")
    assert time.process_time() - start < SECONDS


def test_pixels_of_pictures_are_counted_as_often_as_they_are_named(tmp_path: Path) -> None:
    """MuJoCo keeps one for each texture, also of one file."""
    Image.new("L", (2000, 2000)).save(tmp_path / "p.png")
    few, lot = (mjcf(many(count, '<texture type="2d" name="t#" file="p.png"/>')) for count in (12, 13))
    check_mjcf(parse_xml(few, "it"), "it", tmp_path / "robot.xml")
    with pytest.raises(sr.DescriptionError, match="pixels in all"):
        check_mjcf(parse_xml(lot, "it"), "it", tmp_path / "robot.xml")


@pytest.mark.parametrize(
    "text",
    [
        mjcf(top='<size nstack="300000" nuser_geom="1"/>'),  # the half cheetah of Gym
        mjcf('<texture type="skybox" builtin="gradient" width="512" height="3072"/>'),  # MuJoCo Menagerie
        mjcf('<hfield name="h" nrow="1000" ncol="1000" size="1 1 1 1"/>'),
    ],
)
def test_what_known_robots_ask_for_is_read(text: str) -> None:
    check_mjcf(parse_xml(text, "it"), "it", None)


@pytest.mark.parametrize("spelled", ["utf8", "UTF8", "utf-8"])
def test_usual_spellings_of_utf8_are_read(spelled: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text(f'<?xml version="1.0" encoding="{spelled}"?><robot name="caf\u00e9"/>', encoding="utf-8")
    assert parse_xml(read_xml(file), "it").get("name") == "caf\u00e9"


@pytest.mark.parametrize(("kind", "count"), [("model", 101), ("frame", 1001)])
def test_models_and_frames_of_sdf_are_counted(kind: str, count: int) -> None:
    """Drake takes 17 s for 1800 models, 10 s for 5000 frames that hang on each other."""
    if not missing_drake():
        inner = many(count, f'<{kind} name="x#"/>')
        with pytest.raises(sr.DescriptionError, match=f"{kind}s; at most"):
            sr.load_model(f'<sdf version="1.9"><model name="m"><link name="l"/>{inner}</model></sdf>', springs={})


def missing_drake() -> bool:
    try:
        import pydrake.multibody.parsing  # noqa: F401
    except ImportError:
        missing("drake is not installed")
        return True
    return False


def test_drawings_are_taken_out_in_time_that_grows_with_their_number() -> None:
    """One by one, each behind the blanks of all before it, 19000 took 5 s."""
    text = '<sdf><model name="m"><link name="a">' + "\n".join(['<visual name="v"/>'] * 19000) + "</link></model></sdf>"
    start = time.process_time()
    for made in (without_drawings(text), with_found_meshes(text, None)):
        assert "<visual" not in made
        assert '<link name="a">' in made
    assert time.process_time() - start < SECONDS


def test_member_that_is_there_twice_is_found_at_once() -> None:
    """Looked for among all names before each it took a minute in a file of a megabyte."""
    start = time.process_time()
    with pytest.raises(sr.SoftRobotsError, match="'a99999'"):
        parse_json("{" + many(100_000, '"a#": 1, ') + '"a99999": 1}')
    assert time.process_time() - start < SECONDS


def test_array_of_texts_without_room_is_refused(tmp_path: Path) -> None:
    """A million million of them are a file of 200 bytes, and as a list more than the memory."""
    head = b"{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,), }\n"
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("solver.npy", b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head)
    with pytest.raises(sr.FileFormatError, match="<U0"):
        read_arrays(tmp_path / "a.npz")
