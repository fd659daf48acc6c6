"""Transfer of ellipsoids through fitted adapters, against pyRiemann's matrix functions."""

import time
from collections.abc import Callable, Iterator

import numpy as np
from pyriemann.geometry.base import invsqrtm, powm, sqrtm

import maniport as mp
from maniport.spd.kernels.loops import KAPPA
from maniport.util.defaults import STUDENT_SAMPLES, TEACHER_SAMPLES

from .inputs import DAMPING, Array, domains, load
from .measure import Row, compare, duration, faster, within

PEER = "pyRiemann powm and products"


def rows(quick: bool) -> Iterator[Row]:
    """Yield one ellipsoid and a million through ICP, then the length field."""
    seconds, n = (0.3, 100_000) if quick else (3.0, 1_000_000)
    adapter = mp.RiemannianICP(damping=DAMPING).fit(*domains(400))
    peer = _peer(adapter)
    point = domains(400)[0][7]
    many = domains(n)[0]
    for work, function, points, ratio, bound in (
        ("one ellipsoid, transform()", lambda: adapter.transform(point), point, 0.5, 40e-6),
        (
            f"{n:,} ellipsoids, transform()",
            lambda: adapter.transform(many),
            many,
            8.0,
            0.3 * n / 1e6,
        ),
    ):
        error = float(np.abs(function() - peer(points)).max())
        times = compare(function, lambda points=points: peer(points), seconds)
        yield faster(work, times, PEER, ratio, f"largest difference {error:.1g}", error < 1e-9)
        yield within(f"{work}: time", times.ours, bound, duration)
    yield from _length_field(1 if quick else 3, seconds)


def _peer(adapter: mp.RiemannianICP) -> Callable[[Array], Array]:
    """Return f(T) = B (W T W)^s Bᵀ with all constant matrices computed beforehand, and release the damping."""
    whitening = invsqrtm(adapter.teacher_mean_)
    s = float(adapter.dispersion_ratio_)
    spread = sqrtm(adapter.student_mean_) @ adapter.rotation_
    spread_t = np.ascontiguousarray(spread.T)
    damping = adapter.teacher_damping_ * np.eye(3)
    epsilon = adapter.student_damping_

    def transform(points: Array) -> Array:
        mapped = spread @ powm(whitening @ (points + damping) @ whitening, s) @ spread_t
        values, vectors = np.linalg.eigh(mapped)
        gap = values - epsilon
        values = 0.5 * (gap + np.sqrt(gap**2 + 4.0 * KAPPA * epsilon * values))
        return (vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2)

    return transform


def _length_field(fits: int, seconds: float) -> Iterator[Row]:
    teacher = mp.sample_domain(load("rhuman"), TEACHER_SAMPLES, 0)
    student = mp.sample_domain(load("panda"), STUDENT_SAMPLES, 1)
    adapter = mp.LengthField(DAMPING, np.eye(3), mp.FeasibleProjector(load("panda")))
    times = []
    for _ in range(fits):
        begin = time.process_time()
        adapter.fit(teacher, student)
        times.append(time.process_time() - begin)
    yield within("fit of the length field", min(times), 5.0, duration, "processor time")
    times_of_one = compare(lambda: adapter.transform(teacher[7]), lambda: None, seconds)
    work = "one ellipsoid by the length field, transform(): time"
    yield within(work, times_of_one.ours, 200e-6, duration)
