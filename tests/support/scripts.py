"""Run the scripts of the checkout in this process."""

from __future__ import annotations

from tests.conftest import load_script


def run_script(name: str, arguments: list[str]) -> int:
    """Import a script as a module and call its main."""
    return load_script(name).main(arguments)
