"""A row of the comparison with a paper: what it prints, what this package computes, and what counts as agreement."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from softrobots.core.checks import FloatArray, choice, finite_number
from softrobots.core.errors import ParameterError

AGREES, MENDED, FITTED, TAKEN = "agrees", "agrees, mended", "fitted", "by construction"
ERRATUM, OURS = "erratum", "ours alone"
MEASURED, UNPUBLISHED, UNREADABLE = "measured", "not published", "unreadable"
KINDS = {
    AGREES: "must agree: within the rounding of the printed digits, or within the tolerance that the row states",
    MENDED: "must agree with the equation after its erratum is mended; not with the print",
    FITTED: "agrees, but on assumptions that were chosen so that it does; rows on one set of assumptions are counted once",
    TAKEN: "the same because ours is made of it: taken from the paper, a definition, or two ways through one model of ours; "
    "tells only that it still is so",
    ERRATUM: "the print is wrong: ours must differ from it",
    OURS: "the paper gives no number, or none that can be compared; this one is of this package",
    MEASURED: "measured in the laboratory, and the raw data are not published: cannot be computed",
    UNPUBLISHED: "the paper does not give what it takes to compute this",
    UNREADABLE: "cannot be read for certain in the text at hand",
}
"""What a row says of its two values, by its kind."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One number or one equation of a paper beside ours.

    Raises:
        ParameterError: If a number is not finite, the kind is unknown, or a row that claims something has no difference.
    """

    place: str
    """Where it stands in the paper: table, equation, figure or section."""
    quantity: str
    """What it is."""
    kind: str
    """One of `KINDS`."""
    unit: str = ""
    """Unit of all numbers of the row, as people write it (kPa, mm, degrees)."""
    printed: str = ""
    """What the paper prints, with its digits; a word where it is an equation; empty if nothing."""
    ours: float | None = None
    """What this package computes; None where there is no single number."""
    difference: float | None = None
    """Ours less the paper's; of an equation the largest difference over many cases, as a size."""
    tolerance: float | None = None
    """Largest difference that counts as agreement; of an erratum, the largest that would make it none."""
    decimals: int | None = None
    """How many decimals of ours and of the difference matter, two more than are printed; None: five significant digits."""
    note: str = ""
    """Assumptions and reasons."""
    assumptions: str = ""
    """Name of the set of assumptions of a row that was fitted."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        choice("kind", self.kind, tuple(KINDS))
        for name in ("ours", "difference", "tolerance"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, finite_number(name, getattr(self, name), self.unit))
        if self.claims and (self.difference is None or self.tolerance is None):
            raise ParameterError("difference", self.difference, f"given with a tolerance in a row of the kind {self.kind!r}")
        if bool(self.assumptions) != (self.kind == FITTED):
            raise ParameterError("assumptions", self.assumptions, f"named in the rows of the kind {FITTED!r}, and only there")

    @property
    def claims(self) -> bool:
        """Whether the row can be wrong."""
        return self.kind in (AGREES, MENDED, FITTED, TAKEN, ERRATUM)

    @property
    def holds(self) -> bool:
        """Whether what the row claims is so; True where it claims nothing."""
        if not self.claims or self.difference is None or self.tolerance is None:
            return True
        return (abs(self.difference) <= self.tolerance) == (self.kind != ERRATUM)

    @property
    def verdict(self) -> str:
        """The kind, or in capitals that its claim does not hold."""
        if self.holds:
            return self.kind
        return "NO ERRATUM" if self.kind == ERRATUM else "DISAGREES"


def rounded(place: str, quantity: str, printed: str, ours: float, unit: str = "", note: str = "") -> Row:
    """A printed number that ours must round to.

    Args:
        place: Where it is printed.
        quantity: What it is.
        printed: The number with its digits, e.g. "4.11".
        ours: Our number.
        unit: Unit of both.
        note: Assumptions.

    Raises:
        ParameterError: If `printed` is no number or ours is not finite.
    """
    _, decimals = _number(printed)
    tolerance = 0.5 * 10.0**-decimals * (1.0 + 1e-9)  # a value half way between two prints may round to either
    return within(place, quantity, printed, ours, tolerance, unit, note)


def taken(row: Row) -> Row:
    """The same row, said to agree by construction: ours is made of what the paper prints, or defined so.

    Args:
        row: A row that must agree.

    Raises:
        ParameterError: If it is of another kind.
    """
    choice("kind", row.kind, (AGREES,))
    return replace(row, kind=TAKEN)


def fitted(row: Row, assumptions: str) -> Row:
    """The same row, said to agree on assumptions that were chosen so that it does.

    Args:
        row: A row that must agree.
        assumptions: Name of the set of assumptions.

    Raises:
        ParameterError: If the row is of another kind, or the set has no name.
    """
    choice("kind", row.kind, (AGREES,))
    return replace(row, kind=FITTED, assumptions=assumptions)


def mended(row: Row) -> Row:
    """The same row, said to agree with an equation whose erratum is mended.

    Args:
        row: A row that must agree.

    Raises:
        ParameterError: If it is of another kind.
    """
    choice("kind", row.kind, (AGREES,))
    return replace(row, kind=MENDED)


def within(place: str, quantity: str, printed: str, ours: float, tolerance: float, unit: str = "", note: str = "") -> Row:
    """A printed number that ours must meet within a tolerance; the note says why not within the printed digits.

    Args:
        place: Where it is printed.
        quantity: What it is.
        printed: The number with its digits.
        ours: Our number.
        tolerance: Largest difference.
        unit: Unit of all three.
        note: The reason.

    Raises:
        ParameterError: If `printed` is no number or another number is not finite.
    """
    value, decimals = _number(printed)
    return Row(
        place=place,
        quantity=quantity,
        kind=AGREES,
        unit=unit,
        printed=printed,
        ours=ours,
        difference=ours - value,
        tolerance=tolerance,
        decimals=decimals + 2,
        note=note,
    )


def equation(place: str, quantity: str, difference: float, unit: str = "", note: str = "", tolerance: float = 1e-12) -> Row:
    """A printed equation, evaluated as it stands, that ours must reproduce.

    Args:
        place: Its number.
        quantity: What is compared, and over which cases.
        difference: Largest difference over these cases, a size.
        unit: Its unit.
        note: Assumptions.
        tolerance: Largest that counts as agreement; by default rounding of numbers around 1.

    Raises:
        ParameterError: If a number is not finite.
    """
    return Row(
        place=place,
        quantity=quantity,
        kind=AGREES,
        unit=unit,
        printed="equation",
        difference=difference,
        tolerance=tolerance,
        note=note,
    )


def erratum(
    place: str, quantity: str, as_printed: float, ours: float, unit: str = "", note: str = "", tolerance: float = 1e-6
) -> Row:
    """A print that is wrong, evaluated, beside the right number.

    Args:
        place: Where it is printed.
        quantity: What it is.
        as_printed: What the print gives.
        ours: The right number.
        unit: Unit of both.
        note: What should stand there, and why.
        tolerance: Largest difference that would make it no erratum.

    Raises:
        ParameterError: If a number is not finite.
    """
    return Row(
        place=place,
        quantity=quantity,
        kind=ERRATUM,
        unit=unit,
        printed=f"{as_printed:.5g}",
        ours=ours,
        difference=ours - as_printed,
        tolerance=tolerance,
        note=note,
    )


def own(place: str, quantity: str, ours: float, unit: str = "", note: str = "", printed: str = "") -> Row:
    """A number of this package where the paper has none, or none that can be compared.

    Args:
        place: What of the paper it belongs to.
        quantity: What it is.
        ours: The number.
        unit: Its unit.
        note: What it is based on.
        printed: What the paper says instead, if anything.

    Raises:
        ParameterError: If the number is not finite.
    """
    return Row(place=place, quantity=quantity, kind=OURS, unit=unit, printed=printed, ours=ours, note=note)


def absent(kind: str, place: str, quantity: str, printed: str = "", unit: str = "", note: str = "") -> Row:
    """Something of a paper that cannot be computed.

    Args:
        kind: `MEASURED`, `UNPUBLISHED` or `UNREADABLE`.
        place: Where it stands.
        quantity: What it is.
        printed: What is printed, if anything.
        unit: Its unit.
        note: The reason.

    Raises:
        ParameterError: If the kind is another.
    """
    choice("kind", kind, (MEASURED, UNPUBLISHED, UNREADABLE))
    return Row(place=place, quantity=quantity, kind=kind, unit=unit, printed=printed, note=note)


def largest(values: FloatArray) -> float:
    """Largest size of a number, e.g. of the differences between two ways to compute the same."""
    return float(np.abs(values).max())


def _number(printed: str) -> tuple[float, int]:
    """Value of a printed number and its decimals."""
    try:
        value = float(printed)
    except ValueError as error:
        raise ParameterError("printed", printed, "a number as it is printed, e.g. '4.11'") from error
    if not math.isfinite(value) or "e" in printed.lower():
        raise ParameterError("printed", printed, "a number as it is printed, e.g. '4.11'")
    return value, len(printed.partition(".")[2])
