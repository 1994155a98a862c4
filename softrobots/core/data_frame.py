"""Results as pandas DataFrames."""

from __future__ import annotations

from typing import Any

from softrobots.core.errors import MissingDependency
from softrobots.core.result_file import table_of


def to_dataframe(result: Any) -> Any:
    """Return a result as a `pandas.DataFrame`, with the rows and columns that `save_csv` writes.

    How `Measurements.from_dataframe` reads a table of measurements again stands in its `attrs["columns"]`.

    Args:
        result: The result.

    Raises:
        ParameterError: If it is no table.
        MissingDependency: If pandas is not installed (extra `pandas`).
    """
    columns, reading = table_of(result)
    with MissingDependency.of_imports("pandas", "pandas"):
        from pandas import DataFrame
    frame = DataFrame(dict(columns))
    if reading is not None:
        frame.attrs["columns"] = reading
    return frame
