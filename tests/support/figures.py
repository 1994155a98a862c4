"""What tests ask of every figure."""

from __future__ import annotations

from typing import Any

READABLE = 7.0
"""Height of small print that can still be read on a screen [px]."""


def smallest_text(figure: Any) -> float:
    """Height of the smallest text of a figure that is shown 400 pixels wide, as on a phone or beside a text [px]."""
    from matplotlib.text import Text

    figure.draw_without_rendering()  # places the numbers on the axes
    sizes = [text.get_size() for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    return float(min(sizes)) * 400.0 / (72.0 * figure.get_size_inches()[0])
