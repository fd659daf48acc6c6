"""Where tasks run: in this process, in processes of this computer, on a Dask cluster, or on Ray; all return futures.

Each engine's own `submit` is used. joblib has back ends for Dask and Ray, but they would lose what a batch needs: of a
Dask worker that dies, joblib's back end never reports the task, and waits for ever; neither tells how many workers
there are as they join and leave, nor that a cluster is gone.
"""

import asyncio
import logging
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import TYPE_CHECKING, Protocol, TypeVar

from joblib.externals.loky import ProcessPoolExecutor

from maniport.errors import ManiportError
from maniport.util.optional import distributed, ray
from maniport.util.process import end_with_parent, in_background, settled

if TYPE_CHECKING:
    from distributed import Client

T = TypeVar("T")
R = TypeVar("R")

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
"""Environment of processes that share the cores among them."""

PATIENCE = 60.0
"""Time that a cluster may be without workers, or its scheduler without an answer [s]. A new scheduler
process starts in a few seconds, a new worker in less than a minute."""
SHOWN_AFTER = 30.0
"""Time after which a file that a worker wrote is visible here at the latest [s]: clients of NFS keep the content
of a folder for 30 s by default."""
TASKS_PER_THREAD = 2
"""Tasks of a cluster per thread of its workers: the next task is there when one ends."""


class ClusterLostError(ManiportError):
    """No task will ever end, because the cluster is gone."""


class Submit(Protocol):
    """Run a function on an argument, somewhere."""

    def __call__(self, work: Callable[[T], R], task: T, /) -> "Future[R]":
        """Return a future of the result."""


@dataclass(frozen=True)
class Executor:
    """Something that runs tasks.

    Attributes
    ----------
    submit : Submit
    width : callable
        Returns how many tasks are submitted at a time, which changes as workers join and leave.
    check : callable
        Called between two waits; it raises `ClusterLostError` when no task will ever end.
    shown_after : float
        Time after which files of workers on other computers are visible here at the latest [s].
    """

    submit: Submit
    width: Callable[[], int]
    check: Callable[[], None] = lambda: None
    shown_after: float = 0.0

    @property
    def is_cluster(self) -> bool:
        """Whether workers may be on other computers."""
        return self.shown_after > 0.0


def completed(
    executor: Executor, work: Callable[[T], R], tasks: Iterable[T], period: float = 1.0
) -> Iterator[tuple[T, R | Exception]]:
    """Run tasks; yield each, as it ends, with its result or with the error that ended it.

    When a process is killed, all tasks under way may be lost. Each of them is run once more, alone, after the others.
    """
    lost = list[T]()
    for task, outcome in _ended(executor, work, tasks, executor.width, period):
        if isinstance(outcome, BrokenExecutor):
            lost.append(task)
        else:
            yield task, outcome
    for task, outcome in _ended(executor, work, lost, lambda: 1, period):
        if isinstance(outcome, BrokenExecutor):
            yield task, ManiportError("worker process killed, probably out of memory")
        else:
            yield task, outcome


def _ended(
    executor: Executor,
    work: Callable[[T], R],
    tasks: Iterable[T],
    width: Callable[[], int],
    period: float,
) -> Iterator[tuple[T, R | Exception]]:
    """Run at most `width` tasks at a time; yield each with its result or error.

    Every `period` [s] the executor is checked, and more tasks are submitted if the width has grown.
    """
    waiting = deque(tasks)
    running = dict[Future[R], T]()
    while waiting or running:
        free = width() - len(running)
        while waiting and free > 0:
            task = waiting.popleft()
            running[executor.submit(work, task)] = task
            free -= 1
        done = wait(running, period, FIRST_COMPLETED).done
        executor.check()
        for future in done:
            outcome = _outcome(future)
            yield running.pop(future), outcome


def _outcome(future: "Future[R]") -> R | Exception:
    """Return the result or the error of a future that is done; one that was cancelled lost its cluster."""
    if future.cancelled():
        raise ClusterLostError("the cluster was lost")
    error = future.exception()
    if isinstance(error, CancelledError | asyncio.CancelledError):
        raise ClusterLostError("the cluster was lost")
    if isinstance(error, Exception):
        return error
    return future.result()


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
    return nullcontext(Executor(_here, lambda: 1))


def _here(work: Callable[[T], R], task: T) -> "Future[R]":
    """Run a task in this process, at once."""
    return settled(Future(), work, task)


