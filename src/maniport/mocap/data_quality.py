"""Quality of an arm fit: observable joints, saturated limits, and warnings where model and person differ much."""

from collections.abc import Collection, Mapping

import numpy as np

from maniport.arms import PERSONS, Arm
from maniport.arms.chain import LEFT, RIGHT
from maniport.arms.human import JOINTS
from maniport.errors import argument
from maniport.mocap.arm_ik_result import ArmFit, about_axis
from maniport.mocap.directions import AROUND, DEVIATION, ELBOW, FLEXION, TURN, Directions
from maniport.mocap.path_solver import BLOCK, parts_of
from maniport.util.validation import Array

MEASUREMENT_ERROR = np.radians(1.0)
"""Assumed error of a direction of weight one [rad]; directions of less weight have more of it."""

PRIOR = 1.0  # Standard deviation of a joint angle without any measurement [rad]

AT_LIMIT = 1e-3  # A joint nearer to a limit than this is saturated [rad]

MOST_FRAMES = 0.5  # Share of the frames above which a joint that is seen counts as determined

LARGE = 10.0  # Excess over a limit of the model from which a warning is given [degrees]

NOTABLE = 1.0  # Excess over a limit of the model from which a note is given [degrees]


def expected_error(slopes: Array) -> Array:
    """Return the standard deviation of each joint angle [rad] for directions with `MEASUREMENT_ERROR`."""
    values, vectors = np.linalg.eigh(np.einsum("nri,nrj->nij", slopes, slopes))
    variance = 1.0 / (np.maximum(values, 0.0) / MEASUREMENT_ERROR**2 + PRIOR**-2)
    return np.asarray(np.sqrt(np.einsum("nik,nk->ni", vectors**2, variance)))


def open_joints(arm: Arm, roles: Collection[str]) -> dict[int, str]:
    """Return the joints that the roles leave unobservable in every frame, with the reason."""
    hand, axis = "hand" in roles, "wrist_axis" in roles
    names = arm.joint_names
    if hand and axis:
        return {}
    if axis:
        return dict.fromkeys((DEVIATION, FLEXION), "no hand point: held at the neutral angle")
    if hand:
        shared = (
            f"no wrist axis: the hand's direction gives two numbers for {names[TURN]}, {names[DEVIATION]} and "
            f"{names[FLEXION]}; of the angles that agree with it, those nearest to neutral were taken"
        )
        return dict.fromkeys((TURN, DEVIATION, FLEXION), shared)
    return dict.fromkeys((TURN, DEVIATION, FLEXION), "no hand point and no wrist axis: held at the neutral angle")


def observability(directions: Directions, roles: Collection[str], q: Array) -> tuple[Array, tuple[str, ...], Array]:
    """Return in what part of the frames each joint is seen, why it is not determined, and excesses over limits [rad].

    A joint is seen in frames in which its error is at most 20°.
    """
    arm, errors, excesses = directions.arm, [], []
    for part in parts_of(len(q), BLOCK):
        values, slopes = directions.take(part).residual(q[part])
        errors.append(expected_error(slopes))
        excesses.append(_excess(arm, q[part], values, slopes))
    seen = np.mean(np.concatenate(errors) <= np.radians(20.0), axis=0)
    reasons = [""] * arm.dof
    for joint, reason in open_joints(arm, roles).items():
        seen[joint], reasons[joint] = 0.0, reason
    for joint in range(arm.dof):
        if seen[joint] <= MOST_FRAMES and not reasons[joint]:
            reasons[joint] = (
                f"the points tell it in {seen[joint]:.0%} of the frames only; elsewhere other joints can make up for "
                "it, and it is carried over smoothly"
            )
    return seen, tuple(reasons), np.concatenate(excesses)


def _excess(arm: Arm, q: Array, values: Array, slopes: Array) -> Array:
    """Estimate by how much each saturated joint would exceed its limit in a fit without limits."""
    downhill = -np.einsum("nri,nr->ni", slopes, values)
    curvature = np.einsum("nri,nrj->nij", slopes, slopes) + (MEASUREMENT_ERROR / PRIOR) ** 2 * np.eye(arm.dof)
    step = np.linalg.solve(curvature, downhill[..., None])[..., 0]
    outward = np.where(q - arm.lower < AT_LIMIT, -1.0, np.where(arm.upper - q < AT_LIMIT, 1.0, 0.0))
    return np.where(outward * downhill > 0.0, np.maximum(outward * step, 0.0), 0.0)


