"""The verdict on a run: did the tip follow, did the ellipsoids, what stands in the way, what to try next."""

import shlex
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from maniport.defaults import DAMPING, TIP_TOLERANCE
from maniport.demonstrations.data_quality import LARGE, beyond_limits, far_off
from maniport.evaluation.rows import RAW_COPY
from maniport.pipeline import TransferResult
from maniport.pipeline.execution import Execution
from maniport.telling.answer import Answer, Card, rounded_sum
from maniport.telling.facts import at_moment, in_axes, listed
from maniport.telling.of_motion import EXCESS, far_points, missed_points
from maniport.telling.of_robot import typed
from maniport.telling.status import GREEN, RED, status_of
from maniport.tracking.follow.status import ENOUGH_DISTANCE, JOINT_LIMIT, NEAR_DISTANCE, VELOCITY_LIMIT
from maniport.validation import Array

IN_PART = 1.2
"""Median distance up to which ellipsoids follow in part: one axis 82 % too long."""

FEW_FAR = 0.05
"""Share of the points with a large position error up to which the position counts as tracked elsewhere."""

SMALL = 0.1
"""Gaps are told more finely where that of doing nothing is below."""

PARTS = ("infeasible", "path", "motion")
"""What a mean distance is the sum of, in the order of `maniport.pipeline.execution.Parts`."""


def verdict_of(
    execution: Execution, clock: Array, reasons: Sequence[str], transfer: TransferResult | None = None
) -> Answer:
    """Summarize a motion."""
    motion = execution.motion
    median, status = float(np.median(motion.distance)), status_of(reasons)
    position, well = _position(execution)
    reached = len(motion.status) - missed_points(motion)
    title = "; ".join(filter(None, [position, _ellipsoids(median)]))
    advice, command = _next(execution, transfer, well, status)
    cards = [_distance_card(execution, clock), _tip_card(execution, clock)]
    cards += [_transfer_card(transfer)] if transfer is not None else []
    return Answer(
        f"{title[:1].upper()}{title[1:]}: {reached} of {len(motion.status)} points reached.",
        " ".join([*_dangers(execution), *_half(median), *_sum(execution)]),
        " ".join([*_leap(execution), *_doubts(transfer)]),
        advice,
        command,
        status,
        tuple(reasons),
        tuple(card for card in (*cards, _limit_card(execution)) if card is not None),
    )


def unmoved(transfer: TransferResult) -> Answer:
    """Say how a transfer came out whose target nobody follows."""
    card = _transfer_card(transfer)
    gap = None if transfer.evaluation is None else transfer.evaluation.adapter.feasibility_gap
    said = "" if gap is None else f"Half of its ellipsoids are {gap.median:.2f} or more from what the robot can make."
    return Answer(
        f"{transfer.robot.name} has its target and was not moved.", said, cards=() if card is None else (card,)
    )


def _ellipsoids(median: float) -> str:
    if median <= ENOUGH_DISTANCE:
        return "ellipsoids tracked"
    if median <= NEAR_DISTANCE:
        return "ellipsoids approximated"
    return "ellipsoids approximated in part" if median <= IN_PART else "ellipsoids not tracked"


def _position(execution: Execution) -> tuple[str, bool]:
    """Say whether the position is tracked; also whether it mostly is."""
    error = execution.motion.position_error
    if error is None:
        return "", True
    far = far_points(execution.motion)
    if far > FEW_FAR * len(error):
        return "position not tracked", False
    return ("position mostly tracked" if far else "position tracked"), True


def _half(median: float) -> list[str]:
    if median <= ENOUGH_DISTANCE:
        return []
    return [f"Half of the time the ellipsoid is {median:.2f} or more off ({in_axes(median)})."]


def _sum(execution: Execution) -> list[str]:
    if float(np.mean(execution.motion.distance)) <= ENOUGH_DISTANCE:
        return []
    parts = _parts(execution)
    total, values = rounded_sum([value for _, value in parts])
    summands = [f"{name} {value}" for (name, _), value in zip(parts, values, strict=True)]
    return [f"Mean distance {total} = {' + '.join(summands)}."]


