"""Names in somebody's files choose no path, run no code and add nothing to a page; servers answer for this machine only."""

from __future__ import annotations

import ast
import csv
import http.client
import os
import re
import socket
import sys
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

import softrobots as sr
from softrobots.export import FORMATS, export_model
from softrobots.view.figures import canvas
from softrobots.view.legend import LegendEntry
from softrobots.view.local_requests import is_local
from softrobots.view.meshcat_page.page_text import legend_rows
from softrobots.view.viewer import Viewer, view
from studies.papers import trajectory_pictures
from tests.conftest import CHECKOUT, PATIENCE, load_script
from tests.support.pictures import listening

SCRIPT = "</script><script>window.pwned = 1</script><img src=x onerror='window.pwned = 1'>"
NAMES = (
    "../../outside",
    "/tmp/outside",
    SCRIPT,
    '"""\nimport pwned\nr"""',
    "'''\npwned()\n'''",
    '\\"""\npwned()\n\\',
    "*/ int pwned; /*",
    "x' + pwned() + '",
    "${pwned}",
    "$(pwned)",
    "{pwned}%s%n",
    "--><b>pwned</b><!--",
    "]]>",
    "$\\frac{$",
    "=pwned()",
    "a,b;c\td",
    "caf\u00e9 \U0001f600",
)
"""What joints and links may be called in XML."""

ROBOT = """<robot name={0} xmlns:softrobots="urn:softrobots:urdf"><link name={1}><inertial><mass value="1"/>{inertia}</inertial>
<visual name={0}><geometry><cylinder radius="0.05" length="0.3"/></geometry>
<material name={0}><color rgba="1 0 0 1"/></material></visual></link>
<joint name={4} type="revolute"><parent link={1}/><child link={2}/><axis xyz="0 1 0"/>{limit}</joint>
<link name={2}><inertial><origin xyz="0 0 0.1"/><mass value="1"/>{inertia}</inertial></link>
<joint name={5} type="revolute"><origin xyz="0 0 0.3"/><parent link={2}/><child link={3}/><axis xyz="1 0 0"/>{limit}
<softrobots:spring stiffness="50" rest="0.1"/></joint><link name={3}><inertial><origin xyz="0 0 0.1"/><mass value="1"/>{inertia}
</inertial><visual><geometry><box size="0.1 0.1 0.2"/></geometry></visual></link></robot>"""


def robot(name: str) -> sr.SoftModel:
    """A motor and a spring whose robot, links, joints, shapes and materials all are called so, and a letter behind it."""
    words = [quoteattr(name + letter, {"\n": "&#10;", "\t": "&#9;"}) for letter in ("", "a", "b", "c", "j", "s")]
    text = ROBOT.format(
        *words,
        inertia='<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>',
        limit='<limit lower="-1" upper="1" effort="9" velocity="1"/>',
    )
    made = sr.load_model(text, tip=f"{name}c")
    assert (made.pinocchio.name, *made.motor_joints, *made.spring_joints) == (name, f"{name}j", f"{name}s")
    return made


def identifiers(text: str) -> set[str]:
    """Everything that Python code names: variables, attributes, modules, arguments."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        for field in ("id", "attr", "name", "module", "arg"):
            found |= {value for value in (getattr(node, field, None),) if isinstance(value, str)}
    return found


# --- Code and documents for other tools


@pytest.mark.parametrize("name", NAMES)
def test_names_stay_names_in_every_export(name: str) -> None:
    model = robot(name)
    for text in (sr.export.to_mjcf(model, (0.3,)), sr.export.to_sdf(model, (0.3,))):
        elements = list(ElementTree.fromstring(text).iter())
        assert f"{name}j" in {value for element in elements for value in element.attrib.values()}
        assert not {"script", "b", "img"} & {str(element.tag) for element in elements}
    for text in (sr.export.to_pybullet(model, (0.3,)), sr.export.to_pinocchio(model, (0.3,))):
        assert not [word for word in identifiers(text) if "pwned" in word]
        constants = [node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)]
        assert [value for value in constants if isinstance(value, str) and f"{name}j" in value]


@pytest.mark.study
@pytest.mark.parametrize("name", NAMES)
def test_names_are_no_code_where_code_is_generated(name: str) -> None:
    """A joint whose name ended the docstring of the generated module once ran whatever came behind it."""
    model = robot(name)
    fast = sr.compile(model, backend="python")
    source = fast.source()
    assert not [word for word in identifiers(source) if "pwned" in word]
    told = ast.get_docstring(ast.parse(source))
    spelled = f"{name}j" if name.isprintable() else f"{name}j".encode("unicode_escape").decode()
    assert told is not None
    assert "".join(spelled.split()) in "".join(told.split())
    assert "pwned" not in re.sub(r"/\*.*?\*/", "", fast.c_source(), flags=re.DOTALL)
    exact = sr.solve_equilibrium(model, (0.3,), (1.0, 2.0, -3.0))
    assert np.allclose(fast.equilibrium((0.3,), (1.0, 2.0, -3.0)).q_springs, exact.q_springs, atol=1e-9)


# --- Files


def files_below(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if not path.is_dir()}


@pytest.mark.study
@pytest.mark.parametrize("name", ["../../outside", "/tmp/softrobots_outside"])
def test_files_are_written_where_the_caller_says(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the robot is called: there are the files that were asked for, and no other."""
    inner = tmp_path / "one" / "two"
    inner.mkdir(parents=True)
    monkeypatch.chdir(inner)
    model = robot(name)
    held = sr.solve_equilibrium(model, (0.3,), (1.0, 2.0, -3.0))
    wanted = set()
    for kind in FORMATS:
        wanted.add(f"one/two/{kind}")
        export_model(model, inner / kind, kind)
    wanted |= {"one/two/r.npz", "one/two/p.html", "one/two/f.png"}
    sr.save_result(held, inner / "r.npz")
    with view(model, held) as viewer:
        viewer.write_html(inner / "p.html")
    canvas.write_png(sr.plot(held), inner / "f.png", overwrite=False)
    assert files_below(tmp_path) == wanted
    assert not Path("/tmp/softrobots_outside").exists()


