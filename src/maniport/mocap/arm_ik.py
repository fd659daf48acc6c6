"""Joint angles of a human arm from a recording."""

import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.arms import PERSONS, Arm
from maniport.arms.chain import SIDES
from maniport.arms.human import as_height, human_arm
from maniport.errors import InvalidInputError, ManiportWarning, argument, typed
from maniport.mocap.arm_ik_result import ArmFit
from maniport.mocap.data_quality import (
    AT_LIMIT,
    MOST_FRAMES,
    doubts_of,
    notes_of,
    observability,
    open_joints,
)
from maniport.mocap.directions import Directions, require_human
from maniport.mocap.initial_path import initial_path
from maniport.mocap.jumps import LEAPS, calibration_pose, holes, treated
from maniport.mocap.observation import Observation, observe, segment_lengths
from maniport.mocap.path_solver import solve_long
from maniport.mocap.recording import LONGEST_GAP, Recording
from maniport.mocap.smoothing import as_smoothing
from maniport.util.defaults import AUTO, BOTH, KEEP
from maniport.util.progress import Progress, Step
from maniport.util.validation import Array, as_choice, as_number


def fit_arm(
    recording: Recording,
    person: str = "myoarm",
    markers: Mapping[str, Any] | None = None,
    fill: float = LONGEST_GAP,
    progress: Progress | None = None,
    *,
    side: str = AUTO,
    height: float | None = None,
    smooth: str | float = AUTO,
    jumps: str = KEEP,
) -> ArmFit:
    """Find the joint angles with which a human arm follows a recording.

    The directions of upper arm, forearm and, where their points are recorded, of hand, elbow axis and wrist axis are
    taken relative to the trunk and fitted over all frames together, within the joint limits. Unobservable joints are
    held at zero, or at the limit next to it; see ``undetermined`` in the result.

    Parameters
    ----------
    recording : Recording
        The person's trunk and at least one arm.
    person : {"myoarm", "rhuman"}
        Model of the human arm, one of `maniport.arms.PERSONS`; it gets the segment lengths of the recording.
    markers : mapping, optional
        Points of roles that have other than the usual names:
        ``{"shoulder": ["RFSH", "RBSH"], "elbow_axis": (["RIEL"], ["RELB"])}``, the mean of several points each.
        Roles: shoulder, elbow, wrist, hand; as pairs (from, to) elbow_axis (medial, lateral), wrist_axis (ulnar,
        radial), trunk_up (low, high), trunk_front (back, front), trunk_left (right, left). None drops a role.
    fill : float
        Gaps up to this many seconds are interpolated; frames in longer ones are left out.
    progress : callable, optional
        Called with the name of the step and the fraction done.
    side : {"auto", "right", "left"}
        Which arm; "auto" takes the one that is recorded whole, of two the one that moves more. See ``arm.side`` and
        ``side_reason`` of the result. Equal joint angles of either arm are mirrored configurations.
    height : float, optional
        The person's body height [m], from 1 to 2.5. Segments that are not recorded, or not as long as an adult's, get
        their fraction of it, see `maniport.arms.human`.
    smooth : {"auto", "off"} or float
        "auto" smooths points with large noise, as keypoints of video; a number smooths all points at that cutoff
        frequency [Hz].
    jumps : {"keep", "smooth", "split"}
        What is done where a joint is too fast: nothing; all joints are interpolated; the longest part between two
        jumps is used.

    Raises
    ------
    UnknownNameError
        When `person`, a role or a point does not exist.
    InvalidInputError
        When the person's model lacks the joints or frames of a human arm, or an option has a wrong value.
    RecordingError
        When points that are needed are not recorded, or never all at once, or the body changes its size.

    Warns
    -----
    ManiportWarning
        When the model and the person differ much: a joint would exceed its limit by more than 10° in more than 20 % of
        the frames, a segment is more than 5° (median) from its measured direction, or markers of a joint seem to be
        exchanged.
    """
    tall, cutoff = require_person(person, side, height, smooth, jumps)
    longest = as_number(fill, "fill [s]", minimum=0.0)
    step = Step(progress, "fit the person's arm")
    fit, differences = fitted(recording, observe(recording, markers, side, longest, cutoff), person, tall, jumps, step)
    for doubt in differences:
        warnings.warn(doubt, ManiportWarning, stacklevel=2)
    step.end(fit.summary)
    return fit


