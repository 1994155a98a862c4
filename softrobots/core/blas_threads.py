"""Linear algebra on one thread, wherever an equilibrium is sought or asked about.

The matrices are small (4 to 300 rows). From about a hundred rows on, BLAS splits them over all cores, which gains nothing, and
costs a hundred times the work itself while another program uses one of the cores (measured: 0.2 ms become 25 to 130 ms).
It also rounds differently then: without this, bytes would depend on the cores, and on what other threads do at the time.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

_LARGE = 48  # rows; smaller matrices stay on one thread by themselves
_LOCK = threading.Lock()
_NOTHING = nullcontext()


class _Limit:
    """The one limit of the process, shared by all threads that are solving: set by the first, lifted by the last."""

    users = 0
    controller: Any = None
    limiter: Any = None


def one_blas_thread(rows: int) -> AbstractContextManager[None]:
    """Keep BLAS on one thread in a `with` block.

    Args:
        rows: Size of the matrices; for small ones nothing is done.
    """
    return _NOTHING if rows < _LARGE else _limited()


@contextmanager
def _limited() -> Iterator[None]:
    with _LOCK:
        if _Limit.users == 0:
            if _Limit.controller is None:
                from threadpoolctl import ThreadpoolController

                _Limit.controller = ThreadpoolController()
            _Limit.limiter = _Limit.controller.limit(limits=1, user_api="blas")
        _Limit.users += 1
    try:
        yield
    finally:
        with _LOCK:
            _Limit.users -= 1
            if _Limit.users == 0:
                _Limit.limiter.restore_original_limits()
