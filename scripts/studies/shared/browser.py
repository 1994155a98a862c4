"""Headless Chromium: pictures of viewer pages."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from softrobots.core.errors import MissingDependency, ViewerError
from softrobots.core.files import as_path, new_file, write_bytes

_NAMES = ("chromium", "chromium-browser", "google-chrome")
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
    with MissingDependency.of_imports("playwright", "pictures"):
        from playwright.sync_api import sync_playwright
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(_OPTIONS))
        try:
            yield browser
        finally:
            browser.close()


def take_picture(
    html: str | Path,
    png: str | Path,
    *,
    width: int = 1000,
    height: int = 640,
    scale: float = 1.0,
    aside: float = 0.0,
    share: float = 0.0,
) -> Path:
    """Write a picture of a self-contained viewer page.

    Args:
        html: The page.
        png: File to write; an existing one is replaced.
        width: Width [px].
        height: Height [px].
        scale: Pixels of the picture for each of them; in a narrower window with a larger scale text is larger.
        aside: Share of the width by which the robot of a viewer page is moved to the right, off its legend [-].
        share: Share of the animation at which it is stopped, from 0 (start) to 1 (end) [-].

    Returns:
        The path of the picture.

    Raises:
        ViewerError: If the page is no file or no Chromium is installed.
        OutputError: If the picture cannot be written.
        MissingDependency: If Playwright is not installed.
    """
    with open_page(html, png, width, height, scale) as (page, target):
        if aside:
            page.wait_for_function("() => window.viewer")
            page.evaluate(_ASIDE, aside)
        show_share(page, share)
        shot = page.screenshot()
    return write_bytes(target, shot, overwrite=True)


@contextlib.contextmanager
def open_page(html: str | Path, picture: str | Path, width: int, height: int, scale: float = 1.0) -> Iterator[tuple[Any, Path]]:
    """Open a page in a window of a size [px] with its controls hidden; arguments and errors are those of `take_picture`.

    Yields:
        The Playwright `Page`, and the path of the picture.
    """
    page_file = as_path("html", html)
    if not page_file.is_file():
        raise ViewerError(f"{page_file} is no file; a page written by Viewer.write_html is required")
    target = new_file(picture, overwrite=True)
    with open_browser() as browser:
        page = browser.new_page(viewport={"width": width, "height": height}, device_scale_factor=scale)
        page.goto(page_file.resolve().as_uri())
        page.add_style_tag(content="#softrobots-hint, #hint, #toggle, .dg { display: none !important; }")
        yield page, target


def show_share(page: Any, share: float) -> None:
    """Wait until a viewer page has drawn its scene, and stop its animation at a share of its duration, from 0 to 1."""
    if page.evaluate("Boolean(window.softrobots)"):  # a page that solves by itself
        page.evaluate("softrobots.ready.then(() => true)")
        page.evaluate(_FRAMES)
        return
    page.wait_for_function(_SETTLED)
    page.evaluate("share => { viewer.animator.pause(); viewer.animator.seek(share * viewer.animator.duration); }", share)
    page.evaluate(_TWO_FRAMES)


# A page in a file is complete when it defines `viewer`. On a served page objects arrive one after the other: it is complete
# when ten checks, 50 ms apart, find no new object.
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
_ASIDE = "share => viewer.camera.setViewOffset(innerWidth, innerHeight, -share * innerWidth, 0, innerWidth, innerHeight)"
_FRAMES = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"
_TWO_FRAMES = """() => new Promise(done => {
  viewer.set_dirty();
  requestAnimationFrame(() => { viewer.render(); requestAnimationFrame(() => done(true)); });
})"""
