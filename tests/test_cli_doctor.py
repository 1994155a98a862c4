"""`softrobots doctor`: what it finds in this installation, and what it says where something is missing or wrong."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import softrobots as sr
from softrobots.cli.tools import packages
from softrobots.cli.tools.packages import EXTRAS, Package, installed_version, missing_of_extras, required_packages
from softrobots.compiled.run.backends import available_backend, cache_folder, cache_is_kept
from softrobots.description.paths import urdf_folder, xacro_folder
from softrobots.view.meshcat_page.server import ServerProcess
from tests.conftest import CHECKOUT

ARM = urdf_folder() / "inflatable_arm.urdf"
MASTERS = {"motor_2": "motor_1", "motor_3": "motor_2"}
"""Masters of joints that mimic; that of `motor_3` mimics, too."""


@pytest.fixture
def one_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look at one file, and at no page: all of them are looked at once, which is enough."""
    monkeypatch.setattr("softrobots.cli.doctor.ROBOTS", {"inflatable_arm": sr.InflatableArm})
    monkeypatch.setattr("softrobots.cli.doctor._page", lambda report: None)


@pytest.mark.study
def test_doctor_finds_this_installation_well(told) -> None:
    status, out, err = told("doctor")
    assert status == 0
    assert out.endswith("\nall well\n")
    assert f"softrobots {sr.__version__}, Python " in out
    assert f"  xacro    {xacro_folder()}\n" in out
    assert f"  cache    {cache_folder()} (compiled solvers, by {available_backend()})\n" in out
    for name in sr.ROBOTS:
        assert re.search(rf"^  {name} +yourdfpy +\S+ +\d\.\de-1\d m +\d\.\de-1\d rad", out, re.M)
    assert re.search(r"^  served  at http://127\.0\.0\.1:\d+/static/, and ended again$", out, re.M)
    assert err == ""  # progress bars are for terminals


@pytest.mark.study
@pytest.mark.usefixtures("one_robot")
def test_doctor_answers_machines(told) -> None:
    status, out, _ = told("doctor", "--json")
    assert status == 0
    answer = json.loads(out)
    (row,) = answer["kinematics"]
    assert (row["file"], row["tool"], row["version"]) == ("inflatable_arm", "yourdfpy", installed_version("yourdfpy"))
    assert max(row["position_error"], row["rotation_error"]) < 1e-12  # rounding; 1e-15 measured
    assert row["problems"] == []
    assert (answer["ok"], answer["wrong"], answer["softrobots"]) == (True, [], sr.__version__)
    assert {row["name"]: row["version"] for row in answer["packages"]} == {row.name: row.version for row in required_packages()}
    assert list(answer["extras"]) == list(EXTRAS)


