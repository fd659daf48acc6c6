"""Results written for people: data, figures, summaries and the page, whole or not at all."""

import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maniport.errors import InvalidInputError
from maniport.files import folder_written_whole
from maniport.optional import rerun
from maniport.pipeline import TransferResult
from maniport.pipeline.execution import DATA_FILES as MOTION_DATA
from maniport.pipeline.execution import Execution
from maniport.pipeline.learned import DATA_FILES as LEARNED_DATA
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.result import DATA_FILES
from maniport.profiles.agreement import axis_deviations
from maniport.steps import Progress, Step, counted
from maniport.telling.facts import Facts, facts_of
from maniport.telling.renderings import PAGE, SUMMARY, files_of, write_facts
from maniport.telling.roles import ACHIEVED, PERSON, TARGET
from maniport.tracking.exports import FORMATS, export_motion
from maniport.validation import Array, as_choice

if TYPE_CHECKING:  # slow to load
    from maniport.telling.page import Picture
    from maniport.telling.page.motions import Charted

TOLD = ("summary.md", SUMMARY, PAGE)
FIGURES = ("ellipsoids", "curves", "diffusion_map", "arms")
STILLS = {
    "arms": "Person and robot in postures along the motion, with their ellipsoids",
    "ellipsoids": "Ellipsoids of the person and their targets along the motion",
    "motion": "How near the robot comes over time, and its joints within their limits",
}
"""Figures that stand for what moves where a page's scripts do not run."""
STILL_COLORS = 256
"""So many keep pale blue apart from pale green."""

SCENE, SCENE_FILE = "rerun", "motion.rrd"
"""The format that shows what the page shows, and its file."""
EXPORTS = (*(one.file for one in FORMATS.values()), SCENE_FILE)
EXECUTION_FILES = (*MOTION_DATA, *files_of("motion"), *TOLD, *EXPORTS)
"""The files that `write_results` writes of an `Execution`."""
LEARNED_FILES = (*LEARNED_DATA, *files_of("learned"), *TOLD)
"""The files that it writes of a `LearnedProfile`."""
RUN_FILES = (*DATA_FILES, *files_of("motion", *FIGURES), *TOLD, *EXPORTS)
"""The files that it writes of a `TransferResult`."""


