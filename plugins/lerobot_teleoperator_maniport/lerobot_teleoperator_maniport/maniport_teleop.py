"""The teleoperator."""

import logging
import math
from typing import Any

from lerobot.teleoperators.teleoperator import Teleoperator

from lerobot_teleoperator_maniport.answers import Answers
from lerobot_teleoperator_maniport.config_maniport import ManiportTeleopConfig

try:
    from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
except ImportError:  # before 0.4
    from lerobot.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

METERS = "m"


class ManiportTeleop(Teleoperator):
    """A robot follows a person by ``maniport live``, whose joint positions are the actions.

    Parameters
    ----------
    config : ManiportTeleopConfig
    """

    config_class = ManiportTeleopConfig
    name = "maniport"

    def __init__(self, config: ManiportTeleopConfig):
        self._answers: Answers | None = None
        super().__init__(config)
        self.config = config
        self._factors: dict[str, float] = {}  # from rad or m to the units of the action
        self._joints: dict[str, float] = {}  # newest ones [rad or m]

    @property
    def action_features(self) -> dict[str, type]:
        """Type of each part of the action."""
        names = [f"{name}.pos" for name in self.config.joints.values()]
        return dict.fromkeys([*names, *self.config.fixed], float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """Nothing: ``maniport live`` gets measured joints with the frames of the sensor."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether ``maniport live`` has named its joints."""
        return self._answers is not None

    @property
    def is_calibrated(self) -> bool:
        """Whether the teleoperator is calibrated: the recording of ``maniport live`` is its calibration."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Ask ``maniport live`` for its joints.

        Raises
        ------
        ConnectionError
            When it does not answer.
        ValueError
            When its joints are others than those of the options.
        """
        if self.is_connected:
            raise DeviceAlreadyConnectedError(f"{self} is already connected")
        config = self.config
        answers = Answers(config.host, config.udp, config.send)
        try:
            first = answers.first_line(config.timeout)
            units = dict(first["units"])
            self._joints = {str(name): float(value) for name, value in dict(first["start"]).items()}
            self._factors = self._unit_factors(units)
        except BaseException:
            answers.close()
            raise
        self._answers = answers

    def _unit_factors(self, units: dict[str, str]) -> dict[str, float]:
        """Return the factor of each joint; `ValueError` where the options have other joints."""
        if set(units) != set(self.config.joints):
            raise ValueError(
                f"joints must be those of maniport live, {', '.join(units)}; found "
                f"{', '.join(self.config.joints)}"
            )
        factors = {}
        for name, unit in units.items():
            factors[name] = 1.0
            if unit != METERS and self.config.unit == "deg":
                factors[name] = math.degrees(1.0)
        return factors

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""

    def get_action(self) -> dict[str, float]:
        """Return the newest joint positions, before the first answer the start configuration of ``maniport live``."""
        if self._answers is None:
            raise DeviceNotConnectedError(f"{self} is not connected")
        joints = self._answers.newest_joints()
        if joints is not None:
            self._joints = joints
        self._log_errors(self._answers.errors)
        action = {}
        for name, of_robot in self.config.joints.items():
            action[f"{of_robot}.pos"] = self._factors[name] * self._joints[name]
        return {**action, **self.config.fixed}

    def _log_errors(self, errors: list[str]) -> None:
        for text in errors:
            logging.warning("maniport live: %s", text)
        errors.clear()

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: there is no feedback."""

    def disconnect(self) -> None:
        """Close the port."""
        if self._answers is None:
            raise DeviceNotConnectedError(f"{self} is not connected")
        self._answers.close()
        self._answers = None
