"""The code of README.md and of the pages in docs/ runs and prints what they say; and the site shows every page and every name.

The rules are in `tests/support/documentation.py`.
"""

from __future__ import annotations

import importlib
import re
import runpy
import sys
import threading
import urllib.request
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import softrobots as sr
from softrobots.cli.main import parser
from softrobots.robots.fields import facts_of
from tests.conftest import CHECKOUT, PATIENCE, missing
from tests.support.documentation import PageError, PageRunner, blocks, differences, missing_package
from tests.support.tables import each_row

DOCS = CHECKOUT / "docs"
PAGES = ["README.md", *sorted(f"docs/{path.name}" for path in DOCS.glob("*.md"))]


def page_text(name: str) -> str:
    return (CHECKOUT / name).read_text(encoding="utf-8")


def run_page(name: str, folder: Path) -> dict[str, object]:
    """Run a page and return its names; what it needs and is not installed fails in CI and skips elsewhere."""
    try:
        return PageRunner(name, page_text(name), folder).run()
    except ImportError as error:
        reason = missing_package(error)
        if reason is None:
            raise
        missing(reason)
        raise


@pytest.mark.system
@pytest.mark.parametrize("name", PAGES)
def test_the_code_of_the_page_prints_what_it_says(name: str, tmp_path: Path) -> None:
    names = run_page(name, tmp_path)
    if name == "README.md":  # what it does not print
        assert names["sag"].stable
        assert names["design"].realisable
        assert np.abs(names["felt"] - (0.0, 10.0, -15.0)).max() < 1e-8  # from torques of an equilibrium settled to 1e-10


@pytest.mark.system
def test_every_task_of_the_first_page_runs_as_it_stands(tmp_path: Path) -> None:
    """The lines of its table in their order, as one page; only measurements are made up here."""
    table = page_text("docs/index.md").partition("## I want to ...")[2].partition("## Install")[0]
    cells = [line.split(" | ")[1] for line in table.splitlines() if line.startswith("| ") and "`" in line]
    lines = [re.findall(r"`([^`]+)`", cell) for cell in cells]
    assert len(lines) >= 20
    text = "```python\nimport softrobots as sr\nq = [(0.3, 0.6, -0.8), (0.1, 0.9, -0.5)]\nf = [(0, 0, -9), (0, 5, -6)]\n"
    text += "tips = [sr.solve_equilibrium(sr.load_model(sr.InflatableArm()), *row).tip_position for row in zip(q, f)]\n"
    text += "rows = sr.Measurements(q, force=f, tip_position=tips, std={'tip_position': 1e-3})\n```\n"
    for line in [line for cell in lines for line in cell]:
        text += f"\n```{'sh' if line.startswith('softrobots ') else 'python'}\n{line}\n```\n"
    assert run_text(text, tmp_path).ran > len(lines)


# --- The harness itself


def run_text(text: str, folder: Path) -> PageRunner:
    runner = PageRunner("page.md", text, folder)
    runner.run()
    return runner


GOOD = """
```python
x = 0.123456
print("x", x, [1, 2])
```

```text
x 0.123457 [1, 2]
```

```py
from pathlib import Path
Path("a.txt").write_text(str(x))
```

```console
$ cat a.txt
0.123456
$ softrobots --version
softrobots VERSION
```

<!-- not run: takes an hour -->
```sh
apt-get install nothing && python3 scripts/solver_rates.py
```
"""


def test_a_good_page_runs(tmp_path: Path) -> None:
    runner = run_text(GOOD.replace("VERSION", sr.__version__), tmp_path)
    assert runner.ran == 4  # two blocks of Python, two commands
    assert (tmp_path / "a.txt").read_text() == "0.123456"
    assert runner.module.x == 0.123456
    assert Path.cwd() != tmp_path
    assert runner.module.__name__ not in sys.modules


@each_row(
    ("old", "new", "told"),
    [
        ("0.123457", "0.123459", r"page.md:8: the output is another one\ntold    x 0.123459"),
        ("[1, 2]\n", "[1, 3]\n", "another one"),
        ("x 0.123457", "y 0.123457", "another one"),
        ("```text\n", "```text\nmore\n", "2 lines are told, 1 printed"),
        ("```text", "words\n\n```text", "does not stand right behind"),
        ("```py\n", "```pycon\n", "a fence of pycon; known: python"),
        ("```py\n", "```\n", "a fence of no language"),
        ("$ cat a.txt\n0.123456", "$ cat a.txt\n0.5", "page.md:17: the output"),
        ("$ cat a.txt", "$ cat b.txt", "status 1 instead of 0"),
        ("$ cat a.txt", "$ rm a.txt", "rm is not run here"),
        ("$ softrobots --version", "$ softrobots --no-such", "status 2 instead of 0"),
        ("<!-- not run: takes an hour -->", "", "apt-get is not run here"),
        ("<!-- not run: takes an hour -->", "<!-- not run: -->", "apt-get is not run here"),
        ("scripts/solver_rates.py", "scripts/solver_rates.py --no-such", "unrecognized arguments: --no-such"),
        ("$ cat a.txt", "cat a.txt", "a console begins with"),
    ],
)
def test_a_bad_page_is_noticed(old: str, new: str, told: str, tmp_path: Path) -> None:
    text = GOOD.replace("VERSION", sr.__version__)
    assert text.count(old) >= 1
    with pytest.raises(PageError, match=told):
        run_text(text.replace(old, new, 1), tmp_path)


