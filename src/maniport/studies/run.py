"""Repeat the paper's experiments; tables next to its numbers, and how many of these are matched."""

import os
import time as clock
from collections.abc import Iterable, Sequence
from pathlib import Path

from maniport.report.page import write_page
from maniport.report.render import write_report
from maniport.report.values import Report, Section, Table, software
from maniport.studies.experiments import (
    DRAWS,
    OURS,
    PAPER,
    Experiment,
    Line,
    human_robot,
    toy,
    two_dof,
)
from maniport.util.atomic_io import folder_written_whole, require_free
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import as_choice, as_count

EXPERIMENTS = {"toy": toy, "two-dof": two_dof, "human-robot": human_robot}
TABLES = "paper.md", "paper.json"
PAGE = "report.html"
FILES = (*TABLES, PAGE)  # What `reproduce` writes

FORMS = {"per_dispersion": "÷ c", "per_squared_dispersion": "÷ c²"}
"""Forms of the error in the paper's text and in the authors' program, with their column heads."""

LEGEND = (
    "RMSE: root mean squared affine-invariant distance to the truth. ÷ c: divided by the mean distance of the mapped "
    "ellipsoids to their mean, as in the paper's text. ÷ c²: by their mean squared distance, as in the authors' "
    "program. Over several draws: mean ± standard deviation; iterations are means."
)

EXACT = "the truth lies in the model class and the rotation search finds it; the authors' gradient exchanges a pair"
REASONS = {
    "I": EXACT,
    "II": f"{EXACT} (lower); domains that are sampled separately do not determine the rotation in the arm's plane; "
    "parallel transport alone uses no pairs, and even the means of the evaluation trajectories give it no error as "
    "small as printed (400 samples, ÷ c: 1.86, 1.63 and 1.71, with those means 1.23, 1.40 and 1.43, in the paper "
    "0.874, 0.783 and 0.782); the angles of M-Eval-1 to -3 are not all published (higher)",
    "III": "no truth: errors are distances to a lookup, which depend on its samples; the Panda's paths are not "
    "published",
}
"""Reasons for numbers that are lower or higher, by table."""


def reproduce(
    which: str,
    output: str | os.PathLike[str],
    seed: int = 0,
    progress: Progress | None = None,
    draws: int = DRAWS,
    overwrite: bool = False,
) -> Report:
    """Run one or all of the paper's experiments and write tables to a folder, whole or not at all."""
    names: Sequence[str] = (which,)
    if as_choice(which, "experiment", (*EXPERIMENTS, "all")) == "all":
        names = tuple(EXPERIMENTS)
    first = as_count(seed, "seed", minimum=0)
    count = as_count(draws, "draws")
    require_free(Path(output), FILES, overwrite)
    progress = progress or no_progress
    started = clock.perf_counter()
    experiments = list[Experiment]()
    with folder_written_whole(output, FILES, overwrite) as folder:
        for name in names:
            experiment = EXPERIMENTS[name](first, progress, draws=count)
            experiments.append(experiment)
            progress(experiment.title, 1.0, f"{len(experiment.lines)} results")
        report = _report(experiments, first, clock.perf_counter() - started)
        for name in TABLES:
            write_report(folder / name, report)
        write_page(folder / PAGE, report)
    return report


def _report(experiments: Sequence[Experiment], seed: int, seconds: float) -> Report:
    """Return a section for each experiment, and the comparison with the paper."""
    run = Section("Run")
    run.add("Paper", "", None, "Reithmeir, Figueredo and Haddadin, IROS 2022 (arXiv 2208.07588)")
    run.add(
        "Time", "duration", round(seconds, 1), f"{seconds:.0f} s", "Of all experiments.", unit="s"
    )
    run.metrics += tuple(software(seed))
    groups = compare(experiments)
    cells = [tuple(map(str, group.values())) for group in groups]
    table = Table(tuple(groups[0]), tuple(cells), "", "groups", groups)
    lead = "The paper's numbers against ours with the paper's settings; our defaults use the base rotation and damping."
    compared = Section("Comparison with the paper", (), (table,), "comparison", lead)
    return Report(
        "The paper's experiments, repeated",
        "Human-to-robot manipulability transfer by Riemannian ICP: the paper's numbers, its settings repeated, and "
        "maniport's defaults.",
        (*map(_section, experiments), run, compared),
    )


