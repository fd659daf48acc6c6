"""What a worker does: one recording, on the robots that are asked for; what it knows of robots and persons it keeps."""

import json
import time as clock
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

from threadpoolctl import threadpool_limits

from maniport.atomic_io import folder_written_whole, written_whole
from maniport.batches.content import as_setting, digest
from maniport.batches.sources import Source
from maniport.batches.table import COMPUTING, failed_row, is_row, row_of
from maniport.bodies.chain import RIGHT
from maniport.bodies.human import human_arm
from maniport.demonstrations import ArmFit, Recording, read_recording
from maniport.errors import ManiportError, on_the_command_line
from maniport.pipeline.parts import Fitted, KnownRobot, Shown
from maniport.pipeline.work import Job
from maniport.telling.facts import facts_of
from maniport.telling.write import RUN_FILES, writers
from maniport.transfer import load_adapter

PAIR = "pair.json"
"""The file with the settings of a pair, the sizes of its files, and its row of the table."""

ADAPTERS = "adapters"
"""The folder of the adapters, which recordings of one person share."""

SHOWN, WIDTH = 3, 60
"""How many differing settings a message names, and the characters of each value."""

DECIMALS = 2
"""A person's lengths are rounded to centimetres before the adapter is fitted, so that recordings of one person share
it: markers give them with an error of some millimetres."""

KEPT = 4
"""What is known of so many robots a worker keeps; of each it is about 60 MB."""

