"""Motion problems: what a trajectory or a control step minimizes, within limits and free of collisions."""

from typing import Protocol, runtime_checkable

from maniport.util.validation import Array


@runtime_checkable
class Cost(Protocol):
    """One term of a motion problem: the sum of its squared residuals, at each waypoint.

    Weights are inside the residual, whose unit is that of a distance between ellipsoids: a cost of a position error has
    a weight in 1/m, one of an angle in 1/rad. The planner multiplies the squares by the time that a waypoint stands for.
    Pass own costs as ``plan_motion(costs=[...])``; the controller takes the same objects.
    """

    def residual(self, q: Array, time: Array) -> Array:
        """Return residuals, shape (m, r).

        Parameters
        ----------
        q : ndarray, shape (m, dof)
            Configurations of all joints of the group.
        time : ndarray, shape (m,)
            Time in the demonstration of each configuration [s]. The planner adds waypoints between those of the
            profile, and the controller has its own steps, so a cost is a function of time and not of a row.
        """

    def jacobian(self, q: Array, time: Array) -> Array:
        """Return the derivatives of the residuals with respect to the joints, shape (m, r, dof)."""
