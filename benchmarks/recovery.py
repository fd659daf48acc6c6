"""How often the ICP finds the rotation between copies of a cloud, and whether it knows that it did.

Each side has its own share of ellipsoids that the other lacks: common ones, turned by a random rotation, the rest drawn
anew from the same distribution. ``python -m benchmarks --only recovery``.
"""

import time
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.stats import special_ortho_group

import maniport as mp
from maniport.errors import IdentifiabilityWarning
from maniport.transfer.icp.initialization import aligned_frames
from maniport.transfer.icp.rotation import RotationProblem
from maniport.transfer.rigid_adapter import recenter
from maniport.transfer.rotation_group import rotation_angle

from .inputs import DAMPING, Array, load
from .measure import Row, duration

REPORTED = range(1000, 1020)
"""Seeds of the table; nothing was chosen by looking at them."""

RIGHT = 3.0
"""Degrees within which a rotation is the right one."""

WANTED = 0.95


@dataclass(frozen=True)
class Setting:
    """How two clouds are made from one.

    Attributes
    ----------
    cloud : str
        "covariance": A Aᵀ of Gaussian A, 3 × 3, whose distribution no rotation changes, so that only the copies tell;
        "skewed": Gaussian logarithms of a random covariance, whose distribution tells; else the name of an arm.
    n, m : int
        Ellipsoids of the teacher and the student.
    shared : float
        Share of the smaller side that the other side has, too.
    outliers : float
        Share of each side that is replaced by ellipsoids of another distribution, with Gaussian logarithms of 1.5
        times the spread, alike in all directions.
    noise : float
        Standard deviation of the logarithm by which the student's copies differ.
    copies : bool
        False: nothing is shared and nothing turned; the start is right and everything else is wrong.
    """

    cloud: str = "covariance"
    n: int = 300
    m: int = 300
    shared: float = 0.7
    outliers: float = 0.0
    noise: float = 0.01
    copies: bool = True

    def __str__(self) -> str:
        if not self.copies:
            return f"{self.cloud}, independent draws, N = {self.n}, M = {self.m}"
        return (
            f"{self.cloud}, N = {self.n}, M = {self.m}, {self.shared:.0%} shared, {self.outliers:.0%} outliers, "
            f"noise {self.noise:.0%}"
        )


@dataclass(frozen=True)
class Outcome:
    """One fit: errors of the answer, of what was found and of the start [deg], costs, and how long it took [s]."""

    answer: float
    found: float
    start: float
    kept: bool
    warned: bool
    seconds: float
    reason: str


SETTINGS = (
    *(Setting(n=n, m=n) for n in (60, 100, 300, 1000, 3000)),
    *(Setting(n=n, m=n, shared=share) for n in (100, 1000) for share in (0.5, 0.6, 0.85, 1.0)),
    *(Setting(n=n, m=n, outliers=share) for n in (100, 1000) for share in (0.1, 0.3)),
    *(Setting(n=n, m=n, noise=noise) for n in (100, 1000) for noise in (0.0, 0.03, 0.05)),
    Setting(n=100, m=300),
    Setting(n=300, m=100),
    Setting(n=1000, m=3000),
    Setting(n=3000, m=3000, shared=1.0, noise=0.03),
    *(Setting("skewed", n=n, m=n) for n in (100, 1000)),
    *(Setting("panda", n=n, m=n) for n in (100, 300, 1000, 3000)),
    *(Setting("rhuman", n=n, m=n) for n in (100, 1000)),
    *(Setting(arms, n, n, copies=False) for arms in ("panda", "rhuman-panda") for n in (12, 60, 300, 1000)),
)


def rows(quick: bool) -> Iterator[Row]:
    """One row for each setting."""
    settings = [one for one in SETTINGS if not quick or max(one.n, one.m) <= 300]
    for setting in settings:
        outcomes = list(outcomes_of(setting, REPORTED[:4] if quick else REPORTED))
        right = np.mean([one.answer <= RIGHT for one in outcomes])
        asked = setting.shared >= 0.7 and setting.outliers == 0.0 and setting.cloud in ("covariance", "skewed")
        yield Row(
            str(setting),
            f"{right:.0%}",
            "",
            f"{right:.0%}",
            f"≥ {WANTED:.0%}" if asked and setting.copies else "100%" if not setting.copies else "–",
            right >= WANTED if asked and setting.copies else right == 1.0 if not setting.copies else None,
            in_words(outcomes),
        )


def outcomes_of(setting: Setting, seeds: Iterable[int]) -> Iterator[Outcome]:
    """Fit once for every seed."""
    yield from Parallel(n_jobs=-1, return_as="generator")(delayed(outcome)(setting, seed) for seed in seeds)


def in_words(outcomes: list[Outcome]) -> str:
    """Count what went wrong, and how."""
    found = [one.found <= RIGHT for one in outcomes]
    right = [one.answer <= RIGHT for one in outcomes]
    rejected = sum(f and not r for f, r in zip(found, right, strict=True))
    wrong = sum(not r and not one.kept for r, one in zip(right, outcomes, strict=True))
    warned = sum(r and one.warned for r, one in zip(right, outcomes, strict=True))
    seconds = duration(float(np.median([one.seconds for one in outcomes])))
    return (
        f"found {sum(found)} of {len(found)}; found but rejected {rejected}, wrong accepted {wrong}, "
        f"warned though right {warned}; {seconds} each"
    )