def compare(experiments: Iterable[Experiment], tolerance: float = 0.2) -> list[dict[str, object]]:
    """Count the paper's numbers that are matched, lower and higher, by table, settings and form of the error."""
    ratios: dict[tuple[str, str, str], list[float]] = {}
    for experiment in experiments:
        for line in experiment.lines:
            if not line["table"] or line["settings"] == OURS:
                continue
            for form, head in FORMS.items():
                key = line["table"], line["settings"], head
                ratios.setdefault(key, []).append(line[form] / line["paper_rmse"])
    groups = []
    for (table, settings, error), values in ratios.items():
        lower = 0
        higher = 0
        for value in values:
            if value < 1.0 - tolerance:
                lower += 1
            if value > 1.0 + tolerance:
                higher += 1
        counts = {
            f"within {100 * tolerance:.0f} %": len(values) - lower - higher,
            "lower": lower,
            "higher": higher,
        }
        reason = ""
        if lower + higher:
            reason = REASONS[table]
        groups.append(
            {"table": table, "settings": settings, "error": error, **counts, "reason": reason}
        )
    return groups


def _section(experiment: Experiment) -> Section:
    """Return the paper's rows with our numbers below each, and rows that the paper does not have."""
    lines = list(experiment.lines)
    section = Section(experiment.title, key=experiment.name, text="\n".join(experiment.notes))
    for settings in dict.fromkeys(line["settings"] for line in lines):
        fits = {}  # each once: it has a line for each evaluation set
        for line in lines:
            if line["settings"] == settings:
                fits[line["row"], line["data"], line["samples"], line["method"]] = line
        warned = 0
        draws = 0
        for line in fits.values():
            warned += line["warned"]
            draws += line["draws"]
        if warned:
            section.warn(
                "fits", f"{experiment.title}, {settings}: warnings in {warned} of {draws} fits"
            )
    printed = []
    further = []
    for line in lines:
        if line["table"] is None:
            further.append(line)
        else:
            printed.append(line)
    section.tables = (_pivot(printed, LEGEND, "rows", lines),)
    if further:
        section.tables += (
            _pivot(further, f"Rows that the paper does not have, {FORMS['per_dispersion']}:"),
        )
    return section


def _pivot(
    lines: list[Line], caption: str, key: str = "", value: list[Line] | None = None
) -> Table:
    """Arrange lines as the paper does: a column for each evaluation set, a row for each settings and form."""
    names = "data", "samples", "method"
    columns = list[str]()
    for line in lines:
        if line["evaluation"] not in columns:
            columns.append(line["evaluation"])
    if any(line["paper_iterations"] for line in lines):
        columns.append("iterations")
    rows: dict[tuple[str, ...], dict[str, dict[str, str]]] = {}  # cells by numbers' origin, by data
    for line in lines:
        block = rows.setdefault((line["data"], line["samples"], line["method"]), {})
        for origin, cells in _cells(line).items():
            known = block.setdefault(origin, cells)
            known[line["evaluation"]] = cells[line["evaluation"]]

    written_rows = []
    for data, block in rows.items():
        for origin, cells in block.items():
            numbers = [cells.get(column, "–") for column in columns]
            written_rows.append((*data, origin, *numbers))
    return Table((*names, "numbers of", *columns), tuple(written_rows), caption, key, value)


def _cells(line: Line) -> dict[str, dict[str, str]]:
    """Return the cells of a line by the origin of their numbers, and by column."""
    evaluation = line["evaluation"]
    cells = {}
    if line["table"] is None:
        heads = {"per_dispersion": line["settings"]}
    else:
        iterations = _number(line["paper_iterations"])
        cells["paper"] = {"iterations": iterations, evaluation: _number(line["paper_rmse"])}
        heads = {"per_dispersion": f"{line['settings']} {FORMS['per_dispersion']}"}
        if line["settings"] == PAPER:
            heads = {form: f"{line['settings']} {head}" for form, head in FORMS.items()}
    for form, origin in heads.items():
        text = _number(line[form])
        if line["draws"] > 1:
            text += f" ± {_number(line[f'{form}_spread'])}"
        cells[origin] = {"iterations": f"{line['iterations']:.3g}", evaluation: text}
    return cells


def _number(value: float | str | None) -> str:
    """Three decimals, or the power of ten of small values."""
    if value is None:
        return "–"
    if isinstance(value, int | str):
        return str(value)
    if value >= 1e-3 or value == 0:
        return f"{value:.3f}"
    return f"{value:.0e}"
