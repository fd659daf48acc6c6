"""Results written to a folder: data, summaries and the page, whole or not at all."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from maniport.arms import Arm, ArmGroup
from maniport.errors import InvalidInputError
from maniport.motion.exports import FORMATS, NEEDED, SCENE, export_motion
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.trajectory import Trajectory
from maniport.pipeline import BothResult, TransferResult
from maniport.pipeline.both_result import DATA_FILES as BOTH_DATA
from maniport.pipeline.both_result import FOLDERS
from maniport.pipeline.config import CONFIG
from maniport.pipeline.execution import DATA_FILES as MOTION_DATA
from maniport.pipeline.execution import Execution
from maniport.pipeline.learned import DATA_FILES as LEARNED_DATA
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.result import DATA_FILES
from maniport.report.metrics import Report, facts_of
from maniport.report.renderings import PAGE, SUMMARY, files_of, write_facts
from maniport.util.atomic_io import folder_written_whole, require_free
from maniport.util.progress import Progress, Step
from maniport.util.validation import as_choice

if TYPE_CHECKING:
    from maniport.report.page.content import Motion

TOLD = ("summary.md", SUMMARY, PAGE, CONFIG)
FIGURES = ("ellipsoids", "curves", "diffusion_map", "arms", "motion")
"""Figures of a run, which `maniport figures` adds to its folder."""

EXPORTS = tuple(one.file for one in FORMATS.values())
EXECUTION_FILES = (*MOTION_DATA, *TOLD, *EXPORTS, *files_of("motion"))
"""Files of an `Execution`. A folder with other files is not replaced."""
LEARNED_FILES = (*LEARNED_DATA, *TOLD, *files_of("learned"))  # Files of a `LearnedProfile`
RUN_FILES = (*DATA_FILES, *TOLD, *EXPORTS, *files_of(*FIGURES))  # Files of a `TransferResult`
BOTH_FILES = (*BOTH_DATA, *TOLD, *EXPORTS, *files_of("motions", "arms"))
"""Files of a `BothResult`, and folders with `RUN_FILES`."""


def write_results(
    result: TransferResult | BothResult | Execution | LearnedProfile,
    folder: str | os.PathLike[str],
    progress: Progress | None = None,
    exports: Iterable[str] = (),
    *,
    overwrite: bool = False,
) -> Report:
    """Write data, ``run.yaml``, summaries and ``report.html`` to a folder, whole or not at all.

    The folder is made where it is missing. ``result.save(folder)`` writes the data alone, `write_figures` adds figures.

    Parameters
    ----------
    result : TransferResult, BothResult, Execution or LearnedProfile
        The results of each arm of a `BothResult` are in the folders ``left`` and ``right``.
    folder : str or path-like
    progress : callable, optional
        Called with the name of a step and the fraction done.
    exports : str or iterable of str
        Further formats: those of `maniport.motion.export_motion`, and ``"rerun"``, the content of the page in
        ``motion.rrd``.
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
    kinds = (TransferResult, BothResult, Execution, LearnedProfile)
    if not isinstance(result, kinds):
        names = ", ".join(kind.__name__ for kind in kinds)
        raise InvalidInputError(f"result must be one of {names}; found {type(result).__name__}")
    formats = export_files(exports)
    moves = not isinstance(result, LearnedProfile) and (not isinstance(result, BothResult) or result.motion is not None)
    if formats and not moves:
        raise InvalidInputError(f"exports are of a robot's motion, of which there is none; found {sorted(formats)}")
    step, report = Step(progress, "Write results"), facts_of(result)
    if isinstance(result, BothResult):
        require_free_for_both(Path(folder), overwrite)
        own = BOTH_FILES
    else:
        own = {LearnedProfile: LEARNED_FILES, Execution: EXECUTION_FILES}.get(type(result), RUN_FILES)
    with folder_written_whole(folder, own, overwrite) as staging:
        if isinstance(result, BothResult):
            _write_both(result, report, formats, staging)
        elif isinstance(result, LearnedProfile):
            _write_learned(result, report, staging)
        else:
            write_run(result, report, formats, staging)
            write_run_page(result, report, formats, staging)
        if result.config is not None:
            result.config.save(staging / CONFIG)
    step.end()
    return report


def write_run(result: TransferResult | Execution, report: Report, formats: Mapping[str, str], folder: Path) -> None:
    """Write data, summaries and exports of a run or of a motion to a folder that exists."""
    result.write_data(folder)
    _write_summary(report, folder)
    execution = result if isinstance(result, Execution) else result.execution
    if execution is not None:
        _export(execution.motion, execution.robot, formats, folder)


def write_run_page(
    result: TransferResult | Execution, report: Report, formats: Mapping[str, str], folder: Path
) -> "Motion":
    """Write the page of a run or of a motion, and its scene where it is requested; return what they show."""
    from maniport.report.page.motions import motion_of  # slow to load

    motion = motion_of(result)
    _write_page(folder, report, "motion", motion, formats)
    return motion


def _write_both(result: BothResult, report: Report, formats: Mapping[str, str], folder: Path) -> None:
    """Write the results of both arms, those of each arm to a folder of its own."""
    from maniport.report.page.pairs import motion_of_both  # slow to load

    result.write_data(folder)
    of_one = {name: file for name, file in formats.items() if FORMATS[name].robot == NEEDED}
    of_both = {name: file for name, file in formats.items() if name not in of_one}
    motions = []
    for side, one in zip(FOLDERS, result.each, strict=True):
        (folder / side).mkdir(exist_ok=True)
        own = facts_of(one)
        write_run(one, own, of_one, folder / side)
        motions.append(write_run_page(one, own, formats, folder / side))
    _write_summary(report, folder)
    if result.motion is not None:
        _export(result.motion, result.robot, of_both, folder)
    _write_page(folder, report, "pair", motion_of_both(result, motions), formats)


def _write_learned(result: LearnedProfile, report: Report, folder: Path) -> None:
    from maniport.report.page.motions import motion_of_learned  # slow to load

    result.write_data(folder)
    _write_summary(report, folder)
    _write_page(folder, report, "profile", motion_of_learned(result), {})


def _write_page(folder: Path, report: Report, section: str, motion: "Motion", formats: Mapping[str, str]) -> None:
    """Write a page with a motion in a section, and the same as a scene for Rerun where it is requested."""
    from maniport.report.page import write_page
    from maniport.report.scene_file import write_scene

    write_page(folder / PAGE, report, {section: [motion]})
    if SCENE in formats:
        write_scene(folder / FORMATS[SCENE].file, motion)


def _write_summary(report: Report, folder: Path) -> None:
    for name in TOLD[:2]:
        write_facts(folder / name, report)


def _export(motion: Trajectory | RobotMotion, robot: Arm | ArmGroup, formats: Mapping[str, str], folder: Path) -> None:
    """Write a motion in further formats; the scene is written with the page."""
    for name, file in formats.items():
        if name != SCENE:
            export_motion(folder / file, motion, name, robot)


def require_free_for_both(folder: Path, overwrite: bool) -> None:
    """Raise `OutputError` unless results of both arms may be written to a folder without other files."""
    require_free(folder, BOTH_FILES, overwrite)
    for side in FOLDERS:
        if (folder / side).exists():
            require_free(folder / side, RUN_FILES, overwrite)


def export_files(formats: str | Iterable[str]) -> dict[str, str]:
    """Return the names of the files of formats that exist and can be written, by format."""
    names = [formats] if isinstance(formats, str) else formats
    return {name: FORMATS[as_choice(name, "export", FORMATS)].ready for name in names}
