"""Links of the site: those that leave docs/ come to pages of the files, and names in code lead to the reference.

Pages in docs/ link to `../README.md` or `../xacro/robot.urdf.xacro`, as GitHub wants it; here such a file is a page.
"""

from __future__ import annotations

import html
import importlib
import posixpath
import re
from functools import cache
from typing import Any

from api_pages import PAGES
from generated_pages import CHECKOUT, TOP, source_files, source_page
from mkdocs.exceptions import PluginError
from mkdocs.utils import get_relative_url

import softrobots

OUTWARD = re.compile(r"(?<!!)(\]\()(\.\./[^)#\s]*)(#[^)\s]*)?(?=[)\s])")
CODE = re.compile(r"<code>([^<]+)</code>")
UNTOUCHED = re.compile(
    r"(<pre\b.*?</pre>|<a\b.*?</a>|<h[1-6]\b.*?</h[1-6]>|<autoref\b.*?</autoref>|<summary>.*?</summary>)", re.DOTALL
)
OWN_MODULES = {
    "inflatable_arm.md": "inflated_beam",
    "pcc_arm.md": "constant_curvature",
    "helix.md": "helix",
    **{f"api/{name}.md": name for name in ("inflated_beam", "constant_curvature", "helix", "export")},
}
"""Modules whose names a page writes without the module's."""


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Turn links to files beside docs/ into links to their pages."""

    def one(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join("docs", posixpath.dirname(page.file.src_uri), match[2]))
        path = CHECKOUT / target
        if target in TOP:
            page_path = TOP[target]
        elif path.is_dir():
            page_path = f"source/{target}/index.md"
        else:
            page_path = source_page(path)
        if not path.exists():
            raise PluginError(f"{page.file.src_uri}: {match[2]} does not exist")
        return match[1] + posixpath.relpath(page_path, posixpath.dirname(page.file.src_uri) or ".")

    return OUTWARD.sub(one, markdown) if page.file.generated_by is None else markdown


@cache
def _identifiers() -> dict[str, str]:
    """Names as guides write them, and what they are called in the reference."""
    identifiers = {}
    for name in softrobots.__all__:
        module = getattr(softrobots, name)
        if hasattr(module, "__all__"):
            identifiers |= {f"{name}.{inner}": f"softrobots.{name}.{inner}" for inner in module.__all__}
            identifiers[name] = f"softrobots.{name}"
        elif not name.startswith("_"):
            identifiers[name] = f"softrobots.{name}"
    for page in PAGES.values():
        for full in page.names:
            identifiers.setdefault(full.rpartition(".")[2], full)
            identifiers[full.removeprefix("softrobots.")] = full
    identifiers |= {"compile": "softrobots.compiled.run.compiled_model.compile_model"}
    classes = {name: getattr(softrobots, name) for name in softrobots.__all__ if isinstance(getattr(softrobots, name), type)}
    classes["CompiledModel"] = importlib.import_module("softrobots.compiled.run.compiled_model").CompiledModel
    for name, kind in classes.items():
        known = [inner for inner in (*vars(kind), *getattr(kind, "__annotations__", ())) if not inner.startswith("_")]
        identifiers |= {f"{name}.{inner}": f"{identifiers[name]}.{inner}" for inner in known}
    return identifiers


def _identifier(code: str, own: str | None) -> str | None:
    """What a piece of code names, or None."""
    bare = re.sub(r"\(\)$", "", code)
    bare = re.sub(r"^(softrobots|sr)\.", "", bare)
    if not re.fullmatch(r"[A-Za-z_][\w.]*", bare):
        return None
    known = _identifiers()
    return known.get(f"{own}.{bare}") if own and f"{own}.{bare}" in known else known.get(bare)


def on_page_content(text: str, page: Any, files: Any, **_: Any) -> str:
    """Link names of the library, and of files that have pages."""
    name = page.file.src_uri
    if name.startswith("source/") or name.endswith(".ipynb"):
        return text
    sources = {path.relative_to(CHECKOUT).as_posix(): path for path in source_files()}
    own = OWN_MODULES.get(name)

    def one(match: re.Match[str]) -> str:
        code = html.unescape(match[1])
        if code in sources:
            file = files.get_file_from_path(source_page(sources[code]))
            return f'<a href="{get_relative_url(file.url, page.url)}">{match[0]}</a>'
        command = name in ("commands.md", "changelog.md") and code.isalpha() and code.islower()
        identifier = None if command else _identifier(code, own)
        return match[0] if identifier is None else f'<autoref identifier="{identifier}" optional>{match[0]}</autoref>'

    parts = UNTOUCHED.split(text)
    return "".join(part if index % 2 else CODE.sub(one, part) for index, part in enumerate(parts))
