"""Repeat the paper's experiments and write the results."""

import csv
import os
import time as clock
from collections.abc import Callable
from pathlib import Path

from maniport.report.page import write_page
from maniport.report.renderings import write_report
from maniport.report.values import Report, report_of
from maniport.studies.paper.experiments import DRAWS, Experiment, fit_quietly, human_robot, toy, toy_draw, two_dof
from maniport.studies.paper.report import Reproduction, experiment_section
from maniport.transfer import NearestNeighbor, ParallelTransport, RiemannianICP
from maniport.util.atomic_io import folder_written_whole, require_free
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import as_choice, as_count

ALL = "all"
EXPERIMENTS: dict[str, Callable[..., Experiment]] = {"toy": toy, "two-dof": two_dof, "human-robot": human_robot}
REPORT = "report.html"
FILES = (
    *(f"{name}{suffix}" for name in EXPERIMENTS for suffix in (".md", ".csv", ".json")),
    REPORT,
)
"""The files that `reproduce` writes for all experiments."""


def reproduce(
    which: str,
    output: str | os.PathLike[str],
    seed: int = 0,
    progress: Progress | None = None,
    draws: int = DRAWS,
    overwrite: bool = False,
) -> Reproduction:
    """Run one or all of the paper's experiments and write tables to a folder, whole or not at all."""
    names = tuple(EXPERIMENTS) if as_choice(which, "experiment", (*EXPERIMENTS, ALL)) == ALL else (which,)
    first, count = as_count(seed, "seed", minimum=0), as_count(draws, "draws")
    require_free(Path(output), FILES, overwrite)
    progress, started = progress or no_progress, clock.perf_counter()
    for adapter in (ParallelTransport(), RiemannianICP(), NearestNeighbor()):
        fit_quietly(adapter, toy_draw(0))  # loads the kernels, which would count as part of the first fit
    with folder_written_whole(output, FILES, overwrite) as folder:
        experiments = []
        for name in names:
            experiments.append(experiment := EXPERIMENTS[name](first, progress, draws=count))
            progress(experiment.title, 1.0, f"{len(experiment.lines)} results")
            with open(folder / f"{name}.csv", "w", encoding="utf-8", newline="") as stream:
                table = csv.DictWriter(stream, list(experiment.lines[0]), lineterminator="\n")
                table.writeheader()
                table.writerows(experiment.lines)
            for suffix in (".md", ".json"):
                write_report(
                    folder / f"{name}{suffix}", Report(experiment.title, "", (experiment_section(experiment),))
                )
        reproduction = Reproduction(tuple(experiments), first, clock.perf_counter() - started)
        write_page(folder / REPORT, report_of(reproduction))
    return reproduction
