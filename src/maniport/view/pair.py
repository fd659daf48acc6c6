"""Both arms of a person and of a robot in the live view: two states, whose robot moves as one."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from maniport.bodies import Arms
from maniport.subsample import evenly_spaced
from maniport.tracking import place_paths
from maniport.tracking.follow.follower import Follower
from maniport.transfer.rotation_group import orthonormal
from maniport.validation import Array, as_finite, require_shape
from maniport.view.picture import Asked, Picture, Wish, as_elapsed
from maniport.view.state import POINTS, LiveState, Playback


class LivePair:
    """Both arms of a person, and those of a robot, which follow them by one programme; left first everywhere.

    Parameters
    ----------
    robot : Arms
    left, right : LiveState
        Of the person's and the robot's arms, which do not move by themselves.
    playback : Playback, optional
        A recorded motion: joints of the person's left arm, then of the right one.
    """

    def __init__(self, robot: Arms, left: LiveState, right: LiveState, playback: Playback | None = None):
        self.robot, self.each, self.playback = robot, (left, right), playback
        self._follower = Follower((left.objective, right.objective), None, robot)
        self._joints = self._together([one.joints for one in self.each])
        self._leap = True

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of what there is to choose from."""
        return self.each[0].methods

    def leap(self) -> None:
        """Let the robot start from the best postures there are, with the next step, instead of moving on."""
        self._leap = True

    def pictures(self, wish: Wish, seconds: float) -> tuple[Picture, ...]:
        """Take the wishes, whose joints are those of both arms, and let the robot follow for some time [s]."""
        asked = self._asked(wish)
        if self._leap:
            postures = [one.best(what) for one, what in zip(self.each, asked, strict=True)]
            self._joints, self._leap = self._together(postures), False
        if (elapsed := as_elapsed(seconds)) > 0.0:
            schedules = tuple(one.schedule(elapsed) for one in asked)
            self._joints = self._follower.follow(self._joints, schedules)[0][-1]
        for one, own in zip(self.each, self.robot.split(self._joints), strict=True):
            one.joints = own
        return tuple(one.picture(what, wish.mounting) for one, what in zip(self.each, asked, strict=True))

    def find_place(self, motion: Sequence[Array], method: str) -> None:
        """Find one place for both hands' paths, along joints of both persons' arms, each of shape (n, dof)."""
        rows = evenly_spaced(len(motion[0]), POINTS)
        maps = [one.refitting.maps[method] for one in self.each]
        hands, targets = [], []
        for one, chosen, joints in zip(self.each, maps, motion, strict=True):
            ellipsoids = one.teacher.manipulability(joints[rows])
            targets.append(np.array([chosen.transform(ellipsoid) for ellipsoid in ellipsoids]))
            hands.append(one.teacher.forward(joints[rows])[:, :3, 3] + one.base)
        banks = [one.bank for one in self.each]
        turn, damping = _between([chosen.turn for chosen in maps]), banks[0].damping
        found = place_paths(hands, targets, self.robot.each, turn=turn, yaw=0.0, damping=damping, banks=banks)
        for one, place in zip(self.each, found, strict=True):
            one.place = place

    def _asked(self, wish: Wish) -> list[Asked]:
        """What is asked of each arm: hands keep their relation, however the maps turn ellipsoids."""
        ends = np.cumsum([0, *(one.teacher.dof for one in self.each)])
        joints = as_finite(wish.joints, "joints")
        require_shape(joints, "joints", (int(ends[-1]),))
        wishes = [Wish(joints[a:b], wish.method, wish.mounting) for a, b in pairwise(ends)]
        asked = [one.ask(own) for one, own in zip(self.each, wishes, strict=True)]
        if not wish.tip_follows:
            return asked
        turn = _between([one.turn for one in asked])
        return [one.reaching(what, turn) for one, what in zip(self.each, asked, strict=True)]

    def _together(self, postures: Sequence[Array]) -> Array:
        """Joints of the pair; shared ones are amid where either arm would have them."""
        total, count = np.zeros(self.robot.dof), np.zeros(self.robot.dof)
        for own, columns in zip(postures, self.robot.columns, strict=True):
            total[columns] += own
            count[columns] += 1
        return np.asarray(total / count)


def _between(turns: Sequence[Array]) -> Array:
    """The rotation between those of both arms, as `maniport.pipeline.transfer_both` turns their paths."""
    return orthonormal(turns[0] + turns[1])
