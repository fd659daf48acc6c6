"""Content of the page of a run with both arms, made of the content of each arm."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from maniport.arms import ArmGroup
from maniport.pipeline import TransferResult
from maniport.report.page.content import STATES, Body, Motion, Panel, Part
from maniport.report.page.motions import ELLIPSOIDS, ERRORS, HUMAN_JOINTS, opening_time
from maniport.util.validation import Array

SIDES_OF_ARMS = "left", "right"


def motion_of_both(result: TransferResult, each: Sequence[Motion]) -> Motion:
    """Return both arms of person and robot, with the curves of the arms next to one another."""
    first = each[0]
    moved = [arm.motion for arm in result.arms if arm.motion is not None]
    persons = [_shifted(motion.bodies[0], arm.person_base) for motion, arm in zip(each, result.arms, strict=True)]
    bodies = [replace(together(*persons), figure=_trunk(*(person.figure for person in persons)))]
    joints: dict[str, tuple[Panel, ...]] = {}
    if moved:
        assert isinstance(result.robot, ArmGroup)
        bodies.append(replace(together(*(motion.bodies[1] for motion in each)), name=result.robot.name))
        own = [motion.panels[f"Joints of {one.robot.name}"] for motion, one in zip(each, result.arms, strict=True)]
        joints = joints_of_both(result.robot, own)
    groups = {group: _sided([motion.panels.get(group, ()) for motion in each]) for group in (ERRORS, ELLIPSOIDS)}
    groups |= {**joints, HUMAN_JOINTS: _sided([motion.panels[HUMAN_JOINTS] for motion in each])}
    worse = "The strip below the slider has the state of the worse arm."
    order = list(STATES)
    profiles = [next(iter(motion.bodies[0].ellipsoids.values()), one.target_profile)
                for motion, one in zip(each, result.arms, strict=True)]  # fmt: skip
    return replace(
        first,
        bodies=tuple(bodies),
        panels={group: panels for group, panels in groups.items() if panels},
        map=None,
        note=" ".join(dict.fromkeys([*(motion.note for motion in each), *([worse] if moved else [])])),
        states=tuple(max(states, key=order.index) for states in zip(*(one.states for one in each), strict=True)),
        opening=opening_time(first.time, [motion.distance for motion in moved], profiles) if moved else None,
    )


def _shifted(body: Body, by: Array) -> Body:
    """Return a body shifted by a vector [m]."""
    pose = np.eye(4)
    pose[:3, 3] = by
    return replace(
        body,
        skeleton=body.skeleton + by,
        parts=tuple(replace(part, poses=pose @ part.poses) for part in body.parts),
        figure=None if body.figure is None else body.figure + np.append(np.tile(by, 2), 0.0),
    )


def _trunk(left: Array | None, right: Array | None) -> Array | None:
    """Return the mean of the trunks next to each arm, see `trunk_and_head`; without the opposite arms."""
    if left is None or right is None:
        return None
    same = left[[1, 0, 2, 3, 4, 5]]  # the left one is the mirror image: sides change places,
    same[3, :6] = np.roll(same[3, :6], 3)  # and the ends of the rod between the shoulders
    return 0.5 * (same + right[:-1])


def together(first: Body, *others: Body) -> Body:
    """Return arms in one picture; links that several arms share are drawn once."""

    def same(one: Part, other: Part) -> bool:
        first, second = ((part.points.min(axis=0), part.points.max(axis=0)) for part in (one, other))
        return np.allclose(one.poses, other.poses, atol=1e-6) and np.allclose(first, second, atol=0.01)

    beside = []
    for body in others:
        own = tuple(part for part in body.parts if not any(same(part, other) for other in first.parts))
        beside.append(replace(body, name=SIDES_OF_ARMS[1], turn=None, figure=None, parts=own))
    return replace(first, beside=tuple(beside))


def joints_of_both(robot: ArmGroup, each: Sequence[Sequence[Panel]]) -> dict[str, tuple[Panel, ...]]:
    """Group panels of the joints of each arm: those that the arms share, and the others alternating."""
    shared, own = dict[str, Panel](), [list[Panel]() for _ in each]
    for panels, columns, mine in zip(each, robot.columns, own, strict=True):
        for panel, column in zip(panels, columns, strict=True):
            name = robot.joint_names[column]
            if name in robot.shared:
                shared.setdefault(name, replace(panel, title=name))
            else:
                mine.append(replace(panel, title=name))
    rows = tuple(panel for row in zip_longest(*own) for panel in row if panel is not None)
    return {f"Shared joints of {robot.name}": tuple(shared.values()), f"Joints of {robot.name}": rows}


def _sided(each: Sequence[Sequence[Panel]]) -> tuple[Panel, ...]:
    """Alternate panels of the arms; panels of one row have one axis."""
    panels: list[Panel] = []
    for row in zip_longest(*each):
        there = [(side, panel) for side, panel in zip(SIDES_OF_ARMS, row, strict=True) if panel is not None]
        span = _span([panel for _, panel in there])
        for side, panel in there:
            title = panel.title if panel.strip else panel.title[:1].lower() + panel.title[1:]
            panels.append(replace(panel, title=f"{side.capitalize()}: {title}", span=panel.span or span))
    return tuple(panels)


def _span(panels: Sequence[Panel]) -> tuple[float, float] | None:
    """Return the ends of an axis for all panels; None for strips, whose axes differ."""
    values = np.concatenate([np.asarray(line.values) for panel in panels for line in panel.lines])
    values = values[np.isfinite(values)]
    if panels[0].strip or not len(values):
        return None
    shown = np.log10(values) if panels[0].logarithmic else values
    low, high = float(shown.min()), float(shown.max())
    margin = 0.06 * (high - low) or 0.5
    at_zero = low >= 0.0 and not panels[0].logarithmic
    return 0.0 if at_zero else low - margin, high + margin
