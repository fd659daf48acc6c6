"""The moving part of the page of a run with both arms, made of what a run of one shows of each."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from maniport.bodies import Arms
from maniport.pipeline import BothResult
from maniport.pipeline.both_result import FOLDERS as SIDES
from maniport.telling.page.content import RIGID, Body, Motion, Panel, Part
from maniport.telling.page.motions import ELLIPSOIDS, NEARNESS, PERSONS_JOINTS, first, opening, robots_joints
from maniport.telling.page.states import STATES
from maniport.validation import Array

MARGIN = 0.06
"""How far an axis that both arms share reaches beyond their values, as a part of their range."""
THINNED = 0.01
"""By so much surfaces of one link may differ, which were thinned out with others [m]."""
WORSE = "The strip below the slider shows how the arm fares that fares worse at the moment."


def motion_of_both(result: BothResult, each: Sequence[Motion]) -> Motion:
    """Show both arms of the person beside both of the robot, and the curves of the left beside those of the right."""
    left, right = each
    persons = [_moved(motion.bodies[0], base) for motion, base in zip(each, result.fits.bases, strict=True)]
    bodies = [replace(together(*persons), figure=_trunk(*(person.figure for person in persons)))]
    drawn, moved = ELLIPSOIDS in left.panels, [one.execution.motion for one in result.each if one.execution is not None]
    joints: dict[str, tuple[Panel, ...]] = {}
    if moved:
        robots = [motion.bodies[1] for motion in each]
        own = [motion.panels[robots_joints(one.robot)] for motion, one in zip(each, result.each, strict=True)]
        joints = joints_of_both(result.robot, own)
        bodies.append(replace(together(*robots), name=result.robot.name))
    panels = {
        NEARNESS: _sided(*(motion.panels.get(NEARNESS, ()) for motion in each)),
        ELLIPSOIDS: _sided(*(motion.panels.get(ELLIPSOIDS, ()) for motion in each)),
        **joints,
        PERSONS_JOINTS: _sided(*(motion.panels[PERSONS_JOINTS] for motion in each)),
    }
    profiles = [first(motion.bodies[0].ellipsoids) if drawn else one.target_profile
                for motion, one in zip(each, result.each, strict=True)]  # fmt: skip
    return replace(
        left,
        bodies=tuple(bodies),
        panels={group: shown for group, shown in panels.items() if shown},
        map=None,
        note=" ".join(dict.fromkeys([left.note, right.note, *([WORSE] if moved else [])])),
        states=tuple(map(_worse, left.states, right.states)),
        opening=opening(left.time, [motion.distance for motion in moved], profiles) if moved else None,
    )


def _moved(body: Body, by: Array) -> Body:
    """Put a body elsewhere."""
    pose = np.eye(4)
    pose[:3, 3] = by
    rod = np.append(np.tile(by, 2), 0.0)
    return replace(
        body,
        skeleton=body.skeleton + by,
        parts=tuple(replace(part, poses=pose @ part.poses) for part in body.parts),
        figure=None if body.figure is None else body.figure + rod,
    )


def _trunk(left: Array | None, right: Array | None) -> Array | None:
    """The trunk amid those that stand beside each arm, see `trunk_and_head`; without the arms opposite."""
    if left is None or right is None:
        return None
    same = left[[1, 0, 2, 3, 4, 5]]  # the left arm's is the mirror image: sides change their places,
    same[3, :6] = np.roll(same[3, :6], 3)  # and the ends of what goes from shoulder to shoulder
    return 0.5 * (same + right[:-1])


def together(left: Body, right: Body) -> Body:
    """Draw the right arm beside the left one; what both hang on is drawn once."""
    own = tuple(part for part in right.parts if not any(_same(part, other) for other in left.parts))
    beside = replace(right, name=SIDES[1], turn=None, figure=None, parts=own)
    return replace(left, beside=(beside,))


def _same(one: Part, other: Part) -> bool:
    """Whether two surfaces are those of one link: they move as one and are as large, with other triangles perhaps."""
    return np.allclose(one.poses, other.poses, atol=RIGID) and np.allclose(_box(one), _box(other), atol=THINNED)


def _box(part: Part) -> tuple[Array, Array]:
    return part.points.min(axis=0), part.points.max(axis=0)


def joints_of_both(robot: Arms, each: Sequence[Sequence[Panel]]) -> dict[str, tuple[Panel, ...]]:
    """Group panels of each arm's joints: those that both arms share, and those of each by turns."""
    shared, own = list[Panel](), (list[Panel](), list[Panel]())
    for panels, columns, mine in zip(each, robot.columns, own, strict=True):
        for panel, column in zip(panels, columns, strict=True):
            name = robot.joint_names[column]
            if name not in robot.shared:
                mine.append(replace(panel, title=name))
            elif mine is own[0]:
                shared.append(replace(panel, title=name))
    rows = tuple(panel for pair in zip_longest(*own) for panel in pair if panel is not None)
    return {f"Joints that both arms of {robot.name} share": tuple(shared), f"Joints of {robot.name}": rows}


def _sided(left: Sequence[Panel], right: Sequence[Panel]) -> tuple[Panel, ...]:
    """Panels of the left arm and of the right one by turns, each with whose it is, and with one axis."""
    panels: list[Panel] = []
    for pair in zip_longest(left, right):
        there = [(side, panel) for side, panel in zip(SIDES, pair, strict=True) if panel is not None]
        span = _span([panel for _, panel in there])
        panels += [replace(panel, title=_whose(side, panel), span=panel.span or span) for side, panel in there]
    return tuple(panels)


def _whose(side: str, panel: Panel) -> str:
    title = panel.title if panel.strip else panel.title[:1].lower() + panel.title[1:]
    return f"{side.capitalize()}: {title}"


def _span(panels: Sequence[Panel]) -> tuple[float, float] | None:
    """Ends of an axis for all panels; None where there is nothing to draw, or joints have axes of their own."""
    values = np.concatenate([np.asarray(line.values) for panel in panels for line in panel.lines])
    values = values[np.isfinite(values)]
    if panels[0].strip or not len(values):
        return None
    shown = np.log10(values) if panels[0].logarithmic else values
    low, high = float(shown.min()), float(shown.max())
    margin = MARGIN * (high - low) or 0.5
    at_zero = low >= 0.0 and not panels[0].logarithmic
    return 0.0 if at_zero else low - margin, high + margin


def _worse(one: str, other: str) -> str:
    """The state of the arm that fares worse."""
    order = list(STATES)
    return max(one, other, key=order.index)
