"""Draw the figure of the task study: push along the hidden direction, relative to the position-only motion.

    python scripts/make_task_figure.py FOLDER [OUTPUT.png]

FOLDER is the output of ``python -m benchmarks.tasks run``; the figure is written to ``docs/tasks.png`` by default.
"""

import json
import sys
from pathlib import Path

from matplotlib import rc_context

from maniport.report.figures import TEXT, column_figure

COLORS = {"panda": "#0072B2", "xarm7": "#009E73", "ur5": "#CC79A7", "g1_right_arm": "#000000"}
METHODS = {
    "yoshikawa": "largest manipulability index", "elbow": "elbow as the person's", "random": "random configurations",
    "length-field, velocity": "velocity ellipsoids", "length-field, force": "force ellipsoids",
    "direct-force": "direction is an input",
}  # fmt: skip


def main(folder: Path, output: Path) -> None:
    """Read ``tasks.json`` and draw medians with their 95 % intervals."""
    sections = json.loads((folder / "tasks.json").read_text(encoding="utf-8"))
    robots = [robot for robot in COLORS if robot in sections]
    with rc_context({"font.size": TEXT}):
        figure = column_figure(2.4)
        axes = figure.add_subplot()
        for k, robot in enumerate(robots):
            rows = [sections[robot]["methods"][name]["push"] for name in METHODS]
            places = [i + 0.18 * (k - 0.5 * (len(robots) - 1)) for i in range(len(rows))]
            middle = [row["median"] for row in rows]
            reach = [
                [row["median"] - row["low"] for row in rows],
                [row["high"] - row["median"] for row in rows],
            ]
            axes.errorbar(
                middle, places, xerr=reach, fmt="o", ms=3, lw=1, color=COLORS[robot], label=robot
            )
        axes.axvline(1.0, color="0.6", lw=0.8)
        axes.set_xscale("log")
        axes.set_xticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
        axes.set_yticks(range(len(METHODS)), list(METHODS.values()))
        axes.set_xlabel("force along the hidden direction / position-only motion")
        axes.legend(frameon=False, loc="lower right")
        figure.savefig(output, dpi=200, bbox_inches="tight")


if __name__ == "__main__":
    page = Path(__file__).parents[1] / "docs" / "tasks.png"
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else page)
