"""Equations of the site: LaTeX becomes MathML while the pages are built, so that a page needs no script and no network.

Inline `$...$` and displayed ```` ```math ```` fences, as GitHub renders them. An equation that cannot be converted whole is a
warning that names it, and a strict build fails.
"""

from __future__ import annotations

import html
import logging
import re
import unicodedata
from typing import Any
from xml.etree import ElementTree

from latex2mathml.converter import convert

MATHML = "http://www.w3.org/1998/Math/MathML"
ENVIRONMENTS = {"aligned": "align*", "split": "split", "gathered": "matrix"}
"""Environments of several lines, and how latex2mathml knows them."""
MATRICES = ("matrix", "pmatrix", "bmatrix", "vmatrix", "cases", "array")
STYLES = ("double-struck", "sans-serif", "script", "fraktur")
"""Styles of letters that browsers know by characters of their own only."""
FUNCTIONS = frozenset(
    ("sin", "cos", "tan", "cot", "sec", "csc", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh")
    + ("ln", "log", "exp", "det", "arg", "dim", "ker")
)
r"""Names that stand a thin space away from what is beside them, as those of `\operatorname` do."""

PARTS = {"mfrac": 2, "msup": 2, "msub": 2, "mover": 2, "munder": 2, "mroot": 2, "msubsup": 3, "munderover": 3}
"""Elements that have so many parts."""
BARS = ("|", "\N{DOUBLE VERTICAL LINE}")
"""What stands on both sides of a norm."""
SIGNS = ("-", "+", "\N{MINUS SIGN}", "\N{PLUS-MINUS SIGN}")
OPENING = ("(", "[", "{", ",", "=", "<", ">", "\N{LESS-THAN OR EQUAL TO}", "\N{GREATER-THAN OR EQUAL TO}", "\N{MIDDLE DOT}")
"""After these a plus or minus is a sign."""

_log = logging.getLogger("mkdocs.hooks.equations")
_page = {"name": "?"}
_MARKED = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)

_NETWORK = re.compile(r"<script\b(?:(?!</script>).)*(?:mermaid|mathjax)(?:(?!</script>).)*</script>", re.DOTALL | re.IGNORECASE)
_CELL = re.compile(r'(<div class="jp-RenderedHTMLCommon jp-RenderedMarkdown[^>]*>)(.*?)(</div>\s*</div>)', re.DOTALL)
_OPERATOR = re.compile(r"\\operatorname\{(\w+)\}")

ElementTree.register_namespace("", MATHML)


class EquationError(ValueError):
    """An equation that does not become MathML."""


def mathml(latex: str, *, display: bool) -> str:
    """Convert an equation.

    Args:
        latex: The equation, without dollar signs.
        display: Whether it stands on a line of its own.

    Returns:
        A `<math>` element.

    Raises:
        EquationError: If it cannot be converted, or not whole: an unknown command, a brace or an `&` too many.
    """
    _check_braces(latex)
    plain = _plain(latex)
    try:
        root = ElementTree.fromstring(convert(plain, display="block" if display else "inline"))
    except ElementTree.ParseError:
        raise EquationError(f"an & outside of a table in {latex!r}") from None
    except Exception as error:  # latex2mathml's own errors have no common root
        raise EquationError(f"{type(error).__name__} in {latex!r}") from error
    functions = FUNCTIONS | set(_OPERATOR.findall(latex))
    for element in root.iter():
        _check(element, latex)
        _join_letters(element)
    for element in root.iter():
        _space_functions(element, functions)
        _space_operators(element)
    return ElementTree.tostring(root, encoding="unicode")


def display_block(latex: str) -> str:
    r"""A displayed equation with its number (`\tag{3}`) at the right edge."""
    tags = re.findall(r"\\tag\{(.*?)\}", latex)
    if len(tags) > 1:
        raise EquationError(f"more than one \\tag in {latex!r}")
    number = f'<span class="equation-number">({html.escape(tags[0])})</span>' if tags else ""
    bare = re.sub(r"\\tag\{.*?\}", "", latex)
    return f'<div class="equation"><div>{mathml(bare, display=True)}</div>{number}</div>'


def _check_braces(latex: str) -> None:
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", latex.replace(r"\\", "  ")):
        depth += 1 if brace == "{" else -1
        if depth < 0:
            break
    if depth:
        raise EquationError(f"braces do not match in {latex!r}")


def _plain(latex: str) -> str:
    """Replace what latex2mathml does not know by an equivalent that it knows."""

    def environment(match: re.Match[str]) -> str:
        if match[2] not in (*ENVIRONMENTS, *MATRICES):
            raise EquationError(f"unknown environment {match[2]} in {latex!r}; known: {', '.join((*ENVIRONMENTS, *MATRICES))}")
        return f"\\{match[1]}{{{ENVIRONMENTS.get(match[2], match[2])}}}"

    latex = re.sub(r"\\(begin|end)\{(.*?)\}", environment, latex)
    return _OPERATOR.sub(lambda match: rf"\mathrm{{{match[1]}}}", latex)


def _check(element: ElementTree.Element, latex: str) -> None:
    """Refuse what latex2mathml passes through unconverted, and what browsers do not draw."""
    kind, text = element.tag.removeprefix(f"{{{MATHML}}}"), element.text or ""
    if "\\" in text or (kind == "mi" and text in {"{", "}", "&"}):
        raise EquationError(f"{text!r} is not known in {latex!r}")
    if kind == "mo" and not text:
        raise EquationError(f"an operator without a name in {latex!r}")
    if kind == "mspace" and element.get("linebreak"):
        raise EquationError(f"lines need \\begin{{aligned}} in {latex!r}")
    if len(element) != PARTS.get(kind, len(element)):
        raise EquationError(f"{kind} without its {PARTS[kind]} parts in {latex!r}")
    style = element.get("mathvariant")
    if style in STYLES:
        element.text = _letter(style, text, latex)
        del element.attrib["mathvariant"]
    elif style not in (None, "normal", "bold", "bold-italic"):
        raise EquationError(f"letters in {style} are not drawn by browsers, in {latex!r}")


