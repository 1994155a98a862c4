"""Limits of MJCF files, checked before MuJoCo reads them.

Measured with MuJoCo 4.0: `<replicate count="100000000">` and generated meshes exhaust the memory after minutes, a model that
attaches itself ends the process, a named pipe in place of a mesh blocks, and the name of a missing class is used as a C format
string, which can write to memory. Files may be included from below the folder of the description only.
"""

from __future__ import annotations

import math
import struct
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NoReturn

from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import number_in, parse_xml, read_xml
from softrobots.description.mesh_files import unfit_file

MOST_ELEMENTS = 20_000
"""Most elements with all included, attached and replicated ones; MuJoCo's time grows with their square."""
MOST_PIXELS = 50_000_000
"""Most pixels of textures, height fields and PNG files together; MuJoCo keeps them all in memory."""
MOST_FOLDERS = 20
"""Most folders in which MuJoCo searches files."""

_CHAIN = 10  # nesting of models
_COST = {"composite": 1.0, "flexcomp": 8.0}  # elements for each of the `count` parts of an element
_WITHOUT_OBJECT = ("user", "clock", "e_potential", "e_kinetic")  # sensors that every copy of <replicate> doubles
_LARGEST: Mapping[str, Mapping[str, float]] = {
    "composite": {"count": 10_000},
    "flexcomp": {"count": 10_000, "cellcount": 10_000},
    "flex": {"cellcount": 10_000},
    "texture": {"width": 20_000, "height": 20_000, "gridsize": 100, "nchannel": 4},
    "hfield": {"nrow": 20_000, "ncol": 20_000},
    "camera": {"resolution": 20_000_000},
    "numeric": {"size": 10_000},
    "user": {"dim": 10_000},
    "lengthrange": {"inttotal": 100},
    "size": {
        **dict.fromkeys(("nkey", "nuserdata", "nconmax", "njmax"), 100_000),
        "nstack": 10_000_000,
        **{f"nuser_{of}": 1000 for of in ("actuator", "body", "cam", "geom", "jnt", "sensor", "site", "tendon")},
    },
}
"""Largest product of the numbers of an attribute, by element."""
_ANYWHERE = {"nsample": 10_000.0, "actdim": 10_000.0}  # attributes of actuators and sensors of any tag
_LEAST = {"timestep": 1e-4, "interval": 1e-4}  # time steps of the simulation for <lengthrange>
_MEMORY = {"K": 2.0**10, "M": 2.0**20, "G": 2.0**30}
_MOST_MEMORY = 2.0**30  # bytes that MuJoCo allocates
_RESOLUTION = 100.0  # of a generated mesh; the first numbers of its `params`


def check_mjcf(root: ElementTree.Element, source: str, path: Path | None) -> None:
    """Refuse an MJCF description, read from a file or not, that exceeds a limit or includes files from elsewhere.

    Raises:
        DescriptionError: If it expands to more than `MOST_ELEMENTS` elements; if an included file is not below its folder,
            included twice, no XML or not in UTF-8; if text without a file includes files; if models attach each other in a
            circle; if a named file is a pipe or folder, or too large; if a size exceeds its limit; or if an attribute has a
            percent sign.
    """
    survey = _Survey(source, None if path is None else path.parent.resolve())
    if path is not None:
        _check_utf8(path, source)
    survey.weight(root, () if path is None else (path.resolve(),))
    survey.check_files()


