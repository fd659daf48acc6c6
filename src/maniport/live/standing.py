"""What a robot that follows live does at a moment, by how far it is from its target."""

from collections.abc import Callable

import numpy as np

from maniport.live.moment import FOLLOWING, HOLDING, LAGGING, REACHING, RECOVERING

NEAR, NEAR_ELLIPSOID = 0.01, 0.1
"""The robot is there when its tip is so near to its target [m]; without a path its ellipsoid …"""
SETTLED, CLOSER = 0.5, 0.98
"""… or when it has not come nearer than this share of the way for so long [s]."""
FAR = 0.03
"""It lags once its tip is farther away than this, until it is near again [m]."""


class Standing:
    """The state of a robot, from its start on.

    Attributes
    ----------
    state : str
        One of `maniport.live.STATES`.
    """

    def __init__(self) -> None:
        self.state = REACHING
        self._least, self._least_at = np.inf, 0.0

    @property
    def approaching(self) -> bool:
        """Whether it is on its way to where the person's arm is."""
        return self.state in (REACHING, RECOVERING)

    def hold(self) -> None:
        """It brakes, and rests."""
        self.state = HOLDING

    def go(self) -> None:
        """It does not rest any more."""
        if self.state == HOLDING:
            self.state, self._least = RECOVERING, np.inf

    def judge(self, now: float, off: float | None, distance: Callable[[], float]) -> None:
        """Tell how it goes at a time [s]."""
        if self.approaching:
            away, enough = (distance(), NEAR_ELLIPSOID) if off is None else (off, NEAR)
            if away < CLOSER * self._least:
                self._least, self._least_at = away, now
            if away > enough and now - self._least_at <= SETTLED:
                return
            self.state = FOLLOWING
        if off is not None and not NEAR < off <= FAR:
            self.state = FOLLOWING if off <= NEAR else LAGGING
