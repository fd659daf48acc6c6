"""What the parts of the main job hand on to one another."""

from dataclasses import dataclass, replace

import numpy as np

from maniport.evaluation import Choice
from maniport.mocap import ArmFit, Recording
from maniport.motion import Planner
from maniport.motion.plan.planner import ArmPlanner
from maniport.transfer import DomainAdapter
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array

Fitted = tuple[DomainAdapter, tuple[str, ...]]  # A fitted adapter, and what its fit warned of

FEWEST = 3  # Frames without which there is no motion to judge


@dataclass(frozen=True, eq=False)
class Shown:
    """What a recording shows: the person's arm, its ellipsoids (n, d, d) and the path of its hand (n, 3) [m]."""

    recording: Recording
    fit: ArmFit
    demonstrated: Array
    hand: Array
    warnings: tuple[str, ...] = ()

    def thinned(self, rate: float) -> "Shown":
        """Show no more than so many moments a second [Hz], as evenly as the frames allow."""
        count = max(FEWEST, int(np.ceil(np.ptp(self.fit.time) * rate)) + 1)
        rows = evenly_spaced(len(self.fit), count)
        return replace(self, fit=self.fit.thinned(count), demonstrated=self.demonstrated[rows], hand=self.hand[rows])


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What is known of a robot before it is shown anything, so that many recordings may share it."""

    planner: Planner | ArmPlanner | None  # None where the robot shall or can not move
    domain: Array  # (m, d, d)
    # As the planner left it: each motion draws from a copy, so that none depends on another
    random: np.random.Generator
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class TransferOutput:
    """What a robot is asked for: its target ellipsoids (n, d, d), by which adapter and how that came about."""

    adapter: DomainAdapter
    target: Array
    teacher: Array
    seconds: float
    choice: Choice | None
