"""Results written for people: data, figures, summaries and the page, whole or not at all."""

import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maniport.atomic_io import folder_written_whole, require_free
from maniport.errors import InvalidInputError
from maniport.pipeline import BothResult, TransferResult
from maniport.pipeline.both_result import DATA_FILES as BOTH_DATA
from maniport.pipeline.both_result import FOLDERS
from maniport.pipeline.execution import DATA_FILES as MOTION_DATA
from maniport.pipeline.execution import Execution
from maniport.pipeline.learned import DATA_FILES as LEARNED_DATA
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.result import DATA_FILES
from maniport.profiles.agreement import axis_deviations
from maniport.steps import Progress, Step, counted
from maniport.telling.drawing import Drawing, drawing, of_arms, of_both_arms, of_both_motions, of_motion, of_profiles
from maniport.telling.facts import Facts, facts_of
from maniport.telling.renderings import PAGE, SUMMARY, files_of, write_facts
from maniport.tracking.exports import FORMATS, NEEDED, SCENE, export_motion
from maniport.validation import as_choice

if TYPE_CHECKING:  # slow to load
    from maniport.telling.page.content import Motion

TOLD = ("summary.md", SUMMARY, PAGE)
FIGURES = ("ellipsoids", "curves", "diffusion_map", "arms")
STILLS = {
    "arms": "Person and robot in postures along the motion, with their ellipsoids",
    "ellipsoids": "Ellipsoids of the person and their targets along the motion",
    "motion": "How near the robot comes over time, and its joints within their limits",
    "motions": "How near both arms of the robot come over time, and their joints within their limits",
}
"""Figures that stand for what moves where a page's scripts do not run."""

SCENE_FILE = FORMATS[SCENE].file
"""The format that shows what the page shows, and its file."""
EXPORTS = tuple(one.file for one in FORMATS.values())
EXECUTION_FILES = (*MOTION_DATA, *files_of("motion"), *TOLD, *EXPORTS)
"""The files that `write_results` writes of an `Execution`."""
LEARNED_FILES = (*LEARNED_DATA, *files_of("learned"), *TOLD)
"""The files that it writes of a `LearnedProfile`."""
RUN_FILES = (*DATA_FILES, *files_of("motion", *FIGURES), *TOLD, *EXPORTS)
"""The files that it writes of a `TransferResult`."""
RESULTS = TransferResult, BothResult, Execution, LearnedProfile
BOTH_FILES = (*BOTH_DATA, *files_of("motions", "arms"), *TOLD, *EXPORTS)
"""What it writes of a `BothResult`: files, and folders with `RUN_FILES`, in which formats are that take one arm."""


def write_results(
    result: TransferResult | BothResult | Execution | LearnedProfile,
    folder: str | os.PathLike[str],
    progress: Progress | None = None,
    exports: Iterable[str] = (),
    *,
    overwrite: bool = False,
) -> Facts:
    """Write data, figures, ``summary.md``, ``summary.json`` and ``report.html`` to a folder, whole or not at all.

    The folder is made where it is missing. ``result.save(folder)`` writes the data alone.

    Parameters
    ----------
    result : TransferResult, BothResult, Execution or LearnedProfile
        Of both arms what concerns them is in the folder, and of each what is of a run of one in ``left`` and ``right``.
    folder : str or path-like
    progress : callable, optional
        Called with the name of a step and the fraction done.
    exports : str or iterable of str
        Formats that are written besides: those of the robot's motion (`maniport.tracking.export_motion`), in
        ``joints.yaml``, ``joints.mcap``, ``joints_mujoco.npz`` and ``joints.parquet``; and ``"rerun"``, all that moves
        with its curves (`maniport.telling.scene_file.write_scene`), in ``motion.rrd``.
    overwrite : bool
        Whether an earlier result in the folder is replaced.

    Returns
    -------
    Facts
        What was told.

    Raises
    ------
    InvalidInputError
        When `result` is of another type.
    OutputError
        When the folder holds an earlier result that shall stay, or other things, or cannot be written.
    UnknownNameError, MissingPackageError
        When there is no such format, or its package is missing.

    See Also
    --------
    maniport.pipeline.TransferResult : what is written; its `save` writes the data alone.
    """
    if not isinstance(result, RESULTS):
        names = ", ".join(kind.__name__ for kind in RESULTS)
        raise InvalidInputError(f"result must be one of {names}; found {type(result).__name__}")
    also = export_files(exports)
    step, facts = Step(progress, "write the results"), facts_of(result)
    work: list[Callable[[Path], None]]
    if isinstance(result, LearnedProfile):
        if also:
            raise InvalidInputError(f"exports are of a robot's motion, of which there is none; found {sorted(also)}")
        own, work = LEARNED_FILES, [result.write_data, partial(_tell_learned, result, facts)]
    elif isinstance(result, BothResult):
        require_free_for_both(Path(folder), overwrite)
        own, work = BOTH_FILES, _of_both(result, facts, also)
    else:
        own = EXECUTION_FILES if isinstance(result, Execution) else RUN_FILES
        work = writers(result, facts, also)
    with folder_written_whole(folder, own, overwrite) as staging:
        for write in counted(work, len(work), step):
            write(staging)
    step.end(f"in {os.fspath(folder)}/")
    return facts