def _parts(execution: Execution) -> tuple[tuple[str, float], ...]:
    """What the mean distance is the sum of; without a path its price is what two searches of one thing differ by."""
    unmendable, path, way = map(float, execution.parts)
    if execution.motion.path is None:
        return (PARTS[0], unmendable + path), (PARTS[2], way)
    return tuple(zip(PARTS, (unmendable, path, way), strict=True))


def _dangers(execution: Execution) -> list[str]:
    """Say what nobody should run on a robot."""
    room, motion = execution.room, execution.motion
    broken, held = list(_broken(execution)), int(np.sum(motion.held))
    return [
        *([f"The robot collides in {room.share:.1%} of the time."] if room.known and room.share else []),
        *([f"It exceeds its limits of {listed(broken)}."] if broken else []),
        *([f"It was held at {held} control steps, where no answer was found."] if held else []),
    ]


def _broken(execution: Execution) -> dict[str, float]:
    """Limits that are exceeded, and the share of them that is used."""
    motion = execution.motion
    use = execution.plan.limits.use(motion.control_time, motion.control_positions).largest
    return {name: share for name, (_, share, _) in use.items() if share > 1.0 + EXCESS}


def _leap(execution: Execution) -> list[str]:
    """Say when the tip is farthest from its path where the recording leaps."""
    error, leaps = execution.motion.position_error, execution.plan.leaps
    if error is None or not far_points(execution.motion) or not leaps[int(np.argmax(error))]:
        return []
    elsewhere = f"; elsewhere it is up to {1e3 * error[~leaps].max():.1f} mm" if not leaps.all() else ""
    return [f"The position error is largest where the recording jumps{elsewhere}."]


def _doubts(transfer: TransferResult | None) -> list[str]:
    """Say where the person is fitted badly, so that what was asked for may not be what the person did."""
    if transfer is None:
        return []
    fit = transfer.fit
    bad = [f"{name} ({off:.0f}°)" for name, off in far_off(fit).items()]
    held = [f"{name} in {100 * share:.0f} %" for name, share in beyond_limits(fit).items()]
    return [
        *([f"The person is fitted badly: {listed(bad)}."] if bad else []),
        *(
            [f"The person exceeds limits of the model by more than {LARGE:.0f}°: {listed(held)} of the frames."]
            if held
            else []
        ),
    ]


def _next(execution: Execution, transfer: TransferResult | None, on_path: bool, status: str) -> tuple[str, str]:
    """Advise what takes away most of what is missing, and the command for it."""
    motion, robot, track = execution.motion, typed(execution.robot), partial(_track, execution)
    tempo = 0.5 * float(execution.options.get("--tempo", 1.0))
    if _broken(execution):
        return "Do not run it as it is: give it more time.", track("slower", tempo=tempo)
    if status == RED:
        return "Do not run it as it is: the warnings tell where.", ""
    if not on_path and execution.placement is None:
        return "Let the path be placed where the robot reaches it.", track("placed", place=True)
    if not on_path and motion.tip_tolerance > TIP_TOLERANCE:
        return "The tip uses the tolerance that it was given: give it less.", track(
            "nearer", tip_tolerance=1e3 * TIP_TOLERANCE
        )
    if not on_path:
        return "The robot is too slow for its path: give it more time.", track("slower", tempo=tempo)
    if float(np.median(motion.distance)) <= NEAR_DISTANCE:
        first = "Run it" if status == GREEN else "Resolve the warnings before you run it"
        return f"{first}: joints.csv has the motion; --export writes it for ROS 2, MuJoCo and others, too.", ""
    parts = execution.parts
    if motion.path is not None and parts.path >= max(parts.no_posture, parts.way):
        return "The tip's path decides. How near do the ellipsoids come without it?", track("no-path", path=False)
    if parts.way > parts.no_posture:
        return "Most of the distance is due to the motion: let joints use all of their range.", track("all", margin=0.0)
    judged = None if transfer is None else transfer.evaluation
    better = "" if judged is None else judged.verdict.recommended
    if transfer is not None and transfer.choice is None and better and better != transfer.method:
        file = Path(transfer.recording.source).name
        verb = f"transfer {shlex.quote(file or 'RECORDING')}" if Path(file).suffix or not file else "learn RECORDINGS"
        return f"No posture makes such targets: {better} asks for what is nearer.", (
            f"maniport {verb} --robot {robot} --method {better} -o {{folder}}-{better}"
        )
    return "No posture makes such targets: try other methods and mountings by hand.", f"maniport view --robot {robot}"