def fitted(
    recording: Recording, seen: Observation, person: str, height: float | None, jumps: str, step: Step
) -> tuple[ArmFit, list[str]]:
    """Fit an arm to an observation; return it with the large differences of model and person."""
    notes = list(seen.notes)
    lengths = segment_lengths(seen.points, recording.source, height, notes, recording.measured)
    arm = human_arm(person, seen.side, lengths=lengths)
    require_human(arm)
    directions = seen.directions(arm)
    q = _solve(directions, seen.time, seen.roles, step)
    q, kept, jumping = treated(q, seen.time, seen.frames, arm.joint_names, jumps)
    directions = directions.take(kept)
    left_out = holes(seen.used.time, seen.frames)
    time, frames = seen.time[kept], seen.frames[kept]
    angles = directions.angles(q)
    share, reasons, beyond = observability(directions, seen.roles, q)
    pose = calibration_pose(dict(zip(directions.names, np.moveaxis(directions.targets, 1, 0), strict=True)), time)
    fit = ArmFit(
        arm=arm,
        side_reason=seen.reason,
        joint_angles=_frozen(q),
        time=_frozen(time),
        frames=_frozen(frames),
        segments=tuple(angles),
        residual=_frozen(np.degrees(np.stack(list(angles.values()), axis=1))),
        twist_residual={segment: _frozen(np.degrees(twist)) for segment, twist in directions.twists(q).items()},
        determined=_frozen(share > MOST_FRAMES),
        seen=_frozen(share),
        reasons=reasons,
        segment_lengths=lengths,
        at_limit=_frozen(((q - arm.lower < AT_LIMIT) | (arm.upper - q < AT_LIMIT)).mean(axis=0)),
        beyond_limit=_frozen(np.degrees(beyond)),
        roles=seen.roles,
        notes=tuple(notes),
        quality_warnings=tuple(text for text in (*seen.quality_warnings, left_out, pose, jumping) if text),
    )
    differences = doubts_of(fit)
    return replace(
        fit, notes=(*fit.notes, *notes_of(fit)), quality_warnings=(*differences, *fit.quality_warnings)
    ), differences


def require_person(
    person: str, side: str, height: float | None, smooth: str | float = AUTO, jumps: str = KEEP
) -> tuple[float | None, float | None]:
    """Check options of `fit_arm`; return the height [m] and the cutoff frequency [Hz]."""
    as_choice(person, "person", PERSONS)
    if side == BOTH:
        takes = "maniport transfer and maniport view" if typed() else "fit_arms and transfer_recording"
        raise InvalidInputError(
            f"{argument('side', BOTH)}: both arms are taken by {takes}; here it is one, {', '.join((AUTO, *SIDES))}"
        )
    as_choice(side, "side", (AUTO, *SIDES))
    as_choice(jumps, "jumps", LEAPS)
    return as_height(height), as_smoothing(smooth)


def _solve(directions: Directions, time: Array, roles: dict[str, Any], step: Step) -> Array:
    """Return the joint angles (n, dof) of the path."""
    step(0.1)
    held = held_by(directions.arm, roles)
    start = np.clip(initial_path(directions, time), held.lower, held.upper)
    step(0.4)
    return solve_long(
        lambda part: directions.take(part).residual,
        start,
        held.lower,
        held.upper,
        _smoothing(time, held.cutoff),
        held.pull,
        held.neutral,
        lambda part: step(0.4 + 0.6 * part),
    )


@dataclass(frozen=True)
class Held:
    """What holds the joints besides the points; each of shape (dof,)."""

    lower: Array  # limits, the same where a joint is fixed [rad]
    upper: Array
    pull: Array  # weight of the pull to the neutral angle
    neutral: Array  # [rad]
    cutoff: Array  # frequency up to which motion is followed [Hz]


def held_by(arm: Arm, roles: Collection[str]) -> Held:
    """Return what holds the joints of an arm whose points play these roles.

    Motion that is fully observed is followed up to 30 Hz; arms move below 10 Hz, and directions of little weight, such
    as the hand's, are followed up to about half of the cutoff. Unobservable joints move below 10 Hz, or are pulled to
    neutral: in proportion to the inverse of their range, so that all use about the same part of it.
    """
    neutral = np.clip(0.0, arm.lower, arm.upper)
    lower, upper, pull = arm.lower.copy(), arm.upper.copy(), np.zeros(arm.dof)
    cutoff = np.full(arm.dof, 30.0)
    for joint in open_joints(arm, roles):
        cutoff[joint] = 10.0
        if "hand" not in roles:
            lower[joint] = upper[joint] = neutral[joint]
        else:
            pull[joint] = 0.004 * np.pi / (arm.upper[joint] - arm.lower[joint])
    return Held(lower, upper, pull, neutral, cutoff)


def _smoothing(time: Array, cutoff: Array) -> Array:
    """Return the weight κ/Δt² of each joint's acceleration in each frame, (n, dof); zero at the ends and at gaps."""
    weight = np.zeros((len(time), len(cutoff)))
    if len(time) > 2:
        steps = np.diff(time)
        joined = steps < 1.5 * np.median(steps)
        full = 1 / (2 * np.pi * cutoff * np.median(steps)) ** 2
        weight[1:-1] = np.where((joined[1:] & joined[:-1])[:, None], full, 0.0)
    return weight


def _frozen(array: Any) -> Any:
    array.setflags(write=False)
    return array
