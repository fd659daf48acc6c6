"""Joint angles of a human arm from a recording."""

import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.bodies import PERSONS, Arm
from maniport.bodies.chain import SIDES
from maniport.bodies.human import as_height, human_arm
from maniport.defaults import AUTO, BOTH, KEEP
from maniport.demonstrations.arm_fit_result import ArmFit
from maniport.demonstrations.determined import AT_LIMIT, MOST_FRAMES, judge, open_joints
from maniport.demonstrations.directions import AROUND, Directions, require_human
from maniport.demonstrations.fit_doubts import doubts_of, notes_of, suspected_axes
from maniport.demonstrations.jitter import as_smoothing
from maniport.demonstrations.leaps import LEAPS, calibration_pose, holes, treated
from maniport.demonstrations.long_paths import solve_long
from maniport.demonstrations.recording import LONGEST_GAP, Recording
from maniport.demonstrations.segments import segment_lengths
from maniport.demonstrations.shown import Shown, shown_by
from maniport.demonstrations.starts import initial_path
from maniport.errors import InvalidInputError, ManiportWarning, argument, typed
from maniport.steps import Progress, Step
from maniport.subsample import evenly_spaced
from maniport.validation import Array, as_choice, as_number

CUTOFF = 30.0
"""Frequency up to which motion that is fully seen is followed [Hz]; arms move below 10 Hz, and the
directions of little weight, such as the hand's, are followed up to about half of it."""

OPEN_CUTOFF = 10.0
"""The same for joints whose share in a motion is not seen but chosen [Hz]: it is chosen to be smooth."""

MOST_COMPARED = 200
"""Frames that are fitted with exchanged markers: the median of the turn is known to a degree."""

NEUTRAL_PULL = 0.004
"""Weight of the pull to the neutral angle, for joints that the points leave open only and for a range of 180°; a joint
with a smaller range is pulled harder in proportion, so that all use about the same part of their range."""


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
    leaps: str = KEEP,
) -> ArmFit:
    """Find the joint angles with which a human arm follows a recording.

    The directions of upper arm, forearm and, where their points are there, of hand, elbow axis and wrist axis are
    taken relative to the trunk and fitted over all frames together, within the joint limits. Joints that no point
    tells anything about are held at zero, or at the limit next to it; see ``undetermined`` in the result.

    Parameters
    ----------
    recording : Recording
        The person's trunk and at least one arm.
    person : {"myoarm", "rhuman"}
        The model of the human arm, one of `maniport.bodies.PERSONS`; it gets the segment lengths of the recording.
    markers : mapping, optional
        Which points play which role, where the usual names do not fit:
        ``{"shoulder": ["RFSH", "RBSH"], "elbow_axis": (["RIEL"], ["RELB"])}``, the mean of several points each.
        Roles: shoulder, elbow, wrist, hand; as pairs (from, to) elbow_axis (medial, lateral), wrist_axis (ulnar,
        radial), trunk_up (low, high), trunk_front (back, front), trunk_left (right, left). None drops a role.
    fill : float
        Gaps up to this many seconds are interpolated; frames in longer ones are left out.
    progress : callable, optional
        Called with the name of the step and the fraction done.
    side : {"auto", "right", "left"}
        Which arm; "auto" takes the one that is recorded whole, of two the one that moves more. See ``arm.side`` and
        ``side_reason`` of the result. Equal joint angles of either arm are mirrored postures.
    height : float, optional
        The person's body height [m], from 1 to 2.5. A segment that the recording does not show, or that is not as
        long there as an adult's may be, gets its fraction of it, see `maniport.bodies.human`; the notes tell.
    smooth : {"auto", "off"} or float
        Points that jitter, as keypoints of video do, are smoothed as far as they say themselves; "off" leaves them as
        they are, a number follows all points up to that frequency [Hz]. See `maniport.demonstrations.jitter`.
    leaps : {"keep", "smooth", "split"}
        What is done where a joint would be faster than joints are: nothing; all joints go over it evenly; the longest
        part between two leaps is used. See `maniport.demonstrations.leaps`.

    Raises
    ------
    UnknownNameError
        When `person`, a role or a point does not exist.
    InvalidInputError
        When the person's model has not the seven joints and four frames of a human arm, or an option a wrong value.
    RecordingError
        When points that are needed are not in the recording, or never all at once, or the body changes its size.

    Warns
    -----
    ManiportWarning
        When the model and the person differ much: a joint would go beyond its limit by more than 10° in more than 20 %
        of the frames, a segment is more than 5° (median) from its measured direction, or markers of a joint seem to be
        exchanged.

    See Also
    --------
    ArmFit : what comes out.
    fit_arms : both arms at once.
    """
    tall, cutoff = require_person(person, side, height, smooth, leaps)
    longest = as_number(fill, "fill [s]", minimum=0.0)
    tell = Step(progress, "fit the person's arm")
    fit, differences = fitted(recording, shown_by(recording, markers, side, longest, cutoff), person, tall, leaps, tell)
    for doubt in differences:
        warnings.warn(doubt, ManiportWarning, stacklevel=2)
    tell.end(fit.summary)
    return fit


