"""The recordings in docs/examples/tdcr_v4: commands of nine servo motors and places of the tip, by tendon and in SI units."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import FileFormatError
from studies.shared.checkout import CHECKOUT

FOLDER = CHECKOUT / "docs" / "examples" / "tdcr_v4"
"""Where the recordings are, with their source and licence."""
SETS = ("train", "val")
"""Files to predict: patterns of one and two segments, and of three."""
TENDONS = 9
"""Tendons of the arm, three a segment, counted from the base."""

FAMILIES = {
    r"tendon\d_id\d_pull": "one tendon",
    r"seg\d_dir\d+": "one segment",
    r"seg\d_circle": "one segment, circle",
    r"pair\d\d_same_dir\d+": "two segments, same way",
    r"pair\d\d_opp_dir\d+": "two segments, opposite",
    r"all3_same_dir\d+": "three segments, same way",
    r"all3_scurve_dir\d+": "three segments, S",
    r"all3_spiral_dir\d+": "three segments, spiral",
}
"""Families of movements by the form of their labels."""

_SINGLE_PULL = re.compile(r"rep\d+_tendon(\d+)_id(\d+)_pull(_hold)?")
_SERVO = re.compile(r"servo_(\d+)_mm")
_TIP = ("tip_x", "tip_y", "tip_z")
_METRES = 1e-3  # a millimetre


@dataclass(frozen=True, eq=False)
class Recording:
    """Rows of one file in the order in which they were recorded."""

    name: str
    """Name of the file without its ending."""
    times: FloatArray
    """Time since the first row, shape (n,) [s]."""
    patterns: tuple[str, ...]
    """Label of the movement that each row belongs to."""
    pulls: FloatArray
    """By how much each motor has pulled its tendon in, tendons by segment, shape (n, 9) [m]."""
    tips: FloatArray
    """Place of the tip in the frame of the cameras, shape (n, 3) [m]."""

    @property
    def blocks(self) -> tuple[str, ...]:
        """The movement of each row; the return to rest behind it (`..._hold`) belongs to it."""
        return tuple(pattern.removesuffix("_hold") for pattern in self.patterns)

    def thinned(self, every: int) -> Recording:
        """Return each so many-th row, from the first on."""
        kept = slice(None, None, every)
        parts = (read_only(part[kept]) for part in (self.pulls, self.tips))
        return Recording(self.name, read_only(self.times[kept]), self.patterns[kept], *parts)

    @property
    def families(self) -> tuple[str, ...]:
        """The family of movements that each row belongs to."""
        return tuple(family_of(pattern) for pattern in self.patterns)


def family_of(pattern: str) -> str:
    """The family of movements of a label, e.g. "two segments, same way" of rep1_pair12_same_dir0_hold.

    Raises:
        FileFormatError: If it is none of `FAMILIES`.
    """
    for form, family in FAMILIES.items():
        if re.fullmatch(rf"rep\d+_{form}(_hold)?", pattern):
            return family
    raise FileFormatError(f"the pattern {pattern!r} is of no known family: {', '.join(FAMILIES.values())}")


def servos_by_tendon(folder: Path = FOLDER) -> tuple[int, ...]:
    """Which servo pulls which tendon: from the labels `rep<r>_tendon<k>_id<servo>_pull` of single pulls.

    Args:
        folder: Folder with tendon_pull.csv.

    Returns:
        Number of the servo of each tendon, tendons by segment, shape (9,).

    Raises:
        FileFormatError: If the file cannot be read, a label is of another form, or the labels do not name one servo of its own
            for each of nine tendons.
    """
    path = folder / "tendon_pull.csv"
    found: dict[int, int] = {}
    for label in _read(path)[1]:
        match = _SINGLE_PULL.fullmatch(label)
        if match is None:
            raise FileFormatError(f"{path}: the label {label!r} is not of the form rep<r>_tendon<k>_id<servo>_pull")
        tendon, servo = int(match[1]), int(match[2])
        if found.setdefault(tendon, servo) != servo:
            raise FileFormatError(f"{path}: tendon {tendon} has the servos {found[tendon]} and {servo}; one is required")
    if sorted(found) != list(range(TENDONS)) or len(set(found.values())) != TENDONS:
        raise FileFormatError(
            f"{path} names servos of the tendons {found}; one of its own is required for each of 0 to {TENDONS - 1}"
        )
    return tuple(found[tendon] for tendon in range(TENDONS))


def read_recording(name: str, folder: Path = FOLDER) -> Recording:
    """Read a file of recordings.

    Args:
        name: Its name without ending: "train", "val" or "tendon_pull".
        folder: Its folder, with tendon_pull.csv beside it.

    Returns:
        The rows, tendons in the order of the segments, in metres and seconds.

    Raises:
        FileFormatError: If it cannot be read, has other columns, or numbers that are not finite, or times that do not ascend.
    """
    path = folder / f"{name}.csv"
    columns, patterns, numbers = _read(path)
    wanted = [f"servo_{servo}_mm" for servo in servos_by_tendon(folder)]
    missing = [column for column in wanted if column not in columns]
    if missing:
        raise FileFormatError(f"{path} has no columns {', '.join(missing)}; it has {', '.join(columns)}")
    times = numbers[:, columns.index("timestamp")]
    if np.any(np.diff(times) <= 0.0):
        raise FileFormatError(f"{path}: the times must ascend; row {int(np.argmax(np.diff(times) <= 0.0)) + 2} does not")
    return Recording(
        name,
        read_only(times - times[0]),
        patterns,
        read_only(_METRES * numbers[:, [columns.index(column) for column in wanted]]),
        read_only(_METRES * numbers[:, [columns.index(column) for column in _TIP]]),
    )


def _read(path: Path) -> tuple[list[str], tuple[str, ...], FloatArray]:
    """Columns of numbers of a file, labels of its rows, and numbers, shape (n, columns)."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.reader(stream))
    except (OSError, ValueError, csv.Error) as error:
        raise FileFormatError(f"cannot read {path}: {error}") from error
    header = rows[0] if rows else []
    columns = [column for column in header if column != "pattern_label"]
    known = [column for column in columns if column in ("timestamp", *_TIP) or _SERVO.fullmatch(column)]
    if len(set(header)) != len(header) or len(header) != TENDONS + 5 or columns != known or len(columns) != len(header) - 1:
        told = ", ".join(header) or "none"
        raise FileFormatError(
            f"{path}: the columns must be timestamp, pattern_label, {TENDONS} servo_<id>_mm, {', '.join(_TIP)}; they are {told}"
        )
    if len(rows) < 2:
        raise FileFormatError(f"{path} has no rows")
    label = header.index("pattern_label")
    numbers = [_numbers(path, place, row, label, len(header)) for place, row in enumerate(rows[1:], start=2)]
    return columns, tuple(row[label] for row in rows[1:]), np.array(numbers)


def _numbers(path: Path, line: int, row: Sequence[str], label: int, count: int) -> list[float]:
    """The numbers of a row."""
    if len(row) != count:
        raise FileFormatError(f"{path}:{line}: {len(row)} cells; {count} are required")
    try:
        numbers = [float(cell) for place, cell in enumerate(row) if place != label]
    except ValueError as error:
        raise FileFormatError(f"{path}:{line}: {error}") from error
    if not np.all(np.isfinite(numbers)):
        raise FileFormatError(f"{path}:{line}: a number is not finite")
    return numbers
