"""GIF of a viewer page, for the README."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import positive_integer, positive_number
from softrobots.core.errors import MissingDependency, ParameterError
from softrobots.core.files import write_bytes
from softrobots.core.progress import with_progress
from studies.shared.browser import open_page, show_share

_FREQUENT = 96  # of 256 colours


def take_animation(
    html: str | Path,
    gif: str | Path,
    *,
    width: int = 720,
    height: int = 400,
    seconds: float = 5.0,
    frames: int = 100,
    progress: bool | str = False,
) -> Path:
    """Write a GIF of the animation of a self-contained viewer page, which repeats.

    Args:
        html: The page.
        gif: File to write; an existing one is replaced.
        width: Width [px].
        height: Height [px].
        seconds: Time of the moving picture [s]; the animation of the page may be faster or slower.
        frames: Number of pictures in it, at least two.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The path of the moving picture.

    Raises:
        ParameterError: If the time is not positive, or there are fewer than two frames.
        ViewerError: If the page is no file or no Chromium is installed.
        OutputError: If the file cannot be written.
        MissingDependency: If Playwright or Pillow is not installed.
    """
    positive_number("seconds", seconds, "s")
    if positive_integer("frames", frames) < 2:
        raise ParameterError("frames", frames, "at least 2")
    try:
        from PIL import Image
    except ImportError as error:
        raise MissingDependency("pillow", "pictures") from error
    with open_page(html, gif, width, height) as (page, target):
        shots = []
        for number in with_progress(range(frames), progress, label="frames", unit="frame"):
            show_share(page, number / frames)
            shots.append(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
    palette = _palette(shots[::4])
    drawn = [shot.quantize(palette=palette, dither=Image.Dither.NONE) for shot in shots]
    options: dict[str, Any] = {"save_all": True, "append_images": drawn[1:], "loop": 0, "optimize": False}
    interval = 1000.0 * seconds / frames
    moving = io.BytesIO()
    drawn[0].save(moving, format="GIF", duration=interval, **options)
    return write_bytes(target, moving.getvalue(), overwrite=True)


def _palette(shots: list[Any]) -> Any:
    """One palette for all frames, or colours would flicker: the most frequent colours, and the others by their variety."""
    from PIL import Image

    pixels = np.concatenate([np.asarray(shot).reshape(-1, 3) for shot in shots])
    shades, counts = np.unique(pixels, axis=0, return_counts=True)
    frequent = shades[np.argsort(-counts, kind="stable")[:_FREQUENT]]
    varied = Image.fromarray(np.unique(shades & 0xFC, axis=0)[None].astype(np.uint8))  # each once: the robot is small
    others = varied.quantize(256 - len(frequent), Image.Quantize.MEDIANCUT).getpalette()
    palette = Image.new("P", (1, 1))
    palette.putpalette([*frequent.ravel().tolist(), *(others or [])])
    return palette
