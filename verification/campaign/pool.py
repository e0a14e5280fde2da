"""Where batches of runs are done: local processes that may die, or a Dask cluster; results as they come."""

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any

from orchestrator.run.processes import interrupts_held, warm_up
from specs.errors import InputError
from verification.campaign.worker import Result, Task, work

ATTEMPTS = 3  # of a run that ends its worker
BATCH = 16  # runs, at most, that a worker does before it reports
SCHEDULER_S = "10s"  # to reach a Dask scheduler
WAITING = 2  # batches for each worker: one that it does, one that waits
Batch = list[Task]
Work = Callable[[Sequence[Task]], list[Result]]


def local(tasks: Sequence[Task], jobs: int, do: Work = work) -> Iterator[list[Result]]:
    """Results in batches, from `jobs` processes.

    When a process dies, the runs that were under way are done again, each alone in a process; one that
    ends it ATTEMPTS times is given up as failed.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    left = _batches(tasks, jobs)
    while left:
        suspects = yield from _until_broken(left, jobs, do)
        for task in suspects:
            yield [_alone(task, do)]


def _until_broken(left: list[Batch], jobs: int, do: Work) -> Generator[list[Result], None, list[Task]]:
    """One pool's life: takes from `left` what it does; returns the runs that were under way when it broke."""
    under_way: dict[Future[list[Result]], Batch] = {}
    pool = _pool(jobs)
    try:
        while left or under_way:
            with interrupts_held():  # processes start with a submit, and inherit it
                while left and len(under_way) < WAITING * jobs:
                    under_way[pool.submit(interruptible, do, left[-1])] = left[-1]
                    left.pop()
            for done in wait(under_way, return_when=FIRST_COMPLETED).done:
                results = done.result()
                del under_way[done]
                yield results
        return []
    except BrokenProcessPool:
        for future in [f for f in under_way if f.done() and not f.cancelled() and f.exception() is None]:
            del under_way[future]
            yield future.result()
        return [task for batch in under_way.values() for task in batch]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _alone(task: Task, do: Work) -> Result:
    for _ in range(ATTEMPTS):
        pool = _pool(1)
        try:
            with interrupts_held():
                future = pool.submit(interruptible, do, [task])
            return future.result()[0]
        except BrokenProcessPool:
            continue
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    return given_up(task)


def _pool(jobs: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(jobs, get_context("spawn"), initializer=warm_up)


def interruptible(do: Work, batch: Batch) -> list[Result]:
    """`do` in a process of the pool, where Ctrl-C may interrupt it."""
    with interrupts_held("SIG_UNBLOCK"):
        return do(batch)


def given_up(task: Task) -> Result:
    """The result of a run that ended its worker each time."""
    reason = f"its worker process ended {ATTEMPTS} times during this run"
    return {
        "key": task["key"],
        "digest": task["digest"],
        "failed": reason,
        "figures": {},
        "missed_limits": [],
        "seconds": 0.0,
    }


def _batches(tasks: Sequence[Task], jobs: int) -> list[Batch]:
    """Batches small enough that all workers have some to the end; runs of one system stay together."""
    size = max(1, min(BATCH, len(tasks) // (8 * jobs)))
    ordered = sorted(tasks, key=lambda t: (t["ssp"], t["key"]))
    batches = [ordered[i : i + size] for i in range(0, len(ordered), size)]
    return batches[::-1]  # taken from the end


def connected(address: str) -> Any:
    """A Dask client; raises InputError when Dask is not installed or nobody answers at the address."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("a Dask scheduler needs Dask: install slewright[campaign]") from None
    try:
        return Client(address, timeout=SCHEDULER_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"no Dask scheduler answers at {address} ({type(error).__name__})") from None


def cluster(tasks: Sequence[Task], address: str, do: Work = work) -> Iterator[list[Result]]:
    """The same through the Dask scheduler at `address`; its workers see the same files.

    Raises InputError as `connected` does.
    """
    client = connected(address)
    from distributed import as_completed

    with client:
        workers = max(1, len(client.scheduler_info()["workers"]))
        batches = {
            client.submit(do, batch, pure=False): batch for batch in reversed(_batches(tasks, workers))
        }
        suspects: list[Task] = []  # Dask blames all that waited on a worker that ended, so each is done again
        for future in as_completed(list(batches)):
            if future.status == "finished":
                yield future.result()
            else:
                suspects += batches[future]
            future.release()
        for task in suspects:  # one after the other: now the one that ends its workers is alone
            future = client.submit(do, [task], pure=False)
            yield [given_up(task)] if future.exception() else future.result()
