"""Tables of cases within one test."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterable
from typing import Any

import pytest


def each_row(names: str | tuple[str, ...], rows: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Run a test for every row of a table, as one item: for many short cases of one kind, such as input that is refused.

    Takes the arguments of `pytest.mark.parametrize`. Every row is tried; rows that fail are named, with the first one as the
    cause. Each row has a `tmp_path` of its own, and what it does with `monkeypatch` is undone; other fixtures are shared.
    """
    words = re.findall(r"\w+", names) if isinstance(names, str) else list(names)
    cases = [(row,) if len(words) == 1 else tuple(row) for row in rows]

    def one_item(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def whole(**fixtures: Any) -> None:
            failed: list[tuple[tuple[Any, ...], Exception]] = []
            for number, case in enumerate(cases):
                with pytest.MonkeyPatch.context() as patch:
                    own: dict[str, Any] = {"monkeypatch": patch} if "monkeypatch" in fixtures else {}
                    if "tmp_path" in fixtures:
                        own["tmp_path"] = fixtures["tmp_path"] / f"row_{number}"
                        own["tmp_path"].mkdir()
                    try:
                        test(**dict(zip(words, case, strict=True)), **fixtures | own)
                    except Exception as error:
                        failed.append((case, error))
            if failed:
                listed = "\n".join(f"{_shown(case)}: {_shown(error)}" for case, error in failed)
                raise AssertionError(f"{len(failed)} of {len(cases)} rows failed:\n{listed}") from failed[0][1]

        signature = inspect.signature(test)
        kept = [parameter for name, parameter in signature.parameters.items() if name not in words]
        whole.__signature__ = signature.replace(parameters=kept)  # type: ignore[attr-defined]
        del whole.__wrapped__  # pytest would look for the fixtures of the test itself
        return whole

    return one_item


def _shown(thing: object) -> str:
    try:
        text = repr(thing)
    except Exception:  # objects that refuse everything are among the cases
        text = f"<{type(thing).__name__}>"
    return text if len(text) < 300 else f"{text[:300]}..."
