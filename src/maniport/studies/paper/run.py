"""Repeat the paper's experiments and write the results."""

import os
import time as clock
from collections.abc import Callable, Sequence
from pathlib import Path

from maniport.errors import InvalidInputError
from maniport.report.page import write_page
from maniport.report.renderings import files_of, write_report
from maniport.report.values import report_of
from maniport.studies.methods import compare_methods, methods_report
from maniport.studies.paper.human_robot import human_robot
from maniport.studies.paper.known_truth import toy, toy_draw, two_dof
from maniport.studies.paper.outcome import DRAWS, Experiment, fit_quietly
from maniport.studies.paper.report import Reproduction, as_csv, experiment_report
from maniport.transfer import NearestNeighbor, ParallelTransport, RiemannianICP
from maniport.util.atomic_io import folder_written_whole, require_free
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import as_choice, as_count

ALL, HUMAN_ROBOT = "all", "human-robot"
EXPERIMENTS: dict[str, Callable[..., Experiment]] = {"toy": toy, "two-dof": two_dof, HUMAN_ROBOT: human_robot}
FIGURES = {
    "toy": ("toy-ellipsoids",),
    "two-dof": ("two-dof-arms", "two-dof-ellipsoids"),
    "human-robot": ("human-robot-arms", "human-robot-ellipsoids", "human-robot-diffusion"),
}
"""Names of the figures of each experiment, without suffix."""

REPORT = "report.html"
FILES = (
    *(f"{name}{suffix}" for name in EXPERIMENTS for suffix in (".md", ".csv", ".json")),
    *("methods.md", "methods.json"),
    *(file for names in FIGURES.values() for file in files_of(*names)),
    REPORT,
)
"""The files that `reproduce` writes for all experiments, with methods and figures."""


def reproduce(
    which: str,
    output: str | os.PathLike[str],
    seed: int = 0,
    progress: Progress | None = None,
    draws: int = DRAWS,
    methods: Sequence[str] = (),
    figures: bool = False,
    overwrite: bool = False,
) -> Reproduction:
    """Run one or all of the paper's experiments and write tables, and figures, to a folder, whole or not at all."""
    names = tuple(EXPERIMENTS) if as_choice(which, "experiment", (*EXPERIMENTS, ALL)) == ALL else (which,)
    first, count = as_count(seed, "seed", minimum=0), as_count(draws, "draws")
    if methods and HUMAN_ROBOT not in names:
        raise InvalidInputError(f"methods are compared in the experiment {HUMAN_ROBOT!r}; found {which!r}")
    if figures:
        from maniport.util.optional import matplotlib

        matplotlib()  # raises MissingPackageError
    require_free(Path(output), FILES, overwrite)
    report, started = progress or no_progress, clock.perf_counter()
    for adapter in (ParallelTransport(), RiemannianICP(), NearestNeighbor()):
        fit_quietly(adapter, toy_draw(0))  # loads the kernels, which would count as part of the first fit
    with folder_written_whole(output, FILES, overwrite) as folder:
        experiments = []
        for name in names:
            experiments.append(experiment := EXPERIMENTS[name](first, report, draws=count))
            report(experiment.title, 1.0, f"{len(experiment.lines)} results")
            if figures:
                _draw(name, first, folder, report)
            (folder / f"{name}.csv").write_text(as_csv(experiment), encoding="utf-8")
            for suffix in (".md", ".json"):
                drawn = FIGURES[name] if figures else ()
                write_report(folder / f"{name}{suffix}", experiment_report(experiment, drawn))
        compared = compare_methods(methods, first, report) if methods else None
        reproduction = Reproduction(tuple(experiments), first, clock.perf_counter() - started, compared)
        if compared is not None:
            for suffix in (".md", ".json"):
                write_report(folder / f"methods{suffix}", methods_report(compared))
        write_page(folder / REPORT, report_of(reproduction))
    return reproduction


def _draw(name: str, seed: int, folder: Path, progress: Progress) -> None:
    """Draw the figures of an experiment."""
    from maniport.report import figures
    from maniport.studies.paper.figures import DRAWN  # matplotlib is slow to load

    step = f"{name}, figures"
    progress(step, 0.0)
    for title, figure in DRAWN[name](seed).items():
        figures.save(figure, folder / title)
    progress(step, 1.0, ", ".join(FIGURES[name]))
