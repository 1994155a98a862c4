"""A page inside a cell of a notebook."""

from __future__ import annotations

import html
from dataclasses import dataclass


@dataclass(frozen=True)
class InlinePage:
    """A self-contained page that Jupyter shows if it is the last expression of a cell.

    It is an iframe that holds the whole page: it needs no server, Jupyter extension or network, and is saved with the
    notebook.
    """

    page: str
    """HTML text of the page."""
    height: int = 480
    """Height in the notebook [px]; it is as wide as the cell."""

    def _repr_html_(self) -> str:
        """Return the iframe for Jupyter."""
        return (
            f'<iframe title="softrobots" srcdoc="{html.escape(self.page)}" '
            f'style="width:100%;height:{self.height}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        """Return a short text for consoles; the page itself is a megabyte."""
        return f"InlinePage({len(self.page)} characters, height={self.height})"
