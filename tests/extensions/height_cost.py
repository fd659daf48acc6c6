"""A cost of one's own: a point of the robot is held at a height."""


class HeightCost:
    """Hold the origin of a frame at a height above the robot's base [m]; the weight is for a meter [1/m]."""

    def __init__(self, arm, frame, height, weight=10.0):
        self.arm = arm
        self.frame = frame
        self.height = height
        self.weight = weight

    def residual(self, at):
        """Return weighted height errors of n configurations, shape (n, 1)."""
        heights = self.arm.point_positions(at.joint_positions, [self.frame])[:, 0, 2:]
        return self.weight * (heights - self.height)

    def jacobian(self, at):
        """Return their derivatives with respect to the joints, shape (n, 1, dof)."""
        return self.weight * self.arm.point_jacobians(at.joint_positions, [self.frame])[:, 0, 2:3]
