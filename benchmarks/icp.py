"""Complete ICP fits, human → Panda, random domains, damping 0.01."""

from collections.abc import Iterator

import maniport as mp

from .complete_fit import measure
from .inputs import DAMPING, damped, domains
from .measure import Row, duration, failed, faster, megabytes, race, within
from .peers.paper_icp import PaperICP

TIMEOUT = 300.0  # s


def rows(quick: bool) -> Iterator[Row]:
    """N = 400 against the peer, N = 20 000 for time and memory."""
    yield _against_paper(100 if quick else 400)
    yield from _large(2_000 if quick else 20_000)


def _against_paper(n: int) -> Row:
    teacher, student = domains(n)
    damped_teacher, damped_student = damped(teacher), damped(student)
    ours, peer = mp.RiemannianICP(damping=DAMPING, margin=0.0, random_state=0), PaperICP()
    times = race(
        lambda: ours.fit(teacher, student), lambda: peer.fit(damped_teacher, damped_student), seconds=0.0, least=2
    )
    return faster(
        f"complete ICP fit, N = {n}, multi-start",
        times,
        "PyManOpt + pyRiemann",
        300,
        "the peer is benchmarks/peers/paper_icp.py; cost reached (root mean squared distance of the "
        f"matched pairs): ours {ours.cost_:.3f} from {ours.n_starts + 1} starts, {ours.n_iter_} iterations at best; "
        f"peer {peer.cost_:.3f} in {peer.n_iter_} iterations of {peer.n_starts} starts each",
        ours.cost_ <= peer.cost_ * (1.0 + 1e-3),
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
