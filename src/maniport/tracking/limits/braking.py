"""Position, velocity and acceleration limits that never contradict one another."""

import numpy as np
import pinocchio as pin
from pink.configuration import Configuration
from pink.limits import Limit

from maniport.validation import Array


class BrakingLimit(Limit):  # type: ignore[misc]  # Pink is untyped
    """Keep joints within their limits of position, velocity and acceleration, all at once.

    A joint may be no faster than it can brake in whole steps. With the way D to its limit and the acceleration a,
    braking takes n steps with n (n − 1) / 2 ≤ D / (a dt²) ≤ n (n + 1) / 2, and the largest first step is

        Δq = (D + a dt² n (n − 1) / 2) / n,

    since the steps Δq, Δq − a dt², … sum up to D. From each configuration and velocity that respects this bound, some
    step respects it again. Pink's AccelerationLimit takes √(2 a D), for continuous braking, which may leave no step:
    so in a quarter of the steps of Pandas that were driven into their limits at 100 Hz with 10 rad/s².

    For models whose joints have one coordinate each.

    Parameters
    ----------
    model : pinocchio.Model
        With position limits.
    velocity_limits, acceleration_limits : ndarray, shape (nv,)
        Infinite where there is none.

    Attributes
    ----------
    last_step : ndarray, shape (nv,)
        Displacement in the step before [rad or m]; the caller keeps it up to date.

    See Also
    --------
    CollisionLimit : another limit for ``pink.solve_ik``.
    MotionLimits : where the figures come from.
    """

    def __init__(self, model: pin.Model, velocity_limits: Array, acceleration_limits: Array):
        self.lower, self.upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
        self.velocity_limits, self.acceleration_limits = velocity_limits, acceleration_limits
        self.last_step = np.zeros(model.nv)
        eye = np.eye(model.nv)
        self._sides = np.concatenate([eye, -eye])

    def __repr__(self) -> str:
        return f"BrakingLimit(velocity_limits={self.velocity_limits}, acceleration_limits={self.acceleration_limits})"

    def compute_qp_inequalities(self, configuration: Configuration, dt: float) -> tuple[Array, Array]:
        """Pair (G, h) of G Δq ≤ h, shapes (2 nv, nv) and (2 nv,)."""
        least, most = self.bounds(configuration.q, dt)
        return self._sides, np.concatenate([most, -least])

    def bounds(self, q: Array, dt: float) -> tuple[Array, Array]:
        """Smallest and largest displacements in the next step, shapes (nv,)."""
        change = self.acceleration_limits * dt * dt
        farthest = self.velocity_limits * dt
        most = np.minimum(np.minimum(farthest, self.last_step + change), _braking(self.upper - q, change))
        least = -np.minimum(np.minimum(farthest, change - self.last_step), _braking(q - self.lower, change))
        return np.minimum(least, most), most


def _braking(way: Array, change: Array) -> Array:
    """Largest step from which a joint comes to rest within `way`, slower by `change` each step."""
    way = np.maximum(way, 0.0)
    steps = np.maximum(np.ceil(0.5 * (np.sqrt(1.0 + 8.0 * way / change) - 1.0)), 1.0)
    spare = np.where(steps > 1.0, 0.5 * np.where(np.isinf(change), 0.0, change) * steps * (steps - 1.0), 0.0)
    return (way + spare) / steps
