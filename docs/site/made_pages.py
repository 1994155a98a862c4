"""Pages of the site that are made while it is built: API reference, changelog, help texts, and the files that pages link to."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
from api_pages import PAGES, overview, page_text
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

from softrobots.cli.main import parser

CHECKOUT = Path(__file__).resolve().parent.parent.parent
HELP = re.compile(r"^<!-- help: softrobots (\w+) -->$", re.MULTILINE)
FONTS = ("DejaVuSerif.ttf", "STIXGeneral.ttf", "LICENSE_DEJAVU", "LICENSE_STIX")
"""Fonts for equations where the reader has none; matplotlib brings them. See site.css."""
SHELL = re.compile(r'<div class="language-(?:sh|console) highlight">.*?</pre>', re.DOTALL)
SOURCES = {"scripts/*.py": "python", "xacro/**/*.xacro": "xml", "urdf/*.urdf": "xml", "docs/examples/**/*.*": ""}
"""Files of the checkout that become pages, and their languages."""
LANGUAGES = {".py": "python", ".xacro": "xml", ".urdf": "xml", ".csv": "text"}
TOP = {"README.md": "index.md", "CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
"""Files beside docs/, and the pages that stand for them."""


def source_files() -> list[Path]:
    """Files of the checkout that become pages."""
    found = {path for pattern in SOURCES for path in CHECKOUT.glob(pattern) if path.suffix in LANGUAGES}
    return sorted(path for path in found if "__pycache__" not in path.parts)


def source_page(path: Path) -> str:
    """The name of the page of such a file."""
    return f"source/{path.relative_to(CHECKOUT).as_posix()}.md"


def _source_text(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    fence = "`" * max(3, 1 + max(map(len, re.findall(r"`{3,}", text)), default=2))
    title = path.relative_to(CHECKOUT).as_posix()
    return f"---\nsearch:\n  exclude: true\n---\n\n# {title}\n\n{fence}{LANGUAGES[path.suffix]}\n{text}\n{fence}\n"


def _folder_text(folder: Path, files: list[Path]) -> str:
    name = folder.relative_to(CHECKOUT).as_posix()
    rows = [f"- [{path.relative_to(folder)}]({path.relative_to(folder).as_posix()}.md)" for path in files]
    return "\n".join(["---", "search:", "  exclude: true", "---", "", f"# {name}/", "", *rows, ""])


def on_files(files: Any, config: Any) -> Any:
    """Add the pages."""
    made = {f"api/{name}.md": page_text(page) for name, page in PAGES.items()}
    made |= {"api/index.md": overview()}
    for name in ("CHANGELOG.md", "CONTRIBUTING.md"):
        made[TOP[name]] = (CHECKOUT / name).read_text(encoding="utf-8").replace("](docs/", "](")
    sources = source_files()
    made |= {source_page(path): _source_text(path) for path in sources}
    for folder in (CHECKOUT / "scripts", CHECKOUT / "xacro", CHECKOUT / "urdf"):
        made[f"source/{folder.name}/index.md"] = _folder_text(folder, [path for path in sources if folder in path.parents])
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    for name in FONTS:
        files.append(File.generated(config, f"fonts/{name}", abs_src_path=str(fonts / name)))
    return files


def on_page_content(text: str, **_: Any) -> str:
    """Take colours off the words of a shell: `export` and `0.3` are neither keyword nor number there. Comments keep theirs."""
    bare = re.compile(r'<span class="(?!c1?"|gp"|go"|s[12]?")\w+">((?:(?!<span).)*?)</span>', re.DOTALL)
    return SHELL.sub(lambda found: bare.sub(r"\1", found[0]), text)


def on_post_build(config: Any) -> None:
    """Give the index of the search as a script, too: a page from a folder may load no data."""
    index = Path(config["site_dir"]) / "search" / "search_index.json"
    index.with_suffix(".js").write_text(f"var __index = {index.read_text(encoding='utf-8')}", encoding="utf-8")


def commands(made: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The subcommands of a parser, by name."""
    for action in made._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def helps(name: str, made: argparse.ArgumentParser) -> Iterator[tuple[str, str]]:
    """A command and its subcommands: what to type, and the answer."""
    yield f"{name} --help", made.format_help()
    for sub, inner in commands(made).items():
        yield from helps(f"{name} {sub}", inner)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the help texts where a page asks for them."""
    if not HELP.search(markdown):
        return markdown
    os.environ["COLUMNS"] = "100"  # argparse wraps at it
    known = commands(parser())

    def one(found: re.Match[str]) -> str:
        if found[1] not in known:
            raise PluginError(f"{page.file.src_uri}: no command {found[1]}; there are {', '.join(known)}")
        blocks = []
        for typed, answer in helps(f"softrobots {found[1]}", known[found[1]]):
            lines = ["```text", *answer.rstrip().splitlines(), "```"]
            blocks.append("\n".join([f'??? quote "`{typed}`"', "", *(f"    {line}".rstrip() for line in lines), ""]))
        return "\n".join(blocks)

    return HELP.sub(one, markdown)
