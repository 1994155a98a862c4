"""A page inside a cell of a notebook."""

from __future__ import annotations

import html
from dataclasses import dataclass


@dataclass(frozen=True)
class InlinePage:
    """A self-contained page that Jupyter shows where this is the last expression of a cell.

    It is an iframe that holds the whole page: no server, no extension of Jupyter and no network is needed, and it stays in the
    notebook when that is saved.
    """

    page: str
    """HTML text of the page."""
    height: int = 480
    """Height in the notebook [px]; it is as wide as the cell."""

    def _repr_html_(self) -> str:
        """What Jupyter asks for."""
        return (
            f'<iframe title="softrobots" srcdoc="{html.escape(self.page)}" '
            f'style="width:100%;height:{self.height}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        """A line for where no HTML is shown; the page itself is a megabyte."""
        return f"InlinePage({len(self.page)} characters, height={self.height})"
