"""Recovery of a known map: exact and noisy data, partial overlap, unequal sizes, outliers, and unpaired clouds.

    python -m benchmarks.recovery [--quick]

A teacher's cloud is mapped rigidly, with a random rotation, dispersion and mean, as the toy data of Reithmeir et al.
2022, and permuted. A set is recovered where the root mean squared distance of 50 further ellipsoids from their true
images is below 0.15. Unpaired clouds are two samples of one arm, one of them turned about a horizontal axis. A result
is then right up to the arm's symmetries where the base axis, without its sign, is at most 10° off.
"""

import argparse
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from joblib import Parallel, delayed
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport.errors import IdentifiabilityWarning
from maniport.transfer.rigid_adapter import RigidMap
from maniport.transfer.rotation_group import random_rotation

from .inputs import Array, load
from .measure import Row, duration

RECOVERED = 0.15  # largest root mean squared distance of a recovered map

RIGHT_TILT = 10.0  # largest error of the base axis [deg]

NEW = 50  # ellipsoids that the map is tested on

OUTLIER_SCALES = (0.5, 0.4, 0.2)  # of the rows of G in the outliers G Gᵀ, repeated for d > 3

SEED = 30_000


@dataclass(frozen=True)
class Setting:
    """How two clouds with common ellipsoids are made.

    Ellipsoids are the Panda's for d = 3, and random otherwise. Of the smaller cloud a share `overlap` has a partner in
    the other cloud. `noise` is the standard deviation of the student's ellipsoids in the tangent space at each. The
    shares `outliers` of the teacher's and the student's ellipsoids are replaced.
    """

    d: int = 3
    n: int = 100  # ellipsoids of the teacher
    m: int = 100  # ellipsoids of the student
    overlap: float = 1.0
    noise: float = 0.0
    outliers: tuple[float, float] = (0.0, 0.0)

    def __str__(self) -> str:
        parts = [f"d = {self.d}", f"{self.n} and {self.m}"]
        if self.overlap < 1.0:
            parts.append(f"{self.overlap:.0%} overlap")
        if self.noise > 0.0:
            parts.append(f"{self.noise:.0%} noise")
        if max(self.outliers) > 0.0:
            parts.append(f"outliers {self.outliers[0]:.0%} and {self.outliers[1]:.0%}")
        if len(parts) == 2:
            parts.append("exact")
        return ", ".join(parts)


@dataclass(frozen=True)
class Problem:
    """Two clouds, and further ellipsoids of the teacher with their true images."""

    teacher: Array
    student: Array
    new: Array
    images: Array


@dataclass(frozen=True)
class Unpaired:
    """Two samples of one arm."""

    arm: str = "panda"
    n: int = 400  # ellipsoids of each

    def __str__(self) -> str:
        return f"unpaired, {self.arm}, {self.n} and {self.n}"


SETTINGS = (
    *(Setting(d) for d in (2, 3, 6)),
    *(Setting(noise=noise) for noise in (0.01, 0.05, 0.1)),
    *(Setting(d, noise=0.05) for d in (2, 6)),
    *(Setting(overlap=overlap) for overlap in (0.9, 0.7, 0.5)),
    *(Setting(d, overlap=0.7) for d in (2, 6)),
    Setting(overlap=0.7, noise=0.05),
    *(Setting(d, n, m) for d in (2, 3, 6) for n, m in ((60, 100), (100, 60))),
    *(Setting(outliers=(0.0, share)) for share in (0.1, 0.2, 0.3, 0.4)),
    Setting(outliers=(0.3, 0.0)),
    *(Setting(outliers=(share, share)) for share in (0.3, 0.4)),
    *(Setting(d, outliers=(0.0, 0.3)) for d in (2, 6)),
    Setting(outliers=(0.3, 0.3), noise=0.05),
    Setting(n=400, m=400, overlap=0.7, noise=0.05),
    Setting(n=400, m=400, outliers=(0.3, 0.3)),
)

UNPAIRED = tuple(Unpaired(n=n) for n in (400, 1000))

QUICK = (
    Setting(),
    Setting(noise=0.05),
    Setting(overlap=0.7),
    Setting(n=60),
    Setting(outliers=(0.3, 0.3)),
)


def rows(quick: bool) -> Iterator[Row]:
    """Yield one row for each setting."""
    seeds = range(SEED, SEED + (4 if quick else 8))
    for setting in QUICK if quick else SETTINGS:
        yield recovery_row(setting, seeds, with_peers=not quick)
    for unpaired in UNPAIRED[:1] if quick else UNPAIRED:
        yield tilt_row(unpaired, range(SEED, SEED + (8 if quick else 40)))


