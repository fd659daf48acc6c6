"""Audits: all motions of a dataset are checked for a robot, in several processes."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from itertools import chain, islice
from typing import NamedTuple

import numpy as np
from joblib.externals.loky import ProcessPoolExecutor

from maniport.arms import Arm, ArmGroup
from maniport.audit.checks import COLLISION, KINDS, SHARES, Checks, FrameTable, NotChecked
from maniport.datasets import JointMotion, ReadOptions, open_dataset
from maniport.datasets.columns import given_names, matched_columns, unit_factors
from maniport.datasets.joint_motion import UNITS
from maniport.errors import FileFormatError, InvalidInputError, argument
from maniport.util.process import end_with_parent
from maniport.util.progress import Progress, Step
from maniport.util.validation import Array, as_choice, as_count, as_number

TOLERANCE = 0.05  # a motion of maniport resampled to 50 Hz reads 101.25 % of the acceleration limit
BLOCK_FRAMES = 8192  # frames of a task of a worker
WORST = 6  # episodes with curves in the report
UNCALIBRATED = ("normalized", "percent", "-100..100")
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


@dataclass(frozen=True)
class AuditOptions:
    """Options of an audit.

    Attributes
    ----------
    unit : str or None
        Unit of revolute joints where the dataset states none, ``"rad"`` or ``"deg"``.
    columns : tuple of str
        Joint of each column in its order, ``"-"`` for a column that is none. Default: by names.
    feature : str or None
        As in `ReadOptions`.
    rate : float or None
        As in `ReadOptions`.
    fail_on : tuple of str
        Kinds of findings that fail an episode, of `KINDS`. Default: all that can be checked.
    tolerance : float
        Share by which limits of velocity, acceleration and torque may be exceeded.
    processes : int
    """

    unit: str | None = None
    columns: tuple[str, ...] = ()
    feature: str | None = None
    rate: float | None = None
    fail_on: tuple[str, ...] = ()
    tolerance: float = TOLERANCE
    processes: int = 1

    def __post_init__(self) -> None:
        if self.unit in UNCALIBRATED:
            raise InvalidInputError(
                f"{argument('unit')}: values of −100 to 100 have no unit without the calibration of the "
                "robot, which the dataset does not hold. Convert them to rad or deg first"
            )
        if self.unit is not None:
            as_choice(self.unit, "unit", UNITS)
        for kind in self.fail_on:
            as_choice(kind, "fail_on", KINDS)
        as_number(self.tolerance, "tolerance", minimum=0.0, maximum=1.0)
        as_count(self.processes, "processes", 1)


@dataclass(frozen=True, eq=False)
class Finding:
    """What was found of one kind in one episode.

    Attributes
    ----------
    share : float
        Largest share of a limit; nan for collisions, and where the kind is not checked.
    joint : str
        Joint of that share, or the colliding pair.
    time : float
        When [s].
    frames : int
        Number of frames beyond the limit with the tolerance.
    """

    share: float = np.nan
    joint: str = ""
    time: float = np.nan
    frames: int = 0


@dataclass(frozen=True, eq=False)
class EpisodeResult:
    """Results of one motion.

    Attributes
    ----------
    episode : int
        Its number in the dataset.
    name : str
    frames : int
    duration : float
        [s].
    findings : mapping of str to Finding
        By `KINDS`.
    failed : tuple of str
        Kinds that fail the episode.
    singular_value, speed, speed_share, force : float
        Smallest singular value of the linear Jacobian, largest speed [m/s], largest share of the
        speed in the direction of motion, and smallest force that is available in it [N]; nan where
        unknown.
    """

    episode: int
    name: str
    frames: int
    duration: float
    findings: dict[str, Finding]
    failed: tuple[str, ...]
    singular_value: float
    speed: float
    speed_share: float
    force: float

    @property
    def excess(self) -> float:
        """Rank among the failed episodes: the largest share, and more for collisions."""
        shares = [finding.share for kind, finding in self.findings.items() if kind in self.failed]
        collides = COLLISION in self.failed
        return float(np.nanmax([0.0, *shares])) + 100.0 * collides


@dataclass(frozen=True, eq=False)
class Audit:
    """Result of an audit.

    Attributes
    ----------
    dataset, kind : str
        Path and format.
    robot : Arm or ArmGroup
    episodes : tuple of EpisodeResult
    worst : tuple of (EpisodeResult, FrameTable)
        Failed episodes with their frames, the worst first.
    not_checked : tuple of NotChecked
    fail_on : tuple of str
    options : AuditOptions
    columns : mapping of str to str
        Column of the dataset for each joint of the robot.
    ignored : tuple of str
        Columns that are no joints of the robot.
    notes : tuple of str
    """

    dataset: str
    kind: str
    robot: Arm | ArmGroup
    episodes: tuple[EpisodeResult, ...]
    worst: tuple[tuple[EpisodeResult, FrameTable], ...]
    not_checked: tuple[NotChecked, ...]
    fail_on: tuple[str, ...]
    options: AuditOptions
    columns: dict[str, str] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def failed(self) -> tuple[EpisodeResult, ...]:
        """Episodes with findings of the kinds that count."""
        return tuple(one for one in self.episodes if one.failed)

    @property
    def kept(self) -> tuple[int, ...]:
        """Numbers of the episodes that pass."""
        return tuple(one.episode for one in self.episodes if not one.failed)

    @property
    def frames(self) -> int:
        """Number of frames of all episodes."""
        return sum(one.frames for one in self.episodes)

    def count(self, kind: str) -> int:
        """Return the number of episodes with findings of a kind."""
        return sum(bool(one.findings[kind].frames) for one in self.episodes)

    def worst_of(self, kind: str) -> EpisodeResult | None:
        """Return the episode with the largest share of a kind, or with most colliding frames; None without any."""
        checked = [one for one in self.episodes if one.findings[kind].joint]
        if not checked:
            return None
        if kind == COLLISION:
            return max(checked, key=lambda one: one.findings[kind].frames)
        return max(checked, key=lambda one: one.findings[kind].share)


FrameWriter = Callable[[int, FrameTable], None]


class _Motion(NamedTuple):
    """One motion of the robot's joints."""

    episode: int
    name: str
    time: Array  # (n,) [s]
    q: Array  # (n, dof) [rad or m]


