"""Identifiability of a fitted adapter.

Teacher and student are the same Panda, but the student is mounted on a wall, so the true map is a rotation by 90°. The
domains do not determine it: no rotation near the initial one is clearly better, and the rotation about the base axis of
the robot leaves its domain unchanged. The adapter reports this. Five pairs or a known base_rotation determine the map.

    python 04_fit_and_question_an_adapter.py [FOLDER]
"""

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.report import figures
from maniport.report.renderings import write_report

WALL = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # up, as the table has it, points out of the wall
HOME = np.array([0.3, -0.6, 0.2, -2.1, 0.3, 1.7, 0.5])  # [rad]
SWING = np.array([0.5, 0.4, -0.3, 0.4, 0.5, -0.4, 0.0])


def hung(ellipsoids):
    """The same ellipsoids, seen from the frame of the table."""
    return WALL @ ellipsoids @ WALL.T


def main(folder):
    """Four fits of the same two domains, what they know, and whether the one with pairs is worth while."""
    folder.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore", mp.errors.IdentifiabilityWarning)  # we ask ourselves
    panda = mp.load_arm("panda")
    teacher, student = mp.sample_domain(panda, 2048, 0), hung(mp.sample_domain(panda, 4096, 1))
    profile = panda.manipulability(HOME + SWING * np.sin(np.linspace(0.0, np.pi, 40))[:, None])
    truth = hung(profile)

    few = panda.manipulability(panda.sample(5, 2))  # five tasks that both have been seen to do
    fits = {
        "parallel transport": mp.ParallelTransport(damping=0.01).fit(teacher, student),
        "ICP": mp.RiemannianICP(damping=0.01, random_state=0).fit(teacher, student),
        "ICP, five pairs": mp.RiemannianICP(damping=0.01, random_state=0).fit(teacher, student, (few, hung(few))),
        "base_rotation known": mp.ParallelTransport(damping=0.01, base_rotation=WALL).fit(teacher, student),
    }
    for name, adapter in fits.items():
        error = np.sqrt(np.mean(adapter.errors(profile, truth) ** 2))
        off = np.degrees(np.arccos(np.clip((np.trace(adapter.map_rotation_.T @ WALL) - 1.0) / 2.0, -1.0, 1.0)))
        print(f"{name}: {error:.3f} from the truth (root mean square), turned by {off:.1f}° beside it")
        print(f"  {adapter.identifiability_.in_words()}")

    # What the sentences are made from: how much further apart a turn by 30° about each axis brings the domains.
    found = fits["ICP, five pairs"].identifiability_
    for axis, curvature, error in zip(found.axes, found.curvature, found.standard_error, strict=True):
        print(
            f"  about ({', '.join(f'{part:.2f}' for part in axis)}): {1e3 * curvature:.1f} ± {1e3 * error:.1f} ‰/rad²"
        )

    # Is it better than doing nothing? The same measures for the identity baseline and other cheap alternatives.
    chosen = fits["ICP, five pairs"]
    evaluation = mp.evaluate(chosen, teacher, student, profile, truth=truth, n_domain=0)
    summary = evaluation.summary
    print(f"take {summary.recommended}: {summary.measure} {summary.best_value:.3f}, identity {summary.identity:.3f}")
    write_report(folder / "evaluation.md", mp.report.report_of(evaluation))

    # A file for later; the map is exact there and back.
    chosen.save(folder / "adapter.npz")
    again = mp.load_adapter(folder / "adapter.npz")
    there = again.transform(profile)
    print(f"there and back from the file: off by {np.abs(again.inverse_transform(there) - profile).max():.1e}")
    rows, numbers = {"teacher": profile, "adapted": there, "truth": truth}, np.arange(1, len(profile) + 1)
    figures.save(figures.ellipsoids(numbers, rows, axis="number of the ellipsoid"), folder / "adapted.png")
    print(f"the adapter, the evaluation and a figure are in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
