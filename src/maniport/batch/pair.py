"""What a worker does: it transfers one recording to robots, and keeps what it computed of robots and persons."""

import json
import time as clock
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from socket import gethostname
from threading import Lock
from typing import Any

from threadpoolctl import threadpool_limits

from maniport.arms import as_group
from maniport.arms.chain import RIGHT
from maniport.arms.human import human_arm
from maniport.batch.inputs import Robot, Source, digest
from maniport.batch.table import COMPUTING, failed_row, is_row, row_of
from maniport.errors import ManiportError, on_the_command_line
from maniport.mocap import ArmFit
from maniport.pipeline.config import CONFIG
from maniport.pipeline.extensions import load_extensions
from maniport.pipeline.human import Human
from maniport.pipeline.results import RESULT_FILES
from maniport.pipeline.transfer import FittedMap, Transfer, sample_teacher
from maniport.report.describe import report_of
from maniport.report.values import listed
from maniport.report.write import export_files, write_run
from maniport.transfer import load_adapter
from maniport.util.atomic_io import folder_written_whole, write_text
from maniport.util.defaults import ABOUT
from maniport.version import __version__

PAIR = "pair.json"  # file with the settings of a pair and its row of the table
ADAPTERS = "adapters"  # folder of the adapters, which recordings of one person share

UNREADABLE = "unreadable"  # start of the digest of a recording that cannot be read
SAME_FOLDERS = "workers need the same folders, at the same paths"

_alone = (
    Lock()
)  # workers of Dask may have several threads, and warnings are caught for a whole process
_maps: dict[Path, FittedMap] = {}


@dataclass(frozen=True, eq=False)
class Pair:
    """A recording on a robot."""

    output: Path  # folder of the batch
    source: Source
    content: str  # digest of the recording when the batch began
    robot: Robot
    typed: bool = False  # whether errors name options of the command line

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

    def kept_row(self) -> dict[str, Any] | None:
        """Return the row of the pair, under its present names, if its result has these settings."""
        saved = self._saved()
        if saved is None or saved["settings"] != self.settings:
            return None
        recording, robot = self.names
        folder = self.folder.relative_to(self.output).as_posix()
        return {**saved["row"], "recording": recording, "robot": robot, "folder": folder}

    def difference(self) -> str:
        """Return in which settings the folder holds another result; empty where it holds none."""
        if (saved := self._saved()) is None:
            return f"{PAIR} was changed" if (self.folder / PAIR).exists() else ""
        names = {**self.settings, **saved["settings"]}
        return "made with another " + listed(
            name for name in names if self.settings.get(name) != saved["settings"].get(name)
        )

    def discard(self) -> None:
        """Let a later call repeat the pair, if the folder claims to have its result."""
        if self.kept_row() is not None:
            with suppress(OSError):
                (self.folder / PAIR).unlink()

    def _saved(self) -> dict[str, Any] | None:
        """Read the file of the pair; None where it is missing or was changed."""
        try:
            saved: dict[str, Any] = json.loads((self.folder / PAIR).read_text(encoding="utf-8"))
            return saved if isinstance(saved["settings"], dict) and is_row(saved["row"]) else None
        except (OSError, ValueError, KeyError, TypeError):
            return None


def content_of(source: Source) -> str:
    """Digest of a recording's files; where they cannot be read, why: reading the recording will report it."""
    try:
        return digest(sorted(source.path.glob("*.json")) if source.path.is_dir() else source.path)
    except OSError as error:
        return f"{UNREADABLE}: {error}"


def reason(error: Exception) -> str:
    """Why there is no result, for the table."""
    if isinstance(error, ManiportError):
        return str(error)
    if isinstance(error, OSError) and error.filename is not None:  # such as a read-only folder
        return f"{error.filename}: {error.strerror}"
    return f"unexpected {type(error).__name__}: {error}"