def test_the_page_that_doctor_asks_for_is_that_of_its_server(told, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A server that starts and ends, one that does not start, and one that serves something else."""
    started: list[ServerProcess] = []
    monkeypatch.setattr("softrobots.cli.doctor.ROBOTS", {})
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")  # nobody is there; loopback needs no proxy
    monkeypatch.setattr("softrobots.cli.doctor.ServerProcess", lambda: started.append(ServerProcess()) or started[-1])
    status, out, _ = told("doctor", "--json")
    assert (status, len(started)) == (0, 1)
    assert json.loads(out)["page"] == {"served": True, "url": started[0].web_url, "problem": ""}
    assert not started[0].running  # its port may be somebody else's by now

    def no_server() -> None:
        raise sr.ViewerError("the meshcat server ended before it served: no reason")

    monkeypatch.setattr("softrobots.cli.doctor.ServerProcess", no_server)
    status, out, _ = told("doctor")
    assert status == 1
    assert "  not served  the meshcat server ended before it served: no reason" in out
    assert "wrong:\n  the page of the viewer cannot be served: the meshcat server ended" in out

    page = tmp_path / "page.html"
    page.write_text("<p>nothing of ours</p>", encoding="utf-8")
    ended = []
    for url, told_of_it in (
        (page.as_uri(), "answers with something else than"),
        ("http://127.0.0.1:9/", "http://127.0.0.1:9/: "),
    ):
        server = SimpleNamespace(web_url=url, end=lambda url=url: ended.append(url))
        monkeypatch.setattr("softrobots.cli.doctor.ServerProcess", lambda server=server: server)
        status, out, _ = told("doctor")
        assert status == 1
        assert told_of_it in out
    assert ended == [page.as_uri(), "http://127.0.0.1:9/"]


def test_doctor_tells_what_is_missing_and_what_to_type(told, monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing package of an extra is no trouble; a required one that is missing or too old is."""
    versions = {"meshcat": None, "numpy": "1.26.4", "mujoco": None, "pillow": "1.2"}
    monkeypatch.setattr(packages, "installed_version", lambda name: versions.get(name, "9999"))
    status, out, _ = told("doctor")
    assert status == 1
    assert "missing: pip install 'meshcat>=0.3.2'" in out
    assert "1.26.4 is older than 2.2: pip install -U 'numpy>=2.2'" in out
    assert "missing: pip install 'softrobots[interop]'" in out
    assert "1.2 is older than 11: pip install -U 'softrobots[pictures]'" in out
    wrong = out[out.index("\nwrong:\n") :]
    assert "numpy" in wrong
    assert "meshcat" in wrong
    assert "mujoco" not in wrong
    assert "pillow" not in wrong
    assert re.search(r"^  interop +lacks mujoco +simulators", out, re.M)
    assert re.search(r"^  pictures +lacks pillow +", out, re.M)
    assert re.search(r"^  plot +complete +plots", out, re.M)


def test_an_extra_is_complete_without_what_cannot_be_had_for_this_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """PyBullet has no wheels above Python 3.11; viser is part of two extras."""
    monkeypatch.setattr(packages, "installed_version", lambda name: None if name in ("pybullet", "viser") else "9999")
    for version, lacking in (((3, 11), ["pybullet"]), ((3, 12), [])):
        monkeypatch.setattr(packages.sys, "version_info", version)
        lacks = {"interop": lacking, "viser": ["viser"], "interop-kinematics": ["viser"]}
        assert missing_of_extras(required_packages()) == {name: [] for name in EXTRAS} | lacks


def test_every_extra_has_a_package_and_an_installation_without_metadata_is_told(told, monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(EXTRAS) == {extra for package in required_packages() for extra in package.extras}

    def requires(name: str) -> None:
        raise packages.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(packages.metadata, "requires", requires)
    status, out, _ = told("doctor")
    assert status == 1
    assert out.endswith("wrong:\n  softrobots has no metadata here: install it with pip\n")


@pytest.mark.usefixtures("one_robot")
def test_doctor_tells_of_a_cache_that_does_not_last(told, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SOFTROBOTS_CACHE", str(tmp_path / "cache"))
    assert cache_is_kept()
    in_the_way = tmp_path / "file"
    in_the_way.touch()
    monkeypatch.setenv("SOFTROBOTS_CACHE", str(in_the_way / "cache"))
    assert not cache_is_kept()
    status, out, _ = told("doctor")
    assert status == 0
    assert "for this process alone: the folder for caches cannot be written" in out


@pytest.mark.study
@pytest.mark.usefixtures("one_robot")
def test_doctor_sees_broken_files_and_kinematics_that_do_not_agree(
    told, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for file in urdf_folder().glob("*.urdf"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    text = ARM.read_text(encoding="utf-8")
    mimics = '<mimic joint="{}" multiplier="1"/></joint>'
    mimicking = re.sub(
        r"(<joint name=\"(motor_[23])\".*?)</joint>", lambda m: m[1] + mimics.format(MASTERS[m[2]]), text, flags=re.S
    )
    (tmp_path / ARM.name).write_text(mimicking, encoding="utf-8")
    (tmp_path / "pcc_arm.urdf").write_text("<robot", encoding="utf-8")
    monkeypatch.setattr("softrobots.cli.doctor.urdf_folder", lambda: tmp_path)
    some = {name: sr.ROBOTS[name] for name in ("inflatable_arm", "pcc_arm")}  # the others agree, as the tests above see
    monkeypatch.setattr("softrobots.cli.doctor.ROBOTS", some)  # the page is left out
    status, out, _ = told("doctor")
    assert status == 1
    wrong = out[out.index("\nwrong:\n") :]
    assert "pcc_arm.urdf is not well-formed XML" in wrong
    assert re.search(r"inflatable_arm: yourdfpy is within \d\.\de\+?-?\d+ m", wrong)  # it knows no mimic of a mimic


@pytest.mark.usefixtures("one_robot")
def test_doctor_stops_without_folders(told, monkeypatch: pytest.MonkeyPatch) -> None:
    def nowhere() -> Path:
        raise sr.DescriptionError("softrobots was installed without its folder urdf/; install it again")

    monkeypatch.setattr("softrobots.cli.doctor.urdf_folder", nowhere)
    status, out, _ = told("doctor")
    assert status == 1
    assert "Packages" in out
    assert "kinematics at" not in out
    assert "without its folder urdf/" in out


def test_the_packages_are_those_of_pyproject() -> None:
    """Required ones and those of each extra, with the same oldest versions."""
    text = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    listed: dict[str, set[tuple[str, str]]] = {}
    place = ""
    for line in text[text.index("dependencies = [") : text.index("[project.scripts]")].splitlines():
        head = re.match(r"([\w-]+) = \[", line)
        place = head[1] if head else place
        for name, least in re.findall(r'"([\w-]+)(?:\[\w+\])?(?:>=([\d.]+)|")', line):
            listed.setdefault(name, set()).add(("" if place == "dependencies" else place, least or "0"))
    ours = {row.name: {(extra, row.minimum) for extra in row.extras or ("",)} for row in required_packages()}
    of_users = {name: {entry for entry in listed[name] if entry[0] not in ("dev", "test")} for name in listed}
    stale = "the installation is older than pyproject.toml: install it again"
    assert ours == {name: entries for name, entries in of_users.items() if entries}, stale
    alone = {name for name, entries in of_users.items() if not entries}
    assert alone == {
        "build",
        "coverage",
        "hypothesis",
        "mpmath",
        "mypy",
        "pytest",
        "pytest-timeout",
        "pytest-xdist",
        "twine",
        "uv",
    }


@pytest.mark.parametrize(
    ("version", "minimum", "ok"),
    [("2.0", "2.0", True), ("2.10.1", "2.9", True), ("1.26.4", "2.0", False), ("2.0rc1", "2.0", True), (None, "1", False)],
)
def test_versions_are_compared_by_their_numbers(version: str | None, minimum: str, ok: bool) -> None:
    package = Package("p", minimum, (), None, version)
    assert package.ok == ok
    assert bool(package.advice) != ok
