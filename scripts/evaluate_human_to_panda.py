"""Evaluate transfer methods from a human arm to the Panda, and write the table of docs/evaluation.md.

    python scripts/evaluate_human_to_panda.py --details build/evaluation.md

Takes about five minutes. `--methods` takes any names that the command line accepts, `--motions` a choice of the six.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path

import maniport as mp
from maniport.evaluation import Evaluation
from maniport.evaluation.summary import IDENTITY, MEAN_TRANSPORT, TRANSPORT
from maniport.report.renderings import as_markdown, as_numbers
from maniport.report.transfer import evaluation_section
from maniport.report.values import Report, report_of
from maniport.studies.methods import FITTED_METHODS, Motion, study
from maniport.transfer import METHODS
from maniport.util.defaults import AUTO

PAGE = Path(__file__).parent.parent / "docs" / "evaluation.md"
BEGIN, END = "<!-- feasibility gaps -->", "<!-- end of feasibility gaps -->"
Results = Mapping[Motion, Evaluation]


def gap_table(results: Results) -> str:
    """Mean feasibility gap by motion and method, in Markdown."""
    methods = (IDENTITY, MEAN_TRANSPORT, TRANSPORT, *FITTED_METHODS)
    lines = [f"| motion | method | {' | '.join(methods)} |", f"|---|---|{'---|' * len(methods)}"]
    for motion, evaluation in results.items():
        gaps = {row.name: row.feasibility_gap for row in evaluation.rows if row.feasibility_gap is not None}
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
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), gap_table(results)), encoding="utf-8")
    if options.details is not None:
        options.details.write_text(details(results), encoding="utf-8")
    if options.json is not None:
        reports = {motion.name: as_numbers(report_of(evaluation)) for motion, evaluation in results.items()}
        options.json.write_text(json.dumps(reports, indent=1, allow_nan=False), encoding="utf-8")
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
