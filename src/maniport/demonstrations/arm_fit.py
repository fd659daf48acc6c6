"""Joint angles of a human arm from a recording."""

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.bodies import PERSONS, Arm
from maniport.bodies.anthropometry import as_height
from maniport.bodies.human import human_arm
from maniport.defaults import AUTO
from maniport.demonstrations.arm_fit_result import ArmFit
from maniport.demonstrations.determined import AT_LIMIT, MOST_FRAMES, judge, open_joints
from maniport.demonstrations.dialects import DIRECTIONS
from maniport.demonstrations.directions import AXES, MARKED, SEGMENTS, Directions, require_human
from maniport.demonstrations.fit_doubts import doubts_of
from maniport.demonstrations.long_paths import solve_long
from maniport.demonstrations.recording import LONGEST_GAP, Recording, runs_of
from maniport.demonstrations.roles import role_position, trunk_rotation
from maniport.demonstrations.segments import SHORTEST_SEGMENT, segment_lengths
from maniport.demonstrations.sides import find_side
from maniport.demonstrations.starts import initial_path
from maniport.errors import ManiportWarning, RecordingError
from maniport.steps import Progress, Step
from maniport.validation import Array, as_choice, as_number

Bools = NDArray[np.bool_]

CUTOFF = 30.0
"""Frequency up to which motion that is fully seen is followed [Hz]; arms move below 10 Hz, and the
directions of little weight, such as the hand's, are followed up to about half of it."""

OPEN_CUTOFF = 10.0
"""The same for joints whose share in a motion is not seen but chosen [Hz]: it is chosen to be smooth."""

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
        long there as an adult's may be, gets its fraction of it, see `maniport.bodies.anthropometry`; the notes tell.

    Raises
    ------
    UnknownNameError
        When `person`, a role or a point does not exist.
    InvalidInputError
        When the person's model has not the seven joints and four frames of a human arm, or `side`, `fill` or `height`
        has a wrong value.
    RecordingError
        When points that are needed are not in the recording, or never all at once.

    Warns
    -----
    ManiportWarning
        When the model and the person differ much: a joint would go beyond its limit in more than 20 % of the frames, a
        segment is more than 5° (median) beside its measured direction, or markers of a joint seem to be exchanged.
    """
    as_choice(person, "person", PERSONS)
    tall, longest = as_height(height), as_number(fill, "fill [s]", minimum=0.0)
    tell = Step(progress, "fit the person's arm")
    chosen, reason, roles = find_side(recording, markers, side)
    used = recording.select(_points(roles)).fill_gaps(longest)
    notes = list(used.notes[len(recording.notes) :])
    points = {role: role_position(used, names) for role, names in roles.items() if role not in DIRECTIONS}
    if "hand" not in (markers or {}):
        _drop_hand_on_wrist(roles, points, notes)
    trunk = trunk_rotation(used, roles)
    frames = _complete_frames(used, points, trunk, notes)
    lengths = segment_lengths(points, recording.source, tall, notes)
    arm = human_arm(person, chosen, lengths=lengths)
    require_human(arm)
    directions = _directions(arm, used, roles, points, trunk).take(frames)
    q = _solve(directions, used.time[frames], roles, tell)
    angles = directions.angles(q)
    seen, reasons, beyond = judge(directions, roles, q)
    fit = ArmFit(
        arm=arm,
        side_reason=reason,
        joint_angles=_frozen(q),
        time=_frozen(used.time[frames]),
        frames=_frozen(frames),
        segments=tuple(angles),
        residual=_frozen(np.degrees(np.stack(list(angles.values()), axis=1))),
        twist_residual={segment: _frozen(np.degrees(twist)) for segment, twist in directions.twists(q).items()},
        determined=_frozen(seen > MOST_FRAMES),
        seen=_frozen(seen),
        reasons=reasons,
        segment_lengths=lengths,
        at_limit=_frozen(((q - arm.lower < AT_LIMIT) | (arm.upper - q < AT_LIMIT)).mean(axis=0)),
        beyond_limit=_frozen(np.degrees(beyond)),
        roles=roles,
        notes=tuple(notes),
    )
    for doubt in doubts_of(fit):
        warnings.warn(doubt, ManiportWarning, stacklevel=2)
    tell.end(fit.summary)
    return fit


def _points(roles: dict[str, Any]) -> list[str]:
    """All points that play a role, each once."""
    groups = [group for role, names in roles.items() for group in (names if role in DIRECTIONS else (names,))]
    return list(dict.fromkeys(name for group in groups for name in group))


def _drop_hand_on_wrist(roles: dict[str, Any], points: dict[str, Array], notes: list[str]) -> None:
    """Do without a hand point that coincides with the wrist, as end sites of skeletons often do."""
    if "hand" in points and np.nanmedian(np.linalg.norm(points["hand"] - points["wrist"], axis=-1)) < SHORTEST_SEGMENT:
        notes.append(f"hand: {', '.join(roles['hand'])} coincides with the wrist and was not used")
        del roles["hand"], points["hand"]


def _complete_frames(used: Recording, points: dict[str, Array], trunk: Array, notes: list[str]) -> NDArray[np.intp]:
    """The frames in which trunk and arm are all seen; says in `notes` which are left out, and for want of what."""
    lost: dict[str, Bools] = {role: np.isnan(position[:, 0]) for role, position in points.items()}
    lost["trunk"] = np.asarray(np.isnan(trunk).any(axis=(1, 2)))
    out = np.any(list(lost.values()), axis=0)
    if out.all():
        worst = ", ".join(f"{role} in {gone.mean():.0%}" for role, gone in lost.items() if gone.any())
        raise RecordingError(
            f"no frame of {used.source!r} shows all that is needed; missing are: {worst} of the frames"
        )
    for start, stop in runs_of(out):
        missing = ", ".join(role for role, gone in lost.items() if gone[start:stop].any())
        notes.append(
            f"{stop - start} frames left out, {used.time[start]:.2f}–{used.time[stop - 1]:.2f} s: {missing} missing"
        )
    return np.flatnonzero(~out)


def _directions(arm: Arm, used: Recording, roles: dict[str, Any], points: dict[str, Array], trunk: Array) -> Directions:
    """Unit vectors of segments and joint axes in the trunk frame."""
    vectors = {name: points[b] - points[a] for name, (a, b) in SEGMENTS.items() if a in points and b in points}
    for name in AXES:
        if name in roles:
            across = role_position(used, roles[name][1]) - role_position(used, roles[name][0])
            vectors[name] = MARKED[str(arm.side)] * across
    world = np.stack(list(vectors.values()), axis=1)
    local = np.einsum("nij,nki->nkj", trunk, world)
    length = np.linalg.norm(local, axis=-1, keepdims=True)
    return Directions(arm, tuple(vectors), local / np.where(length > 0, length, np.nan))


def _solve(directions: Directions, time: Array, roles: dict[str, Any], tell: Step) -> Array:
    """Joint angles (n, dof) of the path."""
    tell(0.1)
    arm = directions.arm
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
    start = np.clip(initial_path(directions, time), lower, upper)
    tell(0.4)
    return solve_long(
        lambda part: directions.take(part).residual,
        start,
        lower,
        upper,
        _smoothing(time, cutoff),
        pull,
        neutral,
        lambda part: tell(0.4 + 0.6 * part),
    )


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