def audit_dataset(
    path: str | os.PathLike[str],
    checks: Checks,
    options: AuditOptions = AuditOptions(),
    *,
    robot_file: str | None = None,
    write_frames: FrameWriter | None = None,
    progress: Progress | None = None,
) -> Audit:
    """Check all motions of a dataset.

    Parameters
    ----------
    path : str or path
        As in `maniport.datasets.open_dataset`.
    checks : Checks
        Of the robot.
    options : AuditOptions
    robot_file : str, optional
        Robot that identifies the order of joints of files without names.
    write_frames : callable, optional
        Called with the number of each episode and its `FrameTable`, in their order.
    progress : callable, optional

    Raises
    ------
    FileFormatError
        When a file cannot be read.
    InvalidInputError
        When it cannot be decided: units or columns are unknown, or a kind of `fail_on` cannot be
        checked.
    """
    fail_on = _kinds(checks, options)
    names = given_names(options.columns, checks.robot.joint_names)
    reading = ReadOptions(options.feature, names, robot_file, options.rate)
    source = open_dataset(path, reading)
    mapping = _Mapping(checks.robot, options)
    step = Step(progress, "Audit")
    episodes: list[EpisodeResult] = []
    worst: list[tuple[EpisodeResult, FrameTable]] = []
    motions = (mapping.motion(number, motion) for number, motion in source.motions())
    for motion, table in _tables(motions, checks, options.processes):
        result = _result_of(motion, table, checks, fail_on)
        episodes.append(result)
        if write_frames is not None:
            write_frames(motion.episode, table)
        if result.failed:
            worst.append((result, table))
            worst.sort(key=lambda pair: -pair[0].excess)
            del worst[WORST:]
        if progress is not None:
            progress("Audit", min(len(episodes) / max(source.count, 1), 0.999))
    if not episodes:
        raise FileFormatError(f"{source.name}: holds no motion")
    episodes.sort(key=lambda one: one.episode)
    step.end(f"{len(episodes)} motions, {sum(bool(one.failed) for one in episodes)} with findings")
    not_checked = list(checks.not_checked)
    if mapping.has_base:
        text = "the base moves: torques are those of a fixed, upright base"
        not_checked.append(NotChecked("base", text, complete=False))
    if mapping.varying:
        text = (
            f"times of {mapping.varying} motions do not have a constant rate: derivatives are rough"
        )
        not_checked.append(NotChecked("rate", text, complete=False))
    return Audit(
        dataset=source.name,
        kind=source.kind,
        robot=checks.robot,
        episodes=tuple(episodes),
        worst=tuple(worst),
        not_checked=tuple(not_checked),
        fail_on=fail_on,
        options=options,
        columns=mapping.names,
        ignored=mapping.ignored,
        notes=tuple(mapping.notes),
    )


