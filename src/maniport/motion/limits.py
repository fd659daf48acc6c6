"""Hard limits of a control step: braking within position, velocity and acceleration limits, and collisions."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.util.jit import kernel, part
from maniport.util.validation import Array, as_number


@runtime_checkable
class Limit(Protocol):
    """A hard limit of a control step. Pass own limits as ``track(limits=[...])``."""

    def inequalities(self, q: Array, dt: float) -> tuple[Array, Array]:
        """Return G, shape (k, dof), and h, shape (k,), of k ≥ 0 inequalities G Δq ≤ h.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Present configuration [rad or m].
        dt : float
            Duration of the step [s].
        """


class BrakingLimit:
    """Limits of position, velocity and acceleration that never contradict one another.

    A joint may be no faster than it can brake before its position limit. With the distance D to the limit, the
    acceleration a and steps of dt, this velocity is √(2 a D) − a dt / 2, and D / dt where the joint can stop within a
    step. From each configuration and velocity that respects this bound, a step exists that respects it again; the steps
    may have different durations.

    Parameters
    ----------
    lower, upper : ndarray, shape (dof,)
        Position limits [rad or m].
    velocity, acceleration : ndarray, shape (dof,)
        Largest magnitudes; infinite where a joint has no limit.
    """

    def __init__(self, lower: Array, upper: Array, velocity: Array, acceleration: Array):
        self._limits = np.array([lower, upper, velocity, acceleration], dtype=np.float64)

    def __repr__(self) -> str:
        return f"BrakingLimit({', '.join(map(repr, self._limits))})"

    def bounds(self, q: Array, velocity: Array, last_dt: float, dt: float, speed_share: float = 1.0) -> Array:
        """Return the smallest and the largest velocities of the next step, shape (2, dof).

        `velocity` is that of the step before, `last_dt` and `dt` the durations of that and the next step [s]. A joint
        that is faster than the share of the velocity limits that may be used slows down as its acceleration allows.
        """
        bounds = np.empty((2, len(q)))
        _fill_bounds(q, velocity, self._limits, last_dt, dt, speed_share, bounds)
        return bounds

    def move(self, q: Array, velocity: Array, bounds: Array, dt: float) -> tuple[Array, Array]:
        """Return the velocity within bounds, and two configurations (2, dof): after the step, and after braking."""
        achieved, configurations = np.empty(len(q)), np.empty((2, len(q)))
        _fill_step(q, velocity, bounds, self._limits, dt, achieved, configurations)
        return achieved, configurations

    def program(
        self,
        hessian: Array,
        gradients: Array,
        durations: Array,
        bounds: Array,
        speed_share: float,
        rows: Array,
        allowed: Array,
        relaxed: bool,
    ) -> tuple[Array, Array, Array, Array, Array, NDArray[np.int32]]:
        """Return the quadratic program of the velocities in m intervals, times the first duration, for `daqp.solve`.

        The cost is the mean over the durations (m,) of costs at the ends of the intervals, whose Hessian (dof, dof) is
        the same and whose halved gradients (m, dof) are those at the present configuration. `bounds` and the
        inequalities rows (k, dof) · Δq ≤ allowed (k,) hold for the first interval. Later velocities are within the
        share of the limits that may be used, and reached within the limits of acceleration. `relaxed` weakens each
        inequality that no velocity within the bounds satisfies, as little as possible.
        """
        return _program(hessian, gradients, durations, bounds, self._limits, speed_share, rows, allowed, relaxed)  # type: ignore[no-any-return]


@kernel
def _fill_bounds(q, velocity, limits, last_dt, dt, speed_share, bounds):  # type: ignore[no-untyped-def]
    for i in range(len(q)):
        v, a = velocity[i], limits[3, i]
        change = 0.5 * a * (last_dt + dt)
        fastest = max(speed_share * limits[2, i], abs(v) - change)
        upper = min(fastest, v + change, _braking_speed(limits[1, i] - q[i], a, dt))
        bounds[0, i] = min(-min(fastest, change - v, _braking_speed(q[i] - limits[0, i], a, dt)), upper)
        bounds[1, i] = upper


@kernel
def _fill_step(q, velocity, bounds, limits, dt, achieved, configurations):  # type: ignore[no-untyped-def]
    for i in range(len(q)):
        achieved[i] = min(max(velocity[i], bounds[0, i]), bounds[1, i])
        configurations[0, i] = min(max(q[i] + dt * achieved[i], limits[0, i]), limits[1, i])
        slower = max(abs(achieved[i]) - 0.5 * limits[3, i] * dt, 0.0)
        configurations[1, i] = configurations[0, i] + np.sign(achieved[i]) * slower**2 / (2.0 * limits[3, i])


@kernel
def _program(hessian, gradients, durations, bounds, limits, speed_share, rows, allowed, relaxed):  # type: ignore[no-untyped-def]
    stages, dof = gradients.shape
    size, count, dt, unlimited = stages * dof, len(rows), durations[0], 1e30
    quadratic, linear = np.zeros((size, size)), np.zeros(size)
    matrix = np.zeros((count + size - dof, size))
    above = np.full(size + len(matrix), unlimited)
    below = -above
    for k in range(stages):
        for a in range((k + 1) * dof):
            weight = durations[k] / durations.sum() * durations[a // dof] / dt
            linear[a] += weight * gradients[k, a % dof]
            for b in range((k + 1) * dof):
                quadratic[a, b] += weight * durations[b // dof] / dt * hessian[a % dof, b % dof]
    for i in range(dof):
        above[i], below[i] = min(dt * bounds[1, i], unlimited), max(dt * bounds[0, i], -unlimited)
    for i in range(dof, size):
        fastest = min(dt * speed_share * limits[2, i % dof], unlimited)
        above[i], below[i] = max(fastest, above[i - dof]), min(-fastest, below[i - dof])
        row, k = count + i - dof, i // dof
        matrix[row, i], matrix[row, i - dof] = 1.0, -1.0
        change = min(0.5 * (durations[k - 1] + durations[k]) * limits[3, i % dof] * dt, unlimited)
        above[size + row], below[size + row] = change, -change
    matrix[:count, :dof] = rows
    above[size : size + count] = allowed
    for k in range(count if relaxed else 0):
        least = 0.0
        for i in range(dof):
            least += min(rows[k, i] * below[i], rows[k, i] * above[i])
        above[size + k] = max(allowed[k], least + 1e-9 * abs(least))
    return quadratic, linear, matrix, above, below, np.zeros(len(above), np.int32)


@part
def _braking_speed(distance, a, dt):  # type: ignore[no-untyped-def]
    distance, half = max(distance, 0.0), 0.5 * a * dt
    fast = np.sqrt(2.0 * a * distance) - half  # nan without a limit of acceleration
    return fast if fast > half else distance / dt


class CollisionLimit:
    """Keep the distances of collision pairs above a margin.

    A pair with the distance D, which changes by J Δq, may use up a share of it in a step (Faverjon and Tournassoud, A
    local based approach for path planning of manipulators with a high number of degrees of freedom, ICRA 1987):

        J Δq ≥ −(1 − exp(−dt / time_constant)) (D − margin)

    A pair within the margin moves apart, but no faster than with a share of the velocity limits, so that the program
    stays solvable. Distances are computed again after joint motion of 0.045 rad or m, and are linear in between.

    Parameters
    ----------
    collisions : Collisions
        Collision model of the arm or group.
    margin, reach : float
        Smallest distance of pairs, and largest distance of pairs that count [m].
    time_constant : float
        Time constant with which the clearance is used up [s].
    separation_share : float
        Share of the velocity limits with which pairs within the margin move apart, in [0, 1]. With 0 approaching is
        forbidden only, and an arm may always rest; so it is for joints without a velocity limit.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong value, or the arm has no collision geometry.

    Examples
    --------
    >>> import maniport as mp
    >>> arm = mp.load_arm("panda", frame="panda_hand_tcp")
    >>> CollisionLimit(mp.Collisions.of(arm, table=0.0))
    CollisionLimit(Collisions('panda', 36 pairs), margin=0.02, reach=0.1, time_constant=0.1)
    """

    def __init__(
        self,
        collisions: Collisions,
        margin: float = 0.02,
        reach: float = 0.1,
        time_constant: float = 0.1,
        separation_share: float = 0.1,
    ):
        if not isinstance(collisions, Collisions):
            raise InvalidInputError(f"collisions must be a Collisions object; found {type(collisions).__name__}")
        if not collisions.checked:
            raise InvalidInputError(f"collisions: no collision geometry is available: {collisions.reason}")
        self.collisions = collisions
        self.margin = as_number(margin, "margin", minimum=0.0)
        self.reach = as_number(reach, "reach", above=self.margin)
        self.time_constant = as_number(time_constant, "time_constant", above=0.0)
        self.separation_share = as_number(separation_share, "separation_share", minimum=0.0, maximum=1.0)
        speeds = collisions.arm.velocity_limits
        self._speeds = np.zeros(collisions.arm.dof) if speeds is None else np.where(np.isfinite(speeds), speeds, 0.0)
        self.reset()

    def __repr__(self) -> str:
        options = ", ".join(f"{name}={getattr(self, name)}" for name in ("margin", "reach", "time_constant"))
        return f"CollisionLimit({self.collisions!r}, {options})"

    def reset(self) -> None:
        """Discard distances computed for earlier configurations."""
        self._q: Array | None = None
        self._distance, self._slope = np.empty(0), np.empty((0, 0))

    def inequalities(self, q: Array, dt: float) -> tuple[Array, Array]:
        """Return G and h of G Δq ≤ h, shapes (k, dof) and (k,), for the k pairs within reach."""
        if self._q is None or (q - self._q) @ (q - self._q) > 0.045**2:
            self._q = q.copy()
            self._distance, self._slope = self.collisions.gradient(q[None], self.reach, scaled=True)[1:]
        slope = self._slope
        if not len(slope):
            return np.empty((0, len(q))), np.empty(0)
        distance = self._distance + slope @ (q - self._q)
        allowed = -np.expm1(-dt / self.time_constant) * (distance - self.margin)
        return -slope, np.maximum(allowed, -self.separation_share * dt * np.abs(slope) @ self._speeds)
