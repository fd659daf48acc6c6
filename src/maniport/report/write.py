"""Results written to a folder: data, summaries and the page, whole or not at all."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from maniport.errors import InvalidInputError
from maniport.motion.exports import COMPLETE, DATASET, FORMATS, SCENE, export_motion
from maniport.pipeline.config import CONFIG
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.pipeline.results import RESULT_FILES, MotionResult, TransferResult
from maniport.report.describe import report_of
from maniport.report.render import PAGE, SUMMARY, write_report
from maniport.report.values import Report
from maniport.util.atomic_io import folder_written_whole
from maniport.util.progress import Progress, Step
from maniport.util.validation import as_choice

SUMMARIES = "summary.md", SUMMARY


def write_results(
    result: TransferResult | MotionResult | LearnedProfile,
    folder: str | os.PathLike[str],
    progress: Progress | None = None,
    exports: str | Iterable[str] = (),
    *,
    overwrite: bool = False,
) -> Report:
    """Write data, ``run.yaml``, summaries and ``report.html`` to a folder, whole or not at all.

    The folder is made where it is missing. ``result.save(folder)`` writes the data alone, `write_figures` adds figures.

    Parameters
    ----------
    result : TransferResult, MotionResult or LearnedProfile
        The data of several arms are in a folder for each.
    folder : str or path-like
    progress : callable, optional
        Called with the name of a step and the fraction done.
    exports : str or iterable of str
        Further formats: those of `maniport.motion.export_motion`, ``"rerun"``, the content of the page in
        ``motion.rrd``, and ``"lerobot"``, a LeRobot dataset of one episode in the folder ``lerobot``, unless the
        result is red.
    overwrite : bool
        Whether an earlier result in the folder is replaced.

    Returns
    -------
    Report

    Raises
    ------
    InvalidInputError
        When `result` is of another type.
    OutputError
        When the folder holds an earlier result that may not be overwritten, or other files, or cannot be written.
    UnknownNameError, MissingPackageError
        When there is no such format, or its package is missing.
    """
    kinds = (TransferResult, MotionResult, LearnedProfile)
    if not isinstance(result, kinds):
        names = ", ".join(kind.__name__ for kind in kinds)
        raise InvalidInputError(f"result must be one of {names}; found {type(result).__name__}")
    formats = export_files(exports)
    if formats and getattr(result, "motion", None) is None:
        raise InvalidInputError(
            f"exports are of a robot's motion, of which there is none; found {sorted(formats)}"
        )
    step = Step(progress, "Write results")
    with folder_written_whole(folder, RESULT_FILES, overwrite) as staging:
        report = report_of(result)
        write_run(result, report, formats, staging, os.path.abspath(folder))
        result.config.save(staging / CONFIG)
    step.end()
    return report


def write_run(
    result: Any,
    report: Report,
    formats: Mapping[str, str],
    folder: Path,
    place: str,
    pages: bool = True,
) -> None:
    """Write data, summaries, exports and the page of a result to a folder, which will be moved to `place`."""
    result.write_data(folder)
    for name in SUMMARIES:
        write_report(folder / name, report, place)
    for name, file in formats.items():
        if name not in COMPLETE:
            start = result.config.export_start
            export_motion(folder / file, result.motion, name, result.robot, start)
    if DATASET in formats:
        from maniport.report.dataset_export import write_dataset

        write_dataset(folder / FORMATS[DATASET].file, result, report)
    if pages or SCENE in formats:
        from maniport.report.page import write_page  # slow to load
        from maniport.report.page.animation import animation_of
        from maniport.report.page.content import write_scene

        animation = animation_of(result)
        if pages:
            write_page(folder / PAGE, report, animation, place)
        if SCENE in formats:
            write_scene(folder / FORMATS[SCENE].file, animation)


def export_files(formats: str | Iterable[str]) -> dict[str, str]:
    """Return the names of the files of formats, by format, after a check that their packages are installed."""
    names = [formats] if isinstance(formats, str) else formats
    chosen = {name: FORMATS[as_choice(name, "export", FORMATS)] for name in names}
    for exporter in chosen.values():
        exporter.package()
    return {name: exporter.file for name, exporter in chosen.items()}
