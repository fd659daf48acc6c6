"""What a week of use leaves in memory: ``python -m benchmarks.soak [quick]`` prints it, in a process of its own.

Ten million transforms, a thousand fits and two hundred tracked motions, in rounds. Memory is looked at after each
round; what the second half of the rounds adds is what a week would go on adding, for by then everything is loaded,
compiled and as large as it gets.
"""

import gc
import json
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import maniport as mp

from .inputs import DAMPING, Array, domains, load
from .measure import Row, failed, fresh_process, within

ROUNDS = 20
MATRICES = {"at once": 9_500_000, "one by one, compiled": 400_000, "one by one": 100_000}
BATCH = 19_000
FITS = {"parallel transport": 400, "ICP": 300, "field of lengths": 300}
TRACKS = 200
SAMPLES = 200
"""Of each domain that is fitted."""
POINTS = 21
"""Of each motion that is tracked; it lasts a fifth of a second."""
GROWTH = 4.0
"""MB. In the second half, one number kept of each matrix would be 40 MB, one domain of each fit 7 MB; what comes and
goes with the pages of the allocator is less."""
TIMEOUT = 1800.0  # s
SERIES = ("transforms", "fits", "tracks")


def rows(quick: bool) -> Iterator[Row]:
    """A row for the memory of each kind of work, one for what else a process can lose."""
    if not Path("/proc/self/statm").exists():
        yield failed("memory after a week's work", "no growth", "memory can only be looked at on Linux")
        return
    found = fresh_process("-m", "benchmarks.soak", *(["quick"] if quick else []), timeout=TIMEOUT)[1]
    for name in SERIES:
        one = found[name]
        yield within(
            f"growth of memory over the second half of {one['count']:,} {name}",
            one["megabytes"],
            GROWTH,
            lambda value: f"{value:.2f} MB",
            f"{one['about']}; at the end {one['resident']:.0f} MB in use and {one['blocks']:.0f} blocks of Python's "
            f"memory more than at half time; {one['seconds']:.0f} s",
        )
    for what in ("files", "threads"):
        more = max(found[name][what] for name in SERIES)
        yield within(f"open {what}, more at the end than at half time", more, 0, lambda value: f"{value:.0f}")


def measured(work: Callable[[int], None], rounds: int) -> dict[str, float]:
    """Do the rounds; what memory, files and threads the second half of them adds."""
    began, seen = time.perf_counter(), []
    for number in range(rounds):
        work(number)
        gc.collect()
        seen.append((resident(), sys.getallocatedblocks(), _count("fd"), _count("task")))
    half = seen[rounds // 2 - 1]
    growth = dict(zip(("megabytes", "blocks", "files", "threads"), np.subtract(seen[-1], half).tolist(), strict=True))
    return {**growth, "resident": seen[-1][0], "seconds": time.perf_counter() - began}


def transforms(share: float) -> dict[str, object]:
    """All at once, one by one as anybody calls it, and as a control loop does."""
    teacher, student = domains(SAMPLES)
    adapter = mp.ParallelTransport(damping=DAMPING).fit(teacher, student)
    compiled, many = adapter.compiled(), np.resize(teacher, (BATCH, 3, 3))
    counts = {name: round(share * count) // ROUNDS for name, count in MATRICES.items()}

    def work(number: int) -> None:
        for _ in range(counts["at once"] // BATCH):
            adapter.transform(many)
        for i in range(counts["one by one, compiled"]):
            compiled(teacher[i % SAMPLES])
        for i in range(counts["one by one"]):
            adapter.transform(teacher[i % SAMPLES])

    return {**measured(work, ROUNDS), **_about(counts)}


def fits(share: float) -> dict[str, object]:
    """Each of domains of its own."""
    counts = {name: round(share * count) // ROUNDS for name, count in FITS.items()}
    methods: dict[str, Callable[[int], mp.transfer.DomainAdapter]] = {
        "parallel transport": lambda seed: mp.ParallelTransport(damping=DAMPING),
        "ICP": lambda seed: mp.RiemannianICP(damping=DAMPING, random_state=seed),
        "field of lengths": lambda seed: mp.LengthField(damping=DAMPING, n_samples=SAMPLES),
    }
    human, panda = load("rhuman"), load("panda")

    def work(number: int) -> None:
        for name, method in methods.items():
            for i in range(counts[name]):
                seed = number * max(counts.values()) + i
                teacher, student = (mp.sample_domain(arm, SAMPLES, seed, "uniform") for arm in (human, panda))
                method(seed).fit(teacher, student)

    return {**measured(work, ROUNDS), **_about(counts)}


def tracks(share: float) -> dict[str, object]:
    """Each from a start of its own along a path of its own, with an arm that is read anew in every round."""
    counts = {f"motions of {POINTS} points": round(share * TRACKS) // ROUNDS}

    def work(number: int) -> None:
        panda = load("panda")
        for i in range(*counts.values()):
            _track(panda, np.random.default_rng((number, i)))

    return {**measured(work, ROUNDS), **_about(counts)}


def _track(panda: mp.Arm, random: np.random.Generator) -> None:
    first = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.0]) + 0.2 * random.normal(size=7)
    joints = np.linspace(first, first + 0.05 * random.normal(size=7), POINTS)
    target: Array = panda.manipulability(joints)
    path = panda.forward(joints)[:, :3, 3]
    mp.track(panda, target, time=np.linspace(0.0, 0.2, POINTS), path=path, start=first)


def _about(counts: dict[str, int]) -> dict[str, object]:
    """How many there are altogether, and of which kinds."""
    kinds = ", ".join(f"{ROUNDS * count:,} {name}" for name, count in counts.items())
    return {"count": ROUNDS * sum(counts.values()), "about": kinds}


def resident() -> float:
    """Memory of this process now [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20


def _count(what: str) -> int:
    return sum(1 for _ in Path(f"/proc/self/{what}").iterdir())


if __name__ == "__main__":
    warnings.simplefilter("ignore", mp.errors.IdentifiabilityWarning)  # Python would keep the text of each
    part = 0.1 if sys.argv[1:] == ["quick"] else 1.0
    print(json.dumps({name: {"transforms": transforms, "fits": fits, "tracks": tracks}[name](part) for name in SERIES}))
