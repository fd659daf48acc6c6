"""Where a fitted arm and the person differ too much, and what to do about it: sentences to be read before all else."""

from collections.abc import Mapping

import numpy as np

from maniport.bodies import PERSONS
from maniport.bodies.chain import LEFT, RIGHT
from maniport.bodies.human import JOINTS
from maniport.demonstrations.arm_fit_result import ArmFit, about_axis
from maniport.demonstrations.directions import AROUND, ELBOW, TURN
from maniport.errors import argument

OFTEN = 0.2
"""Share of the frames above which an excess over a limit of the model is reported."""

LARGE, NOTABLE = 10.0, 1.0
"""An excess above the first is a warning, above the second a note [degrees]."""

BESIDE = 5.0
"""A median angle between measured and modelled direction above which a segment is doubted [degrees]."""

EXCHANGED = 25.0
"""A median turn of a segment about its axis, between joint axis and markers, from which markers may be exchanged
[degrees]. Good recordings have up to 15°, as markers sit beside the joints; with exchanged ones it is 36° to 169°."""

ARM_SEGMENTS = {"upper arm", "forearm"}


def doubts_of(fit: ArmFit, exchanged: Mapping[str, float] | None = None) -> list[str]:
    """What is doubtful in a fit, one sentence each; none where the model follows the person well."""
    far, held = far_off(fit), beyond_limits(fit)
    wrong = [_wrong_markers(fit, axis, far, (exchanged or {}).get(axis, 0.0)) for axis in suspected_axes(fit)]
    return wrong or ([_difference(fit, far, held)] if far or held else [])


def suspected_axes(fit: ArmFit) -> list[str]:
    """Return the axes, keys of `AROUND`, whose markers contradict the model."""
    far = far_off(fit)
    return [axis for axis, segment in AROUND.items() if about_axis(segment) in far]


def far_off(fit: ArmFit) -> dict[str, float]:
    """What lies too far from what was measured, and how far (median) [degrees]: segments, and their turns."""
    most = {about_axis(segment): EXCHANGED for segment in AROUND.values()}
    off = {name: row["median"] for name, row in fit.residual_summary().items()}
    return {name: median for name, median in off.items() if median > most.get(name, BESIDE)}


def beyond_limits(fit: ArmFit, excess: float = LARGE) -> dict[str, float]:
    """Return the determined joints that exceed a limit by more than `excess` [degrees] too often, with their shares."""
    shares = (fit.beyond_limit > excess).mean(axis=0).tolist()
    return {
        name: share
        for name, share, known in zip(fit.joint_names, shares, fit.determined, strict=True)
        if known and share > OFTEN
    }


def notes_of(fit: ArmFit) -> list[str]:
    """Describe the excesses over limits of the model that are too small for a warning."""
    small = beyond_limits(fit, NOTABLE).keys() - beyond_limits(fit).keys()
    return [_beyond(fit, name, NOTABLE) for name in fit.joint_names if name in small]


def _wrong_markers(fit: ArmFit, axis: str, far: Mapping[str, float], exchanged: float) -> str:
    """Advise to exchange two markers where the model then follows them, else to leave them out."""
    first, second = fit.roles[axis]
    pair, without = f"{'+'.join(first)} and {'+'.join(second)}", argument("markers", {axis: None})
    off = far[about_axis(AROUND[axis])]
    text = f"the {AROUND[axis]} is turned {off:.0f}° (median) about its axis from where its markers put it"
    if exchanged > EXCHANGED:
        return (
            f"{text}, and {exchanged:.0f}° where {pair} are taken in the other order: in neither they show the axis of "
            f"the joint. Leave them out: {without}"
        )
    return (
        f"{text}: {pair} may be exchanged. If so, give {argument('markers', {axis: [list(second), list(first)]})}; "
        f"where that does not help leave them out: {without}"
    )


def _difference(fit: ArmFit, far: Mapping[str, float], held: Mapping[str, float]) -> str:
    """Say how model and person differ, with what to do."""
    told = [_beyond(fit, name, LARGE) for name in held]
    told += [f"the {name} is {off:.1f}° (median) from what was measured" for name, off in far.items()]
    todo = []
    if ELBOW in map(JOINTS.index, held) and _limit(fit, ELBOW) == fit.arm.lower[ELBOW]:
        todo.append("change the sign of one axis, if the axes are left-handed as those of Unity and Unreal")
    if far.keys() & ARM_SEGMENTS or any(JOINTS.index(name) < TURN for name in held):
        todo.append(f"see which points play which role (maniport info) and give others with {argument('markers')}")
    if far.keys() & ARM_SEGMENTS:
        todo.append(f"try the other arm ({argument('side', LEFT if fit.arm.side != LEFT else RIGHT)})")
    others = [name for name in PERSONS if name != fit.arm.name.removesuffix(f"_{LEFT}")]
    todo += [f"try another model ({argument('person', others[0])})"] if others else []
    return f"the model of the arm and the person differ: {'; '.join(told)}. What to do: {', or '.join(todo)}"


def _limit(fit: ArmFit, joint: int) -> float:
    """The limit of a joint [rad] beyond which it would mostly go."""
    q = float(np.median(fit.joint_angles[fit.beyond_limit[:, joint] > NOTABLE, joint]))
    return float(min((fit.arm.lower[joint], fit.arm.upper[joint]), key=lambda one: abs(one - q)))


def _beyond(fit: ArmFit, name: str, excess: float) -> str:
    joint = JOINTS.index(name)
    beyond = fit.beyond_limit[:, joint]
    often, limit = beyond > excess, np.degrees(_limit(fit, joint))
    return (
        f"{name} would go beyond its limit of {limit:.0f}° by more than {excess:.0f}° in {100 * often.mean():.0f} % of "
        f"the frames (median of these {np.median(beyond[often]):.0f}°, largest {beyond.max():.0f}°)"
    )
