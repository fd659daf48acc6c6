"""Quality of an arm fit: observable joints, saturated limits, gaps, and differences of model and person."""

from collections.abc import Collection

import numpy as np

from maniport.arms import PERSONS
from maniport.arms.chain import LEFT, RIGHT
from maniport.arms.human import JOINTS
from maniport.errors import argument, counted
from maniport.mocap.arm_fit import ArmFit
from maniport.mocap.directions import AXES, BLOCK, DEVIATION, ELBOW, FLEXION, TURN, Directions
from maniport.mocap.recording import runs_of, when
from maniport.util.validation import Array

MEASUREMENT_ERROR = np.radians(
    1.0
)  # Of a direction of weight one [rad], assumed; less weight means more error
PRIOR = 1.0  # Standard deviation of a joint angle without any measurement [rad]
AT_LIMIT = 1e-3  # A joint nearer to a limit than this is saturated [rad]

# A joint that is faster from one frame to the next jumps [degrees/s]. In everyday motion none is; elbows of pitchers
# reach 2300 and their shoulders 7000 (Fleisig et al., Journal of Biomechanics 32, 1999).
FASTEST_JOINT = 1500.0


def unobservable_joints(roles: Collection[str]) -> dict[int, str]:
    """Return the joints that the roles leave unobservable in every frame, with the reason."""
    missing = [name for name in ("hand", "wrist_axis") if name not in roles]
    joints = (
        (TURN, DEVIATION, FLEXION)
        if "wrist_axis" in missing
        else (DEVIATION, FLEXION)
        if missing
        else ()
    )
    return dict.fromkeys(
        joints, f"points of {' and '.join(missing)} are missing: held at or near the neutral angle"
    )


def observability(
    directions: Directions, roles: Collection[str], q: Array
) -> tuple[dict[str, str], Array]:
    """Return why joints are not observable in more than half of the frames, and excesses over limits [rad].

    A joint is observable in frames in which the standard deviation of its error is at most 20°.
    """
    arm, errors, excesses = directions.arm, [], []
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
    unobservable = {
        arm.joint_names[joint]: fixed.get(
            joint,
            f"observable in {100 * share[joint]:.0f} % of the frames; elsewhere interpolated smoothly",
        )
        for joint in np.flatnonzero(share <= 0.5).tolist()
    }
    return unobservable, np.concatenate(excesses)


def model_differences(fit: ArmFit, large: float = 10.0, small: float = 1.0) -> list[str]:
    """Report differences of the model and the person; empty where the model follows well.

    More than `large` [degrees] beyond a limit may be a fault of the points. Rotations about a segment's axis have up to
    15° in good recordings, as markers lie at some distance from the joints, and 36° to 169° with exchanged markers.
    """
    medians = {name: row["median"] for name, row in fit.residual_summary().items()}
    exchanged = []
    for axis, (_, segment) in AXES.items():
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
    for joint in np.flatnonzero(
        fit.observable & ((fit.beyond_limit > small).mean(axis=0) > 0.2)
    ).tolist():
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
    texts += [
        f"the {name} is {medians[name]:.1f}° (median) from the measured one" for name in segments
    ]
    if not texts:
        return []
    arms = bool({"upper arm", "forearm"} & set(segments))
    model = next(name for name in PERSONS if name != fit.arm.name.removesuffix(f"_{LEFT}"))
    cases = {
        "change the sign of one axis, if the axes are left-handed as those of Unity and Unreal": bends_backward,
        f"check the roles of the points (maniport info) and assign others with {argument('markers')}": arms
        or far,
        f"try the other arm ({argument('side', LEFT if fit.arm.side != LEFT else RIGHT)})": arms,
        f"try another model ({argument('person', model)})": True,
    }
    advice = [text for text, applies in cases.items() if applies]
    return [
        f"the model of the arm and the person differ: {'; '.join(texts)}. Advice: {', or '.join(advice)}"
    ]


def gap_warning(fit: ArmFit, time: Array) -> list[str]:
    """Report frames of a recording with these times that are omitted in the middle of the motion."""
    first, last = fit.frames[[0, -1]]
    missing = ~np.isin(np.arange(last + 1), fit.frames) & (np.arange(last + 1) > first)
    if not missing.any():
        return []
    start, stop = max(runs_of(missing), key=lambda run: run[1] - run[0])
    count = int(missing.sum())
    lack = "lacks points and is" if count == 1 else "lack points and are"
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
