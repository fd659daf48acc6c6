"""Draw the front of force and ellipsoid distance along the weight of the person's lines.

    PYTHONPATH=. python scripts/make_capability_front.py FILE [FILE ...] [--output PICTURE.png]

The files are those that ``python -m benchmarks.capability`` writes; the picture is ``docs/capability.png`` by default.
Each point is the median over the motions that all weights of a robot have: ratio of force to positions only, against
the distance to the ellipsoids.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib import rc_context

from benchmarks.capability import DEFAULT, POSITIONS, ROBOTS, WEIGHTS, Run
from maniport.pipeline import Config
from maniport.report.figures import TEXT, column_figure

NONE = "none"
COLORS = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LEAST_SHARE = 0.2  # of the motions of a robot that a weight must have
Results = dict[Run, dict[str, float]]


def read(files: Sequence[Path]) -> Results:
    """Return the figures of all runs."""
    results = {}
    for file in files:
        for line in file.read_text(encoding="utf-8").splitlines():
            record = json.loads(line)
            results[Run(**record["run"])] = record["result"]
    return results


def weight_of(method: str) -> float | None:
    """Return the weight of the lines beside the ellipsoids; None for a method with other targets."""
    if method == NONE:
        return 0.0
    if method == DEFAULT:
        return Config().capability_weight
    if method in WEIGHTS:
        return float(method.split()[1])
    return None


def front(results: Results, robot: str) -> tuple[list[list[float]], int]:
    """Return weight, median distance and median ratio of force at each weight, and the number of motions.

    Only motions count that every weight has; a weight that few motions have is left out.
    """
    by_weight: dict[float, dict[Run, tuple[float, float]]] = {}
    for run, result in results.items():
        weight = weight_of(run.method)
        reference = results.get(replace(run, method=POSITIONS))
        if run.robot != robot or weight is None or reference is None:
            continue
        ratio = result["force"] / reference["force"]
        by_weight.setdefault(weight, {})[replace(run, method="")] = (result["distance"], ratio)
    most = max((len(values) for values in by_weight.values()), default=0)
    measured = {}
    for weight, values in by_weight.items():
        if len(values) >= LEAST_SHARE * most:
            measured[weight] = values
    if len(measured) < 2:
        return [], 0

    common = set.intersection(*(set(values) for values in measured.values()))
    if not common:
        return [], 0
    rows = []
    for weight in sorted(measured):
        values = np.array([measured[weight][run] for run in common])
        rows.append([weight, *np.median(values, axis=0)])
    return rows, len(common)


def main() -> None:
    """Read the files and draw the front of each robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    page = Path(__file__).parents[1] / "docs" / "capability.png"
    parser.add_argument("--output", type=Path, default=page)
    options = parser.parse_args()
    results = read(options.files)
    with rc_context({"font.size": TEXT}):
        figure = column_figure(2.6)
        axes = figure.add_subplot()
        for robot, color in zip(ROBOTS, COLORS, strict=True):
            rows, count = front(results, robot)
            if not rows:
                continue
            _, distances, ratios = zip(*rows, strict=True)
            axes.plot(distances, ratios, "o-", ms=3, lw=1, color=color, label=f"{robot} ({count})")
            print(robot, count)
            for row in rows:
                print("  weight {:g}: distance {:.2f}, force × {:.2f}".format(*row))
                axes.annotate(
                    f"{row[0]:g}",
                    row[1:],
                    xytext=(3, -7),
                    textcoords="offset points",
                    color=color,
                    fontsize=0.75 * TEXT,
                )
        axes.axhline(1.0, color="0.6", lw=0.8)
        axes.set_xlabel("distance to the person's ellipsoids (median)")
        axes.set_ylabel("force / positions only (median)")
        axes.set_ylim(bottom=0.0)
        axes.legend(edgecolor="none", framealpha=1.0, title="robot (motions)", loc="lower right")
        figure.savefig(options.output, dpi=200, bbox_inches="tight")


if __name__ == "__main__":
    main()