def _kinds(checks: Checks, options: AuditOptions) -> tuple[str, ...]:
    """Return the kinds that fail an episode; `InvalidInputError` where one cannot be checked."""
    if not options.fail_on:
        return tuple(kind for kind in KINDS if checks.is_checked(kind))
    for kind in options.fail_on:
        if not checks.is_checked(kind):
            reasons = [one.reason for one in checks.not_checked if one.kind == kind]
            raise InvalidInputError(
                f"{argument('fail_on')}: {kind} cannot be checked: {'; '.join(reasons)}"
            )
    return options.fail_on


class _Mapping:
    """Motions of datasets as motions of a robot; the columns are those of the first motion."""

    def __init__(self, robot: Arm | ArmGroup, options: AuditOptions):
        self.robot = robot
        self.options = options
        self.names: dict[str, str] = {}
        self.ignored: tuple[str, ...] = ()
        self.notes: list[str] = []
        self.has_base = False
        self.varying = 0  # motions without a constant rate
        self._first: tuple[int, tuple[str, ...]] | None = None
        self._columns: tuple[int, ...] = ()
        self._rate = 0.0

    def motion(self, number: int, motion: JointMotion) -> _Motion:
        """Return the positions of the robot's joints [rad or m]."""
        count = motion.positions.shape[1]
        if self._first is None:
            self._begin(motion)
        elif self._first != (count, motion.columns):
            raise FileFormatError(
                f"{motion.name}: all motions must have the same columns; found {count} here and "
                f"{self._first[0]} in the first, or other names"
            )
        if abs(motion.rate - self._rate) > 0.01 * self._rate:
            raise FileFormatError(
                f"{motion.name}: all motions must have the same rate; found {motion.rate:.4g} Hz here and "
                f"{self._rate:.4g} Hz in the first"
            )
        self.varying += not motion.has_constant_rate
        self.has_base |= motion.root_positions is not None
        for note in motion.notes:
            if note not in self.notes:
                self.notes.append(note)
        factors = unit_factors(motion, self.robot, self._columns, self.options.unit)
        q = motion.positions[:, self._columns] * factors
        return _Motion(number, motion.name, motion.time, q)

    def _begin(self, motion: JointMotion) -> None:
        count = motion.positions.shape[1]
        joints = self.robot.joint_names
        columns = matched_columns(motion.columns, count, joints, self.options.columns)
        labels = motion.columns or tuple(f"column {place}" for place in range(count))
        self._first = (count, motion.columns)
        self._columns = columns
        self._rate = motion.rate
        self.names = {joint: labels[place] for joint, place in zip(joints, columns, strict=True)}
        self.ignored = tuple(labels[place] for place in range(count) if place not in columns)