def writers(
    result: TransferResult | Execution,
    facts: Facts,
    also: Mapping[str, str],
    page: bool = True,
) -> list[Callable[[Path], None]]:
    """What writes the files of a run, or of a motion, in their order: the page takes pictures of the figures."""
    execution = result if isinstance(result, Execution) else result.execution
    shown = _Shown(result, facts, SCENE in also).work() if page else []
    work: list[Callable[[Path], None]] = [result.write_data, partial(_tell_in_words, facts)]
    if execution is not None:
        work += _exports(execution.motion, execution.robot, also)
    return [*work, *shown]


class _Shown:
    """Figures and page of a run, or of a motion: the page takes pictures of them.

    `motion` is what the page shows moving, once it was written.
    """

    def __init__(self, result: TransferResult | Execution, facts: Facts, scene: bool):
        self._result, self._facts, self._scene = result, facts, scene
        self._run = result if isinstance(result, TransferResult) else None
        execution = result if isinstance(result, Execution) else result.execution
        self._profiles = None if self._run is None else of_profiles(self._run)
        self._figures = [] if self._profiles is None else list(self._profiles.profiles)
        if execution is not None:
            self._figures.append(of_motion(execution))
            if self._run is not None and self._run.spec.part != "full":
                self._figures.insert(-1, of_arms(self._run, execution))
        self._small: dict[str, bytes] = {}
        self.motion: Motion | None = None

    def work(self) -> list[Callable[[Path], None]]:
        """What writes them, in order."""
        return [self._chart, *(partial(_draw, one, self._small) for one in self._figures), self._write]

    def _chart(self, folder: Path) -> None:
        """Draw the map of a run, and make the page's moving part, which shows it too."""
        from maniport.telling.page.motions import motion_of  # slow to load

        charted = None
        if self._profiles is not None:
            charted, drawn = self._profiles.charted()
            drawn.write(folder)
        self.motion = motion_of(self._result, charted)

    def _write(self, folder: Path) -> None:
        assert self.motion is not None
        _write_page(folder, self._facts, "motion", self.motion, self._small, self._scene)


def require_free_for_both(folder: Path, overwrite: bool) -> None:
    """Raise `OutputError` unless results of both arms may be written to a folder, in which nothing else lies."""
    require_free(folder, BOTH_FILES, overwrite)
    for side in FOLDERS:
        if (folder / side).exists():
            require_free(folder / side, RUN_FILES, overwrite)


