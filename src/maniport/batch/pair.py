"""What a worker does: it transfers one recording to robots, and keeps what it computed of robots and persons."""

import json
import time as clock
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any

from threadpoolctl import threadpool_limits

from maniport.arms.chain import RIGHT
from maniport.arms.human import human_arm
from maniport.batch.content import digest
from maniport.batch.inputs import Robot, Source
from maniport.batch.table import COMPUTING, failed_row, is_row, row_of
from maniport.errors import ManiportError, on_the_command_line
from maniport.mocap import ArmFit
from maniport.pipeline import stages
from maniport.pipeline.config import CONFIG
from maniport.pipeline.options import HumanOptions
from maniport.pipeline.transfer import follow_person, recorded
from maniport.pipeline.values import FittedMap, Human, SampledRobot
from maniport.report.metrics import report_of
from maniport.report.write import RUN_FILES, write_run
from maniport.transfer import load_adapter
from maniport.util.atomic_io import folder_written_whole, written_whole

PAIR = "pair.json"  # The file with the settings of a pair, the sizes of its files, and its row of the table

ADAPTERS = "adapters"  # The folder of the adapters, which recordings of one person share

Warnings = tuple[str, ...]

_alone = Lock()  # Workers of Dask may have several threads, and warnings are caught for a whole process
_robots: dict[str, tuple[SampledRobot, Warnings]] = {}
_maps: dict[Path, tuple[FittedMap, Warnings]] = {}


@dataclass(frozen=True, eq=False)
class Order:
    """What is the same for all pairs."""

    output: Path
    human: HumanOptions  # options of reading
    profile_rate: float  # Ellipsoids a second, at most [Hz]
    exports: Mapping[str, str]  # Files by formats
    pages: bool
    typed: bool  # Whether errors name options of the command line


@dataclass(frozen=True, eq=False)
class Task:
    """A recording with the digest of its content, and robots with the settings of each pair."""

    order: Order
    source: Source
    content: str
    robots: tuple[Robot, ...]
    settings: tuple[Mapping[str, str], ...]


def folder_of(order: Order, source: Source, robot: Robot) -> Path:
    """Where the results of a pair are."""
    return order.output / robot.name / source.name


def content_of(source: Source) -> str:
    """Digest of a recording's files; where they cannot be read, why: reading the recording will report it."""
    try:
        return digest(sorted(source.path.glob("*.json")) if source.path.is_dir() else source.path)
    except OSError as error:
        return f"unreadable: {error}"


def settings_of(order: Order, content: str, robot: Robot) -> dict[str, str]:
    """Return all that determines the result of a pair, as text by name: robot, recording, all settings, version."""
    return {**robot.settings, "recording": content}


def kept_row(order: Order, source: Source, robot: Robot, settings: Mapping[str, str]) -> dict[str, Any] | None:
    """Return the row of a pair that is done with these settings and unchanged since, under its present names."""
    folder = folder_of(order, source, robot)
    found = _read_pair(folder)
    if found is None or found["settings"] != settings or found["files"] != _sizes(folder):
        return None
    names = {"recording": source.name, "robot": robot.name, "folder": folder.relative_to(order.output).as_posix()}
    return {**found["row"], **names}


def difference(folder: Path, settings: Mapping[str, str], shown: int = 3, width: int = 60) -> str:
    """Return why a folder holds a result that must not be replaced: other settings, the first ones by name."""

    def short(values: Mapping[str, str], name: str) -> str:
        text = values.get(name, "not set")
        return text if len(text) <= width else f"{text[:width]}…"

    if not (folder / PAIR).exists():
        return ""
    found = _read_pair(folder)
    if found is None:
        return f"{PAIR} was changed since"
    earlier = found["settings"]
    names = [name for name in {**settings, **earlier} if settings.get(name) != earlier.get(name)]
    if names:
        values = [f"{name} {short(earlier, name)}, now {short(settings, name)}" for name in names[:shown]]
        return "made with " + "; ".join(values) + (f"; and {len(names) - shown} more" if names[shown:] else "")
    changed = [name for name, size in _sizes(folder).items() if found["files"].get(name) != size]
    return f"{', '.join(changed[:shown])} changed since" if changed else ""