def write_results(
    result: TransferResult | Execution | LearnedProfile,
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
    result : TransferResult, Execution or LearnedProfile
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
    OutputError
        When the folder holds an earlier result that shall stay, or other things, or cannot be written.
    UnknownNameError, MissingPackageError
        When there is no such format, or its package is missing.
    """
    also = export_files(exports)
    step, facts = Step(progress, "write the results"), facts_of(result)
    work: list[Callable[[Path], None]]
    if isinstance(result, LearnedProfile):
        if also:
            raise InvalidInputError(f"exports are of a robot's motion, of which there is none; found {sorted(also)}")
        own, work = LEARNED_FILES, [result.write_data, partial(_tell_learned, result, facts)]
    else:
        own = EXECUTION_FILES if isinstance(result, Execution) else RUN_FILES
        work = writers(result, facts, also)
    with folder_written_whole(folder, own, overwrite) as staging:
        for write in counted(work, len(work), step):
            write(staging)
    step.end(f"in {os.fspath(folder)}/")
    return facts


def writers(
    result: TransferResult | Execution, facts: Facts, also: Mapping[str, str], page: bool = True
) -> list[Callable[[Path], None]]:
    """What writes the files of a run, or of a motion, in their order: the page takes pictures from the folder.

    Parameters
    ----------
    result, facts
    also : mapping of str to str
        What `export_files` made of the formats that are written besides.
    page : bool
        Whether figures and page are written, which takes longer than all else.
    """
    run = result if isinstance(result, TransferResult) else None
    execution = result if isinstance(result, Execution) else result.execution
    work: list[Callable[[Path], None]] = [result.write_data]
    if page and run is not None and run.spec.part != "full":
        work += [partial(_draw_ellipsoids, run)]
    if execution is not None:
        work += [partial(_draw_motion, execution)] if page else []
        work += [partial(_export, execution, file, one) for one, file in also.items() if one != SCENE]
    return [*work, partial(_tell_in_words, facts), *([partial(_tell, result, facts, SCENE in also)] if page else [])]


def export_files(formats: str | Iterable[str]) -> dict[str, str]:
    """Names of files by their formats; see `export_file`."""
    return {one: export_file(one) for one in ([formats] if isinstance(formats, str) else formats)}


def export_file(format: str) -> str:
    """Name of the file of a format, which is there and can be written.

    Raises
    ------
    UnknownNameError, MissingPackageError
        When there is no such format, or its package is missing.
    """
    if as_choice(format, "export", (*FORMATS, SCENE)) != SCENE:
        return FORMATS[format].ready
    rerun()
    return SCENE_FILE


def _export(execution: Execution, file: str, format: str, folder: Path) -> None:
    export_motion(folder / file, execution.motion, format, execution.robot)


def _tell_in_words(facts: Facts, folder: Path) -> None:
    for name in TOLD[:2]:
        write_facts(folder / name, facts)


def _tell(result: TransferResult | Execution, facts: Facts, scene: bool, folder: Path) -> None:
    from maniport.telling.page import write_page  # what follows is slow to load
    from maniport.telling.page.motions import charted_of, motion_of
    from maniport.telling.scene_file import write_scene

    charted = None
    if isinstance(result, TransferResult):  # figure and page show one map
        charted = charted_of(result)
        _draw_domains(result, charted, folder)
    motion = motion_of(result, charted)
    write_page(folder / PAGE, facts, {"motion": [motion, *_stills(folder)]})
    if scene:
        write_scene(folder / SCENE_FILE, motion)


def _tell_learned(result: LearnedProfile, facts: Facts, folder: Path) -> None:
    """Tell what was learned, with its figure on the page where it can be drawn."""
    from maniport.telling import figures
    from maniport.telling.page import write_page

    _tell_in_words(facts, folder)
    aligned, pictures = result.alignment, []
    if result.spec.part != "full":
        figure = figures.learned(
            (aligned.time, aligned.ellipsoids, result.paths), (result.time, result.profile, result.path),
            axis_deviations(result.profile, result.covariance), result.agreement.odd, result.spec.unit,
        )  # fmt: skip
        figures.save(figure, folder / "learned")
        pictures = [_picture(folder / "learned.png", "The demonstrations, and what is learned of them, over time")]
    write_page(folder / PAGE, facts, {"profile": pictures})


def _stills(folder: Path) -> "list[Picture]":
    """Make small pictures of the figures, for where a page's scripts do not run."""
    files = {folder / f"{name}.png": about for name, about in STILLS.items()}
    return [_picture(file, about, still=True) for file, about in files.items() if file.exists()]


def _picture(file: Path, about: str, still: bool = False) -> "Picture":
    """A smaller one, of few colours."""
    from PIL import Image  # matplotlib needs it

    from maniport.telling.page import Picture

    stream = BytesIO()
    with Image.open(file) as image:
        small = image.convert("RGB").resize((image.width // 2, image.height // 2), Image.Resampling.LANCZOS)
    small.quantize(STILL_COLORS, dither=Image.Dither.NONE).save(stream, "png", optimize=True)
    return Picture(stream.getvalue(), about, still=still)


def _draw_ellipsoids(result: TransferResult, folder: Path) -> None:
    """Draw the profiles before and after, and person and robot with their ellipsoids."""
    from maniport.telling import figures

    profiles, roles = _profiles(result, result.demonstrated_profile, result.target_profile)
    unit = result.spec.unit
    figures.save(figures.ellipsoids(result.time, profiles, unit=unit, roles=roles), folder / "ellipsoids")
    figures.save(figures.curves(result.time, profiles, unit, roles), folder / "curves")
    if result.execution is None:
        return
    spec, robot, motion = result.spec, result.robot, result.execution.motion
    skeletons = {
        "person": result.fit.arm.skeleton(result.fit.joint_angles),
        robot.name: robot.skeleton(motion.joint_positions),
    }
    # the robot follows velocity ellipsoids, whatever kind was transferred: both are drawn in their unit
    force = spec.kind == "force"
    person = np.linalg.inv(result.demonstrated_profile) if force else result.demonstrated_profile
    note = "velocity ellipsoids: the inverses of the force ellipsoids" if force else ""
    figure = figures.arms(
        skeletons, {"person": person, robot.name: motion.achieved}, unit=spec.velocity.unit, note=note,
        roles={"person": PERSON.name, robot.name: ACHIEVED.name},
    )  # fmt: skip
    figures.save(figure, folder / "arms")


def _draw_domains(result: TransferResult, charted: "Charted", folder: Path) -> None:
    from maniport.telling import figures

    robot = result.robot.name
    domains = {"person": charted.domains[PERSON.name], robot: charted.domains[ACHIEVED.name]}
    profiles, roles = _profiles(result, charted.profiles[PERSON.name], charted.profiles[TARGET.name])
    roles |= {robot: ACHIEVED.name}
    figure = figures.diffusion_map(domains, profiles, time=result.time, roles=roles, chart=charted.chart)
    figures.save(figure, folder / "diffusion_map")


def _profiles(result: TransferResult, person: Array, target: Array) -> tuple[dict[str, Array], dict[str, str]]:
    """Name the person's ellipsoids and the target, and tell whose they are."""
    goal = f"target for {result.robot.name}"
    return {"person": person, goal: target}, {"person": PERSON.name, goal: TARGET.name}


def _draw_motion(execution: Execution, folder: Path) -> None:
    """Draw how well the robot follows over time, and its joints within their limits."""
    from maniport.telling import figures

    found, names = execution.motion, execution.motion.joint_names
    limits = zip(execution.robot.lower.tolist(), execution.robot.upper.tolist(), strict=True)
    figure = figures.motion(
        found.time,
        found.distance,
        dict(zip(names, found.joint_positions.T, strict=True)),
        dict(zip(names, limits, strict=True)),
        found.position_error,
        dict(zip(names, found.joint_units, strict=True)),
    )
    figures.save(figure, folder / "motion")
