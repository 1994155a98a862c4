"""Run blocks of work in this process or on a Dask cluster, with the same results.

A Dask scheduler gives the blocks of a lost worker to another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pkgutil import resolve_name
from typing import Any, TypeVar

from softrobots.core.errors import ClusterError, MissingDependency, ParameterError, SoftRobotsError
from softrobots.version import __version__

Block = TypeVar("Block")
Answer = TypeVar("Answer")

_PATIENCE = 30  # [s], for a scheduler to answer, and for its first worker


def run_blocks(
    work: Callable[[Block], Answer], blocks: Sequence[Block], *, threads: int = 1, scheduler: str | None = None
) -> Iterator[tuple[int, Answer]]:
    """Apply a function to blocks, in any order.

    Args:
        work: Function of a block; for a cluster, one that pickles.
        blocks: The blocks.
        threads: Threads of this process, without a scheduler.
        scheduler: Address of a Dask scheduler, e.g. "tcp://127.0.0.1:8786"; None: in this process.

    Yields:
        Number of a block and its result, in the order of completion.

    Raises:
        MissingDependency: If a scheduler is given and distributed is not installed.
        ParameterError: If the address of the scheduler is not valid.
        ClusterError: If the scheduler does not answer, has no workers, or gives up a block.
        SoftRobotsError: Errors of `work`.
    """
    if scheduler is not None:
        return _on_cluster(work, blocks, scheduler)
    return _in_threads(work, blocks, threads) if threads > 1 else enumerate(map(work, blocks))


def _in_threads(work: Callable[[Block], Answer], blocks: Sequence[Block], threads: int) -> Iterator[tuple[int, Answer]]:
    pool = ThreadPoolExecutor(threads)
    try:
        numbers = {pool.submit(work, block): number for number, block in enumerate(blocks)}
        for future in as_completed(numbers):
            yield numbers[future], future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _on_cluster(work: Callable[[Block], Answer], blocks: Sequence[Block], address: str) -> Iterator[tuple[int, Answer]]:
    with MissingDependency.of_imports("distributed", "cluster"):
        from distributed import Client
        from distributed import as_completed as as_completed_there
        from distributed.comm.addressing import parse_host_port
    try:
        parse_host_port(address)
    except (AttributeError, TypeError, ValueError) as error:  # a client of such an address takes a minute to close
        raise ParameterError("scheduler", address, "an address with a port, e.g. 'tcp://127.0.0.1:8786'") from error
    client: Any = None
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
        client.wait_for_workers(1, timeout=_PATIENCE)
        _check_versions(client)
        numbers = {client.submit(work, block, pure=False): number for number, block in enumerate(blocks)}
        for future in as_completed_there(numbers, loop=client.loop):
            yield numbers[future], future.result()
    except SoftRobotsError:
        raise
    except Exception as error:  # connections, time-outs, blocks that kill workers, failed imports
        raise ClusterError(f"the Dask scheduler {address} failed: {type(error).__name__}: {error}") from error
    finally:
        if client is not None:
            client.close()


def _check_versions(client: Any) -> None:
    """Require this version of softrobots on all workers; a failed import would make them restart forever.

    Raises:
        ClusterError: If a worker has another version, or none.
    """
    for worker, theirs in client.run(resolve_name, "softrobots:__version__", on_error="return").items():
        if theirs != __version__:
            raise ClusterError(f"the Dask worker {worker} needs softrobots {__version__}; it has {theirs}")
