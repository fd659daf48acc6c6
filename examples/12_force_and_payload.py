"""Force and payload.

The largest force of the Panda's end effector in the vertical plane, with and without a payload, before a joint exceeds
its torque limit. The force ellipsoid with the torque limits, less gravity, as joint weights is near this polytope; that
of unit torques, here with the same area, is not: it treats the wrist joints as equally strong as the shoulder.

    python 12_force_and_payload.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import maniport as mp
from maniport.evaluation import ellipsoid_extent, polytope_extent
from maniport.report.page.content import ACHIEVED, REFERENCE, TARGET

CONFIGURATION = [0.0, 0.2, 0.0, -1.9, 0.0, 2.6, 0.8]  # [rad]
ANGLES = np.linspace(0.0, 2.0 * np.pi, 361)
DIRECTIONS = np.column_stack([np.cos(ANGLES), np.zeros_like(ANGLES), np.sin(ANGLES)])


def main(folder):
    """Compare polytopes and ellipsoids without and with 2 kg."""
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(7.0, 3.9), layout="constrained")
    for panel, mass in zip(
        figure.subplots(1, 2, subplot_kw={"projection": "polar"}), (0.0, 2.0), strict=True
    ):
        robot = mp.load_arm("panda").with_payload(mass)
        polytope = polytope_extent(robot, [CONFIGURATION], DIRECTIONS)[0]
        limited, unit = (
            ellipsoid_extent(
                [robot.manipulability(CONFIGURATION, "force", joint_weights=weights)], DIRECTIONS
            )[0]
            for weights in ("joint-limits", None)
        )
        unit *= np.sqrt(np.mean(limited**2) / np.mean(unit**2))
        panel.fill(ANGLES, polytope, color=REFERENCE.pale, alpha=0.4, label="polytope")
        panel.plot(ANGLES, limited, color=ACHIEVED.color, label="ellipsoid, torque limits")
        panel.plot(ANGLES, unit, "--", color=TARGET.color, label="ellipsoid, unit torques, scaled")
        panel.set(
            title=f"{mass:g} kg: largest force [N]", ylim=(0.0, 400.0), yticks=(100, 200, 300)
        )
        up, down = polytope[90], polytope[270]
        print(f"{mass:g} kg: {polytope[0]:.0f} N forward, {up:.0f} N up, {down:.0f} N down")
    figure.legend(
        *panel.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False
    )
    figure.savefig(folder / "force.png", dpi=200)
    print(f"figure in {folder / 'force.png'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
