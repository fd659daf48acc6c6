"""Complete pipelines: from a recording to a file of joint positions, beside a loop of Pink that only moves the hand.

The peer is kindly treated: it gets maniport's reader, its fit of the person's arm and the place that maniport found for
the path, for nothing, and has no limits of acceleration to keep. What it makes is judged by the same ellipsoids.
"""

import tempfile
import time as clock
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import maniport as mp
from maniport.errors import ManiportWarning
from maniport.mocap import shipped_recording
from maniport.motion import ArmMotion
from maniport.motion.motion_limits import DERIVATIVES
from maniport.motion.trajectory import Clearance
from maniport.pipeline.results import ArmResult

from .inputs import Array
from .measure import Row, duration
from .tracking_runs import without_ellipsoids

RECORDINGS = ("freeform", "ladder")
GMR = (
    "for comparison, another machine and another task: GMR, which retargets whole bodies without ellipsoids, says "
    "60 to 70 frames/s of itself on an AMD Threadripper 7960X (Speed Benchmark in its README, github.com/YanjieZe/GMR)"
)


class Motion(NamedTuple):
    """What a pipeline made of a recording, and how long it took [s]."""

    seconds: float
    result: ArmMotion
    room: Clearance


def rows(quick: bool) -> Iterator[Row]:
    """Each recording after one run that compiles what is compiled."""
    for name in RECORDINGS[:1] if quick else RECORDINGS:
        file = shipped_recording(name)
        if name == RECORDINGS[0]:
            _ours(file)
        ours, execution, frames = _ours(file)
        peer = _hand_only(file, execution)
        yield from _compared(name, ours, peer, execution, frames)


def _ours(file: Path) -> tuple[Motion, ArmResult, int]:
    with tempfile.TemporaryDirectory() as folder:
        begin = clock.perf_counter()
        result = mp.transfer_recording(file)
        execution = result.arm
        assert execution.motion is not None
        result.save(Path(folder) / "out")
        seconds = clock.perf_counter() - begin
    return Motion(seconds, execution.motion, execution.motion.clearance), execution, len(result.time)


def _hand_only(file: Path, execution: ArmResult) -> Motion:
    placed, robot = execution.placement, execution.robot
    assert placed is not None
    with tempfile.TemporaryDirectory() as folder:
        begin = clock.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ManiportWarning)  # of the person, as ours heard them
            fit = mp.fit_arm(mp.read_recording(file))
        path = placed.apply(fit.arm.forward(fit.joint_angles)[:, :3, 3])
        followed = without_ellipsoids(
            robot, replace(placed, path=path, profile=execution.motion.target), fit.time, execution.motion.damping
        )
        table = np.column_stack([followed.control_time, followed.control_positions])
        np.savetxt(Path(folder) / "joints.csv", table, delimiter=",", header="time," + ",".join(robot.joint_names))
        seconds = clock.perf_counter() - begin
    apart = mp.Collisions.of(robot)
    return Motion(seconds, followed, Clearance.of(apart, followed))


def _compared(name: str, ours: Motion, peer: Motion, execution: ArmResult, frames: int) -> Iterator[Row]:
    work = f"{name}, recording to joint file"
    lasts = float(execution.motion.demonstrated_time[-1] - execution.motion.demonstrated_time[0])
    yield Row(
        work,
        f"{duration(ours.seconds)}, {lasts / ours.seconds:.2g} s of recording a second",
        f"hand-only loop of Pink: {duration(peer.seconds)}",
        f"{peer.seconds / ours.seconds:.2g}×",
        "–",
        None,
        f"the person's arm, both domains, the choice of the method, place and plan included; {frames} frames, "
        f"{frames / ours.seconds:.3g} a second. {GMR}",
    )
    yield _side_by_side(f"{work}: d, median / 95 % / largest", ours, peer, lambda one: _spread(one.result.distance))
    yield _side_by_side(f"{work}: tip, median / 95 % / largest [mm]", ours, peer, lambda one: _tip(one.result))
    yield _side_by_side(
        f"{work}: most of the limits of velocity / acceleration / jerk",
        ours,
        peer,
        lambda one: _use(execution, one.result),
        "differences of the samples of each file; the peer's at 100 Hz, which hides what lies between",
    )
    yield _side_by_side(
        f"{work}: nearest to a collision [mm]",
        ours,
        peer,
        lambda one: f"{1e3 * one.room.distance:.0f}, {one.room.share:.1%} of the time in one",
    )


def _side_by_side(work: str, ours: Motion, peer: Motion, show: Callable[[Motion], str], note: str = "") -> Row:
    return Row(work, show(ours), f"hand-only loop of Pink: {show(peer)}", show(ours), "–", None, note)


def _spread(values: Array) -> str:
    return " / ".join(f"{one:.2f}" for one in (np.median(values), np.quantile(values, 0.95), values.max()))


def _tip(result: ArmMotion) -> str:
    assert result.position_error is not None
    return _spread(1e3 * result.position_error)


def _use(execution: ArmResult, result: ArmMotion) -> str:
    largest = execution.motion.limits.use(result.control_time, result.control_positions).largest
    return " / ".join(f"{largest[quantity][1]:.0%}" for quantity in DERIVATIVES)