def test_an_error_names_the_line_of_the_page(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError) as caught:
        run_text("a\n\n```python\nx = 1\nx / 0\n```\n", tmp_path)
    assert caught.traceback[-1].lineno + 1 == 5
    assert str(caught.traceback[-1].path).endswith("page.md")


def test_python_that_is_not_run_must_be_python(tmp_path: Path) -> None:
    text = "<!-- not run: serves until Ctrl-C -->\n```python\nviewer.wait()\n```\n"
    assert run_text(text, tmp_path).ran == 0
    with pytest.raises(SyntaxError):
        run_text(text.replace("wait()", "wait("), tmp_path)


def test_what_readers_need_not_see_comes_first(tmp_path: Path) -> None:
    text = "<!-- first: x = 2 -->\n```python\ny = 3 * x\n```\n"
    assert run_text(text, tmp_path).module.y == 6
    assert run_text(text.replace(" x = 2 ", "\nx = 2\nx = 3\n"), tmp_path).module.y == 9
    with pytest.raises(PageError, match="only Python that runs"):
        run_text(text.replace("```python", "```sh"), tmp_path)


def test_a_block_can_be_a_file(tmp_path: Path) -> None:
    text = "<!-- file: my_part.py -->\n```python\nsize = 2\n```\n\n"
    text += "```python\nfrom my_part import size\n```\n\n```sh\ncat my_part.py\n```\n"
    runner = run_text(text, tmp_path)
    assert runner.ran == 2
    assert runner.module.size == 2
    assert "my_part" not in sys.modules
    (tmp_path / "empty").mkdir()
    with pytest.raises(ModuleNotFoundError, match="my_part"):
        run_text(text.replace("<!-- file: my_part.py -->\n", ""), tmp_path / "empty")


def test_there_is_no_numba_on_a_page(tmp_path: Path) -> None:
    text = "```python\nimport softrobots as sr\nfast = sr.compile(sr.load_model(sr.InflatableArm()))\n```\n"
    assert run_text(text, tmp_path).module.fast.backend == "python"


def test_a_status_that_is_told_is_required(tmp_path: Path) -> None:
    text = "```sh\nsoftrobots urdf no_such_robot  # status 2\n```\n"
    assert run_text(text, tmp_path).ran == 1
    with pytest.raises(PageError, match="status 2 instead of 1"):
        run_text(text.replace("# status 2", "# status 1"), tmp_path)


@pytest.mark.parametrize(
    ("told", "printed", "same"),
    [
        ("1.25", "1.26", True),
        ("1.25", "1.27", False),
        ("-0.000", "0.000", True),
        ("[ 0.  1.5]", "[0. 1.5]", True),
        ("3", "4", False),
        ("1e-10", "2e-10", True),
        ("1e-10", "3e-10", False),
        ("1.5e3", "1.6e3", True),
        ("1.8e-12", "7e-12", True),
        ("1.8e-12", "1.8e-3", False),
        ("motor_1", "motor_2", False),
        ("a  b\n", "a b", True),
        ("1.5", "nan", False),
        ("2.0 m", "2.0 mm", False),
    ],
)
def test_the_last_digit_may_differ(told: str, printed: str, same: bool) -> None:
    assert (not differences(told, printed)) == same


# --- The site


