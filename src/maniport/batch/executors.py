"""Where tasks run: in this process, in processes of this computer, on a Dask cluster, or on Ray; all return futures.

joblib's backends are not used: of a Dask worker that dies, its backend never reports the task, and waits for ever.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import islice
from time import monotonic
from typing import Any, TypeVar

from joblib.externals.loky import ProcessPoolExecutor

from maniport.errors import ManiportError
from maniport.util.optional import distributed, ray
from maniport.util.process import end_with_parent, in_background, settled

T = TypeVar("T")
Work = Callable[[Any], Any]

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
"""Environment of processes that share the cores among them."""


@dataclass(frozen=True)
class Executor:
    """Something that runs tasks."""

    submit: Callable[[Work, Any], "Future[Any]"]
    width: int  # Tasks that are submitted at a time
    check: Callable[[], None] = lambda: None  # raises `ManiportError` when no task will ever end


def completed(
    executor: Executor, work: Work, tasks: Iterable[T], period: float = 5.0
) -> Iterator[tuple[T, Any]]:
    """Run tasks; yield each, as it ends, with its result or with the error that ended it.

    When a process is killed, all tasks under way may be lost. Each of them is run once more, alone, after the others.
    """
    lost = list[T]()
    for task, outcome in _ended(executor, work, tasks, executor.width, period):
        if isinstance(outcome, BrokenExecutor):
            lost.append(task)
        else:
            yield task, outcome
    for task, outcome in _ended(executor, work, lost, 1, period):
        killed = isinstance(outcome, BrokenExecutor)
        yield (
            task,
            ManiportError("worker process killed, probably out of memory") if killed else outcome,
        )


def _ended(
    executor: Executor, work: Work, tasks: Iterable[T], width: int, period: float
) -> Iterator[tuple[T, Any]]:
    """Run at most `width` tasks at a time; yield each with its result or error."""
    waiting, running = iter(tasks), dict[Future[Any], T]()
    while True:
        running |= {
            executor.submit(work, task): task for task in islice(waiting, width - len(running))
        }
        if not running:
            return
        if not (done := wait(running, period, FIRST_COMPLETED).done):
            executor.check()
        for future in done:
            if future.cancelled():
                raise ManiportError("the cluster was lost; run again to continue")
            yield running.pop(future), future.exception() or future.result()


def executor_for(
    processes: int, dask: str | None, on_ray: bool
) -> AbstractContextManager[Executor]:
    """Return a context with the executor that was chosen."""
    if dask is not None:
        return _dask(dask)
    if on_ray:
        return _ray()
    if processes > 1:
        return _processes(processes)
    return nullcontext(Executor(lambda work, task: settled(Future(), work, task), 1))


@contextmanager
def _processes(width: int) -> Iterator[Executor]:
    """Run pairs in local processes; if one is killed, restart all."""

    def start() -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            width, env=ONE_THREAD, initializer=end_with_parent, initargs=(os.getpid(),)
        )

    pool = start()

    def submit(work: Work, task: Any) -> "Future[Any]":
        nonlocal pool
        try:
            submitted: Future[Any] = pool.submit(work, task)
        except BrokenExecutor:
            pool = start()
            submitted = pool.submit(work, task)
        return submitted

    try:
        yield Executor(submit, width)
    finally:
        pool.shutdown(kill_workers=True)


@contextmanager
def _dask(address: str, timeout: float = 10.0) -> Iterator[Executor]:
    """Workers of a Dask cluster; an address that takes a connection and is silent is given up after 2 timeouts."""
    connect = partial(distributed().Client, address, timeout=f"{timeout} s")
    try:
        connected = in_background(connect).result(2 * timeout)
    except (OSError, ValueError, TypeError) as error:  # `TimeoutError` is an `OSError`
        raise ManiportError(
            f"cannot connect to the Dask scheduler at {address!r}: {str(error) or 'timeout'}"
        ) from None
    with connected as client:
        yield dask_executor(client)


def dask_executor(client: Any, patience: float = 60.0) -> Executor:
    """Return an executor on a client's cluster, which may be without workers for `patience` [s].

    Two tasks a thread: the next is there when one ends.
    """
    last_seen = monotonic()

    def check() -> None:
        nonlocal last_seen
        last_seen = monotonic() if client.nthreads() else last_seen
        if monotonic() - last_seen > patience:
            raise ManiportError(
                f"the Dask cluster has had no workers for {patience:g} s; run again to continue"
            )

    return Executor(
        client.get_executor(pure=False).submit, 2 * max(1, sum(client.nthreads().values())), check
    )


@contextmanager
def _ray() -> Iterator[Executor]:
    """Workers of a Ray cluster, or of Ray on this computer."""
    package = ray()
    started = not package.is_initialized()
    if started:
        package.init(log_to_driver=False, include_dashboard=False)
    remote = package.remote(num_cpus=1, runtime_env={"env_vars": ONE_THREAD})(
        lambda work, task: work(task)
    )
    try:
        width = 2 * max(1, int(package.cluster_resources().get("CPU", 1)))
        yield Executor(lambda work, task: remote.remote(work, task).future(), width)
    finally:
        if started:
            package.shutdown()
