"""Quality of an arm fit: observable joints, saturated limits, gaps, and differences of model and person."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from maniport.arms.human import JOINTS
from maniport.errors import counted
from maniport.mocap.arm_fit import ArmFit
from maniport.mocap.directions import AXES, BLOCK, DEVIATION, FLEXION, TURN, Directions
from maniport.mocap.recording import runs_of, when
from maniport.util.validation import Array

# The error of a direction of weight one [rad] is assumed; less weight means more error.
MEASUREMENT_ERROR = np.radians(1.0)
PRIOR = 1.0  # Standard deviation of a joint angle without any measurement [rad]
AT_LIMIT = 1e-3  # A joint nearer to a limit than this is saturated [rad]

SMALL_EXCESS = 1.0  # Excess over a limit that is reported [degrees] …
LARGE_SHARE = 0.2  # … in more than this share of the frames
LARGE_EXCESS = 10.0  # Excess that people do not reach, so that points may be wrong [degrees]
LARGE_ANGLE = 5.0  # Median angle between a segment of the model and of the person [degrees]

# Median rotation of a segment about its axis from its markers [degrees]. Good recordings have up to 16°, as markers
# lie at some distance from the joints. Exchanged markers have 25° or more: the forearm turns toward them.
LARGE_TURN = 20.0

# A joint that is faster from one frame to the next jumps [degrees/s]. In everyday motion none is; elbows of pitchers
# reach 2300 and their shoulders 7000 (Fleisig et al., Journal of Biomechanics 32, 1999).
FASTEST_JOINT = 1500.0


def unobservable_joints(roles: Collection[str]) -> dict[int, str]:
    """Return the joints that the roles leave unobservable in every frame, with the reason."""
    missing = [name for name in ("hand", "wrist_axis") if name not in roles]
    if "wrist_axis" in missing:
        joints: tuple[int, ...] = (TURN, DEVIATION, FLEXION)
    elif missing:
        joints = (DEVIATION, FLEXION)
    else:
        joints = ()
    return dict.fromkeys(
        joints, f"points of {' and '.join(missing)} are missing: held at or near the neutral angle"
    )


def observability(
    directions: Directions, roles: Collection[str], q: Array
) -> tuple[dict[str, str], Array]:
    """Return why joints are not observable in more than half of the frames, and excesses over limits [rad].

    A joint is observable in frames in which the standard deviation of its error is at most 20°.
    """
    arm = directions.arm
    errors = []
    excesses = []
    for part in np.array_split(np.arange(len(q)), -(-len(q) // BLOCK)):
        values, slopes = directions.take(part).residual(q[part])
        hessian = np.swapaxes(slopes, 1, 2) @ slopes
        eigenvalues, vectors = np.linalg.eigh(hessian)
        variance = 1.0 / (np.maximum(eigenvalues, 0.0) / MEASUREMENT_ERROR**2 + PRIOR**-2)
        errors.append(np.sqrt(np.einsum("nik,nk->ni", vectors**2, variance)))
        downhill = -(values[:, None] @ slopes)[:, 0]
        step = np.linalg.solve(
            hessian + (MEASUREMENT_ERROR / PRIOR) ** 2 * np.eye(arm.dof), downhill[..., None]
        )
        outward = np.where(
            q[part] - arm.lower < AT_LIMIT, -1.0, np.where(arm.upper - q[part] < AT_LIMIT, 1.0, 0.0)
        )
        excesses.append(
            np.where(outward * downhill > 0.0, np.maximum(outward * step[..., 0], 0.0), 0.0)
        )
    share = np.mean(np.concatenate(errors) <= np.radians(20.0), axis=0)
    fixed = unobservable_joints(roles)
    share[list(fixed)] = 0.0
    unobservable = {}
    for joint in np.flatnonzero(share <= 0.5).tolist():
        unobservable[arm.joint_names[joint]] = fixed.get(
            joint,
            f"observable in {100 * share[joint]:.0f} % of the frames; elsewhere interpolated smoothly",
        )
    return unobservable, np.concatenate(excesses)


@dataclass(frozen=True)
class Differences:
    """Differences of the model and the person."""

    # one text for each joint, segment or axis; empty where the model follows well
    texts: tuple[str, ...]
    # of these the texts of each axis in `AXES` from whose markers a segment is rotated
    turned: dict[str, str]
    doubtful: bool  # whether they may be faults of the points


def model_differences(fit: ArmFit) -> Differences:
    """Return the differences of the model and the person."""
    medians = {name: row["median"] for name, row in fit.residual_summary().items()}
    turned = {}
    texts = []
    for axis, (_, segment) in AXES.items():
        median = medians.pop(f"{segment} about its axis", 0.0)
        if median > LARGE_TURN:
            turned[axis] = (
                f"the {segment} is rotated by {median:.0f}° (median) about its axis from its markers"
            )
            texts.append(turned[axis])

    doubtful = bool(turned)
    often_beyond = (fit.beyond_limit > SMALL_EXCESS).mean(axis=0) > LARGE_SHARE
    for joint in np.flatnonzero(fit.observable & often_beyond).tolist():
        texts.append(_beyond_limit(fit, joint))
        is_far = (fit.beyond_limit[:, joint] > LARGE_EXCESS).mean() > LARGE_SHARE
        doubtful |= joint < TURN and bool(is_far)

    for segment, median in medians.items():
        if median > LARGE_ANGLE:
            texts.append(f"the {segment} is {median:.1f}° (median) from the measured one")
            doubtful |= segment in ("upper arm", "forearm")
    return Differences(tuple(texts), turned, doubtful)


def _beyond_limit(fit: ArmFit, joint: int) -> str:
    """Describe the excess of a joint over a limit."""
    degrees = fit.beyond_limit[:, joint]
    often = degrees > SMALL_EXCESS
    limit = fit.arm.upper[joint]
    middle = (fit.arm.lower[joint] + fit.arm.upper[joint]) / 2
    if np.median(fit.joint_angles[often, joint]) < middle:
        limit = fit.arm.lower[joint]
    return (
        f"{JOINTS[joint]} beyond its limit of {np.degrees(limit):.0f}° in "
        f"{100 * often.mean():.0f} % of the frames (by {np.median(degrees[often]):.0f}°, "
        f"at most {degrees.max():.0f}°)"
    )


def gap_warning(fit: ArmFit, time: Array) -> list[str]:
    """Report frames of a recording with these times that are omitted in the middle of the motion."""
    first, last = fit.frames[[0, -1]]
    missing = ~np.isin(np.arange(last + 1), fit.frames) & (np.arange(last + 1) > first)
    if not missing.any():
        return []
    runs = runs_of(missing)
    start, stop = max(runs, key=lambda run: time[run[1]] - time[run[0] - 1])  # frames may be lost
    count = int(missing.sum())
    if count == 1:
        lack = "lacks points and is"
    else:
        lack = "lack points and are"
    return [
        f"{counted(count, 'frame')} in the middle {lack} omitted: the motion continues on the other "
        f"side of the gap; the longest gap is from {time[start - 1]:.2f} to {time[stop]:.2f} s"
    ]


def jump_warning(fit: ArmFit) -> list[str]:
    """Report the frames into which a joint jumps from the preceding frame of the recording."""
    steps = np.degrees(np.abs(np.diff(fit.joint_angles, axis=0, prepend=fit.joint_angles[:1])))
    is_next = np.diff(fit.frames, prepend=-1) == 1
    jumps = is_next & (steps.max(axis=1) > FASTEST_JOINT * np.diff(fit.time, prepend=-np.inf))
    if not jumps.any():
        return []
    worst, joint = np.unravel_index(np.argmax(steps * jumps[:, None]), steps.shape)
    return [
        f"joints jump in {jumps.sum()} of {len(fit)} frames, faster than {FASTEST_JOINT:g}°/s "
        f"({when(fit.time, jumps)}); most {JOINTS[joint]}, by {steps[worst, joint]:.1f}° in one frame at "
        f"{fit.time[worst]:.2f} s. They are kept"
    ]
