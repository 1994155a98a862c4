"""Base class of pages that can be kept: written to a file, or shown in a notebook."""

from __future__ import annotations

import abc
from pathlib import Path

from softrobots.core.checks import positive_integer
from softrobots.core.files import new_file, write_text
from softrobots.view.meshcat_page.page_text import InlinePage
from softrobots.view.served_page import ServedPage


class WrittenPage(ServedPage):
    """A served page that is also one self-contained HTML text."""

    @abc.abstractmethod
    def html(self, title: str = "softrobots") -> str:
        """Return the page as one self-contained HTML text."""

    def write_html(self, path: str | Path, *, title: str = "softrobots", overwrite: bool = False) -> Path:
        """Write `html` to a file.

        Args:
            path: The file.
            title: Title of the page.
            overwrite: Replace an existing file.

        Returns:
            The path.

        Raises:
            OutputExists: If the file exists and `overwrite` is false.
        """
        new_file(path, overwrite=overwrite)  # refused before the work
        return write_text(path, self.html(title), overwrite=overwrite)

    def inline(self, height: int = 480, *, title: str = "softrobots") -> InlinePage:
        """Return the page as it is now for a cell of a notebook, where it remains when the viewer is closed.

        Args:
            height: Height in the notebook [px].
            title: Title of the page.

        Raises:
            ParameterError: If the height is no positive integer, at most 10000.
            ViewerError: If the viewer is closed.
        """
        return InlinePage(self.html(title), positive_integer("height", height, 10_000))

    def _repr_html_(self) -> str:
        """Return the page for Jupyter; see `inline`."""
        return self.inline()._repr_html_()
