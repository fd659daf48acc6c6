"""A cost of one's own in following: a frame of the robot is held at a height."""

from pink.tasks import Task


class HeightTask(Task):
    """Hold the origin of a frame at a height above the robot's base [m]; `cost` is for a metre."""

    def __init__(self, frame, height, cost=10.0):
        super().__init__(cost=cost)
        self.frame, self.height = frame, height

    def compute_error(self, configuration):
        """How far the frame is above its height, shape (1,)."""
        return configuration.get_transform_frame_to_world(self.frame).translation[2:] - self.height

    def compute_jacobian(self, configuration):
        """How the height changes with the joints, shape (1, nv)."""
        turn = configuration.get_transform_frame_to_world(self.frame).rotation
        return turn[2:] @ configuration.get_frame_jacobian(self.frame)[:3]

    def __repr__(self):
        return f"HeightTask({self.frame!r}, {self.height} m)"
