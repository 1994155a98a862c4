"""What an MJCF file may ask of MuJoCo, looked at before MuJoCo reads it.

A short file can ask for much: `<replicate count="100000000">` and generated meshes ran for minutes until the memory was gone,
a model that attaches itself ended the process, a named pipe in place of a mesh was waited for, and the name of a class that is
not there was taken for a format of C, which can write to memory (MuJoCo 4.0). Files are included from the folder of the
description only.
"""

from __future__ import annotations

import math
import struct
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import number_in, parse_xml, read_xml
from softrobots.description.mesh_files import unfit_file

MOST_ELEMENTS = 20_000
"""Elements of a file with all that it includes, attaches and replicates; MuJoCo's time grows with the square of them."""
MOST_PIXELS = 50_000_000
"""Numbers of colours and heights that it makes, and pixels of the PNG files that it names; MuJoCo keeps them all."""
MOST_FOLDERS = 20
"""Folders in which it may let MuJoCo look for files, with all that it includes and attaches."""

_CHAIN = 10  # models within models
_COST = {"composite": 1.0, "flexcomp": 8.0}  # of one of the `count` parts that an element makes, in elements
_WITHOUT_OBJECT = (
    "user",
    "clock",
    "e_potential",
    "e_kinetic",
)  # sensors; each copy that <replicate> makes doubles their number
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
"""The largest product of the numbers of an attribute, by element."""
_ANYWHERE = {"nsample": 10_000.0, "actdim": 10_000.0}  # attributes of actuators and sensors, which have many names
_LEAST = {"timestep": 1e-4, "interval": 1e-4}  # of <lengthrange>, which simulates so finely
_MEMORY = {"K": 2.0**10, "M": 2.0**20, "G": 2.0**30}
_MOST_MEMORY = 2.0**30  # bytes; MuJoCo sets them aside
_RESOLUTION = 100.0  # of a generated mesh; the first numbers of its `params`


def check_mjcf(root: ElementTree.Element, source: str, path: Path | None) -> None:
    """Refuse an MJCF description that asks for too much, or includes what it must not.

    Args:
        root: The root element.
        source: Where it comes from, for errors.
        path: Its file, if it is one.

    Raises:
        DescriptionError: If it becomes more than `MOST_ELEMENTS` elements; if a file that it includes is not below its folder,
            is included twice, is no XML or not in UTF-8; if it is text and includes files; if models attach each other in a
            circle; if a file that it names is no file, or too large; if a size that it asks for is beyond a limit; or if an
            attribute has a percent sign.
    """
    survey = _Survey(source, None if path is None else path.parent.resolve())
    if path is not None:
        _check_utf8(path, source)
    survey.weight(root, () if path is None else (path.resolve(),))
    survey.check_files()


