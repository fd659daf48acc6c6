"""How long a user waits before anything happens."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .inputs import DAMPING, domains
from .measure import Row, duration, fresh_process, within

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
        1.5,
        duration,
        f"least of {count}, from launching Python to the fitted adapter, warm compile cache; of it importing maniport, "
        f"scikit-learn and SciPy {duration(least['import'])}, fit {duration(least['fit'])}",
    )
