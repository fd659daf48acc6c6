"""Write adapter files that later versions must read: one of each method, with transformed ellipsoids.

Run once for each format of files, ``python scripts/make_golden_adapters.py``; the files of earlier formats stay.
"""

from pathlib import Path

import numpy as np

from maniport.transfer import METHODS, LengthField, RiemannianICP
from maniport.transfer.adapter_file import FILE_FORMAT
from maniport.util.files import save_arrays

FOLDER = Path(__file__).parents[1] / "tests" / "transfer" / "golden"


def main() -> None:
    """Fit and write the adapters."""
    rng = np.random.default_rng(0)
    factors = rng.normal(size=(2, 24, 3, 3))
    teacher, student = factors @ np.swapaxes(factors, -1, -2) + 0.1 * np.eye(3)
    images = {"points": teacher[:5]}
    for name, kind in METHODS.items():
        special = {RiemannianICP: {"n_starts": 0}, LengthField: {"n_rounds": 1}}
        adapter = kind(damping=0.01, **special.get(kind, {})).fit(teacher, student)
        adapter.save(FOLDER / f"{FILE_FORMAT}-{name}.npz")
        images[name] = adapter.transform(images["points"])
    save_arrays(FOLDER / f"{FILE_FORMAT}-images.npz", images)


if __name__ == "__main__":
    main()