@pytest.mark.parametrize("name", NAMES)
def test_names_are_one_cell_of_a_table(name: str, tmp_path: Path) -> None:
    model = robot(name)
    held = sr.solve_equilibrium(model, (0.3,))
    path = sr.Trajectory(np.array([0.0]), held.tip_position[None], (held,), "newton")
    file = sr.save_csv(path, tmp_path / "a.csv")
    with file.open(encoding="utf-8", newline="") as table:
        head, *rows = csv.reader(table)
    assert head[8:] == [f"{name}j", f"{name}s"]
    assert [len(row) for row in rows] == [10]
    assert sr.load_result(sr.save_result(path, tmp_path / "a.npz")).model.motor_joints == (f"{name}j",)


@pytest.mark.study
@pytest.mark.parametrize("name", ["$\\frac{$", "$", "a$b$c\\", "a\nb", SCRIPT])
def test_names_are_no_formulas_in_figures(name: str, tool: Callable[[str], Any]) -> None:
    tool("matplotlib")
    model = robot(name)
    held = sr.solve_equilibrium(model, (0.3,), (1.0, 2.0, -3.0))
    path = sr.Trajectory(np.array([0.0, 1.0]), np.array([held.tip_position] * 2), (held, held), "newton")
    for figure in (sr.plot(held), trajectory_pictures.motor_angles(path, path)):
        figure.draw_without_rendering()  # where formulas are read


# --- Pages


class Elements(HTMLParser):
    """Every element of a page, with the names of its attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, tuple[str, ...]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, tuple(name for name, _ in attrs)))


@pytest.fixture(scope="module")
def hostile() -> Iterator[Viewer]:
    """A page with a robot whose names are scripts."""
    model = robot(SCRIPT)
    with view(model, sr.solve_equilibrium(model, (0.3,), (1.0, 2.0, -3.0))) as viewer:
        yield viewer


@pytest.mark.study
def test_names_add_nothing_to_a_page(hostile: Viewer) -> None:
    plain = robot("plain")
    with view(plain, sr.solve_equilibrium(plain, (0.3,), (1.0, 2.0, -3.0))) as viewer:
        ours, theirs = viewer.html(), hostile.html()
        inline = viewer._repr_html_(), hostile._repr_html_()
    assert Elements(theirs).found == Elements(ours).found
    assert Elements(hostile.html(SCRIPT)).found == Elements(ours).found
    assert Elements(inline[1]).found == Elements(inline[0]).found
    assert "<title>" in theirs
    rows = [legend_rows([LegendEntry(0xFF0000, meaning)]) for meaning in (SCRIPT, "a")]
    assert Elements(rows[0]).found == Elements(rows[1]).found


# --- Servers


def ask(port: int, path: str = "/", *, upgrade: bool = False, **headers: str) -> tuple[int, bytes]:
    """Status and content that a server on loopback answers with."""
    asked = dict(headers)
    if upgrade:
        key = "AAAAAAAAAAAAAAAAAAAAAA=="
        asked |= {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": key}
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    try:
        connection.request("GET", path, headers=asked)
        answer = connection.getresponse()
        return answer.status, b"" if answer.status == 101 else answer.read()
    finally:
        connection.close()


@pytest.fixture(scope="module")
def servers(hostile: Viewer) -> Iterator[dict[str, tuple[int, str, int]]]:
    """Port, path of the page and process of each server that there is."""
    from softrobots.view.slider_page import SliderPage

    with SliderPage(hostile._model) as sliders:
        yield {
            "meshcat": (hostile.port, "/static/", hostile._server.process.pid),
            "sliders": (sliders.port, "/", os.getpid()),
        }


def test_names_run_nothing_in_a_browser(browser: Any, hostile: Viewer, servers: dict[str, tuple[int, str, int]]) -> None:
    """Neither on the page of the viewer nor on the one with sliders, whose names other people's code writes."""
    for server, shown in (("meshcat", "#softrobots-rows span"), ("sliders", "#softrobots-panel")):
        port, path, _ = servers[server]
        page = browser.new_page(viewport={"width": 320, "height": 240})
        page.goto(f"http://127.0.0.1:{port}{path}", wait_until="commit")
        page.locator(shown).first.wait_for(state="attached")
        assert page.evaluate("window.pwned") is None, server
        assert "window.pwned" in page.content()  # as text
        page.close()


