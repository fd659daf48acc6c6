"""Where the robot's hand shall be for each place of the person's hand."""

from dataclasses import dataclass

import numpy as np

from maniport.bodies import Arm
from maniport.live.maps import LiveMap
from maniport.tracking import StartBank, place_path
from maniport.validation import Array

POINTS, SEARCHED = 32, 8
"""Hand positions that decide the placement, and how many of them the search looks at; people wait for the page."""


@dataclass(frozen=True, eq=False)
class HandPlace:
    """p_robot = scale · turn · (p − centre) + offset, where turn is that of the map in use.

    Attributes
    ----------
    centre : ndarray, shape (3,)
        Middle of the person's hand positions, in the trunk frame [m].
    scale : float
    offset : ndarray, shape (3,)
        Where that middle is in the robot's base frame [m].
    """

    centre: Array
    scale: float
    offset: Array

    @classmethod
    def find(cls, teacher: Arm, joints: Array, chosen: LiveMap, student: Arm, bank: StartBank) -> "HandPlace":
        """Place the hand positions of some joint positions (n, dof) where the robot makes the ellipsoids best.

        As `maniport.tracking.place_path` does, without a further turn about the vertical.
        """
        some = joints[np.unique(np.linspace(0, len(joints) - 1, POINTS).round().astype(int))]
        wanted = np.array([chosen.transform(ellipsoid) for ellipsoid in teacher.manipulability(some)])
        hands = teacher.forward(some)[:, :3, 3]
        placed = place_path(
            hands, wanted, student, turn=chosen.turn, yaw=0.0, damping=bank.damping, bank=bank, n_points=SEARCHED
        )
        return cls(placed.centre, placed.scale, placed.offset)

    def apply(self, hand: Array, turn: Array) -> Array:
        """Place of the robot's hand [m], shape (3,), for one of the person's."""
        return np.asarray(self.scale * turn @ (hand - self.centre) + self.offset)