def _of_both(result: BothResult, facts: Facts, also: Mapping[str, str]) -> list[Callable[[Path], None]]:
    """What writes the files of a run with both arms, those of each arm to a folder of its own."""
    if also and result.motion is None:
        raise InvalidInputError(f"exports are of a robot's motion, of which there is none; found {sorted(also)}")

    def within(side: str, write: Callable[[Path], None], folder: Path) -> None:
        (folder / side).mkdir(exist_ok=True)
        write(folder / side)

    alone = {format: file for format, file in also.items() if format != SCENE and FORMATS[format].robot == NEEDED}
    work: list[Callable[[Path], None]] = [result.write_data, partial(_tell_in_words, facts)]
    if result.motion is not None:
        of_both = {format: file for format, file in also.items() if format not in alone}
        work += _exports(result.motion, result.robot, of_both)
    shown = []
    for side, one in zip(FOLDERS, result.each, strict=True):
        own = facts_of(one)
        shown.append(_Shown(one, own, SCENE in also))
        parts: list[Callable[[Path], None]] = [one.write_data, partial(_tell_in_words, own), *shown[-1].work()]
        parts += [] if one.execution is None else _exports(one.execution.motion, one.robot, alone)
        work += [partial(within, side, write) for write in parts]
    return [*work, *_BothShown(result, facts, shown, SCENE in also).work()]


class _BothShown:
    """Figures of both arms, and the page of both, which shows together what those of each arm show."""

    def __init__(self, result: BothResult, facts: Facts, each: list[_Shown], scene: bool):
        self._result, self._facts, self._each, self._scene = result, facts, each, scene
        self._figures = [] if result.motion is None else [of_both_motions(result)]
        if self._figures and result.left.spec.part != "full":
            self._figures.append(of_both_arms(result))
        self._small: dict[str, bytes] = {}

    def work(self) -> list[Callable[[Path], None]]:
        """What writes them, in order."""
        return [*(partial(_draw, one, self._small) for one in self._figures), self._write]

    def _write(self, folder: Path) -> None:
        from maniport.telling.page.pairs import motion_of_both  # slow to load

        motion = motion_of_both(self._result, [one.motion for one in self._each if one.motion is not None])
        _write_page(folder, self._facts, "pair", motion, self._small, self._scene)


def _draw(figure: Drawing, small: dict[str, bytes], folder: Path) -> None:
    """Write a figure, and keep a small picture of it for the page."""
    drawn = figure()
    drawn.write(folder)
    small[drawn.name] = drawn.small


def _write_page(
    folder: Path, facts: Facts, section: str, motion: "Motion", small: Mapping[str, bytes], scene: bool
) -> None:
    """Write a page with what moves at the head of a section; the same as a scene where it is asked for."""
    from maniport.telling.page import Picture, write_page
    from maniport.telling.scene_file import write_scene

    stills = [Picture(small[name], about, still=True) for name, about in STILLS.items() if name in small]
    write_page(folder / PAGE, facts, {section: [motion, *stills]})
    if scene:
        write_scene(folder / SCENE_FILE, motion)


def export_files(formats: str | Iterable[str]) -> dict[str, str]:
    """Names of files by their formats; see `export_file`."""
    return {one: export_file(one) for one in ([formats] if isinstance(formats, str) else formats)}


def export_file(format: str) -> str:
    """Name of the file of a format, which is there and can be written."""
    return FORMATS[as_choice(format, "export", FORMATS)].ready


def _exports(motion: Any, robot: Any, also: Mapping[str, str]) -> list[Callable[[Path], None]]:
    """What writes a motion in formats for others."""

    def write(format: str, file: str, folder: Path) -> None:
        export_motion(folder / file, motion, format, robot)

    return [partial(write, format, file) for format, file in also.items() if format != SCENE]


def _tell_in_words(facts: Facts, folder: Path) -> None:
    for name in TOLD[:2]:
        write_facts(folder / name, facts)


def _tell_learned(result: LearnedProfile, facts: Facts, folder: Path) -> None:
    """Tell what was learned, with its figure on the page where it can be drawn."""
    from maniport.telling.page import Picture, write_page

    _tell_in_words(facts, folder)
    aligned, pictures = result.alignment, []
    if result.spec.part != "full":
        drawn = drawing(
            "learned", (aligned.time, aligned.ellipsoids, result.paths), (result.time, result.profile, result.path),
            axis_deviations(result.profile, result.covariance), result.agreement.odd, result.spec.unit,
        )()  # fmt: skip
        drawn.write(folder)
        pictures = [Picture(drawn.small, "The demonstrations, and what is learned of them, over time")]
    write_page(folder / PAGE, facts, {"profile": pictures})
