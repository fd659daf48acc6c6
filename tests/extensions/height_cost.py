"""A cost of one's own: a point of the robot is held at a height."""


class HeightCost:
    """Hold the origin of a frame at a height above the robot's base [m]; the weight is for a meter [1/m]."""

    def __init__(self, arm, frame, height, weight=10.0):
        self.arm, self.frame, self.height, self.weight = arm, frame, height, weight

    def residual(self, q, time):
        """Return weighted height errors of m configurations, shape (m, 1)."""
        return self.weight * (self.arm.point_positions(q, [self.frame])[:, 0, 2:] - self.height)

    def jacobian(self, q, time):
        """Return their derivatives with respect to the joints, shape (m, 1, dof)."""
        return self.weight * self.arm.point_jacobians(q, [self.frame])[:, 0, 2:3]
