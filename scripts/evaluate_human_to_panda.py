"""Evaluate transfer methods from a human arm to the Panda, and write the table of docs/evaluation.md.

    python scripts/evaluate_human_to_panda.py --details build/evaluation.md

Takes about five minutes. `--method` takes a method other than `auto`, `--motions` a choice of the six.
"""

import argparse
import json
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import maniport as mp
from maniport.arms import Arm, load_arm
from maniport.domain import sample_domain
from maniport.errors import ManiportWarning
from maniport.evaluation import Evaluation, evaluate, select_method
from maniport.evaluation.comparison import with_feasible_set
from maniport.evaluation.metrics import BASELINES
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.report.describe import report_of
from maniport.report.describe.transfers import evaluation_section
from maniport.report.render import as_markdown, as_numbers
from maniport.report.values import Report
from maniport.studies import trajectories
from maniport.transfer import METHODS, method_of
from maniport.util.defaults import AUTO, DAMPING, ROBOT, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.progress import Progress, Step
from maniport.util.sampling import evenly_spaced

PAGE = Path(__file__).parent.parent / "docs" / "evaluation.md"
BEGIN = "<!-- feasibility gaps -->"
END = "<!-- end of feasibility gaps -->"

FITTED_METHODS = ("icp", "length-field")  # Methods in every table besides the baselines

RECORDINGS = {"ladder": "a person climbs a ladder (BVH)", "freeform": "free arm motion (C3D)"}

EVALUATIONS = {
    "H-Eval-1": "sideways motion of the extended arm at 140° elevation",
    "H-Eval-2": "elbow fold",
    "H-Eval-3": "elbow and shoulder fold",
    "H-Eval-4": "upward motion of the extended arm in the plane of 60°",
}


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of a human arm."""

    name: str
    about: str
    person: Arm  # its base frame is the trunk
    profile: np.ndarray  # (n, 3, 3), velocity ellipsoids of the hand


def motions(names: Iterable[str] | None = None) -> tuple[Motion, ...]:
    """Return the evaluation motions of Reithmeir et al. 2022 (rHuMan) and the recordings, 150 ellipsoids each."""
    selected = []
    person = trajectories.human_arm()
    paths = trajectories.human_evaluation()
    for name in (*EVALUATIONS, *RECORDINGS) if names is None else names:
        if name in EVALUATIONS:
            selected.append(
                Motion(name, EVALUATIONS[name], person, person.manipulability(paths[name]))
            )
            continue
        with warnings.catch_warnings():  # models and people differ
            warnings.simplefilter("ignore", ManiportWarning)
            fit = fit_arm(read_recording(shipped_recording(name)))
        ellipsoids = fit.arm.manipulability(fit.joint_angles[evenly_spaced(len(fit), 150)])
        selected.append(Motion(name, RECORDINGS[name], fit.arm, ellipsoids))
    return tuple(selected)


def study(
    method: str = AUTO,
    names: Iterable[str] | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
) -> dict[Motion, Evaluation]:
    """Evaluate a method on the motions, by motion, with all others in further rows."""
    robot = load_arm(ROBOT)
    shared: dict[str, Any] = {"damping": DAMPING, "base_rotation": np.eye(3)}
    student = sample_domain(robot, STUDENT_SAMPLES, random_state + 1)
    evaluated = {}
    for motion in motions(names):
        step = Step(progress, motion.name)
        teacher = sample_domain(motion.person, TEACHER_SAMPLES, random_state)
        options: dict[str, Any] = {"robot": robot, "random_state": random_state}
        if method == AUTO:
            adapter, _ = select_method(teacher, student, motion.profile, **options, **shared)
        else:
            adapter = with_feasible_set(
                method_of(method, random_state=random_state, **shared), robot
            )
            adapter.fit(teacher, student)
        options["rows"] = (*BASELINES, "nearest-neighbor", *FITTED_METHODS)
        evaluated[motion] = evaluate(adapter, teacher, student, motion.profile, **options)
        step.end(f"{evaluated[motion].adapter.name} and {len(evaluated[motion].rows) - 1} more")
    return evaluated


Results = Mapping[Motion, Evaluation]


def gap_table(results: Results) -> str:
    """Mean feasibility gap by motion and method, in Markdown."""
    methods = (
        "identity",
        "mean-transport",
        "parallel-transport",
        "scaled-transport",
        *FITTED_METHODS,
    )
    lines = [f"| motion | method | {' | '.join(methods)} |", f"|---|---|{'---|' * len(methods)}"]
    for motion, evaluation in results.items():
        gaps = {
            row.name: row.feasibility_gap
            for row in evaluation.rows
            if row.feasibility_gap is not None
        }
        cells = (f"{gaps[method].mean:.3f}" if method in gaps else "–" for method in methods)
        lines.append(f"| {motion.name} | {evaluation.adapter.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def details(results: Results) -> str:
    """All metrics of all motions, in Markdown."""
    return "\n".join(
        as_markdown(Report(f"{motion.name}: {motion.about}", "", (evaluation_section(evaluation),)))
        for motion, evaluation in results.items()
    )


def with_table(page: str, table: str) -> str:
    """Replace the table between the markers of the page."""
    before, _, rest = page.partition(BEGIN)
    _, marker, after = rest.partition(END)
    if not marker:
        raise ValueError(f"{PAGE} has no {BEGIN} … {END}")
    return f"{before}{BEGIN}\n\n{table}\n\n{END}{after}"


def main() -> None:
    """Run the study and write the table; with --details and --json also all metrics."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--method", default=AUTO, choices=[AUTO, *METHODS])
    parser.add_argument("--motions", nargs="+", default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--details", type=Path, default=None)
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    with mp.progress() as progress:
        results = study(options.method, options.motions, options.seed, progress)
    PAGE.write_text(
        with_table(PAGE.read_text(encoding="utf-8"), gap_table(results)), encoding="utf-8"
    )
    if options.details is not None:
        options.details.write_text(details(results), encoding="utf-8")
    if options.json is not None:
        reports = {
            motion.name: as_numbers(report_of(evaluation)) for motion, evaluation in results.items()
        }
        options.json.write_text(json.dumps(reports, indent=1, allow_nan=False), encoding="utf-8")
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
