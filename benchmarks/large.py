"""Fits of large matrices: 12×12, the largest that are taken."""

import time
import warnings
from collections.abc import Iterator
from typing import Any

import maniport as mp
from maniport.errors import IdentifiabilityWarning

from .inputs import spd_matrices
from .measure import Row, duration, within

D, SPREAD = 12, 0.3
WANTED = {"parallel-transport": 2.0, "icp": 20.0}  # s


def rows(quick: bool) -> Iterator[Row]:
    """One fit of each method; domains whose logarithms are Gaussian."""
    n = 100 if quick else 1_000
    teacher, student = (spd_matrices(n, D, seed, SPREAD) for seed in (0, 1))
    methods: dict[str, Any] = {
        "parallel-transport": mp.ParallelTransport(),
        "icp": mp.RiemannianICP(random_state=0),
    }
    warnings.simplefilter("ignore", IdentifiabilityWarning)  # it is not examined in this size
    for name, adapter in methods.items():
        adapter.fit(*(spd_matrices(20, D, seed, SPREAD) for seed in (2, 3)))  # compiles what is compiled
        begin = time.perf_counter()
        adapter.fit(teacher, student)
        seconds = time.perf_counter() - begin
        note = f"{adapter.n_iter_} iterations; {adapter.stop_reason_}"
        yield within(f"fit of {n:,} and {n:,} {D}×{D} by {name}", seconds, WANTED[name], duration, note)