@pytest.fixture
def site(tool: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """Import a module of docs/site."""
    monkeypatch.syspath_prepend(str(DOCS / "site"))

    def load(name: str) -> ModuleType:
        tool({"equations": "latex2mathml", "docstrings": "griffe"}.get(name, "mkdocs"))
        return importlib.import_module(name)

    return load


def inline_equations(text: str) -> list[str]:
    """What stands between dollar signs, outside of code."""
    bare = re.sub(r"^( *)(`{3,})[^\n]*\n.*?^\1\2$", "", text, flags=re.DOTALL | re.MULTILINE)
    bare = re.sub(r"(`+)(?!`).+?(?<!`)\1(?!`)", "", bare)
    return re.findall(r"(?<!\\)\$(?=\S)((?:[^$\\]|\\.)+?)(?<=\S)\$", bare)


@pytest.mark.parametrize("name", [name for name in PAGES if name != "README.md"])
def test_every_equation_becomes_mathml(name: str, site: Callable[[str], ModuleType]) -> None:
    equations = site("equations")
    text = page_text(name)
    for latex in inline_equations(text):
        equations.mathml(latex, display=False)
    for block in blocks(text, name):
        if block.language == "math":
            equations.display_block(block.text)


@each_row(
    ("latex", "told"),
    [
        (r"\frac{a", "braces"),
        (r"a}", "braces"),
        (r"\unknown x", r"'\\\\unknown' is not known"),
        (r"\text{a \foo}", "not known"),
        (r"a & b", "outside of a table"),
        (r"a \\ b", r"lines need \\begin\{aligned\}"),
        (r"\frac{a}", "mfrac without its 2 parts"),
        (r"a^b^c", "DoubleSuperscriptsError"),
        (r"\begin{tikzpicture} a \end{tikzpicture}", "unknown environment tikzpicture"),
        ("", "NoAvailableTokensError"),
    ],
)
def test_an_equation_that_is_none_is_refused(latex: str, told: str, site: Callable[[str], ModuleType]) -> None:
    equations = site("equations")
    with pytest.raises(equations.EquationError, match=told):
        equations.mathml(latex, display=True)


def test_equations_are_drawn_as_latex_means_them(site: Callable[[str], ModuleType]) -> None:
    """Names upright and apart, lines aligned, numbers at the right; what latex2mathml alone gets wrong."""
    mathml = site("equations").mathml
    assert "<mi>atan2</mi>" in mathml(r"\operatorname{atan2}(y, x)", display=False)
    assert '<mi>sin</mi><mspace width="0.167em" /><mi>\u03b8</mi>' in mathml(r"\sin\theta", display=False)
    assert mathml(r"\begin{aligned} a &= b \\ c &= d \end{aligned}", display=True).count("<mtr>") == 2
    assert "\u211d" in mathml(r"\mathbb{R}", display=False)
    square = mathml(r"\mathrm{m/s^2}", display=False)
    assert '<msup><mi mathvariant="normal">s</mi><mn>2</mn></msup>' in square
    norm = mathml(r"-|a|^2 = (-b)", display=False)
    assert [re.search(rf'form="(\w+)"[^>]*>{mark}<', norm)[1] for mark in (r"\|", "\u2212")] == ["prefix", "prefix"]
    assert norm.count('form="postfix"') == 1
    block = site("equations").display_block(r"a = b \tag{12}")
    assert '<span class="equation-number">(12)</span>' in block
    assert "tag" not in block


def test_mathematics_in_docstrings_becomes_markdown(site: Callable[[str], ModuleType]) -> None:
    text = "Head.\n\n.. math:: a = b, \\quad\n   c = d\n\nWith :math:`x^2`.\n\n    .. math:: e\n\n    more"
    made = site("docstrings").as_markdown(text)
    assert "```math\na = b, \\quad\nc = d\n```" in made
    assert "With $x^2$." in made
    assert "    ```math\n    e\n    ```" in made
    assert "math::" not in made
    assert site("docstrings").as_markdown("in [0, length] [m]; `a] [m]`") == r"in [0, length] \[m]; `a] [m]`"


def test_fields_of_robots_are_described_by_their_facts(site: Callable[[str], ModuleType]) -> None:
    docstrings = site("docstrings")
    extensions = docstrings.griffe.load_extensions(docstrings.SiteDocstrings)
    robot = docstrings.griffe.load("softrobots", extensions=extensions)["robots.helix_tube.HelixTube"]
    for name, facts in facts_of(sr.HelixTube).items():
        assert robot.members[name].docstring.value == facts.description
        assert facts.what in facts.description
        assert f"[{facts.unit}]" in facts.description or not facts.unit
    assert robot.members["angle"].docstring.value.endswith(
        " [rad], at least 0, below 1.5708. Blumenschein 2018, section III-B (5 degrees)."
    )
    assert robot.members["diameter"].value == "0.0331"


def nav_pages() -> list[str]:
    """Pages of the navigation; the tags in mkdocs.yml are MkDocs' own."""
    text = (DOCS / "site" / "mkdocs.yml").read_text(encoding="utf-8")
    nav = text[text.index("\nnav:\n") : text.index("\ntheme:\n")]
    return re.findall(r": (\S+\.(?:md|ipynb))$", nav, flags=re.MULTILINE)


def test_the_navigation_shows_every_page(site: Callable[[str], ModuleType]) -> None:
    api = {f"api/{name}.md" for name in (*site("api_pages").PAGES, "index")}
    there = {path.relative_to(DOCS).as_posix() for kind in ("*.md", "*.ipynb", "notebooks/*.ipynb") for path in DOCS.glob(kind)}
    listed = nav_pages()
    assert len(listed) == len(set(listed))
    assert set(listed) == there | api | {"changelog.md", "contributing.md"}


def test_the_reference_has_every_public_name(site: Callable[[str], ModuleType]) -> None:
    api = site("api_pages")
    names = [name for page in api.PAGES.values() for name in page.names]
    assert len(names) == len(set(names))
    packages = set(api.PACKAGES)
    for name in sr.__all__:
        full = f"softrobots.{name}"
        thing = getattr(sr, name)
        known = full in names or (getattr(thing, "__module__", "") in names)  # errors are shown with their module
        assert known, f"{full} is on no page of docs/site/api_pages.py"
    assert packages <= set(names)
    for package in packages:
        shown = [name for part in api.parts(package).values() for name in part]
        assert sorted(shown) == sorted(importlib.import_module(package).__all__)
    for name in names:
        module, _, last = name.rpartition(".")
        assert name in packages or hasattr(importlib.import_module(module), last) or importlib.import_module(name), name


def test_every_command_has_an_example_and_its_help() -> None:
    text = page_text("docs/commands.md")
    (action,) = (action for action in parser()._actions if action.dest == "command")
    assert re.findall(r"^<!-- help: softrobots (\w+) -->$", text, flags=re.MULTILINE) == list(action.choices)
    typed = {
        word
        for block in blocks(text, "commands.md")
        for word in re.findall(r"^softrobots (\w+)", block.text, flags=re.MULTILINE)
    }
    assert typed == set(action.choices)


def test_every_picture_says_what_one_sees() -> None:
    """A screen reader reads the text between the brackets: some words, not the name of the file."""
    seen = [picture for name in PAGES for picture in re.findall(r"!\[([^\]]*)\]\(([^)\s]+)", page_text(name))]
    assert len(seen) > 50
    for words, file in seen:
        assert len(words) >= 20, file
        assert len(words.split()) >= 4, file
        assert Path(file).name not in words, file


def test_links_and_pictures_lead_somewhere() -> None:
    for name in (*PAGES, "CONTRIBUTING.md"):
        text = re.sub(r"```.*?```", "", page_text(name), flags=re.DOTALL)
        for target in re.findall(r"\]\((?!https?:|mailto:|#)([^)#\s]+)", text):
            path = (CHECKOUT / name).parent / target
            assert path.exists(), f"{name}: {target}"
            assert path.suffix not in (".png", ".gif", ".webp") or path.stat().st_size > 10_000, f"{name}: {target}"


@pytest.mark.parametrize("name", [*PAGES, "CONTRIBUTING.md"])
def test_pages_name_files_that_exist(name: str) -> None:
    for target in re.findall(r"`((?:tests|scripts|softrobots|docs|xacro|urdf)/[\w./*-]*)`", page_text(name)):
        assert list(CHECKOUT.glob(target.rstrip("/"))) or target == "tests/test_x.py", f"{name}: {target}"


def test_the_start_page_tells_every_extra() -> None:
    text = page_text("pyproject.toml")
    part = text[text.index("[project.optional-dependencies]") : text.index("[project.scripts]")]
    extras = re.findall(r"^([\w-]+) = \[", part, flags=re.MULTILINE)
    table = page_text("docs/index.md").partition("## Extras")[2]
    assert sorted(re.findall(r"^\| `([\w-]+)` \|", table, flags=re.MULTILINE)) == sorted(extras)


# --- The script that builds it (CI runs it; here only what is quick)


def build_docs(*words: str) -> int:
    return runpy.run_path(str(CHECKOUT / "scripts" / "build_docs.py"), run_name="script")["main"](list(words))


def test_a_folder_that_is_no_site_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert build_docs("--output", str(tmp_path)) == 2
    assert "is not empty (it contains mine.txt)" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_without_the_extra_it_says_what_to_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "latex2mathml", None)
    monkeypatch.setitem(sys.modules, "latex2mathml.converter", None)
    assert build_docs("--output", str(tmp_path / "site")) == 2
    assert "pip install 'softrobots[docs]'" in capsys.readouterr().err
    assert not (tmp_path / "site").exists()


def test_the_site_is_served_on_loopback_only(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<title>here</title>")
    served = runpy.run_path(str(CHECKOUT / "scripts" / "build_docs.py"), run_name="script")["ServedFolder"](tmp_path, 0)
    server = served._server
    assert server.server_address[0] == "127.0.0.1"
    assert served.tunnel.startswith(f"ssh -L {server.server_port}:127.0.0.1:{server.server_port} ")
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        with urllib.request.urlopen(f"{served.url}index.html", timeout=PATIENCE) as answer:
            assert answer.read() == b"<title>here</title>"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
