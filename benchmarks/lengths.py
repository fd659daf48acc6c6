"""The field of lengths: its fit, one ellipsoid in a control loop, a million at once."""

import time
from collections.abc import Callable, Iterator

import numpy as np

import maniport as mp
from maniport.util.defaults import STUDENT_SAMPLES, TEACHER_SAMPLES

from .inputs import DAMPING, Array, load
from .measure import Row, duration, race, within

FIT, MILLION = 5.0, 1.0  # s
ONE = {"lengths alone": 3e-6, "lengths and turns": 6e-6}  # s
FITS = 3


def rows(quick: bool) -> Iterator[Row]:
    """Fits to what the Panda can make, then the fitted maps."""
    teacher = mp.sample_domain(load("rhuman"), TEACHER_SAMPLES, 0)
    student = mp.sample_domain(load("panda"), STUDENT_SAMPLES, 1)
    projector, seconds = mp.FeasibleProjector(load("panda")), 0.3 if quick else 3.0
    plain, turning = (mp.LengthField(DAMPING, None, np.eye(3), projector, turn) for turn in (False, True))
    for adapter, what in zip((plain, turning), ONE, strict=True):
        took = min(_fit(adapter, teacher, student) for _ in range(1 if quick else FITS))
        note = f"processor time; {adapter.cost_:.3f} from what the Panda can make"
        yield within(f"fit of a field of {what}", took, FIT, duration, note)
        compiled, out = adapter.compiled(), np.empty((3, 3))
        took = _least(compiled, seconds, teacher[7], out)
        yield within(f"one 3×3 by {what}, in a control loop", took, ONE[what], duration)
    n = 100_000 if quick else 1_000_000
    points = mp.sample_domain(load("rhuman"), n, 2, "uniform")
    took = _least(plain.transform, seconds, points)
    yield within(f"{n:,} 3×3 by lengths alone", took, MILLION * n / 1_000_000, duration, "on all cores")


def _fit(adapter: mp.LengthField, teacher: Array, student: Array) -> float:
    """Processor time [s]."""
    begin = time.process_time()
    adapter.fit(teacher, student)
    return time.process_time() - begin


def _least(function: Callable[..., object], seconds: float, *arguments: Array) -> float:
    """Least time of a call [s]."""
    return race(lambda: function(*arguments), lambda: None, seconds).ours
