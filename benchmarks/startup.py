"""Times until a first result: import, a first fit, and the demo, in fresh processes."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .inputs import DAMPING, domains
from .measure import Row, duration, fresh_process, megabytes, within

FIRST_FIT = f"""
import json, sys, time
begin = time.perf_counter()
import maniport, numpy
imported = time.perf_counter()
clouds = numpy.load(sys.argv[1])
adapter = maniport.RiemannianICP(damping={DAMPING})
adapter.fit(clouds["teacher"], clouds["student"])
print(json.dumps({{"all": time.perf_counter() - begin, "import": imported - begin}}))
"""
DEMO = """
import json, os, resource, subprocess, sys, time
os.environ["NUMBA_CACHE_DIR"], folder = sys.argv[1:]
begin = time.perf_counter()
subprocess.run([sys.executable, "-m", "maniport", "demo", "--quiet", "--overwrite", "--output", folder], check=True,
               stdout=subprocess.DEVNULL)
wall, used = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
peak = used.ru_maxrss / (2**20 if sys.platform == "darwin" else 1024)
print(json.dumps({"wall": wall, "processor": used.ru_utime + used.ru_stime, "peak": peak}))
"""


def rows(quick: bool) -> Iterator[Row]:
    """Yield the import, the first fit and the demo; the least of several runs."""
    count = 1 if quick else 3
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        teacher, student = domains(400)
        np.savez(folder / "domains.npz", teacher=teacher, student=student)
        runs = [
            fresh_process("-c", FIRST_FIT, str(folder / "domains.npz")) for _ in range(count + 1)
        ][1:]
        yield within("import maniport", min(run["import"] for run in runs), 0.3, duration)
        least = min(run["all"] for run in runs)
        yield within(
            "import and first ICP fit, N = 400", least, 1.2, duration, "warm compile cache"
        )
        demos = [
            fresh_process("-c", DEMO, str(folder / "cache"), str(folder / "demo"))
            for _ in range(count + 1)
        ]
    for text, bound, chosen in (
        ("empty compile cache", 32.0, demos[:1]),
        ("warm", 11.0, demos[1:]),
    ):
        best = min(chosen, key=lambda run: run["wall"])
        note = f"{duration(best['processor'])} of processor time"
        yield within(f"maniport demo, {text}", best["wall"], bound, duration, note)
    yield within("maniport demo, memory", max(run["peak"] for run in demos), 600.0, megabytes)
