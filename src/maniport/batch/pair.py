"""What a worker does: it transfers one recording to robots, and keeps what it computed of robots and persons."""

import json
import time as clock
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from socket import gethostname
from tempfile import TemporaryDirectory
from threading import Lock
from typing import NamedTuple

from threadpoolctl import threadpool_limits

from maniport.arms import as_group
from maniport.arms.chain import RIGHT
from maniport.arms.human import human_arm
from maniport.batch.inputs import Robot, Source, digest
from maniport.batch.parquet_tables import FileStamp, PackedResult
from maniport.batch.table import COMPUTING, Row, failed_row, is_row, row_of
from maniport.errors import ManiportError, on_the_command_line
from maniport.mocap import ArmFit
from maniport.pipeline.config import CONFIG
from maniport.pipeline.extensions import load_extensions
from maniport.pipeline.human import Human
from maniport.pipeline.results import RESULT_FILES, TransferResult
from maniport.pipeline.transfer import FittedMap, Transfer, sample_teacher
from maniport.report.describe import report_of
from maniport.report.values import Report, listed
from maniport.report.write import export_files, write_run
from maniport.transfer import load_adapter
from maniport.util.atomic_io import folder_written_whole, write_text
from maniport.util.defaults import ABOUT
from maniport.version import __version__

PAIR = "pair.json"  # file with the settings of a pair and its row of the table
ADAPTERS = "adapters"  # folder of the adapters, which recordings of one person share

MOST_MAPS = 64
"""Maps that a process keeps, 0.3 MB each; recordings of one person follow one another."""
UNREADABLE = "unreadable"  # start of the digest of a recording that cannot be read
SAME_FOLDERS = "workers need the same folders, at the same paths"

# Workers of Dask may have several threads, and warnings are caught for a whole process.
_alone = Lock()
_maps: dict[Path, FittedMap] = {}


class Saved(NamedTuple):
    """What the file of a pair holds."""

    settings: dict[str, str]  # digests of all that determines the result
    row: Row


