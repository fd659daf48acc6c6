"""Limits for Pink: braking in equal or unequal control steps, and collisions."""

import numpy as np
import pinocchio as pin
from pink.configuration import Configuration
from pink.limits import Limit

from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.motion.motion_limits import MotionLimits
from maniport.util.jit import kernel, part
from maniport.util.validation import Array, as_number


class BrakingLimit(Limit):  # type: ignore[misc]  # Pink is untyped
    """Keep joints within their limits of position, velocity and acceleration, which never contradict one another.

    A joint may be no faster than it can brake in whole steps. With the distance D to its limit and the acceleration a,
    braking takes n steps with n (n − 1) / 2 ≤ D / (a dt²) ≤ n (n + 1) / 2, and the largest first step is

        Δq = (D + a dt² n (n − 1) / 2) / n,

    since the steps Δq, Δq − a dt², … sum up to D. From each configuration and velocity that respects this bound, some
    step respects it again. Pink's AccelerationLimit takes √(2 a D), for continuous braking, which may leave no step.

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


class CollisionLimit(Limit):  # type: ignore[misc]  # Pink is untyped
    """Keep the distances of hulls above a margin.

    A pair with the distance D, which changes by J Δq, may use up a share of it in a step (Faverjon and Tournassoud, A
    local based approach for path planning of manipulators with a high number of degrees of freedom, ICRA 1987):

        J Δq ≥ −gain (D − margin)

    What is nearer than the margin must get away, but no faster than with a share of the velocity limits, so that the
    program stays solvable; where none is known only approaching is forbidden.

    Parameters
    ----------
    collisions : Collisions
        Of the arm whose `maniport.motion.robot_model` the limit is for.
    margin : float
        [m].
    reach : float
        Only pairs nearer than this count [m].
    gain : float
        Share of the distance used up in a step, in (0, 1].
    way_out : float
        Share of the velocity limits with which to get away, at most 1; with 0 only approaching is forbidden, and an
        arm may always rest.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong value, or no collision geometry is known.

    Examples
    --------
    >>> import maniport as mp
    >>> arm = mp.load_arm("panda", frame="panda_hand_tcp")
    >>> CollisionLimit(mp.Collisions.of(arm, table=0.0))
    CollisionLimit(Collisions('panda', 36 pairs, padding 0 m), joint_limit_margin=0.02, reach=0.1, gain=0.3)
    """

    def __init__(
        self, collisions: Collisions, margin: float = 0.02, reach: float = 0.1, gain: float = 0.3, way_out: float = 0.1
    ):
        if not isinstance(collisions, Collisions):
            raise InvalidInputError(f"collisions must be a Collisions object; found {type(collisions).__name__}")
        if not collisions.known:
            raise InvalidInputError(f"collisions: nothing is known that could collide: {collisions.why}")
        self.collisions = collisions
        self.margin = as_number(margin, "margin", minimum=0.0)
        self.reach = as_number(reach, "reach", above=self.margin)
        self.gain = as_number(gain, "gain", above=0.0, maximum=1.0)
        self.way_out = as_number(way_out, "way_out", minimum=0.0, maximum=1.0)
        self._watch = collisions.watch(self.reach)  # steps are small: what was far apart need not be looked at

    def __repr__(self) -> str:
        return f"CollisionLimit({self.collisions!r}, joint_limit_margin={self.margin}, reach={self.reach}, gain={self.gain})"

    def near(self, q: Array) -> tuple[Array, Array]:
        """Distances (k,) of the pairs within reach at q (dof,), and their derivatives (k, dof)."""
        return self._watch.gradient(q[None])[1:]

    def compute_qp_inequalities(self, configuration: Configuration, dt: float) -> tuple[Array, Array] | None:
        """Pair (G, h) of G Δq ≤ h, shapes (k, nv) and (k,), for the k pairs within reach; None where there are none."""
        distance, slope = self.near(configuration.q)
        if not len(distance):
            return None
        allowed = self.gain * (distance - self.margin)
        if self.way_out == 0.0:
            return -slope, np.maximum(allowed, 0.0)
        speeds = configuration.model.velocityLimit
        known = np.where(np.isfinite(speeds), speeds, 0.0)
        return -slope, np.maximum(allowed, -self.way_out * dt * np.abs(slope) @ known)


class RememberingLimit(CollisionLimit):
    """The same with distances that are computed again after joint motion of 0.045 rad or m, and linear in between."""

    def __init__(self, collisions: Collisions, way_out: float = 0.1):
        super().__init__(collisions, way_out=way_out)
        self.forget()

    def forget(self) -> None:
        """Know nothing of distances."""
        self._watch = self.collisions.watch(self.reach)
        self._at: Array | None = None
        self._known = np.empty(0), np.empty((0, 0))

    def near(self, q: Array) -> tuple[Array, Array]:
        """As `CollisionLimit.near` gives them."""
        away = None if self._at is None else q - self._at
        if away is None or away @ away > 0.045**2:
            self._at, self._known = q.copy(), self._watch.gradient(q[None])[1:]
            return self._known
        distance, slope = self._known
        return distance + slope @ away, slope

    def free(self, q: Array) -> bool:
        """Whether none of the postures (n, dof) collides."""
        return self._watch.free(q, self.collisions.padding)


class UnevenLimit(Limit):  # type: ignore[misc]  # Pink is untyped
    """As `BrakingLimit`, for control steps that take as long as the time since the last one."""

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
        most = min(fastest, v + change, _braking_speed(ends[1, i] - q[i], a, dt))
        found[0, i] = min(-min(fastest, change - v, _braking_speed(q[i] - ends[0, i], a, dt)), most)
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
def _braking_speed(way, a, dt):  # type: ignore[no-untyped-def]
    way, half = max(way, 0.0), 0.5 * a * dt
    fast = np.sqrt(2.0 * a * way) - half
    return fast if fast > half else way / dt
