"""ICP fits and single rotation steps, against PyManOpt and pyRiemann."""

import json
import sys
import time
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.stats import special_ortho_group

import maniport as mp
from maniport.errors import IdentifiabilityWarning
from maniport.spd.kernels import cholesky
from maniport.transfer import EllipsoidCorrespondence
from maniport.transfer.icp.rotation import RotationProblem

from .inputs import DAMPING, Array, damped, domains, recentred_domains
from .measure import Row, compare, duration, faster, fresh_process, megabytes, peak_memory, within
from .peers.paper_icp import PaperICP
from .peers.pymanopt_rotation import PymanoptRotation


def rows(quick: bool) -> Iterator[Row]:
    """Yield the rotation step, fits of 400 ellipsoids, and a fit of 20 000."""
    yield from (
        _rotation_step(n, bound, 0.5 if quick else 5.0) for n, bound in ((100, 80), (400, 40))
    )
    yield from _fits(100 if quick else 400)
    n = 2_000 if quick else 20_000
    run = fresh_process("-m", "benchmarks.icp", str(n))
    yield within(f"ICP, N = {n:,} on both sides", run["seconds"], 10.0, duration)
    yield within(f"ICP, N = {n:,}: peak memory of the process", run["megabytes"], 1000.0, megabytes)


def _rotation_step(n: int, bound: float, seconds: float) -> Row:
    student, teacher, weights = _matched_pairs(n)
    starts = [np.eye(3), *special_ortho_group.rvs(3, size=3, random_state=0)]
    ours = RotationProblem(cholesky(student), teacher, weights)
    peer = PymanoptRotation(student, teacher, weights)
    norms = [
        max(float(np.linalg.norm(ours.derivatives(end)[1])) for end in ends)
        for ends in ([problem.minimize(start) for start in starts] for problem in (ours, peer))
    ]
    times = compare(
        lambda: [ours.minimize(start) for start in starts],
        lambda: [peer.minimize(start) for start in starts],
        seconds,
    )
    note = f"largest gradient norm {norms[0]:.1g}, PyManOpt {norms[1]:.1g}"
    return faster(
        f"rotation step, N = {n}, 4 starts", times, "PyManOpt", bound, note, max(norms) < 1e-9
    )


def _matched_pairs(n: int) -> tuple[Array, Array, Array]:
    """Pairs S_i, T_i of the paper's score before any rotation, and their weights w³."""
    teacher, student = recentred_domains(n)
    matches = EllipsoidCorrespondence().between(teacher, student)(np.eye(3))
    return student[matches.student], teacher[matches.teacher], matches.weight


def _fits(n: int) -> Iterator[Row]:
    """Compare with the paper's algorithm, which takes the cheapest rotation; then time the defaults."""
    teacher, student = domains(n)
    damped_teacher = damped(teacher)
    damped_student = damped(student)
    ours = mp.RiemannianICP(damping=DAMPING, require_improvement=False, criterion="correspondence")
    peer = PaperICP()
    default = mp.RiemannianICP(damping=DAMPING)
    times = compare(
        lambda: fit(ours, teacher, student),
        lambda: peer.fit(damped_teacher, damped_student),
        0.0,
        2,
    )
    note = f"cost {ours.cost_:.3f}, peer {peer.cost_:.3f}"
    agrees = ours.cost_ <= peer.cost_ * (1.0 + 1e-3)
    yield faster(
        f"ICP, N = {n}, without acceptance test", times, "PyManOpt and pyRiemann", 300, note, agrees
    )
    seconds = compare(lambda: fit(default, teacher, student), lambda: None).ours
    yield within(f"ICP, N = {n}, default options", seconds, 0.06, duration)


def fit(adapter: mp.RiemannianICP, teacher: Any, student: Any) -> None:
    """Fit without the warning that the domains do not determine the rotation."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        adapter.fit(teacher, student)


def main(n: int) -> None:
    """Print time and memory of one fit as JSON."""
    adapter = mp.RiemannianICP(damping=DAMPING)
    fit(adapter, *domains(64))  # loads the compiled functions
    clouds = domains(n)
    begin = time.perf_counter()
    fit(adapter, *clouds)
    print(json.dumps({"seconds": time.perf_counter() - begin, "megabytes": peak_memory()}))


if __name__ == "__main__":
    main(int(sys.argv[1]))
