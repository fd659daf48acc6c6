"""Transfer of ellipsoids through a fitted adapter, against pyRiemann's powm and products."""

import gc
import sys
import tracemalloc
from collections.abc import Callable, Iterator

import numpy as np
from pyriemann.geometry.base import invsqrtm, powm, sqrtm

import maniport as mp

from .inputs import DAMPING, Array, domains
from .measure import Row, duration, faster, race, within

RECYCLED = 128
"""Bytes of the tuple of arguments that Python makes for a call of compiled code and recycles; an array takes more."""


def rows(quick: bool) -> Iterator[Row]:
    """One ellipsoid in a control loop, a million at once."""
    seconds = 0.3 if quick else 3.0
    adapter = mp.RiemannianICP(damping=DAMPING, random_state=0).fit(*domains(400))
    yield from _control_loop(adapter, seconds)
    yield from _public(adapter, seconds)
    yield _many(adapter, 100_000 if quick else 1_000_000, seconds)


def _peer(adapter: mp.RiemannianICP) -> Callable[[Array], Array]:
    """f(T) = B (W T W)^s Bᵀ with everything that can be computed beforehand computed beforehand."""
    whitening, s = invsqrtm(adapter.teacher_mean_), float(adapter.dispersion_ratio_)
    spread = sqrtm(adapter.student_mean_) @ adapter.rotation_
    spread_t = np.ascontiguousarray(spread.T)
    damping, released = adapter.teacher_damping_ * np.eye(3), adapter.released_damping_ * np.eye(3)
    return lambda points: spread @ powm(whitening @ (points + damping) @ whitening, s) @ spread_t - released


def _single(adapter: mp.RiemannianICP) -> Callable[[Array], Array]:
    """Return the map for control loops, which writes into the same array every time."""
    compiled, out = adapter.compiled(), np.empty((3, 3))
    return lambda point: compiled(point, out)


def _control_loop(adapter: mp.RiemannianICP, seconds: float) -> Iterator[Row]:
    point = domains(400)[0][7]
    ours, peer = _single(adapter), _peer(adapter)
    error = float(np.abs(ours(point) - peer(point)).max())
    times = race(lambda: ours(point), lambda: peer(point), seconds)
    yield faster(
        "transfer of one 3×3 in a control loop",
        times,
        "pyRiemann powm and products",
        15,
        f"largest difference {error:.1g}",
        error < 1e-9,
    )
    yield within("transfer of one 3×3: time per call", times.ours, 1e-6, duration)
    blocks, peak = allocations(lambda: ours(point))
    nothing, array = (allocations(call)[1] for call in (lambda: None, lambda: np.empty((3, 3))))
    yield within(
        "transfer of one 3×3: memory in use during a call, beyond that of calling nothing",
        peak - nothing,
        RECYCLED,
        lambda value: f"{value:.0f} bytes",
        f"a new array would take {array - nothing}; blocks left behind by 1,000 calls: {blocks}",
    )


def _public(adapter: mp.RiemannianICP, seconds: float) -> Iterator[Row]:
    """One ellipsoid by `transform` as anybody calls it, input and image checked."""
    point, peer = domains(400)[0][7], _peer(adapter)
    error = float(np.abs(adapter.transform(point) - peer(point)).max())
    times = race(lambda: adapter.transform(point), lambda: peer(point), seconds)
    note = f"input and output checked by ours alone; largest difference {error:.1g}"
    yield faster("transfer of one 3×3 by transform", times, "pyRiemann powm and products", 0.5, note, error < 1e-9)
    yield within("transfer of one 3×3 by transform: time per call", times.ours, 25e-6, duration)


def _many(adapter: mp.RiemannianICP, n: int, seconds: float) -> Row:
    points = domains(n)[0]
    peer = _peer(adapter)
    error = float(np.abs(adapter.transform(points) - peer(points)).max())
    times = race(lambda: adapter.transform(points), lambda: peer(points), seconds)
    note = f"{duration(times.ours / n)} an ellipsoid, input and output checked by ours; largest difference {error:.1g}"
    return faster(f"transfer of {n:,}", times, "pyRiemann powm and products", 8, note, error < 1e-9)


def allocations(function: Callable[[], object], calls: int = 1000) -> tuple[int, int]:
    """Blocks of memory that calls leave behind, and bytes that are allocated at the same time during one at most."""
    function()
    gc.collect()
    gc.disable()
    try:
        before = sys.getallocatedblocks()
        for _ in range(calls):
            function()
        blocks = sys.getallocatedblocks() - before
        tracemalloc.start()
        function()
        tracemalloc.reset_peak()
        begin = tracemalloc.get_traced_memory()[0]
        for _ in range(calls):
            function()
        peak = tracemalloc.get_traced_memory()[1] - begin
        tracemalloc.stop()
    finally:
        gc.enable()
    return blocks, peak