_alone = Lock()
"""Workers of Dask may have several threads; what is caught of warnings belongs to a process."""
_robots: dict[str, KnownRobot] = {}
_adapters: dict[Path, Fitted] = {}


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot of a batch, with all that it shall do.

    Attributes
    ----------
    name : str
        Of its folder.
    job : Job
    key : str
        Digest of all that.
    settings : mapping of str to str
        The same by names, as text.
    """

    name: str
    job: Job
    key: str
    settings: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Order:
    """What is the same for all pairs.

    Attributes
    ----------
    output : Path
    reading : mapping
        What is said of all recordings: unit, up and rate, start and stop.
    profile_rate : float
        Ellipsoids a second, at most [Hz].
    exports : mapping of str to str
        Files by formats.
    pages : bool
    typed : bool
        Whether errors speak to people who type commands.
    """

    output: Path
    reading: Mapping[str, Any]
    profile_rate: float
    exports: Mapping[str, str]
    pages: bool
    typed: bool


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
    """Digest of what stands in a recording; of one that cannot be read, why: whoever reads it will say so."""
    try:
        return digest(sorted(source.path.glob("*.json")) if source.path.is_dir() else source.path)
    except OSError as error:
        return f"unreadable: {error}"


def settings_of(order: Order, content: str, robot: Robot) -> dict[str, str]:
    """Return all that determines the result of a pair, as text by name: robot, recording, all settings, version."""
    reading = {f"reading.{name}": as_setting(value) for name, value in order.reading.items()}
    same = {"profile_rate": order.profile_rate, "exports": order.exports, "pages": order.pages}
    also = {name: as_setting(value) for name, value in same.items()}
    return {**robot.settings, **reading, **also, "recording": content}


def kept_row(order: Order, source: Source, robot: Robot, settings: Mapping[str, str]) -> dict[str, Any] | None:
    """Return the row of a pair that is done with these settings and unchanged since, under its present names."""
    folder = folder_of(order, source, robot)
    found = _written(folder)
    if found is None or found["settings"] != settings or found["files"] != _sizes(folder):
        return None
    names = {"recording": source.name, "robot": robot.name, "folder": folder.relative_to(order.output).as_posix()}
    return {**found["row"], **names}


def difference(folder: Path, settings: Mapping[str, str]) -> str:
    """Return why a folder holds what must not be replaced unless allowed: other settings."""
    if not (folder / PAIR).exists():
        return ""
    found = _written(folder)
    if found is None:
        return f"{PAIR} was changed since"
    earlier = found["settings"]
    names = [name for name in {**settings, **earlier} if settings.get(name) != earlier.get(name)]
    if names:
        values = [f"{name} {_short(earlier, name)}, now {_short(settings, name)}" for name in names[:SHOWN]]
        return "made with " + "; ".join(values) + (f"; and {len(names) - SHOWN} more" if names[SHOWN:] else "")
    changed = [name for name, size in _sizes(folder).items() if found["files"].get(name) != size]
    return f"{', '.join(changed[:SHOWN])} changed since" if changed else ""


def _short(settings: Mapping[str, str], name: str) -> str:
    text = settings.get(name, "not set")
    return text if len(text) <= WIDTH else f"{text[:WIDTH]}…"


def _written(folder: Path) -> dict[str, Any] | None:
    """What was written of a pair, unless it is not there, or is no longer what it was."""
    try:
        found = json.loads((folder / PAIR).read_text(encoding="utf-8"))
        texts = all(isinstance(value, str) for value in found["settings"].values())
        whole = texts and isinstance(found["files"], dict) and is_row(found["row"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return found if whole else None


def _sizes(folder: Path) -> dict[str, int]:
    """Files of a pair with their bytes."""
    return {one.name: one.stat().st_size for one in sorted(folder.iterdir()) if one.name != PAIR}


def _since(begun: float) -> float:
    """Return the processor time that passed [s]."""
    return clock.process_time() - begun


def work(task: Task) -> list[dict[str, Any]]:
    """Let each robot have the recording; the rows of the table, those of failures too."""
    with ExitStack() as stack:
        stack.enter_context(_alone)
        stack.enter_context(threadpool_limits(1))  # as many threads everywhere, so that sums round alike
        if task.order.typed:
            stack.enter_context(on_the_command_line())
        rows, shown = list[dict[str, Any]](), list[Shown]()
        for robot, settings in zip(task.robots, task.settings, strict=True):
            begun = clock.process_time()
            try:
                if not shown:
                    recording = read_part(task.source.path, **task.order.reading)
                    if content_of(task.source) != task.content:
                        raise ManiportError(f"{task.source.path}: it was changed meanwhile; start again")
                    shown.append(robot.job.shown(recording).thinned(task.order.profile_rate))
                rows.append(_pair(task, robot, settings, shown[0], begun))
            except Exception as error:  # noqa: BLE001  one failure does not stop the rest
                rows.append(failed_row(task.source.name, robot.name, reason(error)) | {COMPUTING: _since(begun)})
        return rows


def reason(error: Exception) -> str:
    """Why there is no result, for the table."""
    return str(error) if isinstance(error, ManiportError) else f"unexpected {type(error).__name__}: {error}"


def read_part(
    path: Path,
    unit: str | None = None,
    up: str | None = None,
    rate: float | None = None,
    start: float | None = None,
    stop: float | None = None,
) -> Recording:
    """The part of a recording that is meant."""
    recording = read_recording(path, unit, up, rate)
    return recording if start is None and stop is None else recording.crop(start, stop)


def _pair(task: Task, robot: Robot, settings: Mapping[str, str], shown: Shown, begun: float) -> dict[str, Any]:
    """Transfer the recording to one robot, and write the results."""
    order, job = task.order, robot.job
    known = _known(robot)
    given = None if job.chooses else _adapter(order, robot, known, shown.fit)
    result = job.transferred(shown, known, given)
    facts, folder = facts_of(result), folder_of(order, task.source, robot)
    folder.parent.mkdir(parents=True, exist_ok=True)
    row = row_of(facts, task.source.name, robot.name, folder.relative_to(order.output).as_posix())
    with folder_written_whole(folder, (*RUN_FILES, PAIR), True) as staging:
        for write in writers(result, facts, order.exports, order.pages):
            write(staging)
        row[COMPUTING] = _since(begun)
        about = {"settings": settings, "files": _sizes(staging), "row": row}
        (staging / PAIR).write_text(json.dumps(about, ensure_ascii=False), encoding="utf-8")
    return row


def _known(robot: Robot) -> KnownRobot:
    """What is known of a robot, once in each process."""
    if robot.key not in _robots:
        while len(_robots) >= KEPT:
            del _robots[next(iter(_robots))]
        _robots[robot.key] = robot.job.known()
    return _robots[robot.key]


def _adapter(order: Order, robot: Robot, known: KnownRobot, fit: ArmFit) -> Fitted:
    """The adapter of a person and a robot, and what its fit warned of: from the file, and, where it is none, fitted."""
    lengths = {name: round(length, DECIMALS) for name, length in fit.segment_lengths.items()}
    side = fit.arm.side or RIGHT
    person = human_arm(robot.job.whose["person"], side, lengths=lengths)
    sizes = "-".join(f"{100.0 * length:.0f}" for length in lengths.values())
    file = order.output / ADAPTERS / f"{robot.name}-{side}-{sizes}-{digest(robot.key, person)[:8]}.npz"
    about = file.with_suffix(".json")
    if not (file.exists() and about.exists()):
        file.parent.mkdir(parents=True, exist_ok=True)
        adapter, said = robot.job.fit_adapter(person, known)
        with written_whole(about) as temporary:
            text = json.dumps({"person": fit.arm.name, "side": side, "lengths_m": lengths, "warnings": said})
            temporary.write_text(text, encoding="utf-8")
        adapter.save(file)
    if file not in _adapters:
        _adapters[file] = load_adapter(file), tuple(json.loads(about.read_text(encoding="utf-8"))["warnings"])
    return _adapters[file]