@contextmanager
def _processes(width: int) -> Iterator[Executor]:
    """Run pairs in local processes; if one is killed, restart all."""

    def start() -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            width, env=ONE_THREAD, initializer=end_with_parent, initargs=(os.getpid(),)
        )

    pool = start()

    def submit(work: Callable[[T], R], task: T) -> "Future[R]":
        nonlocal pool
        try:
            submitted: Future[R] = pool.submit(work, task)
        except BrokenExecutor:
            pool = start()
            submitted = pool.submit(work, task)
        return submitted

    try:
        yield Executor(submit, lambda: width)
    finally:
        pool.shutdown(kill_workers=True)


@contextmanager
def _dask(address: str, timeout: float = 10.0) -> Iterator[Executor]:
    """Workers of a Dask cluster; an address that takes a connection and is silent is given up after 2 timeouts."""
    connect = partial(distributed().Client, address, timeout=f"{timeout} s")
    with _without_logs("distributed"):
        try:
            client = in_background(connect).result(2 * timeout)
        except (OSError, ValueError, TypeError) as error:  # `TimeoutError` is an `OSError`
            raise ManiportError(
                f"cannot connect to the Dask scheduler at {address!r}: {str(error) or 'timeout'}"
            ) from None
        try:
            yield dask_executor(client)
        finally:
            with suppress(Exception):  # a lost scheduler does not answer
                in_background(client.close).result(timeout)


@contextmanager
def _without_logs(package: str) -> Iterator[None]:
    """Keep a package from logging: when its connection breaks off, it logs tracebacks."""
    prefix = package + "."
    loggers = [logging.getLogger(package)]
    for name in list(logging.root.manager.loggerDict):
        if name.startswith(prefix):
            loggers.append(logging.getLogger(name))
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def dask_executor(client: "Client", patience: float = PATIENCE) -> Executor:
    """Return an executor on a client's cluster.

    The cluster is lost when it is without workers, or its scheduler without an answer, for `patience` [s].
    """

    def count_threads() -> int:
        return sum(client.nthreads().values())

    threads = _Threads("Dask", count_threads, patience)
    return Executor(
        client.get_executor(pure=False).submit, threads.width, threads.check, SHOWN_AFTER
    )


class _Threads:
    """The number of threads of a cluster, which its scheduler is asked for in the background."""

    def __init__(self, cluster: str, count: Callable[[], int], patience: float):
        self._cluster = cluster
        self._count_threads = count
        self._patience = patience
        self._count = 0
        self._answered = monotonic()
        self._with_workers = monotonic()
        self._answer = in_background(count)
        with suppress(TimeoutError):  # usually there within milliseconds
            self._answer.exception(1.0)

    def width(self) -> int:
        """Return the number of tasks to submit; two at least, so that a cluster may start without workers."""
        self._update()
        return TASKS_PER_THREAD * max(1, self._count)

    def check(self) -> None:
        """Raise `ClusterLostError` if the cluster has been without workers or an answer for too long."""
        self._update()
        now = monotonic()
        if not self._count and now - self._with_workers > self._patience:
            raise ClusterLostError(
                f"the {self._cluster} cluster has had no workers for {self._patience:g} s"
            )
        if now - self._answered > self._patience:
            raise ClusterLostError(
                f"the {self._cluster} scheduler was lost, it has not answered for {self._patience:g} s"
            )

    def _update(self) -> None:
        """Take the answer to the last question, if it is there, and ask again."""
        if not self._answer.done():
            return
        if self._answer.exception() is None:
            self._count = self._answer.result()
            self._answered = monotonic()
        if self._count:
            self._with_workers = monotonic()
        self._answer = in_background(self._count_threads)


@contextmanager
def _ray(patience: float = 0.5 * PATIENCE, timeout: float = 10.0) -> Iterator[Executor]:
    """Workers of a Ray cluster, or of Ray on this computer.

    Ray ends this process when its head has been lost for 60 s; the patience is shorter.
    """
    package = ray()
    started = not package.is_initialized()
    if started:
        package.init(log_to_driver=False, include_dashboard=False)
    remote = package.remote(num_cpus=1, runtime_env={"env_vars": ONE_THREAD})(
        lambda work, task: work(task)
    )

    def count_processors() -> int:
        return int(package.cluster_resources().get("CPU", 0))

    def submit(work: Callable[[T], R], task: T) -> "Future[R]":
        future: Future[R] = remote.remote(work, task).future()
        return future

    threads = _Threads("Ray", count_processors, patience)
    try:
        yield Executor(submit, threads.width, threads.check, SHOWN_AFTER)
    finally:
        if started:
            with suppress(Exception):  # a lost cluster does not answer
                in_background(package.shutdown).result(timeout)