def _letter(style: str, text: str, latex: str) -> str:
    """The character that is a letter in a style."""
    case = "CAPITAL" if text.isupper() else "SMALL"
    for prefix in ("MATHEMATICAL ", ""):
        try:
            return unicodedata.lookup(f"{prefix}{style.upper()} {case} {text.upper()}")
        except KeyError:
            continue
    raise EquationError(f"no {style} {text!r} in {latex!r}")


def _join_letters(row: ElementTree.Element) -> None:
    r"""Letters of one `\mathrm` are one name; a browser draws it upright and without gaps."""
    upright = [item.get("mathvariant") == "normal" for item in row]
    if (
        row.tag == f"{{{MATHML}}}mrow"
        and len(row) > 1
        and upright[0]
        and all(u or item.tag == f"{{{MATHML}}}mn" for u, item in zip(upright, row, strict=True))
    ):
        name = ElementTree.Element(f"{{{MATHML}}}mi")
        name.text = "".join(item.text or "" for item in row)
        row[:] = [name]


def _space_functions(row: ElementTree.Element, functions: set[str]) -> None:
    """A thin space between the name of a function and letters, numbers and fractions beside it."""
    if row.tag not in (f"{{{MATHML}}}mrow", f"{{{MATHML}}}mtd"):
        return

    def is_function(item: ElementTree.Element) -> bool:
        while len(item) and item.tag in (f"{{{MATHML}}}mrow", f"{{{MATHML}}}msup", f"{{{MATHML}}}msub"):
            item = item[0]
        return item.text in functions

    apart = {f"{{{MATHML}}}{kind}" for kind in ("mi", "mn", "msup", "msub", "msubsup", "mfrac", "msqrt", "mover")}
    for place in range(len(row) - 1, 0, -1):
        left, right = row[place - 1], row[place]
        before, after = is_function(left), is_function(right)
        if (before and (after or right.tag in apart)) or (after and left.tag in apart):
            row.insert(place, ElementTree.Element(f"{{{MATHML}}}mspace", width="0.167em"))


def _space_operators(row: ElementTree.Element) -> None:
    """Spaces as in LaTeX: none around a slash, within bars, behind a sign, or between max and a parenthesis."""
    scripts = {f"{{{MATHML}}}{kind}" for kind in ("msup", "msub", "msubsup")}
    bases = [item[0] if item.tag in scripts else item for item in row]
    bars = [item for item in bases if item.text in BARS and item.get("form") is None]
    for number, bar in enumerate(bars):
        if len(bars) % 2 == 0:
            bar.attrib.update(form=("prefix", "postfix")[number % 2], stretchy="false", lspace="0", rspace="0")
    for item, before, after in zip(row, [None, *row], [*row[1:], None], strict=False):
        text = item.text or ""
        if text in SIGNS and before is not None and (before.text or "") in OPENING:
            item.attrib.update(form="prefix", lspace="0", rspace="0")
        if item.tag == f"{{{MATHML}}}mo" and (text == "/" or (text.isalpha() and text.isascii())):
            opens = text == "/" or (after is not None and (after.text or "") in ("(", "["))
            item.attrib.update(lspace="0" if text == "/" else "0.167em", rspace="0" if opens else "0.167em")


def fence(source: str, language: str, css_class: str, options: Any, md: Any, **_: Any) -> str:
    """A ```` ```math ```` fence: what pymdownx.superfences calls."""
    try:
        return display_block(source.strip())
    except EquationError as error:
        _log.warning("%s: %s", _page["name"], error)
        return f"<pre>{html.escape(source)}</pre>"


def convert_marked(text: str, name: str) -> str:
    """Convert what arithmatex has marked in a page's HTML."""

    def one(match: re.Match[str]) -> str:
        latex = html.unescape(match[3]).strip()
        try:
            return display_block(latex) if match[2] == "[" else mathml(latex, display=False)
        except EquationError as error:
            _log.warning("%s: %s", name, error)
            return html.escape(latex)

    return _MARKED.sub(one, text)


def on_config(config: Any) -> Any:
    """Teach Markdown the fence."""
    fences = config["mdx_configs"].setdefault("pymdownx.superfences", {}).setdefault("custom_fences", [])
    fences.append({"name": "math", "class": "math", "format": fence})
    return config


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Keep the name of the page for the warnings of its fences."""
    _page["name"] = page.file.src_uri
    return markdown


def on_page_content(text: str, page: Any, **_: Any) -> str:
    """Convert the inline equations of a page, and those of a notebook, whose scripts for it ask the network."""
    name = page.file.src_uri
    if name.endswith(".ipynb"):
        text = _NETWORK.sub("", text)
        text = _CELL.sub(lambda match: match[1] + _mark(match[2]) + match[3], text)
    return convert_marked(text, name)


def _mark(cell: str) -> str:
    """Mark the equations of a cell of text as arithmatex does."""
    parts = re.split(r"(<(?:code|pre)\b.*?</(?:code|pre)>)", cell, flags=re.DOTALL)
    for place in range(0, len(parts), 2):
        parts[place] = re.sub(r"\$\$(.+?)\$\$", r'<div class="arithmatex">\\[\1\\]</div>', parts[place], flags=re.DOTALL)
        inline = r"(?<!\\)\$(?=\S)([^$]+?)(?<=\S)\$"
        parts[place] = re.sub(inline, r'<span class="arithmatex">\\(\1\\)</span>', parts[place])
    return "".join(parts)