def recovery_row(setting: Setting, seeds: range, with_peers: bool) -> Row:
    """Count the recovered sets of a setting."""
    timed = Parallel(n_jobs=-1)(delayed(timed_error)(setting, seed) for seed in seeds)
    errors = [error for error, _ in timed]
    seconds = float(np.median([spent for _, spent in timed]))
    printed = [error_of(fit_as_printed, setting, seed) for seed in seeds]

    peers = []
    if with_peers:
        for name, fit in PEERS.items():
            if find_spec(name.lower()) is None:
                continue
            first = seeds[:1] if name == "PyManOpt" else seeds  # seconds per set
            peers.append(f"{name}: {counted([error_of(fit, setting, seed) for seed in first])}")

    count = sum(error < RECOVERED for error in errors)
    bound = 7 * len(seeds) // 8
    return Row(
        f"recovery, {setting}",
        counted(errors),
        peer="; ".join(peers),
        bound=f"≥ {bound} of {len(seeds)}",
        met=count >= bound,
        note=f"as printed: {counted(printed)}; {duration(seconds)} per fit",
    )


def counted(errors: list[float]) -> str:
    """Return the median error and the number of recovered sets in words."""
    count = sum(error < RECOVERED for error in errors)
    return f"{count} of {len(errors)}, median {np.median(errors):.2g}"


def timed_error(setting: Setting, seed: int) -> tuple[float, float]:
    """Fit with the defaults; return the error, and the time of the fit [s] without compilation."""
    problem = problem_of(setting, seed)
    fit_default(problem)
    begin = time.perf_counter()
    transform = fit_default(problem)
    seconds = time.perf_counter() - begin
    return distance_of(problem, transform), seconds


Transform = Callable[[Array], Array]


def error_of(fit: Callable[[Problem], Transform], setting: Setting, seed: int) -> float:
    """Fit to a problem; return the root mean squared distance of further ellipsoids to their true images."""
    problem = problem_of(setting, seed)
    return distance_of(problem, fit(problem))


def distance_of(problem: Problem, transform: Transform) -> float:
    """Root mean squared distance of further ellipsoids to their true images."""
    distances = mp.spd.distance(transform(problem.new), problem.images)
    return float(np.sqrt(np.mean(distances**2)))


def fit_default(problem: Problem) -> Transform:
    """Fit the default ICP."""
    return fitted(mp.RiemannianICP(), problem.teacher, problem.student).transform


def fit_as_printed(problem: Problem) -> Transform:
    """Fit ICP by the paper's text, with maniport's starts."""
    adapter = mp.RiemannianICP(criterion="correspondence")
    return fitted(adapter, problem.teacher, problem.student).transform


def fit_pyriemann(problem: Problem) -> Transform:
    """Recenter and rescale as pyRiemann's transfer learning does; without labels it has no rotation."""
    from pyriemann.utils.base import invsqrtm, powm, sqrtm
    from pyriemann.utils.distance import distance_riemann
    from pyriemann.utils.mean import mean_riemann

    mean_t = mean_riemann(problem.teacher)
    mean_s = mean_riemann(problem.student)
    spread_t = np.mean(distance_riemann(problem.teacher, mean_t) ** 2)
    spread_s = np.mean(distance_riemann(problem.student, mean_s) ** 2)
    ratio = np.sqrt(spread_s / spread_t)
    whitening = invsqrtm(mean_t)
    coloring = sqrtm(mean_s)

    def transform(points: Array) -> Array:
        centered = whitening @ points @ whitening
        return np.asarray(coloring @ powm(centered, ratio) @ coloring)

    return transform


def fit_pymanopt(problem: Problem) -> Transform:
    """Fit the paper's method on PyManOpt and pyRiemann, from three starts."""
    from .peers.paper_icp import PaperICP

    peer = PaperICP().fit(problem.teacher, problem.student)
    mean_t = mp.spd.mean(problem.teacher)
    mean_s = mp.spd.mean(problem.student)
    ratio = mp.spd.dispersion(problem.student) / mp.spd.dispersion(problem.teacher)
    return RigidMap(mean_t, mean_s, peer.rotation_, ratio).apply


PEERS: dict[str, Callable[[Problem], Transform]] = {
    "pyRiemann": fit_pyriemann,
    "PyManOpt": fit_pymanopt,
}