@dataclass(frozen=True, eq=False)
class Pair:
    """A recording on a robot."""

    output: Path  # folder of the batch
    source: Source
    content: str  # digest of the recording when the batch began; empty in a packed batch
    robot: Robot
    typed: bool = False  # whether errors name options of the command line
    adapters: Path | None = (
        None  # folder of the maps of a packed batch, which has no folders of pairs
    )

    @property
    def names(self) -> tuple[str, str]:
        """Names of recording and robot."""
        return self.source.name, self.robot.name

    @property
    def folder(self) -> Path:
        """Where the results are."""
        return self.output / self.robot.name / self.source.name

    @property
    def settings(self) -> dict[str, str]:
        """Digests of all that determines the result: robot, recording, options and version."""
        return {**self.robot.settings, "recording": self.content}

    def kept_row(self) -> Row | None:
        """Return the row of the pair, under its present names, if its result has these settings."""
        saved = self._saved()
        if saved is None or saved.settings != self.settings:
            return None
        recording, robot = self.names
        folder = self.folder.relative_to(self.output).as_posix()
        return {**saved.row, "recording": recording, "robot": robot, "folder": folder}

    def difference(self) -> str:
        """Return in which settings the folder holds another result; empty where it holds none."""
        saved = self._saved()
        if saved is not None:
            return differing(self.settings, saved.settings)
        if (self.folder / PAIR).exists():
            return f"{PAIR} was changed"
        return ""

    def discard(self) -> None:
        """Let a later call repeat the pair, if the folder claims to have its result."""
        if self.kept_row() is not None:
            with suppress(OSError):
                (self.folder / PAIR).unlink()

    def _saved(self) -> Saved | None:
        """Read the file of the pair; None where it is missing or was changed."""
        try:
            content = json.loads((self.folder / PAIR).read_text(encoding="utf-8"))
            saved = Saved(content["settings"], content["row"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if isinstance(saved.settings, dict) and is_row(saved.row):
            return saved
        return None


def differing(settings: Mapping[str, str], earlier: Mapping[str, str]) -> str:
    """Name the settings in which an earlier result differs."""
    different = []
    for name in {**settings, **earlier}:
        if settings.get(name) != earlier.get(name):
            different.append(name)
    return "made with another " + listed(different)


def content_of(source: Source) -> str:
    """Digest of a recording's files; where they cannot be read, why: reading the recording will report it."""
    try:
        if source.path.is_dir():
            return digest(sorted(source.path.glob("*.json")))
        return digest(source.path)
    except OSError as error:
        return f"{UNREADABLE}: {error}"


def reason(error: Exception) -> str:
    """Why there is no result, for the table."""
    if isinstance(error, ManiportError):
        return str(error)
    if isinstance(error, OSError) and error.filename is not None:  # such as a read-only folder
        return f"{error.filename}: {error.strerror}"
    return f"unexpected {type(error).__name__}: {error}"


class Packed(NamedTuple):
    """What a worker returns of a pair of a packed batch."""

    stamp: FileStamp
    content: str  # digest of the recording
    result: PackedResult


@dataclass(frozen=True)
class Outcome:
    """What a worker returns of a pair: its row of the table, and what to find in its folder."""

    row: Row
    host: str = ""  # name of the worker's computer; empty where its process ended
    content: str = ""  # digest of the folder that was written; empty for a failure
    packed: Packed | None = None

    def is_visible(self, pair: Pair) -> bool:
        """Return whether the folder of the pair, where it has one, has what the worker wrote."""
        if pair.adapters is not None:
            return True
        try:
            return folder_content(pair.folder) == self.content
        except OSError:  # such as a file that vanished in the meantime
            return False

    @property
    def failed(self) -> bool:
        """Whether there is no result."""
        return bool(self.row["state"] == "failed")

    def reported(self, with_host: bool) -> "Outcome":
        """Return a failure; where workers are on other computers, its reason names the host."""
        if not (with_host and self.host):
            return self
        row = self.row | {"reason": f"{self.row['reason']} (worker on {self.host!r})"}
        return replace(self, row=row)

    def missing(self) -> Row:
        """Return the row of a failure for a pair whose folder does not have what the worker wrote."""
        reason = (
            f"what the worker on {self.host!r} wrote is missing or different here; {SAME_FOLDERS}"
        )
        row = failed_row(self.row["recording"], self.row["robot"], reason)
        return row | {COMPUTING: self.row[COMPUTING]}


def folder_content(folder: Path) -> str:
    """Digest of names and contents of all files of a folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    names = [path.relative_to(folder).as_posix() for path in files]
    return digest(names, files)


def require_same_place(pair: Pair) -> None:
    """Raise `ManiportError` where this process does not see the files of the batch, or has another version."""
    if pair.robot.settings["maniport"] != digest(__version__):
        raise ManiportError(
            f"the worker has maniport {__version__}, another version than the batch; "
            "install the same version"
        )
    needed = []
    if pair.adapters is None:  # workers of a packed batch write nothing there
        needed.append(pair.output / ABOUT)
    if not pair.content.startswith(UNREADABLE):
        needed.append(pair.source.path)
    for path in needed:
        if not path.exists():
            raise ManiportError(f"the worker does not see {str(path)!r}; {SAME_FOLDERS}")


def work(pairs: Sequence[Pair]) -> list[Outcome]:
    """Transfer a recording to several robots; return an outcome for each, failures too."""
    load_extensions()  # a worker is another process
    outcomes = list[Outcome]()
    humans = dict[HumanKey, Human]()
    with ExitStack() as stack:
        stack.enter_context(_alone)
        # as many threads everywhere, so that sums round equally
        stack.enter_context(threadpool_limits(1))
        if pairs[0].typed:
            stack.enter_context(on_the_command_line())
        for pair in pairs:
            outcomes.append(_outcome(pair, humans))
    return outcomes


HumanKey = tuple[object, ...]
"""Side of the person and bases of the robot: what a fit of the person depends on within a batch."""


def _outcome(pair: Pair, humans: dict[HumanKey, Human]) -> Outcome:
    """Transfer a recording to one robot; `humans` are the fits of the person so far."""
    host = gethostname()
    begun = clock.process_time()
    try:
        require_same_place(pair)
        transfer = _transfer_to(pair.robot)
        if pair.adapters is not None:
            return _pack(pair, transfer, humans, begun)
        human = _human(pair, transfer, humans)
        row, content = _write(pair, transfer, human, begun)
    except Exception as error:  # noqa: BLE001  one failure does not stop the rest
        row = failed_row(*pair.names, reason(error))
        row[COMPUTING] = clock.process_time() - begun
        return Outcome(row, host)
    return Outcome(row, host, content)


def _pack(pair: Pair, transfer: Transfer, humans: dict[HumanKey, Human], begun: float) -> Outcome:
    """Transfer the recording to one robot; return what a packed batch writes of it."""
    stamp = FileStamp.of(pair.source.path)
    pair = replace(pair, content=content_of(pair.source))
    human = _human(pair, transfer, humans)
    if FileStamp.of(pair.source.path) != stamp:
        raise ManiportError(f"{pair.source.path}: it changed during the batch; start again")
    result = _transferred(pair, transfer, human)
    row = _row(pair, result, report_of(result), "")
    packed = Packed(stamp, pair.content, PackedResult.of(result))
    row[COMPUTING] = clock.process_time() - begun
    return Outcome(row, gethostname(), packed=packed)


def _human(pair: Pair, transfer: Transfer, humans: dict[HumanKey, Human]) -> Human:
    """Fit the person, or take the fit for another robot with the same side and bases; other options are the batch's."""
    job = pair.robot.job
    key: HumanKey = (job.config.side,)
    if len(job.arms) > 1:
        key += tuple(map(tuple, as_group(job.robot).base_positions))
    if key not in humans:
        recording = transfer.read_part(pair.source.path)
        if content_of(pair.source) != pair.content:
            raise ManiportError(f"{pair.source.path}: it changed during the batch; start again")
        humans[key] = transfer.human(recording).subsampled(job.config.profile_rate)
    return humans[key]


@lru_cache(4)  # about 60 MB each
def _transfer_to(robot: Robot) -> Transfer:
    """Return the transfer to a robot, which is sampled once in each process."""
    return Transfer.of(robot.job)


def _transferred(pair: Pair, transfer: Transfer, human: Human) -> TransferResult:
    """Transfer the recording to one robot, by maps of the batch or, where it is selected, by its own."""
    job = pair.robot.job
    selects = job.adapter is None
    if selects:
        fitted = transfer.fit(human)
    else:
        maps = []
        for arm, fit in enumerate(human.motion.arms):
            maps.append(_fitted(pair, transfer, fit, arm))
        fitted = transfer.fitted(maps)
    result = fitted.run(human, baselines=selects)
    config = replace(job.config, recording=(str(pair.source.path),), verb="batch")
    return replace(result, config=config)


def _row(pair: Pair, result: TransferResult, report: Report, folder: str) -> Row:
    """Return the row of a result; the names of several arms are those of their numbers."""
    arms = []
    if len(result.arms) > 1:
        arms = [arm.name for arm in result.arms]
    return row_of(report, *pair.names, folder, arms)


def _write(pair: Pair, transfer: Transfer, human: Human, begun: float) -> tuple[Row, str]:
    """Transfer the recording to one robot, and write the results; return the row and their digest."""
    result = _transferred(pair, transfer, human)
    config = result.config
    report = report_of(result)
    row = _row(pair, result, report, pair.folder.relative_to(pair.output).as_posix())
    pair.folder.parent.mkdir(parents=True, exist_ok=True)
    with folder_written_whole(pair.folder, {*RESULT_FILES, PAIR}, True) as staging:
        formats = export_files(config.export)
        write_run(result, report, formats, staging, str(pair.folder), config.pages)
        config.save(staging / CONFIG)
        row[COMPUTING] = clock.process_time() - begun
        about = {"settings": pair.settings, "row": row}
        (staging / PAIR).write_text(json.dumps(about, ensure_ascii=False), encoding="utf-8")
        content = folder_content(staging)
    return row, content


def _fitted(pair: Pair, transfer: Transfer, fit: ArmFit, arm: int) -> FittedMap:
    """Return the map from an arm of a person to one of a robot, from the file or fitted."""
    robot = pair.robot
    job = robot.job
    lengths = dict[str, float]()
    for name, length in fit.segment_lengths.items():
        lengths[name] = round(length, 2)  # equal in files of one person
    side = fit.arm.side or RIGHT
    person = human_arm(job.config.person, side, lengths=lengths)
    sizes = "-".join(f"{100.0 * length:.0f}" for length in lengths.values())
    key = digest(robot.key, person, arm)[:8]
    file = _adapter_folder(pair) / f"{robot.name}-{side}-{sizes}-{key}.npz"
    about = file.with_suffix(".json")
    if not (file.exists() and about.exists()):
        file.parent.mkdir(parents=True, exist_ok=True)
        fitted = transfer.fit_arm(person, arm)
        content = {
            "person": fit.arm.name,
            "side": side,
            "lengths_m": lengths,
            "warnings": fitted.warnings,
        }
        write_text(about, json.dumps(content))
        fitted.adapter.save(file)
    if file not in _maps:
        if len(_maps) >= MOST_MAPS:
            del _maps[next(iter(_maps))]
        texts = json.loads(about.read_text(encoding="utf-8"))["warnings"]
        teacher = sample_teacher(person, job)
        _maps[file] = FittedMap(load_adapter(file), teacher, warnings=tuple(texts))
    return _maps[file]


def _adapter_folder(pair: Pair) -> Path:
    """Return the folder of the maps; on another computer than that of a packed batch, one of this process."""
    if pair.adapters is None:
        return pair.output / ADAPTERS
    if pair.adapters.is_dir():
        return pair.adapters
    return Path(_own_folder().name)


@cache
def _own_folder() -> "TemporaryDirectory[str]":
    """Return a temporary folder, which is removed when this process ends."""
    return TemporaryDirectory(prefix="maniport-")