def _result_of(
    motion: _Motion, table: FrameTable, checks: Checks, fail_on: Sequence[str]
) -> EpisodeResult:
    """Summarize the frames of a motion."""
    findings = {}
    joints = checks.robot.joint_names
    for kind in SHARES:
        exceeded = table.exceeded[kind]
        if not checks.is_checked(kind):
            findings[kind] = Finding()
            continue
        row = int(table.shares[kind].argmax())
        findings[kind] = Finding(
            float(table.shares[kind][row]),
            joints[int(table.joints[kind][row])],
            float(table.time[row]),
            int(exceeded.sum()),
        )
    findings[COLLISION] = _collision(motion, table, checks)
    failed = tuple(kind for kind in fail_on if findings[kind].frames)
    return EpisodeResult(
        episode=motion.episode,
        name=motion.name,
        frames=len(motion.time),
        duration=float(motion.time[-1] - motion.time[0]),
        findings=findings,
        failed=failed,
        singular_value=float(table.singular_value.min()),
        speed=float(table.speed.max()),
        speed_share=_largest(table.speed_share),
        force=-_largest(-table.force),
    )


def _collision(motion: _Motion, table: FrameTable, checks: Checks) -> Finding:
    """Return the colliding frames, and the pair at the first of them."""
    rows = np.flatnonzero(table.exceeded[COLLISION])
    if not len(rows) or checks.collisions is None:
        return Finding()
    nearest = checks.collisions.nearest(motion.q[rows[:1]])
    pair = f"{nearest.first[0]} and {nearest.second[0]}"
    return Finding(np.nan, pair, float(motion.time[rows[0]]), len(rows))


def _largest(values: Array) -> float:
    """Return the largest number; nan without any."""
    finite = values[np.isfinite(values)]
    return float(finite.max()) if len(finite) else np.nan


def _tables(
    motions: Iterable[_Motion], checks: Checks, processes: int
) -> Iterator[tuple[_Motion, FrameTable]]:
    """Yield each motion with its table, in their order."""
    waiting = _blocks(motions)
    first = list(islice(waiting, 2))  # workers take seconds to start, which one block does not need
    blocks = chain(first, waiting)
    if processes == 1 or len(first) < 2:
        for block in blocks:
            for motion in block:
                yield motion, checks.table(motion.time, motion.q)
        return
    pool = ProcessPoolExecutor(
        processes, env=ONE_THREAD, initializer=_begin_worker, initargs=(os.getpid(), checks)
    )
    running: deque[tuple[list[_Motion], Future[list[FrameTable]]]] = deque()
    try:
        for block in blocks:
            running.append((block, pool.submit(_work, block)))
            if len(running) > 2 * processes:
                yield from _finished(*running.popleft())
        while running:
            yield from _finished(*running.popleft())
    finally:
        pool.shutdown(kill_workers=True)


def _finished(
    block: list[_Motion], future: "Future[list[FrameTable]]"
) -> Iterator[tuple[_Motion, FrameTable]]:
    yield from zip(block, future.result(), strict=True)


def _blocks(motions: Iterable[_Motion]) -> Iterator[list[_Motion]]:
    """Yield several motions at a time, of about `BLOCK_FRAMES` frames."""
    block: list[_Motion] = []
    frames = 0
    for motion in motions:
        block.append(motion)
        frames += len(motion.time)
        if frames >= BLOCK_FRAMES:
            yield block
            block = []
            frames = 0
    if block:
        yield block


_worker_checks: list[Checks] = []


def _begin_worker(parent: int, checks: Checks) -> None:
    """Keep the checks in a worker."""
    end_with_parent(parent)
    _worker_checks[:] = [checks]


def _work(block: list[_Motion]) -> list[FrameTable]:
    checks = _worker_checks[0]
    return [checks.table(motion.time, motion.q) for motion in block]
