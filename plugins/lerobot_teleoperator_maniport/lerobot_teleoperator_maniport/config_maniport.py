"""Options of the teleoperator."""

from dataclasses import dataclass, field

from lerobot.teleoperators.config import TeleoperatorConfig

UNITS = ("deg", "rad")


@TeleoperatorConfig.register_subclass("maniport")
@dataclass(kw_only=True)
class ManiportTeleopConfig(TeleoperatorConfig):
    """Options of the teleoperator.

    Attributes
    ----------
    joints : dict of str to str
        LeRobot's name of each joint of ``maniport live``.
    unit : {"deg", "rad"}
        Unit of the revolute joints of the robot in LeRobot; prismatic joints are in meters.
    fixed : dict of str to float
        Constant parts of the action, by their whole name, such as ``gripper.pos``.
    udp : int
        Port of ``maniport live --udp``.
    send : int
        Port of ``maniport live --send``, at which answers arrive.
    host : str
        Address of this machine; other machines are not listened to by default.
    timeout : float
        Time to wait for ``maniport live`` [s].
    """

    joints: dict[str, str]
    unit: str
    fixed: dict[str, float] = field(default_factory=dict)
    udp: int = 9000
    send: int = 9001
    host: str = "127.0.0.1"
    timeout: float = 10.0

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise ValueError(f"unit must be one of {', '.join(UNITS)}; found {self.unit!r}")
        if not self.joints:
            raise ValueError("joints must have the name in LeRobot of each joint of maniport live")
        names = [f"{name}.pos" for name in self.joints.values()]
        repeated = {name for name in names if names.count(name) > 1 or name in self.fixed}
        if repeated:
            raise ValueError(
                f"joints and fixed must name each part of the action once; found "
                f"{', '.join(sorted(repeated))} more often"
            )
        if self.udp == self.send:
            raise ValueError(f"send must be another port than udp; both are {self.udp}")
        if not self.timeout > 0.0:
            raise ValueError(f"timeout must be above 0 s; found {self.timeout}")