def _track(execution: Execution, then: str, *, path: bool = True, place: bool = False, **options: float) -> str:
    """The command that moves the robot once more: as it was asked for, but for some options, into another folder."""
    motion = execution.motion
    asked = {**execution.options, **{f"--{name.replace('_', '-')}": f"{value:g}" for name, value in options.items()}}
    words = [
        f"maniport track {{folder}}/placed_profile.npz --robot {typed(execution.robot)}",
        *([f"--part {motion.spec.part}"] if motion.spec.part != "translation" else []),
        *([f"--damping {motion.damping.damping:g}"] if motion.damping.damping not in (DAMPING, 0.0) else []),
        *(["--path {folder}/path.npz"] if path and motion.path is not None else []),
        *(["--place"] if place else []),
        *(f"{name} {shlex.quote(value)}" if value else name for name, value in asked.items()),
        f"-o {{folder}}-{then}",
    ]
    return " ".join(words)


def _distance_card(execution: Execution, clock: Array) -> Card:
    distance = execution.motion.distance
    most = int(np.argmax(distance))
    details = f"95 %: {np.percentile(distance, 95):.2f}", f"largest: {distance[most]:.2f} {at_moment(clock[most])}"
    return Card("ellipsoids", f"{np.median(distance):.2f}", "median", details,
                parts=_parts(execution))  # fmt: skip


def _tip_card(execution: Execution, clock: Array) -> Card | None:
    if execution.motion.position_error is None:
        return None
    error = 1e3 * execution.motion.position_error
    most = int(np.argmax(error))
    largest = f"largest: {error[most]:.1f} mm {at_moment(clock[most])}"
    details = f"95 %: {np.percentile(error, 95):.1f} mm", largest
    return Card("tip", f"{np.median(error):.1f} mm", "median", details,
                largest if far_points(execution.motion) else "")  # fmt: skip


def _transfer_card(transfer: TransferResult) -> Card | None:
    if transfer.evaluation is None:
        return None
    found = transfer.evaluation.verdict
    if found.value is None or found.raw_copy is None:
        return None
    fine = 3 if found.raw_copy < SMALL else 2
    others = [f"{name}: {value:.{fine}f}" for name, value in found.values.items() if name not in (found.name, RAW_COPY)]
    both = f"{found.raw_copy:.{fine}f} → {found.value:.{fine}f}"
    return Card("raw copy → adapted", both, "mean gap", tuple(others[:1]))


def _limit_card(execution: Execution) -> Card:
    motion = execution.motion
    count = Counter(motion.status)
    at = (count[JOINT_LIMIT] + count[VELOCITY_LIMIT]) / len(motion.status)
    hits = Counter(motion.position_limit_hits) + Counter(motion.velocity_limit_hits)
    mostly = [f"mostly {name}" for name, _ in hits.most_common(1)] if at else []
    broken = [f"{name}: {100.0 * share:.0f} %" for name, share in _broken(execution).items()]
    details = *mostly, *broken, f"takes {np.ptp(motion.control_time):.1f} s"
    return Card("at limits", f"{100.0 * at:.0f} %", "of the points", details, broken[0] if broken else "")