class _Survey:
    """Counts the elements, files and pixels of a description and its included files."""

    def __init__(self, source: str, folder: Path | None) -> None:
        self._source, self._folder = source, folder
        self._folders: set[str] = {""}
        self._names: Counter[str] = Counter()
        self._pixels = 0.0
        self._weights: dict[Path, int] = {}

    def weight(self, root: ElementTree.Element, chain: tuple[Path, ...]) -> int:
        """Return the number of elements to which MuJoCo expands a document, by its root and the files that lead to it."""
        included = set(chain)
        models = [self._model(element, chain) for element in root.iter("model") if element.get("file") is not None]
        each, total, stack = max(models, default=0), 0, [(root, 1)]
        sensors = doublings = 0
        while stack:
            element, times = stack.pop()
            self._check_element(element)
            cost = _COST.get(str(element.tag))
            parts = 0 if cost is None else math.ceil(cost * _product(element.get("count", "1")))
            total += times * (1 + parts + (each if element.tag == "attach" else 0))
            if element.tag == "replicate":
                count = number_in(element.get("count", "1"))
                if not 0.0 <= count <= MOST_ELEMENTS:
                    self._refuse(f"<replicate count={element.get('count', '')[:100]!r}>")
                doublings += times * math.ceil(count)
                times *= math.ceil(count)
            sensors += element.tag in _WITHOUT_OBJECT and element.get("objname") is None
            if total > MOST_ELEMENTS:
                self._refuse(f"more than {MOST_ELEMENTS} elements, with included, attached and replicated ones")
            children: Iterator[ElementTree.Element] = iter(element)
            if element.tag == "include":
                file = self._included(element)
                if file in included:
                    self._refuse(f"the file {file.name} included twice, or in a circle")
                included.add(file)
                children = iter(self._read(file))
            stack += [(child, times) for child in children]
        if sensors and sensors * 2.0 ** min(doublings, 100) > MOST_ELEMENTS:
            self._refuse(f"sensors without an object, doubled {doublings} times by <replicate>")
        return total

    def check_files(self) -> None:
        """Check meshes, pictures and other named files in all folders where MuJoCo searches them."""
        if len(self._folders) > MOST_FOLDERS:
            self._refuse(f"files in more than {MOST_FOLDERS} folders")
        for name, times in sorted(self._names.items()):
            for folder in sorted(self._folders):
                for relative in {name, name.replace("\\", "/").rpartition("/")[2]}:
                    file = (self._folder or Path()) / folder / relative
                    why = unfit_file(file)
                    if why:
                        self._refuse(f"the file {relative[:200]!r}, which {why}")
                    width, height = _size_of_picture(file)
                    if width * height > MOST_PIXELS:
                        self._refuse(f"the file {relative[:200]!r}, which has {width} x {height} pixels")
                    self._count_pixels(times * width * height)

    def _count_pixels(self, pixels: float) -> None:
        self._pixels += pixels
        if not self._pixels <= MOST_PIXELS:
            self._refuse(f"pictures, textures and heights of more than {MOST_PIXELS:g} pixels in all")

    def _refuse(self, what: str) -> NoReturn:
        raise DescriptionError(f"{self._source} exceeds what is read: {what}")

    def _model(self, element: ElementTree.Element, chain: tuple[Path, ...]) -> int:
        """Weight of a model for `<attach>`."""
        file = self._included(element)
        if file in chain or len(chain) > _CHAIN:
            self._refuse(f"the model {file.name}, which contains itself")
        if file not in self._weights:
            self._weights[file] = self.weight(self._read(file), (*chain, file))
        return self._weights[file]

    def _included(self, element: ElementTree.Element) -> Path:
        name = element.get("file", "")
        if self._folder is None:
            self._refuse(f"the file {name[:200]!r} included by text, which has no folder; a path of a file is required")
        try:
            file = (self._folder / name).resolve()
        except (OSError, RuntimeError, ValueError):  # a loop of links, an invalid name
            file = Path("/")
        if self._folder not in file.parents:
            self._refuse(f"the included file {name[:200]!r}, which is not below the folder of the description")
        return file

    def _read(self, file: Path) -> ElementTree.Element:
        if unfit_file(file) is None:
            return ElementTree.Element("missing")  # MuJoCo reports it
        text = read_xml(file)  # first, because it limits the size
        _check_utf8(file, self._source)
        return parse_xml(text, str(file))

    def _check_element(self, element: ElementTree.Element) -> None:
        """Check the numbers of an element, and collect its files."""
        tag = str(element.tag)
        limits = {**_ANYWHERE, **_LARGEST.get(tag, {})}
        for name, text in element.items():
            if "%" in text:
                self._refuse(f"<{tag} {name}={text[:100]!r}>, which MuJoCo may use as a C format string; no % is allowed")
            if name in limits and not abs(_product(text)) <= limits[name]:
                self._refuse(f"<{tag} {name}={text[:100]!r}>; at most {limits[name]:g} in all")
            if tag == "lengthrange" and name in _LEAST and not number_in(text) >= _LEAST[name]:
                self._refuse(f"<{tag} {name}={text[:100]!r}>; at least {_LEAST[name]:g}")
            if tag == "size" and name == "memory" and not _bytes_in(text) <= _MOST_MEMORY:
                self._refuse(f"<size memory={text[:100]!r}>; at most 1G")
            if name == "params" and "builtin" in element.attrib and not _largest(text) <= _RESOLUTION:
                self._refuse(f"<{tag} params={text[:100]!r}>; at most {_RESOLUTION:g} for each")
            if tag == "compiler" and name in ("assetdir", "meshdir", "texturedir"):
                self._folders.add(text)
            if name.startswith("file") and tag not in ("include", "model"):
                self._names[text] += 1
        if tag == "texture":
            across = _product(element.get("width", "0"))
            flat = element.get("type", "cube") == "2d"
            self._count_pixels(across * (_product(element.get("height", "0")) if flat else 6.0 * across))  # six sides
        elif tag == "hfield":
            self._count_pixels(_product(element.get("nrow", "0")) * _product(element.get("ncol", "0")))


def _product(text: str) -> float:
    """Product of the numbers of an attribute without zeros and signs; NaN if one is malformed."""
    return math.prod(max(abs(number), 1.0) if not math.isnan(number) else number for number in map(number_in, text.split()))


def _largest(text: str) -> float:
    numbers = [abs(number_in(part)) for part in text.split()]
    return math.nan if any(map(math.isnan, numbers)) else max(numbers, default=0.0)


def _bytes_in(text: str) -> float:
    """Memory size in MuJoCo's notation: a number and K, M or G; -1 for automatic."""
    unit = text.strip()[-1:].upper()
    return number_in(text.strip()[:-1]) * _MEMORY[unit] if unit in _MEMORY else number_in(text)


def _size_of_picture(file: Path) -> tuple[int, int]:
    """Width and height of a PNG file; zeros for other files."""
    try:
        with file.open("rb") as stream:
            head = stream.read(24)
    except (OSError, ValueError):
        return 0, 0
    if len(head) < 24 or not head.startswith(b"\x89PNG"):
        return 0, 0
    width, height = struct.unpack(">II", head[16:])
    return int(width), int(height)


def _check_utf8(file: Path, source: str) -> None:
    """Refuse other encodings: MuJoCo reads every file as UTF-8, whatever it declares."""
    if not unfit_file(file):
        try:
            file.read_bytes().decode("utf-8")
        except UnicodeDecodeError as error:
            raise DescriptionError(f"{source} is MJCF, and {file.name} is not in UTF-8: {error}") from error
        except OSError:
            return  # reported where it is read