class _Survey:
    """Goes through a description and the files that it includes."""

    def __init__(self, source: str, folder: Path | None) -> None:
        self._source, self._folder = source, folder
        self._folders: set[str] = {""}
        self._names: Counter[str] = Counter()
        self._pixels = 0.0
        self._weights: dict[Path, int] = {}

    def weight(self, root: ElementTree.Element, chain: tuple[Path, ...]) -> int:
        """Number of elements that MuJoCo makes of a document.

        Args:
            root: Its root.
            chain: Files that lead here: the description, and models within it.
        """
        included = set(chain)
        models = [self._model(element, chain) for element in root.iter("model") if element.get("file") is not None]
        each, total, stack = max(models, default=0), 0, [(root, 1)]
        sensors = doublings = 0
        while stack:
            element, times = stack.pop()
            self._look_at(element)
            cost = _COST.get(str(element.tag))
            made = 0 if cost is None else math.ceil(cost * _product(element.get("count", "1")))
            total += times * (1 + made + (each if element.tag == "attach" else 0))
            if element.tag == "replicate":
                count = number_in(element.get("count", "1"))
                if not 0.0 <= count <= MOST_ELEMENTS:
                    self._refuse(f"<replicate count={element.get('count', '')[:100]!r}>")
                doublings += times * math.ceil(count)
                times *= math.ceil(count)
            sensors += element.tag in _WITHOUT_OBJECT and element.get("objname") is None
            if total > MOST_ELEMENTS:
                self._refuse(f"more than {MOST_ELEMENTS} elements, with all that it includes, attaches and replicates")
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
        """Look at the meshes, pictures and other files that it names, wherever MuJoCo may look for them."""
        if len(self._folders) > MOST_FOLDERS:
            self._refuse(f"files in more than {MOST_FOLDERS} folders")
        for name, times in sorted(self._names.items()):
            for folder in sorted(self._folders):
                for spelled in {name, name.replace("\\", "/").rpartition("/")[2]}:
                    file = (self._folder or Path()) / folder / spelled
                    why = unfit_file(file)
                    if why:
                        self._refuse(f"the file {spelled[:200]!r}, which {why}")
                    width, height = _size_of_picture(file)
                    if width * height > MOST_PIXELS:
                        self._refuse(f"the file {spelled[:200]!r}, which has {width} x {height} pixels")
                    self._count_pixels(times * width * height)

    def _count_pixels(self, pixels: float) -> None:
        self._pixels += pixels
        if not self._pixels <= MOST_PIXELS:
            self._refuse(f"pictures, textures and heights of more than {MOST_PIXELS:g} pixels in all")

    def _refuse(self, what: str) -> None:
        raise DescriptionError(f"{self._source} asks for more than is read: {what}")

    def _model(self, element: ElementTree.Element, chain: tuple[Path, ...]) -> int:
        """Weight of a model that can be attached."""
        file = self._included(element)
        if file in chain or len(chain) > _CHAIN:
            self._refuse(f"the model {file.name}, which contains itself")
        if file not in self._weights:
            self._weights[file] = self.weight(self._read(file), (*chain, file))
        return self._weights[file]

    def _included(self, element: ElementTree.Element) -> Path:
        name = element.get("file", "")
        if self._folder is None:
            self._refuse(f"the file {name[:200]!r} included by text, which has no folder; give the path of a file")
        folder = self._folder or Path()
        try:
            file = (folder / name).resolve()
        except (OSError, RuntimeError, ValueError):  # links in a circle; a name that is none
            file = Path("/")
        if folder not in file.parents:
            self._refuse(f"the included file {name[:200]!r}, which is not below the folder of the description")
        return file

    def _read(self, file: Path) -> ElementTree.Element:
        if unfit_file(file) is None:
            return ElementTree.Element("missing")  # MuJoCo tells where it is named
        text = read_xml(file)  # first, as it refuses what is too large
        _check_utf8(file, self._source)
        return parse_xml(text, str(file))

    def _look_at(self, element: ElementTree.Element) -> None:
        """Check the numbers of an element, and keep the files that it names."""
        tag = str(element.tag)
        limits = {**_ANYWHERE, **_LARGEST.get(tag, {})}
        for name, text in element.items():
            if "%" in text:
                self._refuse(f"<{tag} {name}={text[:100]!r}>, which MuJoCo may take for a format of C; use another sign than %")
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
    """Product of the numbers of an attribute; NaN if one is none, zeros and signs left out."""
    return math.prod(max(abs(number), 1.0) if not math.isnan(number) else number for number in map(number_in, text.split()))


def _largest(text: str) -> float:
    numbers = [abs(number_in(part)) for part in text.split()]
    return math.nan if any(map(math.isnan, numbers)) else max(numbers, default=0.0)


def _bytes_in(text: str) -> float:
    """Memory as MuJoCo has it: a number and K, M or G; -1 leaves it to MuJoCo."""
    unit = text.strip()[-1:].upper()
    return number_in(text.strip()[:-1]) * _MEMORY[unit] if unit in _MEMORY else number_in(text)


def _size_of_picture(file: Path) -> tuple[int, int]:
    """Width and height of a PNG file; zeros if it is none."""
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
    """MuJoCo takes every file for UTF-8, whatever it declares."""
    if not unfit_file(file):
        try:
            file.read_bytes().decode("utf-8")
        except UnicodeDecodeError as error:
            raise DescriptionError(f"{source} is MJCF, and {file.name} is not in UTF-8: {error}") from error
        except OSError:
            return  # it is read, and refused, elsewhere