def _read_pair(folder: Path) -> dict[str, Any] | None:
    """Read the file of a pair; None where it is missing or was changed."""
    try:
        found = json.loads((folder / PAIR).read_text(encoding="utf-8"))
        texts = all(isinstance(value, str) for value in found["settings"].values())
        whole = texts and isinstance(found["files"], dict) and is_row(found["row"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return found if whole else None


def _sizes(folder: Path) -> dict[str, int]:
    """Files of a pair with their bytes."""
    return {file.name: file.stat().st_size for file in sorted(folder.iterdir()) if file.name != PAIR}


def work(task: Task) -> list[dict[str, Any]]:
    """Transfer the recording to each robot; return the rows of the table, those of failures too."""
    with ExitStack() as stack:
        stack.enter_context(_alone)
        stack.enter_context(threadpool_limits(1))  # as many threads everywhere, so that sums round alike
        if task.order.typed:
            stack.enter_context(on_the_command_line())
        rows, human = list[dict[str, Any]](), list[tuple[Human, Warnings]]()
        for robot, settings in zip(task.robots, task.settings, strict=True):
            begun = clock.process_time()
            try:
                if not human:
                    recording = task.order.human.read(task.source.path)
                    if content_of(task.source) != task.content:
                        raise ManiportError(f"{task.source.path}: it changed during the batch; start again")
                    fitted, texts = recorded(partial(stages.fit_human, recording, robot.job))
                    human.append((fitted.subsampled(task.order.profile_rate), texts))
                rows.append(_pair(task, robot, settings, *human[0], begun))
            except Exception as error:  # noqa: BLE001  one failure does not stop the rest
                rows.append(
                    failed_row(task.source.name, robot.name, reason(error)) | {COMPUTING: clock.process_time() - begun}
                )
        return rows


def reason(error: Exception) -> str:
    """Why there is no result, for the table."""
    return str(error) if isinstance(error, ManiportError) else f"unexpected {type(error).__name__}: {error}"


def _pair(
    task: Task, robot: Robot, settings: Mapping[str, str], human: Human, texts: Warnings, begun: float
) -> dict[str, Any]:
    """Transfer the recording to one robot, and write the results."""
    order, selects = task.order, robot.job.adapter is None
    sampled, of_robot = _sampled(robot)
    if selects:
        maps, of_map = recorded(partial(stages.fit_transfer, human, sampled, robot.job))
    else:
        fitted, of_map = _fitted(order, robot, sampled, human.fits[0])
        maps = (fitted,)
    result, own = recorded(partial(follow_person, human, sampled, maps, robot.job, baselines=selects))
    result = replace(result, warnings=tuple(dict.fromkeys((*texts, *of_robot, *of_map, *own))))
    facts, folder = report_of(result), folder_of(order, task.source, robot)
    folder.parent.mkdir(parents=True, exist_ok=True)
    row = row_of(facts, task.source.name, robot.name, folder.relative_to(order.output).as_posix())
    with folder_written_whole(folder, (*RUN_FILES, PAIR), True) as staging:
        write_run(result, facts, order.exports, staging, order.pages)
        replace(robot.job.config, recording=(str(task.source.path),), verb="batch").save(staging / CONFIG)
        row[COMPUTING] = clock.process_time() - begun
        about = {"settings": settings, "files": _sizes(staging), "row": row}
        (staging / PAIR).write_text(json.dumps(about, ensure_ascii=False), encoding="utf-8")
    return row


def _sampled(robot: Robot, most: int = 4) -> tuple[SampledRobot, Warnings]:
    """Sample a robot once in each process; of so many robots the samples are kept, about 60 MB each."""
    if robot.key not in _robots:
        while len(_robots) >= most:
            del _robots[next(iter(_robots))]
        _robots[robot.key] = recorded(partial(stages.sample_robot, robot.job))
    return _robots[robot.key]


def _fitted(order: Order, robot: Robot, sampled: SampledRobot, fit: ArmFit) -> tuple[FittedMap, Warnings]:
    """Return the map from a person to a robot, and the warnings of its fit, from the file or fitted.

    Lengths are rounded to a centimeter, so that recordings of one person share it: markers give them with errors of
    some millimeters.
    """
    lengths = {name: round(length, 2) for name, length in fit.segment_lengths.items()}
    side = fit.arm.side or RIGHT
    person = human_arm(robot.job.config.human.person, side, lengths=lengths)
    sizes = "-".join(f"{100.0 * length:.0f}" for length in lengths.values())
    file = order.output / ADAPTERS / f"{robot.name}-{side}-{sizes}-{digest(robot.key, person)[:8]}.npz"
    about = file.with_suffix(".json")
    if not (file.exists() and about.exists()):
        file.parent.mkdir(parents=True, exist_ok=True)
        fitted, texts = recorded(partial(stages.fit_map, person, None, sampled, robot.job))
        with written_whole(about) as temporary:
            text = json.dumps({"person": fit.arm.name, "side": side, "lengths_m": lengths, "warnings": texts})
            temporary.write_text(text, encoding="utf-8")
        fitted.adapter.save(file)
    if file not in _maps:
        texts = tuple(json.loads(about.read_text(encoding="utf-8"))["warnings"])
        teacher = stages.sample_teacher(person, robot.job)
        _maps[file] = FittedMap(load_adapter(file), teacher, 0.0), texts
    return _maps[file]