def doubts_of(fit: ArmFit) -> list[str]:
    """Return the warnings of a fit; none where the model follows the person well."""
    far, beyond = far_off(fit), beyond_limits(fit)
    exchanged = [
        _exchanged_markers(fit, axis, segment, far[about_axis(segment)])
        for axis, segment in AROUND.items()
        if about_axis(segment) in far
    ]
    return exchanged or ([_difference(fit, far, beyond)] if far or beyond else [])


def notes_of(fit: ArmFit) -> list[str]:
    """Describe the excesses over limits of the model that are too small for a warning."""
    small = beyond_limits(fit, NOTABLE).keys() - beyond_limits(fit).keys()
    return [_beyond(fit, name, NOTABLE) for name in fit.joint_names if name in small]


def far_off(fit: ArmFit) -> dict[str, float]:
    """Return the segments and rotations that are far from the measured ones, with the median [degrees].

    Far is 5° for segments. Rotations about a segment's axis have up to 15° in good recordings, as markers sit beside
    the joints, and 36° to 169° with exchanged markers: far is 25°.
    """
    rotations = {about_axis(segment) for segment in AROUND.values()}
    medians = {name: row["median"] for name, row in fit.residual_summary().items()}
    return {name: median for name, median in medians.items() if median > (25.0 if name in rotations else 5.0)}


def beyond_limits(fit: ArmFit, excess: float = LARGE) -> dict[str, float]:
    """Return the determined joints that exceed a limit by more than `excess` [degrees] in over 20 % of the frames."""
    shares = (fit.beyond_limit > excess).mean(axis=0).tolist()
    return {
        name: share
        for name, share, known in zip(fit.joint_names, shares, fit.determined, strict=True)
        if known and share > 0.2
    }


def _exchanged_markers(fit: ArmFit, axis: str, segment: str, median: float) -> str:
    """Advise to exchange the two markers of a joint axis, else to leave them out."""
    first, second = fit.roles[axis]
    exchanged = argument("markers", {axis: [list(second), list(first)]})
    return (
        f"the {segment} is turned {median:.0f}° (median) about its axis from where its markers put it: "
        f"{'+'.join(first)} and {'+'.join(second)} may be exchanged. If so, give {exchanged}; "
        f"where that does not help leave them out: {argument('markers', {axis: None})}"
    )


def _difference(fit: ArmFit, far: Mapping[str, float], beyond: Mapping[str, float]) -> str:
    """Describe how model and person differ, with advice."""
    found = [_beyond(fit, name, LARGE) for name in beyond]
    found += [f"the {name} is {median:.1f}° (median) from what was measured" for name, median in far.items()]
    segments = bool(far.keys() & {"upper arm", "forearm"})
    advice = []
    if JOINTS[ELBOW] in beyond and _limit(fit, ELBOW) == fit.arm.lower[ELBOW]:
        advice.append("change the sign of one axis, if the axes are left-handed as those of Unity and Unreal")
    if segments or any(JOINTS.index(name) < TURN for name in beyond):
        advice.append(f"see which points play which role (maniport info) and give others with {argument('markers')}")
    if segments:
        advice.append(f"try the other arm ({argument('side', LEFT if fit.arm.side != LEFT else RIGHT)})")
    others = [name for name in PERSONS if name != fit.arm.name.removesuffix(f"_{LEFT}")]
    advice += [f"try another model ({argument('person', others[0])})"] if others else []
    return f"the model of the arm and the person differ: {'; '.join(found)}. What to do: {', or '.join(advice)}"


def _limit(fit: ArmFit, joint: int) -> float:
    """Return the limit of a joint [rad] that it would mostly exceed."""
    q = float(np.median(fit.joint_angles[fit.beyond_limit[:, joint] > NOTABLE, joint]))
    return float(min((fit.arm.lower[joint], fit.arm.upper[joint]), key=lambda limit: abs(limit - q)))


def _beyond(fit: ArmFit, name: str, excess: float) -> str:
    joint = JOINTS.index(name)
    beyond = fit.beyond_limit[:, joint]
    often, limit = beyond > excess, np.degrees(_limit(fit, joint))
    return (
        f"{name} would go beyond its limit of {limit:.0f}° by more than {excess:.0f}° in {100 * often.mean():.0f} % of "
        f"the frames (median of these {np.median(beyond[often]):.0f}°, largest {beyond.max():.0f}°)"
    )
