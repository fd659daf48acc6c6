"""Where the work is done: in this process, in processes, on a Dask cluster, on Ray; one small interface for all."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from concurrent.futures import TimeoutError as NoAnswer
from contextlib import AbstractContextManager, ExitStack, contextmanager
from threading import Thread
from time import monotonic
from typing import Any, Protocol, TypeVar

from joblib.externals.loky import ProcessPoolExecutor

from maniport.errors import ManiportError
from maniport.optional import distributed, ray
from maniport.signals import end_with_parent
from maniport.version import __version__

T = TypeVar("T")
Work = Callable[[Any], Any]

ONE_THREAD = {
    "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1",
}  # fmt: skip
"""For processes that share the cores among them."""

CONNECTING = 10
"""How long one tries to reach a scheduler [s]; twice as long where it takes a connection and says nothing."""

PATIENCE = 60
"""How long one waits for workers of a cluster, which may have to be started [s]."""

ASKED = 5
"""How often one asks whether a cluster still has workers [s]."""

LOST = "the process that worked on it was ended from outside, mostly for want of memory"


class Workers(Protocol):
    """Something that works on tasks."""

    width: int
    """How many at a time."""

    def submit(self, work: Work, task: Any) -> Any:
        """Begin with a task; return what stands for it."""

    def some(self, running: Sequence[Any]) -> Iterable[Any]:
        """Wait until some of them have ended, and return these."""

    def result(self, one: Any) -> Any:
        """What came out, or raise what went wrong."""


def completed(workers: Workers, work: Work, tasks: Iterable[T]) -> Iterator[tuple[T, Any]]:
    """Work on tasks; give each with what came out as it ends, or with the error that ended it."""
    waiting, running, lost = deque(tasks), dict[Any, T](), list[T]()
    while waiting or running or lost:
        alone = not waiting and not running
        while (waiting and len(running) < workers.width) or (lost and not running and not waiting):
            task = waiting.popleft() if waiting else lost.pop()
            running[workers.submit(work, task)] = task
        for one in list(workers.some(list(running))):
            task = running.pop(one)
            try:
                found = workers.result(one)
            except BrokenExecutor:
                if not alone:
                    lost.append(task)
                    continue
                found = ManiportError(LOST)
            except Exception as error:  # noqa: BLE001  one failure does not stop the rest
                found = error
            yield task, found


class InThisProcess:
    """One task after the other, here."""

    width = 1

    def submit(self, work: Work, task: Any) -> Future[Any]:
        """Do it at once."""
        done: Future[Any] = Future()
        try:
            done.set_result(work(task))
        except Exception as error:  # noqa: BLE001  as in a process of its own
            done.set_exception(error)
        return done

    def some(self, running: Sequence[Future[Any]]) -> Iterable[Future[Any]]:
        """All have ended."""
        return running

    def result(self, one: Future[Any]) -> Any:
        """What came out."""
        return one.result()


class Processes:
    """Processes of this computer, as joblib makes them."""

    def __init__(self, width: int):
        self.width = width
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> "Processes":
        return self

    def __exit__(self, *error: Any) -> None:
        if self._pool is not None:
            self._pool.shutdown(kill_workers=True)

    def submit(self, work: Work, task: Any) -> Future[Any]:
        """Hand a task to a process; where one was ended from outside, to a new one."""
        if self._pool is None:
            mine = (os.getpid(),)
            self._pool = ProcessPoolExecutor(self.width, env=ONE_THREAD, initializer=end_with_parent, initargs=mine)
        try:
            begun: Future[Any] = self._pool.submit(work, task)
            return begun
        except BrokenExecutor:
            self._pool = None
            return self.submit(work, task)

    def some(self, running: Sequence[Future[Any]]) -> Iterable[Future[Any]]:
        """Wait until one has ended."""
        return wait(running, return_when=FIRST_COMPLETED).done

    def result(self, one: Future[Any]) -> Any:
        """What came out."""
        return one.result()


class OnDask:
    """Workers of a Dask cluster."""

    def __init__(self, client: Any):
        self._client, self._wait = client, distributed().wait
        self.width = 2 * max(1, sum(client.nthreads().values()))  # the next is there when one ends

    def submit(self, work: Work, task: Any) -> Any:
        """Send a task."""
        return self._client.submit(work, task, pure=False)

    def some(self, running: Sequence[Any]) -> Iterable[Any]:
        """Wait until one has ended; raise `ManiportError` when the scheduler has, or when all workers are gone."""
        last = monotonic()
        try:
            while monotonic() - last <= PATIENCE:
                try:
                    return list(self._wait(running, timeout=ASKED, return_when="FIRST_COMPLETED").done)
                except TimeoutError:
                    last = monotonic() if self._client.nthreads() else last
            raise ManiportError(f"the Dask cluster has had no workers for {PATIENCE} s; start again to go on")
        except (OSError, CancelledError) as error:
            raise ManiportError(f"the Dask scheduler was lost; start again to go on ({error})") from None

    def result(self, one: Any) -> Any:
        """What came out."""
        return one.result()


class OnRay:
    """Workers of a Ray cluster, or of Ray on this computer."""

    def __init__(self, ray: Any):
        self._ray, self._remote = ray, dict[Work, Any]()
        self.width = 2 * max(1, int(ray.cluster_resources().get("CPU", 1)))

    def submit(self, work: Work, task: Any) -> Any:
        """Send a task."""
        if work not in self._remote:
            self._remote[work] = self._ray.remote(num_cpus=1, runtime_env={"env_vars": ONE_THREAD})(work)
        return self._remote[work].remote(task)

    def some(self, running: Sequence[Any]) -> Iterable[Any]:
        """Wait until one has ended."""
        return list(self._ray.wait(list(running), num_returns=1)[0])

    def result(self, one: Any) -> Any:
        """What came out."""
        return self._ray.get(one)


def workers(processes: int, dask: str | None, on_ray: bool) -> AbstractContextManager[Workers]:
    """Workers as they are asked for, until the block ends."""
    if dask is not None:
        return _dask(dask)
    return _ray() if on_ray else _here(processes)


@contextmanager
def _here(count: int) -> Iterator[Workers]:
    with ExitStack() as stack:
        yield InThisProcess() if count == 1 else stack.enter_context(Processes(count))


@contextmanager
def _dask(address: str) -> Iterator[Workers]:
    client = _answering(address)
    with client:
        try:
            there = client.submit(worker_version, pure=False).result(timeout=PATIENCE)
        except Exception as error:  # noqa: BLE001  whatever keeps a worker from it, it would keep it from all tasks
            why = f"within {PATIENCE} s" if isinstance(error, distributed().TimeoutError) else f"well: {error}"
            raise ManiportError(f"no worker of the Dask scheduler at {address!r} answers {why}") from None
        if there != __version__:
            raise ManiportError(f"workers of {address!r} have maniport {there}; here it is {__version__}")
        yield OnDask(client)


def _answering(address: str) -> Any:
    """A client of the scheduler at an address; what takes a connection and says nothing is not waited for."""
    package, found = distributed(), Future[Any]()

    def ask() -> None:
        try:
            found.set_result(package.Client(address, timeout=f"{CONNECTING} s"))
        except Exception as error:  # noqa: BLE001  goes to who waits
            found.set_exception(error)

    Thread(target=ask, daemon=True).start()
    try:
        return found.result(2 * CONNECTING)
    except (OSError, ValueError, TypeError, NoAnswer) as error:
        raise ManiportError(f"no Dask scheduler answers at {address!r}: {str(error) or 'it is silent'}") from None


def worker_version() -> str:
    """The version of maniport that a worker has."""
    return __version__


@contextmanager
def _ray() -> Iterator[Workers]:
    package = ray()
    mine = not package.is_initialized()
    if mine:
        package.init(log_to_driver=False, include_dashboard=False)
    try:
        yield OnRay(package)
    finally:
        if mine:
            package.shutdown()


def cores() -> int:
    """Of this computer, as many as this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
