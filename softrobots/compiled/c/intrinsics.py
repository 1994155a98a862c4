"""Intrinsics of the kernel language as C functions, from `intrinsics.c`."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

NEEDS_WIDE_INTEGERS = ("floor", "sqrt")
"""Those that need <stdint.h>."""


@cache
def c_intrinsics() -> dict[str, str]:
    """Return the text of each static function by its name, with `PREFIX_` before it, in the order of the file."""
    _, *functions = Path(__file__).with_name("intrinsics.c").read_text(encoding="utf-8").strip().split("\n\n")
    return {re.findall(r"PREFIX_(\w+)\(", function)[0]: function for function in functions}
