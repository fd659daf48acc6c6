"""One complete ICP fit in a process of its own: ``python -m benchmarks.complete_fit N`` prints its time and memory.

A process of its own, because only so the peak of its memory is that of the fit.
"""

import json
import sys
import time

import maniport as mp

from .inputs import DAMPING, domains
from .measure import fresh_process, peak_memory


def measure(n: int, timeout: float) -> dict[str, float]:
    """Fit `n` ellipsoids on each side in a new process; return seconds, megabytes, baseline and cost.

    Raises
    ------
    TimeoutError
        When the process, sampling included, takes longer than `timeout` seconds.
    """
    return fresh_process("-m", "benchmarks.complete_fit", str(n), timeout=timeout)[1]


def _main(n: int) -> None:
    mp.RiemannianICP(damping=DAMPING, random_state=0).fit(*domains(64))  # loads what is compiled
    teacher, student = domains(n)
    baseline = peak_memory()
    begin = time.perf_counter()
    adapter = mp.RiemannianICP(damping=DAMPING, random_state=0).fit(teacher, student)
    seconds = time.perf_counter() - begin
    print(
        json.dumps(
            {
                "seconds": seconds,
                "megabytes": peak_memory(),
                "baseline": baseline,
                "cost": adapter.cost_,
                "iterations": adapter.n_iter_,
            }
        )
    )


if __name__ == "__main__":
    _main(int(sys.argv[1]))
