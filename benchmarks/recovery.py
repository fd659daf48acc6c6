"""Success rate of ICP: the rotation between two clouds with a share of common ellipsoids.

The common ellipsoids are rotated by a random rotation; the others are drawn from the same distribution.
"""

import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.stats import special_ortho_group

import maniport as mp
from maniport.errors import IdentifiabilityWarning
from maniport.spd.kernels import cholesky
from maniport.transfer.icp.rotation import RotationProblem
from maniport.transfer.rigid_adapter import recenter
from maniport.transfer.rotation_group import rotation_angle

from .inputs import DAMPING, Array, load
from .measure import Row, duration

SEEDS = range(1000, 1020)

RIGHT = 3.0  # largest error of a right rotation [deg]


@dataclass(frozen=True)
class Setting:
    """How two clouds are made.

    ``cloud`` is "covariance" (A Aᵀ of Gaussian A: only the copies determine the rotation), "skewed" (Gaussian
    logarithms of a random covariance: the distribution determines it) or the name of an arm. Outliers are ellipsoids
    with Gaussian logarithms of 1.5 times the spread. Without copies, the initial rotation is the right one.
    """

    cloud: str = "covariance"
    n: int = 300  # ellipsoids of the teacher
    m: int = 300  # ellipsoids of the student
    shared: float = 0.7  # share of the smaller side
    outliers: float = 0.0  # share of both sides
    noise: float = 0.01  # standard deviation of the logarithms of the student's copies
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
    """One fit."""

    error: float  # of the result [deg]
    candidate_error: float  # of the best rotation before the acceptance test [deg]
    start_kept: bool
    warned: bool
    seconds: float


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
    *(
        Setting(arms, n, n, copies=False)
        for arms in ("panda", "rhuman-panda")
        for n in (12, 60, 300, 1000)
    ),
)


def rows(quick: bool) -> Iterator[Row]:
    """Yield one row for each setting."""
    for setting in SETTINGS:
        if quick and max(setting.n, setting.m) > 300:
            continue
        tasks = [delayed(outcome)(setting, seed) for seed in (SEEDS[:4] if quick else SEEDS)]
        outcomes = Parallel(n_jobs=-1)(tasks)
        right = [run.error <= RIGHT for run in outcomes]
        found = [run.candidate_error <= RIGHT for run in outcomes]
        bound = None
        if not setting.copies:
            bound = 1.0
        elif (
            setting.shared >= 0.7
            and setting.outliers == 0.0
            and setting.cloud in ("covariance", "skewed")
        ):
            bound = 0.95
        rejected = sum(f and not r for f, r in zip(found, right, strict=True))
        wrong = sum(not r and not run.start_kept for r, run in zip(right, outcomes, strict=True))
        yield Row(
            f"ICP, {setting}", f"{np.mean(right):.0%} right", bound="" if bound is None else f"≥ {bound:.0%}",
            met=None if bound is None else bool(np.mean(right) >= bound),
            note=f"right but rejected {rejected}, wrong but accepted {wrong}; "
            f"{duration(float(np.median([run.seconds for run in outcomes])))} per fit",
        )  # fmt: skip


def outcome(setting: Setting, seed: int) -> Outcome:
    """Make both clouds, fit, and compare with the true rotation."""
    teacher, student, copies = clouds(setting, seed)
    adapter = mp.RiemannianICP(damping=DAMPING)
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        adapter.fit(teacher, student)
    seconds = time.perf_counter() - begin
    truth = mp.ParallelTransport(damping=DAMPING).fit(teacher, student).rotation_
    if copies is not None:
        truth = best_for_copies(adapter, *copies)
    errors = [
        float(np.rad2deg(rotation_angle(end, truth)))
        for end in (adapter.rotation_, adapter.found_rotation_)
    ]
    warned = any(issubclass(warning.category, IdentifiabilityWarning) for warning in caught)
    return Outcome(*errors, adapter.start_kept_, warned, seconds)


def best_for_copies(adapter: mp.RiemannianICP, teacher: Array, student: Array) -> Array:
    """Return the best rotation for the true pairs of copies, after both clouds are recentered as in a fit."""
    sides = adapter.teacher_side(teacher), adapter.student_side(student)
    moved = recenter(sides[0], adapter.teacher_mean_, adapter.dispersion_ratio_)
    fixed = recenter(sides[1], adapter.student_mean_)
    problem = RotationProblem(cholesky(fixed), moved, np.full(len(fixed), 1.0 / len(fixed)))
    starts = special_ortho_group.rvs(3, 24, np.random.default_rng(0))
    return min((problem.minimize(start) for start in starts), key=problem.cost)


def clouds(setting: Setting, seed: int) -> tuple[Array, Array, tuple[Array, Array] | None]:
    """Return teacher, student, and the pairs of copies; None if the initial rotation is the right one."""
    random = np.random.default_rng([seed, setting.n, setting.m])
    if not setting.copies:
        first, _, second = setting.cloud.partition("-")
        sides = ((first, setting.n), (second or first, setting.m))
        teacher, student = (
            mp.sample_domain(load(arm), n, random.integers(1 << 30)) for arm, n in sides
        )
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
    """Draw ellipsoids of one distribution."""
    if cloud == "covariance":
        factor = random.standard_normal((count, 3, 3))
        return factor @ np.swapaxes(factor, 1, 2)
    if cloud == "skewed":
        mixing = random.standard_normal((6, 6)) / np.sqrt(6.0)
        return np.asarray(
            mp.spd.expm(mp.spd.from_vector(random.standard_normal((count, 6)) @ mixing.T))
        )
    points = mp.sample_domain(load(cloud), count, random.integers(1 << 30), sequence="uniform")
    return points + DAMPING * np.trace(points.mean(axis=0)) / 3.0 * np.eye(3)


def replaced(
    points: Array, share: float, random: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """Replace a share of ellipsoids by outliers; also return which."""
    vectors = mp.spd.to_vector(mp.spd.logm(points))
    spread = 1.5 * np.sqrt(np.mean(np.var(vectors, axis=0)))
    wild = mp.spd.expm(
        mp.spd.from_vector(vectors.mean(axis=0) + spread * random.standard_normal(vectors.shape))
    )
    chosen = np.zeros(len(points), bool)
    chosen[random.choice(len(points), round(share * len(points)), replace=False)] = True
    return np.where(chosen[:, None, None], wild, points), chosen


def _times(points: Array, noise: float, random: np.random.Generator) -> Array:
    """Return X^½ exp(noise G) X^½ with Gaussian G in Mandel coordinates."""
    if noise == 0.0:
        return points
    factor = mp.spd.expm(mp.spd.from_vector(noise * random.standard_normal((len(points), 6))))
    root = mp.spd.powm(points, 0.5)
    return np.asarray(root @ factor @ root)
