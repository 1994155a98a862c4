"""The tendon-driven arm of `scripts/measured_arm.py` and `scripts/measured_arm_fit.py` in the table over all comparisons."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from softrobots.core.json_text import read_json
from studies.measured.comparison import Overview
from studies.shared.recorded_run import FOLDER

ROBOT = "[arm of nine tendons, 0.19 m](measured_arm.md)"
SOURCE = "[OpenCR](references.md#robots), 2063 rows"
_LARGEST = 2**20  # bytes


def read_record(checkout: Path, name: str) -> dict[str, Any]:
    """The numbers of a recorded run.

    Raises:
        FileFormatError: If there are none.
    """
    found: dict[str, Any] = read_json(checkout / FOLDER / f"{name}.json", _LARGEST)
    return found


def arm_rows(checkout: Path) -> list[Overview]:
    """Its two rows: with nominal parameters, and fitted; errors are those of validation.

    Raises:
        FileFormatError: If a run is not recorded.
    """
    nominal, fitted = read_record(checkout, "measured_arm"), read_record(checkout, "measured_fit")
    kept, error = "place of the tip, 443 rows of validation", f"{1e3 * fitted['sets']['val']['offset_m']:.1f} mm"
    numbers = f"{fitted['n_parameters']} numbers, on the other 1620 rows"
    return [
        Overview(
            ROBOT,
            SOURCE,
            "MIT",
            kept,
            f"{1e3 * nominal['models'][0]['val']['offset_m']:.1f} mm",
            "nothing here; turns of the segments by the source",
            "`python scripts/measured_arm.py`",
        ),
        Overview(ROBOT, SOURCE, "MIT", kept, error, numbers, "`python scripts/measured_arm_fit.py`"),
    ]
