"""How a motion is controlled: what `maniport.tracking.track` takes beside what is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike
from pink.limits import Limit
from pink.tasks import Task

from maniport.errors import InvalidInputError
from maniport.tracking.objective import FOLLOWING_WEIGHT
from maniport.tracking.tasks.task import as_gain, as_lm_damping
from maniport.validation import as_choice, as_number


@dataclass(frozen=True)
class Control:
    """How a motion is controlled; every value is checked at once.

    Attributes
    ----------
    rate : float
        Control steps a second, at least one for each time [Hz].
    interpolation : {"cubic", "linear"}
        Between the times, splines (of logarithms for ellipsoids), or geodesics and straight lines, which make the arm
        jerk at each time.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in metres. Default: the arm's own velocity limits where it knows them (the result's
        summary names the joints that have none), and no limits of acceleration.
    gain : float
        Of the ellipsoid task, in (0, 1].
    lm_damping : float, optional
        Of the ellipsoid task, not negative. Default: 10, and also 3, of which the one that comes clearly nearer is
        kept.
    position_cost : float
        What a metre beside the path counts for, in units of distance between ellipsoids.
    tasks, limits : sequence of pink.tasks.Task, and of pink.limits.Limit
        Joined to those that follow ellipsoid and path, in every control step of rehearsals too. They are for the arm's
        own model, ``maniport.tracking.robot_model(arm)``; targets of theirs are set by whoever makes them.

    Raises
    ------
    InvalidInputError
        When a value is out of its range, or is no object of Pink.
    """

    rate: float = 100.0
    interpolation: str = "cubic"
    velocity_limits: ArrayLike | None = None
    acceleration_limits: ArrayLike | None = None
    gain: float = 1.0
    lm_damping: float | None = None
    position_cost: float = FOLLOWING_WEIGHT
    tasks: Sequence[Task] = ()
    limits: Sequence[Limit] = ()

    def __post_init__(self) -> None:
        as_number(self.rate, "rate", above=0.0)
        as_choice(self.interpolation, "interpolation", ("cubic", "linear"))
        as_gain(self.gain)
        as_number(self.position_cost, "position_cost", above=0.0)
        if self.lm_damping is not None:
            as_lm_damping(self.lm_damping)
        for name, kind in (("tasks", Task), ("limits", Limit)):
            given = getattr(self, name)
            if not isinstance(given, Sequence):
                raise InvalidInputError(f"{name} must be a sequence of pink's {kind.__name__}; found {given!r}")
            for i, one in enumerate(given):
                if not isinstance(one, kind):
                    raise InvalidInputError(f"{name}[{i}] must be a pink.{name}.{kind.__name__}; found {one!r}")
