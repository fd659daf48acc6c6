"""Joint angles of one or several human arms from a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from maniport.arms import PERSONS
from maniport.arms.chain import LEFT, RIGHT, SIDES
from maniport.arms.human import human_arm
from maniport.errors import InvalidInputError, RecordingError, spoken
from maniport.mocap.arm_fit import ArmFit, HumanMotion
from maniport.mocap.arm_path import solve_arm
from maniport.mocap.body_sides import body_sides
from maniport.mocap.data_quality import (
    AT_LIMIT,
    gap_warning,
    jump_warning,
    observability,
)
from maniport.mocap.directions import Observation, observe, require_human, segment_lengths
from maniport.mocap.recording import Recording
from maniport.mocap.remedies import Fitting, model_warnings
from maniport.mocap.roles import ARM, TRUNK, Markers, Roles, direction, roles_by_side
from maniport.util.defaults import AUTO, BOTH
from maniport.util.progress import Progress, Step
from maniport.util.validation import Array, as_choice

GROUP = LEFT, RIGHT  # Order of the arms of a person


def fit_arm(
    recording: Recording,
    person: str = "myoarm",
    markers: Markers = None,
    progress: Progress | None = None,
    *,
    side: str = AUTO,
    smooth: str = AUTO,
) -> ArmFit:
    """Estimate the joint angles of a person's arm from a recording.

    The directions of upper arm, forearm and, where their points are recorded, of hand, elbow axis and wrist axis are
    taken relative to the trunk and fitted over all frames together, within the joint limits. Unobservable joints are
    held at zero, or at the limit next to it; see ``unobservable`` in the result.

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
    progress : callable, optional
        Called with the name of the step and the fraction done.
    side : {"auto", "right", "left"}
        "auto" takes the arm with all required roles, of two the one that moves more. See ``arm.side`` and
        ``side_reason`` of the result. Equal joint angles of either arm are mirrored configurations.
    smooth : {"auto", "off"}
        "auto" smooths points with large noise, as keypoints of video.

    Raises
    ------
    UnknownNameError
        When `person`, a role or a point does not exist.
    InvalidInputError
        When the person's model lacks the joints or frames of a human arm, or an option has a wrong value.
    RecordingError
        When points that are needed are not recorded, or never all at once, or the body changes its size.
    """
    require_person(person, side, smooth)  # rejects "both"
    return fit_arms(recording, person, markers, progress, side=side, smooth=smooth).arms[0]


def fit_arms(
    recording: Recording,
    person: str = "myoarm",
    markers: Markers = None,
    progress: Progress | None = None,
    *,
    side: str = BOTH,
    smooth: str = AUTO,
) -> HumanMotion:
    """Estimate the joint angles of both arms of a person from a recording, each as `fit_arm` does.

    All arms are taken relative to one trunk, in the frames in which all are fully observed.

    Parameters
    ----------
    recording : Recording
        The person's trunk and both arms.
    markers : mapping, optional
        Points of roles for each arm, ``{"left": {...}, "right": {...}}``, as in `fit_arm`; those of the trunk are taken
        from the right arm. For one arm as in `fit_arm`.
    side : {"both", "auto", "right", "left"}
        Both arms, or one as in `fit_arm`.
    person, progress, smooth : optional
        As in `fit_arm`; so are the other errors.

    Raises
    ------
    RecordingError
        When one of the arms is not recorded, or never all of them at once.
    """
    both = side == BOTH
    require_person(person, AUTO if both else side, smooth)
    chosen: dict[str, Markers] = {side: markers}
    if both:
        chosen = dict(_markers_by_side(recording, markers))
    observations = _observations(recording, chosen, smooth == AUTO)
    first = observations[0]
    exchanged = body_sides(recording, first.roles, first.side).warnings()
    fitting = Fitting(recording, chosen, person, smooth == AUTO, observations)
    fits = []
    origins = []
    for i, observation in enumerate(observations):
        step = Step(progress, f"Fit human {observation.side} arm" if both else "Fit human arm")
        fit = _with_warnings(_fit(observation, person, step), fitting, i, exchanged)
        step.end(fit.summary)
        fits.append(fit)
        origins.append(_base_origin(observation, fit))
    return HumanMotion(tuple(fits), np.stack(origins) - np.mean(origins, axis=0))


def _observations(
    recording: Recording, markers: Mapping[str, Markers], smooth: bool
) -> tuple[Observation, ...]:
    """Observe the arm of each side that has markers, in the frames that show all arms, relative to one trunk."""
    observed = []
    for side, markers_of_arm in markers.items():
        observed.append(observe(recording, markers_of_arm, side, smooth))
    common = reduce(np.intersect1d, [observation.frames for observation in observed])
    if not len(common):
        counts = [f"{len(arm.frames)} the {arm.side} one" for arm in observed]
        raise RecordingError(
            f"no frame of {recording.source!r} has all arms; fully observed are {', '.join(counts)}"
        )
    trunk = observed[-1].trunk
    return tuple(replace(arm, frames=common, trunk=trunk) for arm in observed)


def _with_warnings(fit: ArmFit, fitting: Fitting, arm: int, exchanged: Sequence[str]) -> ArmFit:
    """Add the warnings of a fit; where sides are `exchanged`, not those that follow from it."""
    used = fitting.observations[arm].used
    warnings = [*used.quality_warnings, *gap_warning(fit, used.time)]
    differences: list[str] = []
    if exchanged:
        warnings = [*exchanged, *warnings]
    else:
        differences = model_warnings(fit, fitting, arm)
        warnings = [*differences, *warnings, *jump_warning(fit)]
    return replace(fit, quality_warnings=tuple(warnings), model_warnings=tuple(differences))


def _base_origin(observation: Observation, fit: ArmFit) -> Array:
    """Return the origin of the base frame of an arm, from the neck in the axes of the trunk (median), (3,) [m]."""
    neck = fit.roles["trunk_up"][1]
    from_neck = direction(observation.used, (neck, fit.roles["shoulder"]))
    in_trunk = np.sum(observation.trunk * from_neck[:, :, None], axis=1)[observation.frames]
    in_base = fit.arm.point_positions(fit.joint_angles, ("shoulder",))[:, 0]
    return np.asarray(np.median(in_trunk - in_base, axis=0))


def _markers_by_side(recording: Recording, markers: Markers) -> dict[str, Roles]:
    """Return the markers of each arm, with one trunk for all."""
    if markers is None:
        markers = {}
    if not isinstance(markers, Mapping) or not set(markers) <= set(GROUP):
        text = f"{spoken('markers')} of both arms must be {{'left': {{...}}, 'right': {{...}}}}; found {markers!r}"
        raise InvalidInputError(text)
    roles, errors = roles_by_side(recording, markers)
    if roles and errors:
        ((other, error),) = errors.items()
        raise RecordingError(
            f"the recording shows the {', '.join(roles)} arm only; {error}. In the markers of both arms these points "
            f"belong under {other!r}"
        )
    if errors:
        raise errors[RIGHT]
    same = [role for role in ARM if roles[LEFT][role] == roles[RIGHT][role]]
    if same:
        raise RecordingError(
            f"{', '.join(same)} of both arms are the same points: {', '.join(roles[LEFT][same[0]])}; "
            f"{recording.source!r} shows one arm, or the names of its points have no side"
        )
    by_side = {}
    for side in GROUP:
        by_side[side] = dict(markers.get(side) or {})
        for role in TRUNK:
            by_side[side][role] = roles[RIGHT].get(role)
    return by_side


def _fit(observation: Observation, person: str, step: Step) -> ArmFit:
    """Fit an arm, with the person's segment lengths, to an observation; the fit has no warnings yet."""
    used = observation.used
    frames = observation.frames
    roles = observation.roles
    lengths = segment_lengths(used, roles)
    arm = human_arm(person, observation.side, lengths=lengths)
    require_human(arm)
    directions = observation.directions(arm)
    time = used.time[frames]
    q = solve_arm(directions, time, roles, step)
    unobservable, beyond = observability(directions, roles, q)
    return ArmFit(
        arm=arm,
        side_reason=observation.reason,
        joint_angles=q,
        time=time,
        frames=frames,
        residuals={name: np.degrees(error) for name, error in directions.errors(q).items()},
        unobservable=unobservable,
        segment_lengths=lengths,
        at_limit=((q - arm.lower < AT_LIMIT) | (arm.upper - q < AT_LIMIT)).mean(axis=0),
        beyond_limit=np.degrees(beyond),
        roles=roles,
        notes=used.notes,
        smoothed=observation.smoothed,
    )


def require_person(person: str, side: str, smooth: str = AUTO) -> None:
    """Check options of `fit_arm`."""
    as_choice(person, "person", PERSONS)
    as_choice(side, "side", (AUTO, *SIDES))
    as_choice(smooth, "smooth", (AUTO, "off"))
