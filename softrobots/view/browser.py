"""Chromium without a window: pictures of viewer pages, for documentation and tests."""

from __future__ import annotations

import contextlib
import io
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import positive_integer, positive_number
from softrobots.core.errors import MissingDependency, ParameterError, ViewerError
from softrobots.core.files import as_path, new_file, write_bytes
from softrobots.core.progress import with_progress

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_FREQUENT = 96  # of 256 colours of a moving picture
_OPTIONS = (
    "--no-sandbox",  # needed as root; only pages of this project are opened
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)


def find_chromium() -> str:
    """Path of an installed Chromium.

    Raises:
        ViewerError: If there is none.
    """
    for name in _NAMES:
        path = shutil.which(name)
        if path:
            return path
    raise ViewerError(f"no browser found (looked for {', '.join(_NAMES)}); on Debian: apt-get install chromium")


@contextlib.contextmanager
def open_browser() -> Iterator[Any]:
    """Run a headless Chromium with software WebGL; yields a Playwright `Browser`.

    Raises:
        ViewerError: If no Chromium is installed.
        MissingDependency: If Playwright is not installed.
    """
    path = find_chromium()
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise MissingDependency("playwright", "pictures") from error
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(_OPTIONS))
        try:
            yield browser
        finally:
            browser.close()


def take_picture(html: str | Path, png: str | Path, *, width: int = 1000, height: int = 640, share: float = 0.0) -> Path:
    """Take a picture of a self-contained viewer page.

    Args:
        html: The page.
        png: File to write; an existing one is replaced.
        width: Width [px].
        height: Height [px].
        share: Where the animation of the page is stopped, from 0 (start) to 1 (end).

    Returns:
        The path of the picture.

    Raises:
        ViewerError: If the page is no file or no Chromium is installed.
        OutputError: If the picture cannot be written.
        MissingDependency: If Playwright is not installed.
    """
    with _photographed(html, png, width, height) as (page, target):
        show_share(page, share)
        shot = page.screenshot()
    return write_bytes(target, shot, overwrite=True)


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
    """Take a moving picture of a self-contained viewer page: its animation once, then again from the start.

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
    with _photographed(html, gif, width, height) as (page, target):
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


@contextlib.contextmanager
def _photographed(html: str | Path, picture: str | Path, width: int, height: int) -> Iterator[tuple[Any, Path]]:
    """A page in a window of a size [px], without what is there to be clicked, and the file of its picture."""
    page_file = as_path("html", html)
    if not page_file.is_file():
        raise ViewerError(f"{page_file} is no file; a page written by Viewer.write_html is required")
    target = new_file(picture, overwrite=True)
    with open_browser() as browser:
        page = browser.new_page(viewport={"width": width, "height": height})
        page.goto(page_file.resolve().as_uri())
        page.add_style_tag(content="#softrobots-hint, .dg { display: none !important; }")
        yield page, target


def show_share(page: Any, share: float) -> None:
    """Wait until a viewer page has drawn its scene, and stop its animation at a share of its time, from 0 to 1."""
    page.wait_for_function(_SETTLED)
    page.evaluate("share => { viewer.animator.pause(); viewer.animator.seek(share * viewer.animator.duration); }", share)
    page.evaluate(_TWO_FRAMES)


# A page in a file is there when it names its viewer. The commands of a server arrive one after the other: settled is when no
# object has been added for ten looks, 50 ms apart.
_SETTLED = """async () => {
  while (!window.viewer) await new Promise(done => setTimeout(done, 20));
  if (document.getElementById('softrobots-scene')) return true;
  const count = () => { let n = 0; viewer.scene.traverse(() => n++); return n; };
  const robot = () => viewer.scene_tree.find(['meshcat', 'softrobots', 'deformed']).object.children.length;
  for (let last = -1, same = 0; same < 10; last = count()) {
    await new Promise(done => setTimeout(done, 50));
    same = count() === last && robot() > 0 ? same + 1 : 0;
  }
  return true;
}"""
_TWO_FRAMES = """() => new Promise(done => {
  viewer.set_dirty();
  requestAnimationFrame(() => { viewer.render(); requestAnimationFrame(() => done(true)); });
})"""
