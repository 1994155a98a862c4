"""Limit of BLAS to one thread for the linear algebra of the statics.

The matrices are small (4 to 300 rows). From about a hundred rows on, BLAS splits them over all cores, which gains nothing and
takes a hundred times as long while another program uses one of the cores (measured: 25 to 130 ms instead of 0.2 ms). It also
rounds differently then, so that results would depend on the number of cores and on what other threads do.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

_LARGE = 48  # rows; BLAS keeps smaller matrices on one thread anyway
_LOCK = threading.Lock()


class _Limit:
    """The limit of the process, shared by all threads that solve: set by the first, lifted by the last."""

    users = 0
    scipy: bool | None = None
    controller: Any = None
    limiter: Any = None


def one_blas_thread(rows: int) -> AbstractContextManager[None]:
    """Keep BLAS on one thread in a `with` block.

    Args:
        rows: Number of rows of the matrices; nothing is done for small ones.
    """
    return nullcontext() if rows < _LARGE else _limited()


@contextmanager
def _limited() -> Iterator[None]:
    with _LOCK:
        if _Limit.users == 0:
            scipy = "scipy.linalg" in sys.modules  # which brings a BLAS of its own
            if _Limit.scipy is not scipy:
                from threadpoolctl import ThreadpoolController

                _Limit.controller, _Limit.scipy = ThreadpoolController(), scipy
            _Limit.limiter = _Limit.controller.limit(limits=1, user_api="blas")
        _Limit.users += 1
    try:
        yield
    finally:
        with _LOCK:
            _Limit.users -= 1
            if _Limit.users == 0:
                _Limit.limiter.restore_original_limits()
