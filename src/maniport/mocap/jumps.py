"""Jumps of fitted joint angles, calibration poses and missing frames: reported, and jumps smoothed or cut on demand.

Joints jump where points are confused, and where the arm hangs straight down: there the plane in which it is raised
may turn by any angle at once.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from maniport.errors import argument
from maniport.mocap.recording import runs_of, when
from maniport.util.defaults import KEEP
from maniport.util.validation import Array

LEAPS = KEEP, "smooth", "split"
"""Values of the option `jumps`: keep the jumps, interpolate over them, use the longest part between two of them."""

FASTEST_JOINT = 1500.0
"""A joint that is faster from one frame to the next jumps [degrees/s]. In everyday motion none is; elbows of pitchers
reach 2300 and their shoulders 7000 (Fleisig et al., Journal of Biomechanics 32, 1999)."""


def joint_jumps(q: Array, time: Array, frames: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the frames, of those fitted, into which a joint jumps from the recording's frame before."""
    if len(q) < 2:
        return np.zeros(0, dtype=np.intp)
    speed = np.degrees(np.abs(np.diff(q, axis=0)).max(axis=1)) / np.diff(time)
    return np.flatnonzero((speed > FASTEST_JOINT) & (np.diff(frames) == 1)) + 1


def treated(
    q: Array, time: Array, frames: NDArray[np.intp], names: tuple[str, ...], option: str
) -> tuple[Array, slice, str]:
    """Apply the option `jumps`; return joint angles, the frames that are kept and a data-quality warning."""
    jumps, every = joint_jumps(q, time, frames), slice(0, len(q))
    if not len(jumps):
        return q, every, ""
    text = _described(q, time, jumps, names)
    if option == "smooth":
        smooth, width = without_leaps(q, time, frames, jumps)
        return smooth, every, f"{text}. All joints go evenly from {width:g} s before each to {width:g} s after it"
    if option == "split":
        edges = np.concatenate([[0], jumps, [len(q)]])
        longest = int(np.argmax(np.diff(edges)))
        kept = slice(int(edges[longest]), int(edges[longest + 1]))
        part = time[kept]
        return q[kept], kept, f"{text}. The longest part between them is used, from {part[0]:.2f} to {part[-1]:.2f} s"
    options = f"{argument('jumps', 'smooth')} goes over them evenly, {argument('jumps', 'split')} uses the longest part"
    return q, every, f"{text}. They are kept: {options} between"


def without_leaps(
    q: Array, time: Array, frames: NDArray[np.intp], jumps: NDArray[np.intp], widest: float = 1.2
) -> tuple[Array, float]:
    """Interpolate around jumps, wider until none is left; return joint angles and the width on either side [s]."""
    width = 0.15
    while True:
        after = np.searchsorted(jumps, np.arange(len(q)))
        near = np.zeros(len(q), dtype=np.bool_)
        for i in (np.maximum(after - 1, 0), np.minimum(after, len(jumps) - 1)):
            near |= np.abs(time - time[jumps[i]]) <= width
        near[[0, -1]] = False
        smooth = q.copy()
        smooth[near] = PchipInterpolator(time[~near], q[~near])(time[near])
        if not len(joint_jumps(smooth, time, frames)) or width >= widest:
            return smooth, width
        width = min(2 * width, widest)


def _described(q: Array, time: Array, jumps: NDArray[np.intp], names: tuple[str, ...]) -> str:
    """Describe where joints jump, and the largest jump."""
    steps = np.degrees(np.abs(q[jumps] - q[jumps - 1]))
    worst, joint = np.unravel_index(np.argmax(steps), steps.shape)
    flags = np.zeros(len(q), dtype=np.bool_)
    flags[jumps] = True
    return (
        f"joints leap in {len(jumps)} of {len(q)} frames, faster than {FASTEST_JOINT:g}°/s ({when(time, flags)}); most "
        f"{names[joint]}, by {steps[worst, joint]:.1f}° in one frame at {time[jumps[worst]]:.2f} s"
    )


def calibration_pose(directions: Mapping[str, Array], time: Array) -> str:
    """Report a T-pose or A-pose, held for 0.5 s or left at once, with which the motion begins; empty without one.

    In it the elbow is nearly straight, and the arm points to the side, along the horizon (T) or lower (A).
    """
    upper, fore = directions["upper arm"], directions["forearm"]
    elevation = np.degrees(np.arccos(np.clip(-upper[0, 2], -1.0, 1.0))) - 90.0  # above the horizon
    straight = upper[0] @ fore[0] >= np.cos(np.radians(20.0))
    if len(time) < 3 or not straight or abs(upper[0, 0]) > 0.35 or not -65.0 <= elevation <= 15.0:
        return ""
    turned = np.degrees(np.max([np.arccos(np.clip(u @ u[0], -1.0, 1.0)) for u in (upper, fore)], axis=0))
    moving = turned > 3.0
    if not moving.any():
        return ""
    left = int(np.argmax(moving))
    held = float(time[left - 1] - time[0])
    leaves = left <= 2 and turned[left] > 15.0
    if not (held >= 0.5 or leaves):
        return ""
    return (
        f"the recording begins in {'a T' if elevation > -15.0 else 'an A'}-pose, as for calibration, "
        f"{'left at once' if leaves else f'held for {held:.2f} s'}; to leave it out crop the recording: "
        f"{argument('start', round(float(time[left]), 2))}"
    )


def holes(time: Array, frames: NDArray[np.intp]) -> str:
    """Report frames that are left out in the middle of the motion; empty without any."""
    missing = np.ones(frames[-1] + 1, dtype=np.bool_)
    missing[frames] = False
    missing[: frames[0]] = False
    runs = runs_of(missing)
    if not runs:
        return ""
    start, stop = max(runs, key=lambda run: run[1] - run[0])
    return (
        f"{int(missing.sum())} frames in the middle are left out, for want of points: the motion goes on from one side "
        f"of the gap to the other; the longest gap is from {time[start - 1]:.2f} to {time[stop]:.2f} s"
    )
