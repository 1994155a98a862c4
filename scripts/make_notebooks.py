"""Run the quick starts of the documentation in a kernel of their own, and store what their cells show in the files.

The page with sliders, the cell called `page`, is run and not stored: it is larger than all the rest. Needs the extra `dev`.
"""

from __future__ import annotations

import argparse
import base64
import io
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import write_text

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "notebooks"
NAMES = tuple(sorted(path.stem for path in FOLDER.glob("*.ipynb")))


def smaller(picture: str) -> str:
    """A picture in base64 with 128 colours, a third of its size."""
    written = io.BytesIO()
    Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB").quantize(128).save(written, "PNG", optimize=True)
    return base64.b64encode(written.getvalue()).decode("ascii")


def stored(path: Path) -> str:
    """Run a notebook in an empty folder and return its text with the outputs."""
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": folder}}).execute()
    notebook.metadata = {"kernelspec": notebook.metadata.kernelspec, "language_info": {"name": "python"}}
    for cell in notebook.cells:
        cell.metadata = {key: cell.metadata[key] for key in ("alt",) if key in cell.metadata}
        if cell.id == "page":
            cell.outputs = []
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = smaller(output.data["image/png"])
    return nbformat.writes(notebook) + "\n"


def main(argv: list[str] | None = None) -> int:
    """Run each notebook."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES, help="notebooks to run (all)")
    names = parser.parse_args(argv).only

    def run() -> None:
        for name in names:
            text = stored(FOLDER / f"{name}.ipynb")
            print(f"{write_text(FOLDER / f'{name}.ipynb', text, overwrite=True)}: {len(text) / 1000:.0f} kB")

    return exit_status(run)


if __name__ == "__main__":
    sys.exit(main())
