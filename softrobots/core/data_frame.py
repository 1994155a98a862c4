"""Results as pandas DataFrames."""

from __future__ import annotations

from typing import Any

from softrobots.core.errors import MissingDependency
from softrobots.core.result_file import table_of


def to_dataframe(result: Any) -> Any:
    """Return a result that has rows as a `pandas.DataFrame`, with the columns that `save_csv` writes.

    That is a trajectory, contact path, motion, vibration modes, workspace, measurements, or a batch of a compiled model. Units
    are in the names of the columns or, of a trajectory, those of `save_csv`. How `Measurements.from_dataframe` reads a table of
    measurements again stands in its `attrs["columns"]`.

    Args:
        result: The result.

    Raises:
        ParameterError: If it has no rows.
        MissingDependency: If pandas is not installed (extra `pandas`).
    """
    columns, reading = table_of(result)
    with MissingDependency.of_imports("pandas", "pandas"):
        from pandas import DataFrame
    frame = DataFrame(dict(columns))
    if reading is not None:
        frame.attrs["columns"] = reading
    return frame
