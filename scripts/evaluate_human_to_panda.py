"""Measure what a transfer from a human arm to the Panda is worth, and write docs/evaluation.md.

    python scripts/evaluate_human_to_panda.py --jobs 2

Takes about five minutes. `--methods` takes any names that the command line knows, `--motions` a choice of the six. The
sections on the choice of a method (`scripts/lengths_table.py`) and on robots (`scripts/lengths_on_robot.py`) stay.
"""

import argparse
import json
import re
from collections.abc import Mapping
from pathlib import Path

import maniport as mp
from maniport.arms import load_arm
from maniport.evaluation import Evaluation
from maniport.evaluation.baselines import IDENTITY, MEAN_TRANSPORT, TRANSPORT
from maniport.report.metrics import report_of
from maniport.report.renderings import as_markdown, as_numbers
from maniport.report.transfer import COLUMNS, evaluation_section
from maniport.report.values import Report
from maniport.studies.human_to_panda import FITTED_METHODS, Motion, study
from maniport.transfer import METHODS
from maniport.util.defaults import AUTO, DAMPING, ROBOT

PAGE = Path(__file__).parent.parent / "docs" / "evaluation.md"
KEPT = "Which method is taken", "What robots make of it"


def section(title: str) -> str:
    """Return a section of the page as it is, empty where there is none."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.is_file() else ""
    found = re.search(rf"^## {title}\n.*?(?=^## |\Z)", text, flags=re.DOTALL | re.MULTILINE)
    return found.group() if found else ""


def study_page(results: Mapping[tuple[str, str], tuple[Motion, Evaluation]]) -> str:
    """Write the study as a page in Markdown: a summary of feasibility gaps, then every table."""
    shown = (IDENTITY, MEAN_TRANSPORT, TRANSPORT, *FITTED_METHODS)
    lines = [
        "# Human arm → Panda: is it better than doing nothing?",
        "",
        "Every number here is measured by `python scripts/evaluate_human_to_panda.py`, whatever it is. The person "
        "stands where the robot is mounted and faces the same way, and that is given. The end effector of the Panda is "
        f"`{load_arm(ROBOT).frame}`, the default. Singular ellipsoids are damped ({DAMPING:g}). Distances are "
        "affine-invariant: 0.1 is one axis that is 5 % too long, 0.5 one that is 28 % too long.",
        "",
        "## In short",
        "",
        "Mean feasibility gap: how far what is asked of the Panda is from what it can make.",
        "",
        f"| motion | method | {' | '.join(shown)} |",
        f"|---|---|{'---|' * len(shown)}",
    ]
    for (name, _), (_, evaluation) in results.items():
        gaps = {row.name: row.feasibility_gap for row in evaluation.rows if row.feasibility_gap is not None}
        cells = (f"{gaps[one].mean:.3f}" if one in gaps else "–" for one in shown)
        lines.append(f"| {name} | {evaluation.adapter.name} | {' | '.join(cells)} |")
    lines += ["", *(text for title in KEPT if (text := section(title))), ""]
    rows = [row for _, one in results.values() for row in one.rows]
    columns = [column for column in COLUMNS if any(map(column.cell, rows))]
    lines += ["## What the columns mean", "", *(f"- {column.head}: {column.about}" for column in columns), ""]
    for (name, _), (motion, evaluation) in results.items():
        title = f"{name}, {evaluation.adapter.name}: {motion.about}"
        facts = Report(title, "", (evaluation_section(evaluation, explained=False),))
        lines += [as_markdown(facts, level=2)]
    return "\n".join(lines)


def main() -> None:
    """Run the study and write the page; with --json also all numbers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--methods", nargs="+", default=[AUTO], choices=[AUTO, *METHODS])
    parser.add_argument("--motions", nargs="+", default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=None)
    parser.add_argument("-o", "--output", type=Path, default=PAGE)
    parser.add_argument("--json", type=Path, default=None)
    given = parser.parse_args()
    with mp.progress() as tell:
        results = study(given.methods, given.motions, given.seed, given.jobs, progress=tell)
    given.output.write_text(study_page(results), encoding="utf-8")
    if given.json is not None:
        table = {f"{motion}, {method}": as_numbers(report_of(one)) for (motion, method), (_, one) in results.items()}
        given.json.write_text(json.dumps(table, indent=1, allow_nan=False), encoding="utf-8")
    print(f"wrote {given.output}")


if __name__ == "__main__":
    main()
