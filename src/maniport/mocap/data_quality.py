"""Quality of an arm fit: observable joints, saturated limits, gaps, and differences of model and person."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from maniport.arms import PERSONS, Arm
from maniport.arms.chain import LEFT, RIGHT
from maniport.arms.human import JOINTS
from maniport.errors import argument
from maniport.mocap.arm_fit import ArmFit
from maniport.mocap.directions import AROUND, BLOCK, DEVIATION, ELBOW, FLEXION, TURN, Directions
from maniport.mocap.recording import runs_of, when
from maniport.util.validation import Array

MEASUREMENT_ERROR = np.radians(1.0)
"""Assumed error of a direction of weight one [rad]; directions of less weight have more of it."""

PRIOR = 1.0  # Standard deviation of a joint angle without any measurement [rad]
FASTEST_JOINT = 1500.0
"""A joint that is faster from one frame to the next jumps [degrees/s]. In everyday motion none is; elbows of pitchers
reach 2300 and their shoulders 7000 (Fleisig et al., Journal of Biomechanics 32, 1999)."""

AT_LIMIT = 1e-3  # A joint nearer to a limit than this is saturated [rad]


def unobservable_joints(arm: Arm, roles: Collection[str]) -> dict[int, str]:
    """Return the joints that the roles leave unobservable in every frame, with the reason."""
    hand, axis = "hand" in roles, "wrist_axis" in roles
    names = arm.joint_names
    if hand and axis:
        return {}
    if axis:
        return dict.fromkeys((DEVIATION, FLEXION), "no hand point: held at the neutral angle")
    reason = "no hand point and no wrist axis: held at the neutral angle"
    if hand:
        reason = (
            f"no wrist axis: the hand's direction gives two numbers for {names[TURN]}, {names[DEVIATION]} and "
            f"{names[FLEXION]}; of the angles that agree with it, those nearest to neutral were taken"
        )
    return dict.fromkeys((TURN, DEVIATION, FLEXION), reason)


def observability(directions: Directions, roles: Collection[str], q: Array) -> tuple[Array, dict[str, str], Array]:
    """Return the share of frames with each joint observable, why joints are not, and excesses over limits [rad].

    A joint is observable in frames in which the standard deviation of its error is at most 20°. The excess estimates by
    how much a saturated joint would exceed its limit in a fit without limits.
    """
    arm, errors, excesses = directions.arm, [], []
    for part in np.array_split(np.arange(len(q)), -(-len(q) // BLOCK)):
        values, slopes = directions.take(part).residual(q[part])
        hessian = np.swapaxes(slopes, 1, 2) @ slopes
        eigenvalues, vectors = np.linalg.eigh(hessian)
        variance = 1.0 / (np.maximum(eigenvalues, 0.0) / MEASUREMENT_ERROR**2 + PRIOR**-2)
        errors.append(np.sqrt(np.einsum("nik,nk->ni", vectors**2, variance)))
        downhill = -(values[:, None] @ slopes)[:, 0]
        step = np.linalg.solve(hessian + (MEASUREMENT_ERROR / PRIOR) ** 2 * np.eye(arm.dof), downhill[..., None])
        outward = np.where(q[part] - arm.lower < AT_LIMIT, -1.0, np.where(arm.upper - q[part] < AT_LIMIT, 1.0, 0.0))
        excesses.append(np.where(outward * downhill > 0.0, np.maximum(outward * step[..., 0], 0.0), 0.0))
    share = np.mean(np.concatenate(errors) <= np.radians(20.0), axis=0)
    fixed = unobservable_joints(arm, roles)
    share[list(fixed)] = 0.0
    unobservable = {
        arm.joint_names[joint]: fixed.get(
            joint, f"observable in {100 * share[joint]:.0f} % of the frames; elsewhere interpolated smoothly"
        )
        for joint in np.flatnonzero(share <= 0.5).tolist()
    }
    return share, unobservable, np.concatenate(excesses)


def model_differences(fit: ArmFit, large: float = 10.0, small: float = 1.0) -> list[str]:
    """Report differences of the model and the person; empty where the model follows well.

    Observable joints exceed a limit in over 20 % of the frames by more than `small` [degrees]; more than `large` may be
    a fault of the points. Residuals of segments are large from 5° (median). Rotations about a segment's axis have up to
    15° in good recordings, as markers lie at some distance from the joints, and 36° to 169° with exchanged markers:
    large is 25°.
    """
    medians = {name: row["median"] for name, row in fit.residual_summary().items()}
    exchanged = []
    for axis, segment in AROUND.items():
        if (median := medians.pop(f"{segment} about its axis", 0.0)) > 25.0:
            first, second = fit.roles[axis]
            exchanged.append(
                f"the {segment} is rotated by {median:.0f}° (median) about its axis from its markers: "
                f"{'+'.join(first)} and {'+'.join(second)} may be exchanged. If so, give "
                f"{argument('markers', {axis: [list(second), list(first)]})}; "
                f"if that does not help omit them: {argument('markers', {axis: None})}"
            )
    if exchanged:
        return exchanged
    texts, far, bends_backward = [], False, False
    for joint in np.flatnonzero(fit.observable & ((fit.beyond_limit > small).mean(axis=0) > 0.2)).tolist():
        degrees = fit.beyond_limit[:, joint]
        often, lower, upper = degrees > small, fit.arm.lower[joint], fit.arm.upper[joint]
        is_lower = np.median(fit.joint_angles[often, joint]) < (lower + upper) / 2
        texts.append(
            f"{JOINTS[joint]} beyond its limit of {np.degrees(lower if is_lower else upper):.0f}° in "
            f"{100 * often.mean():.0f} % of the frames (by {np.median(degrees[often]):.0f}°, "
            f"at most {degrees.max():.0f}°)"
        )
        if (degrees > large).mean() > 0.2:
            far |= joint < TURN
            bends_backward |= joint == ELBOW and is_lower
    segments = [name for name, median in medians.items() if median > 5.0]
    texts += [f"the {name} is {medians[name]:.1f}° (median) from the measured one" for name in segments]
    if not texts:
        return []
    arms, advice = bool({"upper arm", "forearm"} & set(segments)), []
    if bends_backward:
        advice.append("change the sign of one axis, if the axes are left-handed as those of Unity and Unreal")
    if arms or far:
        advice.append(f"check the roles of the points (maniport info) and assign others with {argument('markers')}")
    if arms:
        advice.append(f"try the other arm ({argument('side', LEFT if fit.arm.side != LEFT else RIGHT)})")
    others = [name for name in PERSONS if name != fit.arm.name.removesuffix(f"_{LEFT}")]
    advice += [f"try another model ({argument('person', name)})" for name in others[:1]]
    return [f"the model of the arm and the person differ: {'; '.join(texts)}. Advice: {', or '.join(advice)}"]


def gap_warning(time: Array, frames: NDArray[np.intp]) -> str:
    """Report frames that are omitted in the middle of the motion; empty without any."""
    missing = ~np.isin(np.arange(frames[-1] + 1), frames)
    missing[: frames[0]] = False
    if not missing.any():
        return ""
    start, stop = max(runs_of(missing), key=lambda run: run[1] - run[0])
    return (
        f"{int(missing.sum())} frames in the middle lack points and are omitted: the motion continues on the other "
        f"side of the gap; the longest gap is from {time[start - 1]:.2f} to {time[stop]:.2f} s"
    )


def jump_warning(q: Array, time: Array, frames: NDArray[np.intp], names: tuple[str, ...]) -> str:
    """Report the frames into which a joint jumps from the preceding frame of the recording; empty without any.

    Joints jump where points are confused, and where the arm hangs straight down: there the plane in which it is raised
    may rotate by any angle at once.
    """
    speed = np.degrees(np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0)) / np.diff(time)
    jumps = np.flatnonzero((speed > FASTEST_JOINT) & (np.diff(frames) == 1)) + 1
    if not len(jumps):
        return ""
    steps = np.degrees(np.abs(q[jumps] - q[jumps - 1]))
    worst, joint = np.unravel_index(np.argmax(steps), steps.shape)
    return (
        f"joints jump in {len(jumps)} of {len(q)} frames, faster than {FASTEST_JOINT:g}°/s "
        f"({when(time, np.isin(np.arange(len(q)), jumps))}); most {names[joint]}, by {steps[worst, joint]:.1f}° in one "
        f"frame at {time[jumps[worst]]:.2f} s. They are kept"
    )
