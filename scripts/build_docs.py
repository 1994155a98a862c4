"""Build the documentation site: guides, notebook, API reference, changelog, with search, without requests to the network.

Every warning is an error: a broken link, an equation that cannot be converted, a page outside the navigation, a failing cell.
Needs the extra `docs`.
"""

from __future__ import annotations

import argparse
import functools
import http.server
import logging
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder
from softrobots.view.served_page import LOOPBACK, tunnel_to
from studies.shared.command_line import serve
from studies.shared.folders import free_folder

CHECKOUT = Path(__file__).resolve().parent.parent
MARK = ".softrobots-site"
"""A file in every site that was built here: its folder may be replaced."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    folder = CHECKOUT / "output" / "site"
    help_text = "folder of the site: new, empty, or with an older site that is replaced (output/site of the checkout)"
    result.add_argument("--output", type=Path, default=folder, metavar="FOLDER", help=help_text)
    result.add_argument("--no-notebook", action="store_true", help="show the notebook without running it")
    result.add_argument("--serve", action="store_true", help="then serve the site on 127.0.0.1 until Ctrl-C")
    result.add_argument("--port", type=int, default=0, help="port of --serve (%(default)s: a free one)")
    return result


class ServedFolder:
    """A folder served on loopback."""

    def __init__(self, folder: Path, port: int) -> None:
        """Open the port."""
        quiet = type("Quiet", (http.server.SimpleHTTPRequestHandler,), {"log_message": lambda *_: None})
        handler = functools.partial(quiet, directory=str(folder))
        try:
            self._server = http.server.ThreadingHTTPServer((LOOPBACK, port), handler)
        except (OSError, OverflowError) as error:
            raise sr.ViewerError(f"cannot serve on port {port}: {error}") from error

    @property
    def url(self) -> str:
        """Its address."""
        return f"http://{LOOPBACK}:{self._server.server_port}/"

    @property
    def tunnel(self) -> str:
        """The command that forwards the port to another machine."""
        return tunnel_to(self._server.server_port)

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        try:
            self._server.serve_forever()
        except KeyboardInterrupt:
            pass
        finally:
            self._server.server_close()


def build(folder: Path, *, execute: bool) -> Path:
    """Build the site strictly.

    Args:
        folder: Where it goes.
        execute: Whether the notebook is run.

    Returns:
        The start page.

    Raises:
        MissingDependency: If the extra `docs` is not installed.
        OutputExists: If the folder holds anything but a site of this script.
        OutputError: If the build has a warning or an error, which is logged.
    """
    folder = folder.resolve()
    if not (folder / MARK).is_file():
        free_folder(folder)
    os.environ["NO_MKDOCS_2_WARNING"] = "1"  # the theme's notice about other products
    os.environ["SOFTROBOTS_DOCS_EXECUTE"] = str(execute).lower()
    try:
        import latex2mathml.converter  # noqa: F401
        import material  # noqa: F401
        import mkdocs_jupyter  # noqa: F401
        import mkdocstrings_handlers.python  # noqa: F401
        from mkdocs.commands.build import build as build_site
        from mkdocs.config import load_config
        from mkdocs.exceptions import BuildError, ConfigurationError
        from nbclient.exceptions import CellExecutionError
    except ImportError as error:
        raise sr.MissingDependency(f"{error.name}", "docs") from error
    make_folder(folder.parent)
    logging.basicConfig(format="%(levelname)s: %(message)s", level=logging.WARNING, stream=sys.stderr)
    logging.getLogger("mkdocs").setLevel(logging.INFO)
    logging.getLogger("traitlets").setLevel(logging.ERROR)  # of the notebook: a cell that fails is an error anyway
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".site-") as scratch:
        os.environ["IPYTHONDIR"] = str(_quiet_kernel(Path(scratch) / "ipython"))
        site = Path(scratch) / "site"
        try:
            config: Any = load_config(str(CHECKOUT / "docs" / "site" / "mkdocs.yml"), strict=True, site_dir=str(site))
            config.plugins.on_startup(command="build", dirty=False)
            build_site(config)
            config.plugins.on_shutdown()
        except (BuildError, CellExecutionError, ConfigurationError, SystemExit) as error:
            raise sr.OutputError(f"the documentation cannot be built: {error}") from error
        (site / MARK).touch()
        shutil.rmtree(folder, ignore_errors=True)  # whole or not at all
        site.rename(folder)
    return folder / "index.html"


def _quiet_kernel(folder: Path) -> Path:
    """Settings of a notebook kernel that logs errors only, not that it listens on loopback."""
    profile = make_folder(folder / "profile_default")
    (profile / "ipython_kernel_config.py").write_text("get_config().IPKernelApp.log_level = 40\n", encoding="utf-8")
    return folder


def run(arguments: argparse.Namespace) -> None:
    """Build, print where, and serve with --serve."""
    page = build(arguments.output, execute=not arguments.no_notebook)
    print(f"written to {page.parent}: open {page.name}")
    if arguments.serve:
        serve(ServedFolder(page.parent, arguments.port))


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input and faults of the documentation end with status 2."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