@dataclass(frozen=True)
class Outcome:
    """What a worker returns of a pair: its row of the table, and what to find in its folder."""

    row: dict[str, Any]
    host: str  # name of the worker's computer
    content: str = ""  # digest of the folder that was written; empty for a failure

    def is_visible(self, pair: Pair) -> bool:
        """Return whether the folder of the pair has what the worker wrote."""
        try:
            return folder_content(pair.folder) == self.content
        except OSError:  # such as a file that vanished in the meantime
            return False

    def with_host(self) -> dict[str, Any]:
        """Return the row of a failure with the name of the host in its reason."""
        return self.row | {"reason": f"{self.row['reason']} (worker on {self.host!r})"}

    def missing(self) -> dict[str, Any]:
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
    needed = [pair.output / ABOUT]
    if not pair.content.startswith(UNREADABLE):
        needed.append(pair.source.path)
    for path in needed:
        if not path.exists():
            raise ManiportError(f"the worker does not see {str(path)!r}; {SAME_FOLDERS}")


def work(pairs: Sequence[Pair]) -> list[Outcome]:
    """Transfer a recording to several robots; return an outcome for each, failures too."""
    load_extensions()  # a worker is another process
    host = gethostname()
    outcomes = list[Outcome]()
    humans = dict[Any, Human]()
    with ExitStack() as stack:
        stack.enter_context(_alone)
        stack.enter_context(
            threadpool_limits(1)
        )  # as many threads everywhere, so that sums round equally
        if pairs[0].typed:
            stack.enter_context(on_the_command_line())
        for pair in pairs:
            begun = clock.process_time()
            try:
                require_same_place(pair)
                transfer = _transfer_to(pair.robot)
                human = _human(pair, transfer, humans)
                row, content = _write(pair, transfer, human, begun)
                outcomes.append(Outcome(row, host, content))
            except Exception as error:  # noqa: BLE001  one failure does not stop the rest
                row = failed_row(*pair.names, reason(error))
                row[COMPUTING] = clock.process_time() - begun
                outcomes.append(Outcome(row, host))
    return outcomes


def _human(pair: Pair, transfer: Transfer, humans: dict[Any, Human]) -> Human:
    """Fit the person, or take the fit for another robot with the same side and bases; other options are the batch's."""
    job = pair.robot.job
    key = (
        job.config.side,
        *map(tuple, as_group(job.robot).base_positions if len(job.arms) > 1 else ()),
    )
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


def _write(
    pair: Pair, transfer: Transfer, human: Human, begun: float
) -> tuple[dict[str, Any], str]:
    """Transfer the recording to one robot, and write the results; return the row and their digest."""
    job = pair.robot.job
    selects = job.adapter is None
    if selects:
        fitted = transfer.fit(human)
    else:
        maps = [_fitted(pair, transfer, fit, arm) for arm, fit in enumerate(human.motion.arms)]
        fitted = transfer.fitted(maps)
    result = fitted.run(human, baselines=selects)
    config = replace(job.config, recording=(str(pair.source.path),), verb="batch")
    result = replace(result, config=config)
    report, arms = report_of(result), [arm.name for arm in result.arms]
    row = row_of(
        report,
        *pair.names,
        pair.folder.relative_to(pair.output).as_posix(),
        arms if len(arms) > 1 else (),
    )
    pair.folder.parent.mkdir(parents=True, exist_ok=True)
    with folder_written_whole(pair.folder, {*RESULT_FILES, PAIR}, True) as staging:
        formats = export_files(job.config.export)
        write_run(result, report, formats, staging, str(pair.folder), job.config.pages)
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
    lengths = {
        name: round(length, 2) for name, length in fit.segment_lengths.items()
    }  # equal in files of one person
    side = fit.arm.side or RIGHT
    person = human_arm(job.config.person, side, lengths=lengths)
    sizes = "-".join(f"{100.0 * length:.0f}" for length in lengths.values())
    file = (
        pair.output
        / ADAPTERS
        / f"{robot.name}-{side}-{sizes}-{digest(robot.key, person, arm)[:8]}.npz"
    )
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
        texts = json.loads(about.read_text(encoding="utf-8"))["warnings"]
        teacher = sample_teacher(person, job)
        _maps[file] = FittedMap(load_adapter(file), teacher, warnings=tuple(texts))
    return _maps[file]