@pytest.mark.parametrize("server", ["meshcat", "sliders"])
def test_pages_from_elsewhere_are_not_answered(server: str, servers: dict[str, tuple[int, str, int]]) -> None:
    """Any page in a browser can ask loopback; one that has made its own name mean loopback could even read the answer."""
    port, path, _ = servers[server]
    for local in (f"127.0.0.1:{port}", f"localhost:{port + 1}", "[::1]:1", "LOCALHOST"):  # tunnels have ports of their own
        status, content = ask(port, path, Host=local)
        assert (status, b"<html" in content) == (200, True)
        assert ask(port, path, Host=local, Origin=f"http://{local}")[0] == 200
        written = local.lower()  # by every browser; Tornado before 6.6 compares it as it comes
        assert ask(port, "/", upgrade=True, Host=written, Origin=f"http://{written}")[0] == 101
    for foreign in ("evil.example", "127.0.0.1.evil.example", "evil.example:80", "", "[", "10.0.0.1"):
        status, content = ask(port, path, Host=foreign)
        assert (status, b"<html" in content) == (403, False)
        assert ask(port, "/", upgrade=True, Host=foreign)[0] == 403
    for foreign in ("http://evil.example", f"http://evil.example:{port}", "null", "http://127.0.0.1.evil.example", "file://"):
        assert ask(port, "/", upgrade=True, Origin=foreign)[0] == 403
        assert b"for this machine only" in ask(port, path, Origin=foreign)[1]


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("server", ["meshcat", "sliders", "documentation"])
def test_servers_listen_on_loopback_only(server: str, servers: dict[str, tuple[int, str, int]]) -> None:
    if server == "documentation":
        served = load_script("build_docs").ServedFolder(CHECKOUT / "docs", 0)
        assert listening(os.getpid()) == {"127.0.0.1"}
        served._server.server_close()
        return
    port, _, process = servers[server]
    assert listening(process) == {"127.0.0.1"}
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.2", port), timeout=5)  # an address of this machine, too, but another one


@pytest.mark.study
@pytest.mark.parametrize("server", ["meshcat", "sliders"])
def test_a_second_page_on_the_same_port_does_not_break_the_first(server: str, servers: dict[str, tuple[int, str, int]]) -> None:
    from softrobots.view.slider_page import SliderPage

    port, path, _ = servers[server]
    model = robot("second")
    kind = Viewer if server == "meshcat" else SliderPage
    before = ask(port, path)
    with pytest.raises(sr.ViewerError, match=f"{port}"):
        kind(model, port=port)
    assert ask(port, path) == before
    with kind(model) as other:  # takes the next free one
        assert other.port != port
        assert ask(other.port, path)[0] == 200
        assert ask(port, path) == before
    assert ask(port, path) == before  # nor does its end


@pytest.mark.parametrize(
    ("host", "origin", "local"),
    [
        (None, None, True),
        ("localhost", None, True),
        ("127.0.0.1:7000", "http://localhost:8080", True),
        ("[::1]:7000", "https://[::1]", True),
        ("evil.example", None, False),
        ("127.0.0.1@evil.example", None, False),
        ("localhost.evil.example", None, False),
        ("127.0.0.1", "null", False),
        ("127.0.0.1", "", False),
        ("127.0.0.1", "http://[", False),
        ("0.0.0.0", None, False),
    ],
)
def test_what_is_local(host: str | None, origin: str | None, local: bool) -> None:
    assert is_local(host, origin) is local
