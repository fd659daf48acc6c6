"""Leaps, which are faster than joints: told, and where that is asked for smoothed or cut out; poses for calibration.

Joints leap where points are taken for others, and where the arm hangs straight down: there the plane in which it is
raised turns by any angle at once. What is recorded is met in both cases; what a body would have to do for it is not.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from maniport.defaults import KEEP
from maniport.demonstrations.recording import runs_of, when
from maniport.errors import argument
from maniport.validation import Array

LEAPS = KEEP, SMOOTH, SPLIT = KEEP, "smooth", "split"
"""What is done about leaps: nothing; the joints go over them evenly; the longest part between two of them is used."""

FASTEST_JOINT = 1500.0
"""A joint that is faster from one frame to the next leaps [degrees/s]. In everyday motion none is; elbows of pitchers
reach 2300 and their shoulders 7000 (Fleisig et al., Journal of Biomechanics 32, 1999)."""

SMOOTHED = (0.15, 1.2)
"""The time on either side of a leap over which joints go evenly, and the most to which it is widened as long as they
leap on [s]."""

HELD = 0.5
"""A pose that is held this long at the beginning is one for calibration [s]."""

STILL = np.radians(3.0)
"""Directions that stay this near to each other stand still [rad]."""

AWAY = np.radians(15.0)
"""The arm leaves a pose of a frame or two in one frame by more than this [rad]."""

STRAIGHT, SIDEWAYS, HORIZONTAL, LOWEST = np.cos(np.radians(20.0)), 0.35, np.radians(15.0), np.radians(25.0)
"""An arm that is held for calibration: its elbow is nearly straight, it points to the side, along the horizon (T) or
lower (A), not along the trunk."""


def leaps(q: Array, time: Array, frames: NDArray[np.intp]) -> NDArray[np.intp]:
    """The frames, of those fitted, into which a joint leaps from the recording's frame before."""
    if len(q) < 2:
        return np.zeros(0, dtype=np.intp)
    speed = np.degrees(np.abs(np.diff(q, axis=0)).max(axis=1)) / np.diff(time)
    return np.flatnonzero((speed > FASTEST_JOINT) & (np.diff(frames) == 1)) + 1


def without_leaps(q: Array, time: Array, frames: NDArray[np.intp], found: NDArray[np.intp]) -> tuple[Array, float]:
    """Let the joints go evenly over the frames around leaps; return them with the time on either side that it took."""
    around, even = SMOOTHED[0], q
    while True:
        after = np.searchsorted(found, np.arange(len(q)))
        near = np.zeros(len(q), dtype=np.bool_)
        for i in (np.maximum(after - 1, 0), np.minimum(after, len(found) - 1)):
            near |= np.abs(time - time[found[i]]) <= around
        near[[0, -1]] = False
        if (~near).sum() < 2:
            return even, around
        even = q.copy()
        even[near] = PchipInterpolator(time[~near], q[~near])(time[near])
        if not len(leaps(even, time, frames)) or around >= SMOOTHED[1]:
            return even, around
        around = min(2 * around, SMOOTHED[1])


def longest_part(count: int, found: NDArray[np.intp]) -> slice:
    """The longest run of frames between leaps."""
    edges = np.concatenate([[0], found, [count]])
    best = int(np.argmax(np.diff(edges)))
    return slice(int(edges[best]), int(edges[best + 1]))


def told(q: Array, time: Array, found: NDArray[np.intp], names: tuple[str, ...]) -> str:
    """Say where joints leap, and the largest of the leaps."""
    steps = np.degrees(np.abs(q[found] - q[found - 1]))
    worst, joint = np.unravel_index(np.argmax(steps), steps.shape)
    flags = np.zeros(len(q), dtype=np.bool_)
    flags[found] = True
    return (
        f"joints leap in {len(found)} of {len(q)} frames, faster than {FASTEST_JOINT:g}°/s ({when(time, flags)}); most "
        f"{names[joint]}, by {steps[worst, joint]:.1f}° in one frame at {time[found[worst]]:.2f} s"
    )


def treated(
    q: Array, time: Array, frames: NDArray[np.intp], names: tuple[str, ...], what: str
) -> tuple[Array, slice, str]:
    """Do about leaps what was asked for."""
    found, every = leaps(q, time, frames), slice(0, len(q))
    if not len(found):
        return q, every, ""
    text = told(q, time, found, names)
    if what == SMOOTH:
        even, around = without_leaps(q, time, frames, found)
        return even, every, f"{text}. All joints go evenly from {around:g} s before each to {around:g} s after it"
    if what == SPLIT:
        kept = longest_part(len(q), found)
        part = time[kept]
        return q[kept], kept, f"{text}. The longest part between them is used, from {part[0]:.2f} to {part[-1]:.2f} s"
    cure = (
        f"{argument('leaps', SMOOTH)} goes over them evenly, {argument('leaps', SPLIT)} uses the longest part between"
    )
    return q, every, f"{text}. They are kept: {cure}"


def calibration_pose(directions: Mapping[str, Array], time: Array) -> str:
    """Tell of a pose for calibration with which the motion begins; empty where it does not."""
    upper, fore = directions["upper arm"], directions["forearm"]
    lowered = np.arccos(np.clip(-upper[0, 2], -1.0, 1.0)) - np.pi / 2  # above the horizon
    if len(time) < 3 or upper[0] @ fore[0] < STRAIGHT or abs(upper[0, 0]) > SIDEWAYS or lowered > HORIZONTAL:
        return ""
    if lowered < LOWEST - np.pi / 2:
        return ""
    turned = np.max([np.arccos(np.clip(one @ one[0], -1.0, 1.0)) for one in (upper, fore)], axis=0)
    left = int(np.argmax(turned > STILL)) if (turned > STILL).any() else len(time)
    held = float(time[left - 1] - time[0])
    leaves = left <= 2 and left < len(time) and turned[left] > AWAY
    if left == len(time) or not (held >= HELD or leaves):
        return ""
    pose = "T" if lowered > -HORIZONTAL else "A"
    return (
        f"the recording begins in {'an' if pose == 'A' else 'a'} {pose}-pose, as for calibration, "
        f"{'left at once' if leaves else f'held for {held:.2f} s'}; to leave it out crop the recording: "
        f"{argument('start', round(float(time[left]), 2))}"
    )


def holes(time: Array, frames: NDArray[np.intp]) -> str:
    """Tell of frames that are left out in the middle of the motion; empty where there are none."""
    missing = np.ones(frames[-1] + 1, dtype=np.bool_)
    missing[frames] = False
    missing[: frames[0]] = False
    runs = runs_of(missing)
    if not runs:
        return ""
    longest = max(runs, key=lambda run: run[1] - run[0])
    return (
        f"{int(missing.sum())} frames in the middle are left out, for want of points: the motion goes on from one side "
        f"of the gap to the other; the longest gap is from {time[longest[0] - 1]:.2f} to {time[longest[1]]:.2f} s"
    )
