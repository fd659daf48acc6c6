"""Identifiability of a fitted adapter.

Teacher and student are the same Panda, but the student is mounted on a wall, so the true map is a rotation by 90°. The
domains do not determine it: no rotation near the initial one is clearly better, and the rotation about the base axis of
the robot leaves its domain unchanged. The adapter reports this. A known base_rotation determines the map.

    python 04_fit_and_question_an_adapter.py [FOLDER]
"""

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.report import figures
from maniport.report.render import write_report

WALL = np.array(
    [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
)  # from the teacher's to the student's base frame
HOME = np.array([0.3, -0.6, 0.2, -2.1, 0.3, 1.7, 0.5])  # [rad]
AMPLITUDE = np.array([0.5, 0.4, -0.3, 0.4, 0.5, -0.4, 0.0])  # [rad]


def on_wall(ellipsoids):
    """Rotate ellipsoids from the teacher's to the student's base frame."""
    return WALL @ ellipsoids @ WALL.T


def main(folder):
    """Compare three fits of the same two domains with the true map."""
    folder.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter(
        "ignore", mp.errors.IdentifiabilityWarning
    )  # the example prints identifiability itself
    panda = mp.load_arm("panda")
    teacher, student = mp.sample_domain(panda, 2048, 0), on_wall(mp.sample_domain(panda, 4096, 1))
    profile = panda.manipulability(HOME + AMPLITUDE * np.sin(np.linspace(0.0, np.pi, 40))[:, None])
    truth = on_wall(profile)

    fits = {
        "parallel transport": mp.ParallelTransport(damping=0.01).fit(teacher, student),
        "ICP": mp.RiemannianICP(damping=0.01).fit(teacher, student),
        "base_rotation known": mp.ParallelTransport(damping=0.01, base_rotation=WALL).fit(
            teacher, student
        ),
    }
    for name, adapter in fits.items():
        error = np.sqrt(np.mean(adapter.errors(profile, truth) ** 2))
        cosine = (np.trace(adapter.map_rotation_.T @ WALL) - 1.0) / 2.0
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        print(f"{name}: error {error:.3f} (root mean square), rotation error {angle:.1f}°")

    # Identifiability: axes of the student's base about which the domains do not determine the rotation.
    for axis in fits["ICP"].free_axes_:
        print(
            f"ICP cannot determine the rotation about ({', '.join(f'{part:.2f}' for part in axis)})"
        )

    # Evaluation: the same metrics for the adapter and for the baselines.
    adapter = fits["base_rotation known"]
    evaluation = mp.evaluate(adapter, teacher, student, profile, truth=truth)
    least, identity = (evaluation.values[name] for name in (evaluation.recommended, "identity"))
    print(
        f"recommended: {evaluation.recommended}; {evaluation.measure} {least:.3f}, identity {identity:.3f}"
    )
    write_report(folder / "evaluation.md", mp.report.report_of(evaluation))

    # Save and load; the inverse of the map is exact.
    adapter.save(folder / "adapter.npz")
    loaded = mp.load_adapter(folder / "adapter.npz")
    adapted = loaded.transform(profile)
    print(f"error of the inverse: {np.abs(loaded.inverse_transform(adapted) - profile).max():.1e}")
    rows = {"teacher": profile, "adapted": adapted, "truth": truth}
    figures.save(
        figures.ellipsoids(np.arange(1, 41), rows, axis="index of the ellipsoid"),
        folder / "adapted.png",
    )
    print(f"adapter, evaluation and figure in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