def fitted(
    recording: Recording, shown: Shown, person: str, tall: float | None, leaps: str, tell: Step
) -> tuple[ArmFit, list[str]]:
    """Fit an arm to what a recording shows of it; return it with what of model and person differs much."""
    notes = list(shown.notes)
    lengths = segment_lengths(shown.points, recording.source, tall, notes, recording.measured)
    arm = human_arm(person, shown.side, lengths=lengths)
    require_human(arm)
    directions = shown.directions(arm)
    q = _solve(directions, shown.time, shown.roles, tell)
    q, kept, leaping = treated(q, shown.time, shown.frames, arm.joint_names, leaps)
    left_out = holes(shown.used.time, shown.frames)
    shown = replace(shown, frames=shown.frames[kept], doubts=(*shown.doubts, left_out))
    fit = _result(directions.take(kept), q, shown, lengths, notes, leaping)
    exchanged = {axis: _turn_if_exchanged(fit, directions.take(kept), axis) for axis in suspected_axes(fit)}
    differences = doubts_of(fit, exchanged)
    return replace(fit, notes=(*fit.notes, *notes_of(fit)), doubts=(*differences, *fit.doubts)), differences


def _turn_if_exchanged(fit: ArmFit, directions: Directions, axis: str) -> float:
    """Fit some frames with the markers of a joint axis exchanged; return the segment's turn (median) [degrees]."""
    some = evenly_spaced(len(fit), MOST_COMPARED)
    targets = directions.targets[some].copy()
    targets[:, directions.names.index(axis)] *= -1.0
    other = replace(directions, targets=targets)
    q = _solve(other, fit.time[some], fit.roles, Step(None, ""))
    return float(np.degrees(np.nanmedian(np.abs(other.twists(q)[AROUND[axis]]))))


def _result(
    directions: Directions, q: Array, shown: Shown, lengths: dict[str, float], notes: list[str], leaping: str
) -> ArmFit:
    """What was found, with how far it can be trusted."""
    arm, angles = directions.arm, directions.angles(q)
    seen, reasons, beyond = judge(directions, shown.roles, q)
    pose = calibration_pose(dict(zip(directions.names, np.moveaxis(directions.targets, 1, 0), strict=True)), shown.time)
    return ArmFit(
        arm=arm,
        side_reason=shown.reason,
        joint_angles=_frozen(q),
        time=_frozen(shown.time),
        frames=_frozen(shown.frames),
        segments=tuple(angles),
        residual=_frozen(np.degrees(np.stack(list(angles.values()), axis=1))),
        twist_residual={segment: _frozen(np.degrees(twist)) for segment, twist in directions.twists(q).items()},
        determined=_frozen(seen > MOST_FRAMES),
        seen=_frozen(seen),
        reasons=reasons,
        segment_lengths=lengths,
        at_limit=_frozen(((q - arm.lower < AT_LIMIT) | (arm.upper - q < AT_LIMIT)).mean(axis=0)),
        beyond_limit=_frozen(np.degrees(beyond)),
        roles=shown.roles,
        notes=tuple(notes),
        doubts=tuple(text for text in (*shown.doubts, pose, leaping) if text),
    )


def require_person(
    person: str, side: str, height: float | None, smooth: str | float = AUTO, leaps: str = KEEP
) -> tuple[float | None, float | None]:
    """Check what `fit_arm` is told; return the height [m] and the frequency up to which motion is followed [Hz]."""
    as_choice(person, "person", PERSONS)
    if side == BOTH:
        takes = "maniport transfer and maniport view" if typed() else "fit_arms and transfer_both"
        raise InvalidInputError(
            f"{argument('side', BOTH)}: both arms are taken by {takes}; here it is one, {', '.join((AUTO, *SIDES))}"
        )
    as_choice(side, "side", (AUTO, *SIDES))
    as_choice(leaps, "leaps", LEAPS)
    return as_height(height), as_smoothing(smooth)


def _solve(directions: Directions, time: Array, roles: dict[str, Any], tell: Step) -> Array:
    """Joint angles (n, dof) of the path."""
    tell(0.1)
    held = held_by(directions.arm, roles)
    start = np.clip(initial_path(directions, time), held.lower, held.upper)
    tell(0.4)
    return solve_long(
        lambda part: directions.take(part).residual,
        start,
        held.lower,
        held.upper,
        _smoothing(time, held.cutoff),
        held.pull,
        held.neutral,
        lambda part: tell(0.4 + 0.6 * part),
    )


@dataclass(frozen=True)
class Held:
    """What the joints are held by beside the points, shapes (dof,).

    Attributes
    ----------
    lower, upper : ndarray
        Limits, the same where a joint is held still [rad].
    pull, neutral : ndarray
        Weight of the pull to an angle, and that angle [rad].
    cutoff : ndarray
        Frequency f up to which motion is followed [Hz].
    """

    lower: Array
    upper: Array
    pull: Array
    neutral: Array
    cutoff: Array


def held_by(arm: Arm, roles: Collection[str]) -> Held:
    """What holds the joints of an arm of which points play these roles."""
    neutral = np.clip(0.0, arm.lower, arm.upper)
    lower, upper, pull = arm.lower.copy(), arm.upper.copy(), np.zeros(arm.dof)
    cutoff = np.full(arm.dof, CUTOFF)
    left_open = open_joints(arm, roles)
    cutoff[list(left_open)] = OPEN_CUTOFF
    for joint in left_open:
        if "hand" not in roles:
            lower[joint] = upper[joint] = neutral[joint]
        else:
            pull[joint] = NEUTRAL_PULL * np.pi / (arm.upper[joint] - arm.lower[joint])
    return Held(lower, upper, pull, neutral, cutoff)


def _smoothing(time: Array, cutoff: Array) -> Array:
    """Weight κ/Δt² of each joint's acceleration at each frame, shape (n, dof); zero at the ends and beside gaps."""
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
