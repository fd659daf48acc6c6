"""Which arm of a person is fitted: the one that is asked for, that is recorded whole, or that moves more."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from maniport.bodies.chain import LEFT, RIGHT, SIDES
from maniport.defaults import AUTO
from maniport.demonstrations.dialects import ARM
from maniport.demonstrations.recording import Recording
from maniport.demonstrations.roles import assign_roles, played, role_position, trunk_rotation
from maniport.errors import RecordingError, argument

ALIKE = 1.1
"""Two arms whose ways differ by less than this factor move alike; then the right one is taken."""


def find_side(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = AUTO
) -> tuple[str, str, dict[str, Any]]:
    """Choose the arm."""
    if side != AUTO:
        return side, "as asked for", assign_roles(recording, markers, side)
    found, errors = {}, {}
    for one in SIDES:
        try:
            found[one] = assign_roles(recording, markers, one)
        except RecordingError as error:
            errors[one] = error
    if not found:
        raise errors[_likelier(recording)]
    if len(found) == 1:
        ((one, roles),) = found.items()
        return one, "the only one that the recording shows whole", roles
    if all(found[RIGHT][role] == found[LEFT][role] for role in ARM):
        reason = f"nothing tells whose points they are; {argument('side', LEFT)} takes them for a left one"
        return RIGHT, reason, found[RIGHT]
    ways = {one: _way(recording, roles) for one, roles in found.items()}
    moving = LEFT if ways[LEFT] > ALIKE * ways[RIGHT] else RIGHT
    other = SIDES[moving == RIGHT]
    alike = moving == RIGHT and ways[RIGHT] <= ALIKE * ways[LEFT]
    reason = (
        f"{'both move alike' if alike else 'it moves more'}: beside the trunk its wrist goes {ways[moving]:.2f} m, the "
        f"{other} one {ways[other]:.2f} m; {argument('side', other)} takes that"
    )
    return moving, reason, found[moving]


def _likelier(recording: Recording) -> str:
    """The arm that has more points with known names; the right one of equals."""
    return max(SIDES, key=lambda one: sum(role in played(recording, side=one)[1] for role in ARM))


def _way(recording: Recording, roles: dict[str, Any]) -> float:
    """How far the wrist goes beside the trunk [m]; where it is not seen, as fast as elsewhere."""
    wrist = role_position(recording, roles["wrist"]) - role_position(recording, roles["trunk_up"][0])
    beside = np.sum(trunk_rotation(recording, roles) * wrist[:, :, None], axis=1)
    steps = np.linalg.norm(np.diff(beside, axis=0), axis=-1)
    return float(np.nanmean(steps) * len(steps)) if np.isfinite(steps).any() else 0.0