def outcome(setting: Setting, seed: int) -> Outcome:
    """Make both clouds and fit."""
    teacher, student, copies = clouds(setting, seed)
    adapter = mp.RiemannianICP(damping=DAMPING, random_state=0)
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        adapter.fit(teacher, student)
    seconds = time.perf_counter() - begin
    truth = mp.ParallelTransport(damping=DAMPING).fit(teacher, student).rotation_
    if copies is not None:
        truth = best_for_copies(adapter, *copies)
    return Outcome(
        *(float(np.rad2deg(rotation_angle(one, truth))) for one in (adapter.rotation_, adapter.found_rotation_)),
        float(np.rad2deg(rotation_angle(adapter.start_rotation_, truth))),
        adapter.start_kept_,
        any(issubclass(one.category, IdentifiabilityWarning) for one in caught),
        seconds,
        adapter.stop_reason_,
    )


def best_for_copies(adapter: mp.RiemannianICP, teacher: Array, student: Array) -> Array:
    """The rotation that the true copies ask for, once both clouds are recentered at their own means, as a fit does.

    Where a share of each cloud is its own, so are its mean and its spread; no rotation makes up for that.
    """
    sides = adapter.teacher_regularization.apply(teacher, ""), adapter.student_regularization.apply(student, "")
    moved = recenter(sides[0], adapter.teacher_mean_, adapter.dispersion_ratio_)
    fixed = recenter(sides[1], adapter.student_mean_)
    problem = RotationProblem(fixed, moved, np.full(len(fixed), 1.0 / len(fixed)))
    return min(
        (problem.minimize(one) for one in aligned_frames(moved, fixed, np.random.default_rng(0))),
        key=lambda end: end.cost,
    ).rotation


def clouds(setting: Setting, seed: int) -> tuple[Array, Array, tuple[Array, Array] | None]:
    """Teacher, student, and the copies among them; None where the start is what counts as right."""
    random = np.random.default_rng([seed, setting.n, setting.m])
    if not setting.copies:
        first, _, second = setting.cloud.partition("-")
        sides = ((first, setting.n), (second or first, setting.m))
        teacher, student = (mp.sample_domain(load(arm), n, random.integers(1 << 30)) for arm, n in sides)
        return teacher, student, None
    n, m = setting.n, setting.m
    common = round(setting.shared * min(n, m))
    points = drawn(setting.cloud, n + m - common, random)
    teacher, student = points[:n], np.concatenate([points[:common], points[n:]])
    wild = [replaced(side, setting.outliers, random) for side in (teacher, student)]
    turn = special_ortho_group.rvs(3, random_state=random)
    student = turn @ _times(wild[1][0], setting.noise, random) @ turn.T
    teacher = wild[0][0]
    same = np.flatnonzero(~(wild[0][1][:common] | wild[1][1][:common]))
    copies = teacher[same], student[same]
    return random.permutation(teacher), random.permutation(student), copies


def drawn(cloud: str, count: int, random: np.random.Generator) -> Array:
    """Ellipsoids of one distribution in random order."""
    if cloud == "covariance":
        factor = random.standard_normal((count, 3, 3))
        return factor @ np.swapaxes(factor, 1, 2)
    if cloud == "skewed":
        mixing = random.standard_normal((6, 6)) / np.sqrt(6.0)
        return np.asarray(mp.spd.expm(mp.spd.from_vector(random.standard_normal((count, 6)) @ mixing.T)))
    points = mp.sample_domain(load(cloud), count, random.integers(1 << 30), sequence="uniform")
    return points + DAMPING * np.trace(points.mean(axis=0)) / 3.0 * np.eye(3)


def replaced(points: Array, share: float, random: np.random.Generator) -> tuple[Array, NDArray[np.bool_]]:
    """Put ellipsoids of another distribution into the places of some; also return which."""
    vectors = mp.spd.to_vector(mp.spd.logm(points))
    spread = 1.5 * np.sqrt(np.mean(np.var(vectors, axis=0)))
    wild = mp.spd.expm(mp.spd.from_vector(vectors.mean(axis=0) + spread * random.standard_normal(vectors.shape)))
    chosen = np.zeros(len(points), bool)
    chosen[random.choice(len(points), round(share * len(points)), replace=False)] = True
    return np.where(chosen[:, None, None], wild, points), chosen


def _times(points: Array, noise: float, random: np.random.Generator) -> Array:
    """X^½ exp(noise G) X^½, G Gaussian in Mandel coordinates."""
    if noise == 0.0:
        return points
    factor = mp.spd.expm(mp.spd.from_vector(noise * random.standard_normal((len(points), 6))))
    root = mp.spd.sqrtm(points)
    return np.asarray(root @ factor @ root)
