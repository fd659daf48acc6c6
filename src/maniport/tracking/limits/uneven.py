"""Position, velocity and acceleration limits for control steps that are not equally long."""

import numpy as np
from pink.configuration import Configuration
from pink.limits import Limit

from maniport.jit import kernel, part
from maniport.tracking.motion_limits import MotionLimits
from maniport.validation import Array


class UnevenLimit(Limit):  # type: ignore[misc]  # Pink is untyped
    """What `BrakingLimit` keeps, where a control step takes as long as the time since the last one.

    Between steps a joint has the constant velocity v, so that its acceleration is the change of v over the time between
    the middles of two steps, (v − v₀) / ½(Δt₀ + Δt). A joint whose velocity falls by the acceleration a, from the
    middle of a step with v on, is at rest after (v − ½ a Δt)² / 2a beyond the end of that step, however long those are
    that follow. With the way D to its limit it may thus go at

        v = √(2 a D) − ½ a Δt,   or D / Δt where that is more than v = ½ a Δt allows,

    and from each state that keeps to this some step does again.

    For models whose joints have one coordinate each.

    Parameters
    ----------
    limits : MotionLimits

    Attributes
    ----------
    velocity : ndarray, shape (dof,)
        In the step before [rad/s or m/s]; the caller keeps it and the next up to date.
    last : float or None
        How long that step took [s]; None before the first.
    share : float
        Of the velocity limits; joints that are faster become slower as they can.
    """

    def __init__(self, limits: MotionLimits):
        self.limits = limits
        self.velocity = np.zeros(limits.arm.dof)
        self.last: float | None = None
        self.share = 1.0
        eye = np.eye(limits.arm.dof)
        self._sides = np.concatenate([eye, -eye])
        self._ends = np.ascontiguousarray([limits.lower, limits.upper, limits.velocity, limits.acceleration])

    def __repr__(self) -> str:
        return f"UnevenLimit({self.limits!r})"

    def compute_qp_inequalities(self, configuration: Configuration, dt: float) -> tuple[Array, Array]:
        """Pair (G, h) of G Δq ≤ h, shapes (2 dof, dof) and (2 dof,)."""
        least, most = self.bounds(configuration.q, dt)
        return self._sides, dt * np.concatenate([most, -least])

    def bounds(self, q: Array, dt: float) -> tuple[Array, Array]:
        """Smallest and largest velocities in the next step, shapes (dof,)."""
        found = np.empty((2, len(self.velocity)))
        fill_bounds(q, self.velocity, self._ends, dt if self.last is None else self.last, dt, self.share, found)
        return found[0], found[1]

    def step(self, q: Array, velocity: Array, dt: float) -> tuple[Array, Array]:
        """Take a step of dt [s] from q (dof,), as fast as asked for or as limits allow."""
        bounds, made, postures = np.empty((2, len(q))), np.empty(len(q)), np.empty((2, len(q)))
        fill_bounds(q, self.velocity, self._ends, dt if self.last is None else self.last, dt, self.share, bounds)
        fill_step(q, velocity, bounds, self._ends, dt, made, postures)
        return made, postures


@kernel
def fill_bounds(q, velocity, ends, last, dt, share, found):  # type: ignore[no-untyped-def]
    """Write smallest and largest velocities (2, dof) after a step that took `last`; see `UnevenLimit`."""
    for i in range(len(q)):
        v, a = velocity[i], ends[3, i]
        change = 0.5 * a * (last + dt)
        fastest = max(share * ends[2, i], abs(v) - change)
        most = min(fastest, v + change, _braking(ends[1, i] - q[i], a, dt))
        found[0, i] = min(-min(fastest, change - v, _braking(q[i] - ends[0, i], a, dt)), most)
        found[1, i] = most


@kernel
def fill_step(q, asked, bounds, ends, dt, made, postures):  # type: ignore[no-untyped-def]
    """Write velocities within bounds (2, dof), where they lead, and where joints then rest; see `UnevenLimit.step`."""
    for i in range(len(q)):
        made[i] = min(max(asked[i], bounds[0, i]), bounds[1, i])
        postures[0, i] = min(max(q[i] + dt * made[i], ends[0, i]), ends[1, i])
        slower = max(abs(made[i]) - 0.5 * ends[3, i] * dt, 0.0)
        postures[1, i] = postures[0, i] + np.sign(made[i]) * slower**2 / (2.0 * ends[3, i])


@part
def _braking(way, a, dt):  # type: ignore[no-untyped-def]
    way, half = max(way, 0.0), 0.5 * a * dt
    fast = np.sqrt(2.0 * a * way) - half
    return fast if fast > half else way / dt