def fitted(adapter: mp.RiemannianICP, teacher: Array, student: Array) -> mp.RiemannianICP:
    """Fit without the warning that the domains do not determine the rotation."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        return adapter.fit(teacher, student)


def problem_of(setting: Setting, seed: int) -> Problem:
    """Make two clouds."""
    random = np.random.default_rng([seed, setting.d])
    n = setting.n
    m = setting.m
    common = round(setting.overlap * min(n, m))
    points = drawn(setting.d, n + m - common, random)
    new = drawn(setting.d, NEW, random)
    center = random_spd(1, setting.d, random)[0]
    rotation = random_rotation(setting.d, random)
    truth = RigidMap(mp.spd.mean(points), center, rotation, random.uniform(0.5, 2.0))

    teacher = points[:n].copy()
    student = truth.apply(np.concatenate([points[:common], points[n:]]))
    student = with_noise(student, setting.noise, random)
    for cloud, share in ((teacher, setting.outliers[0]), (student, setting.outliers[1])):
        count = round(share * len(cloud))
        replaced = random.choice(len(cloud), count, replace=False)
        cloud[replaced] = outliers(count, setting.d, random)
    return Problem(random.permutation(teacher), random.permutation(student), new, truth.apply(new))


def drawn(d: int, count: int, random: np.random.Generator) -> Array:
    """Draw ellipsoids: the Panda's for d = 3."""
    if d != 3:
        return random_spd(count, d, random, condition=100.0)
    panda = load("panda")
    return panda.manipulability(panda.sample(count, random, sequence="uniform"))


def random_spd(count: int, d: int, random: np.random.Generator, condition: float = 30.0) -> Array:
    """SPD matrices with random axes and log-uniform eigenvalues of at most that condition number."""
    axes, _ = np.linalg.qr(random.normal(size=(count, d, d)))
    logs = random.uniform(-0.5, 0.5, size=(count, d)) * np.log(condition)
    product = (axes * np.exp(logs)[:, None]) @ np.swapaxes(axes, 1, 2)
    return np.asarray(0.5 * (product + np.swapaxes(product, 1, 2)))


def outliers(count: int, d: int, random: np.random.Generator) -> Array:
    """Ellipsoids G Gᵀ with Gaussian G, (d, d + 4), whose rows are scaled."""
    scales = np.resize(OUTLIER_SCALES, d)
    factor = random.normal(size=(count, d, d + 4)) * scales[:, None]
    return np.asarray(factor @ np.swapaxes(factor, 1, 2))


def with_noise(points: Array, noise: float, random: np.random.Generator) -> Array:
    """Return X^½ exp(noise G) X^½ with Gaussian G in Mandel coordinates."""
    d = points.shape[-1]
    gaussian = random.standard_normal((len(points), d * (d + 1) // 2))
    if noise == 0.0:
        return points
    factor = mp.spd.expm(mp.spd.from_vector(noise * gaussian))
    root = mp.spd.powm(points, 0.5)
    return np.asarray(root @ factor @ root)


def tilt_row(setting: Unpaired, seeds: range) -> Row:
    """Count the right rotations between two samples of one arm."""
    runs = Parallel(n_jobs=-1)(delayed(tilts)(setting, seed) for seed in seeds)
    ours = [run[0] for run in runs]
    start = [run[1] for run in runs]
    share = float(np.mean([tilt <= RIGHT_TILT for tilt in ours]))
    return Row(
        f"recovery, {setting}",
        f"{share:.0%} right, median {np.median(ours):.1f}°",
        bound="≥ 90%",
        met=share >= 0.9,
        note=f"parallel transport: median {np.median(start):.1f}°",
    )


def tilts(setting: Unpaired, seed: int) -> tuple[float, float]:
    """Errors of the base axis [deg], without its sign, of ICP and of parallel transport."""
    random = np.random.default_rng([seed, setting.n])
    arm = load(setting.arm)
    teacher = mp.sample_domain(arm, setting.n, random.integers(1 << 30))
    student = mp.sample_domain(arm, setting.n, random.integers(1 << 30))
    turn = Rotation.from_euler("xy"[seed % 2], random.uniform(15.0, 165.0), degrees=True)
    truth = turn.as_matrix()
    student = truth @ student @ truth.T

    adapter = fitted(mp.RiemannianICP(damping=0.01), teacher, student)
    start = mp.ParallelTransport(damping=0.01).fit(teacher, student)
    errors = []
    for rotation in (adapter.map_rotation_, start.map_rotation_):
        cosine = min(1.0, abs(float(rotation[:, 2] @ truth[:, 2])))
        errors.append(float(np.degrees(np.arccos(cosine))))
    return errors[0], errors[1]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recovery", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer settings and seeds")
    options = parser.parse_args()
    print("| work | maniport | peer | ratio | bound | met | note |")
    print("|---|---|---|---|---|---|---|")
    for row in rows(options.quick):
        print(row.markdown(), flush=True)


if __name__ == "__main__":
    main()
