"""How long a user waits before anything happens."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .inputs import DAMPING, domains
from .measure import Row, duration, fresh_process, megabytes, within

IMPORT = """
import json, time
begin = time.perf_counter()
import maniport
print(json.dumps({"import": time.perf_counter() - begin}))
"""
FIRST_FIT = f"""
import json, sys, time
path, launched = sys.argv[1], float(sys.argv[2])
begin = time.time()
import maniport, numpy
clouds = numpy.load(path)
adapter = maniport.RiemannianICP(damping={DAMPING}, random_state=0)
imported = time.time()
adapter.fit(clouds["teacher"], clouds["student"])
done = time.time()
print(json.dumps({{"all": done - launched, "import": imported - begin, "fit": done - imported}}))
"""
DEMO = """
import json, os, resource, subprocess, sys, time
os.environ["NUMBA_CACHE_DIR"], folder = sys.argv[1:]
begin = time.perf_counter()
subprocess.run([sys.executable, "-m", "maniport", "demo", "--quiet", "--overwrite", "--output", folder], check=True)
wall, used = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
peak = used.ru_maxrss / (2**20 if sys.platform == "darwin" else 1024)
print(json.dumps({"wall": wall, "processor": used.ru_utime + used.ru_stime, "peak": peak}))
"""
"""The demo as a user has it; of its two processes the larger one's memory."""


def rows(quick: bool) -> Iterator[Row]:
    """Fresh processes, after one that has filled the compile cache."""
    count = 2 if quick else 5
    bare = min(fresh_process("-c", "pass")[0] for _ in range(count))
    imports = [fresh_process("-c", IMPORT)[1]["import"] for _ in range(count + 1)]
    note = f"least of {count}; the names inside load on first use; the interpreter alone takes {duration(bare)}"
    yield within("import maniport", min(imports[1:]), 0.3, duration, note)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "domains.npz"
        teacher, student = domains(400)
        np.savez(path, teacher=teacher, student=student)
        runs = [fresh_process("-c", FIRST_FIT, str(path), repr(time.time()))[1] for _ in range(count + 1)][1:]
    least = min(runs, key=lambda run: run["all"])
    yield within(
        "first ICP fit (N = 400) in a fresh process",
        least["all"],
        1.2,
        duration,
        f"least of {count}, from launching Python to the fitted adapter, warm compile cache; of it importing maniport, "
        f"Numba and SciPy {duration(least['import'])}, fit {duration(least['fit'])}",
    )
    yield from _demo(1 if quick else 3)


def _demo(count: int) -> Iterator[Row]:
    """`maniport demo`, with an empty compile cache, each time another one, then with what the last has filled."""
    empty = (count + 1) // 2
    with tempfile.TemporaryDirectory() as folder:
        caches, results = [str(Path(folder) / f"cache-{i}") for i in range(empty)], str(Path(folder) / "results")
        found = [fresh_process("-c", DEMO, cache, results)[1] for cache in (*caches, *caches[-1:] * count)]
    for name, limit, runs in (("empty compile cache", 30.0, found[:empty]), ("warm", 15.0, found[empty:])):
        least = min(runs, key=lambda run: run["wall"])
        longest = max(run["wall"] for run in runs)
        note = f"least of {len(runs)}, the longest {duration(longest)}"
        note += f"; {duration(least['processor'])} of processor time"
        most = max(run["peak"] for run in runs)
        yield within(f"maniport demo, {name}", least["wall"], limit, duration, note)
        yield within(f"maniport demo, {name}: memory", most, 600.0, megabytes, "largest of all processes of these runs")
