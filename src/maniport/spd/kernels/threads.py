"""Sharing a large batch among threads."""

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from numba import config

from maniport.spd.kernels.loops import WIDTH

Result = TypeVar("Result")

PART_WORK = 65_000
"""Size of a part in d³ operations, some 0.1 ms: small enough to balance, large enough that calling it is nothing."""
PARTS_PER_THREAD = 4
"""A thread joins in for no less than this many parts, for waking it costs half of one."""

_pool: ThreadPoolExecutor | None = None


def in_parts(work: Callable[[int, int], Result], count: int, d: int) -> list[Result]:
    """Call work(first, last) on parts of a batch of `count` d×d matrices, by several threads where that pays."""
    size = WIDTH * max(1, PART_WORK // (WIDTH * d**3))
    if count <= size:
        return [work(0, count)] if count else []
    starts = range(0, count, size)
    waiting = deque(enumerate(starts))
    results: list[tuple[int, Result]] = []

    def take() -> None:
        while True:
            try:
                index, first = waiting.popleft()
            except IndexError:
                return
            results.append((index, work(first, min(first + size, count))))

    threads = min(int(config.NUMBA_NUM_THREADS), len(starts) // PARTS_PER_THREAD)
    helpers = [_threads().submit(take) for _ in range(threads - 1)]
    take()
    for helper in helpers:
        if not helper.cancel():  # one that never got its turn is not waited for
            helper.result()
    return [result for _, result in sorted(results, key=lambda pair: pair[0])]


def _threads() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(max(1, int(config.NUMBA_NUM_THREADS) - 1), thread_name_prefix="maniport")
    return _pool


def _forget() -> None:
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):  # the threads of a process do not live on in its fork
    os.register_at_fork(after_in_child=_forget)
