"""Complete ICP fits, human → Panda, random domains, damping 0.01."""

import warnings
from collections.abc import Iterator
from typing import Any

import maniport as mp
from maniport.errors import IdentifiabilityWarning
from maniport.transfer import Search

from .complete_fit import measure
from .inputs import DAMPING, damped, domains
from .measure import Row, duration, failed, faster, megabytes, race, within
from .peers.paper_icp import PaperICP

TIMEOUT = 300.0  # s

AS_THE_PEER = {"search": Search(require_improvement=False)}
"""The paper's method takes the cheapest rotation as it is and repeats no fit on resampled domains."""


def rows(quick: bool) -> Iterator[Row]:
    """N = 400 against the peer, N = 20 000 for time and memory."""
    yield _against_paper(100 if quick else 400)
    yield _with_defaults(100 if quick else 400)
    yield from _large(2_000 if quick else 20_000)


def fit_quietly(adapter: mp.RiemannianICP, teacher: Any, student: Any) -> None:
    """Fit without the warning that human and robot domains leave the rotation open, which they do."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        adapter.fit(teacher, student)


def _against_paper(n: int) -> Row:
    teacher, student = domains(n)
    damped_teacher, damped_student = damped(teacher), damped(student)
    ours, peer = mp.RiemannianICP(damping=DAMPING, **AS_THE_PEER, random_state=0), PaperICP()
    times = race(
        lambda: fit_quietly(ours, teacher, student),
        lambda: peer.fit(damped_teacher, damped_student),
        seconds=0.0,
        least=2,
    )
    return faster(
        f"complete ICP fit, N = {n}, multi-start",
        times,
        "PyManOpt + pyRiemann",
        300,
        "the peer is benchmarks/peers/paper_icp.py; cost reached (root mean squared distance of the "
        f"matched pairs): ours {ours.cost_:.3f} from {ours.search.n_starts + 1} starts, "
        f"{ours.n_iter_} iterations at best; "
        f"peer {peer.cost_:.3f} in {peer.n_iter_} iterations of {peer.n_starts} starts each",
        ours.cost_ <= peer.cost_ * (1.0 + 1e-3),
    )


def _with_defaults(n: int) -> Row:
    """Time of the defaults: multi-start, test of the improvement, and identifiability."""
    teacher, student = domains(n)
    full, bare = (mp.RiemannianICP(damping=DAMPING, random_state=0, **options) for options in ({}, AS_THE_PEER))
    times = race(lambda: fit_quietly(full, teacher, student), lambda: fit_quietly(bare, teacher, student))
    return within(
        f"complete ICP fit, N = {n}, with the defaults",
        times.ours,
        0.04,
        duration,
        f"{1.0 / times.ratio:.3g} times as long as without multi-start, test and identifiability",
    )


def _large(n: int) -> Iterator[Row]:
    work = f"complete ICP fit, N = {n:,} on each side"
    try:
        found = measure(n, TIMEOUT)
    except TimeoutError:
        yield failed(work, "≤ 10 s, ≤ 1000 MB", f"not finished within {duration(TIMEOUT)}")
        return
    yield within(f"{work}: time", found["seconds"], 10.0, duration, f"{found['iterations']} iterations of the best")
    yield within(
        f"{work}: peak memory",
        found["megabytes"],
        1000.0,
        megabytes,
        f"of the whole process; {megabytes(found['baseline'])} before the fit",
    )
