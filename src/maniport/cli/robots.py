"""Options that choose a robot's moving joints and frames, for commands that take a robot or a pair of arms."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees, isfinite, radians
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli.application import group, require_none
from maniport.errors import InvalidInputError
from maniport.util.defaults import AUTO, BOTH

if TYPE_CHECKING:
    from maniport.arms import Arm, ArmGroup

NO_ROBOT = "name the robot with --robot"

ROUNDED = 5e-3  # Half of the last printed digit of limits [deg or m]; a printed limit may be given as a position


def _one_arm(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel="Which part of the robot moves", **more)


@dataclass
class Chain:
    """Part of a robot that moves."""

    frame: Annotated[
        str | None, _one_arm("Frame of the end effector; by default the frame that carries the gripper.")
    ] = None
    joints: Annotated[
        list[str] | None, _one_arm("Moving joints, separated by commas; the others are held.", metavar="J1,J2,…")
    ] = None
    base: Annotated[
        str | None, _one_arm("First frame of the chain, such as a torso; positions are relative to it.")
    ] = None
    lock: Annotated[
        list[str] | None,
        _one_arm("Held joint and its position [deg; m for prismatic joints]; repeatable.", metavar="JOINT=POSITION"),
    ] = None
    held: dict[str, float] = field(init=False)  # positions of `lock` [deg or m]

    def __post_init__(self) -> None:
        names = [name.strip() for text in self.joints or () for name in text.split(",") if name.strip()]
        if self.joints and not names:
            raise InvalidInputError(f"--joints must be names with commas between them; found {','.join(self.joints)!r}")
        self.joints = names or None
        self.held = {}
        for text in self.lock or ():
            name, value = (part.strip() for part in text.rpartition("=")[::2])
            try:
                position = float(value)
            except ValueError:
                raise InvalidInputError(
                    f"--lock must be a joint and its position, such as lift=0.2; found {text!r}"
                ) from None
            if name in self.held:
                raise InvalidInputError(f"--lock: {name} is held twice; found {self.held[name]:g} and {position:g}")
            self.held[name] = position

    def require_none(self, why: str) -> None:
        """Raise if one of the options was given."""
        given = {"frame": self.frame, "joints": self.joints, "base": self.base, "lock": self.lock or None}
        require_none(given, "chooses a part of a robot", why)

    def load(self, robot: str, side: str = AUTO, height: float | None = None) -> "Arm":
        """Load an arm by name or from a file; of a person the right arm where `side` is auto."""
        from maniport.arms import load_arm
        from maniport.arms.loaders import read_arm

        lock = {}
        if self.held:
            whole = read_arm(robot, self.frame, self.joints, self.base)
            joints = zip(whole.units, whole.lower, whole.upper, strict=True)
            lock = _in_own_units(self.held, dict(zip(whole.coordinates, joints, strict=True)))
        person: dict[str, Any] = {"side": None if side == AUTO else side, "height": height}
        return load_arm(robot, self.frame, self.joints, base=self.base, lock=lock, **person)


def _in_own_units(lock: Mapping[str, float], joints: Mapping[str, tuple[str, float, float]]) -> dict[str, float]:
    """Convert positions of held joints from degrees [rad or m]; `joints` has unit and limits of each joint."""
    positions = dict(lock)  # the library refuses joints that the robot does not have
    for name, (unit, low, high) in joints.items():
        if name in positions and unit == "rad":
            if isfinite(low) and not degrees(low) - ROUNDED <= positions[name] <= degrees(high) + ROUNDED:
                raise InvalidInputError(
                    f"--lock: {name} is {positions[name]:g}°; allowed are {degrees(low):.2f}° to {degrees(high):.2f}°"
                )
            positions[name] = min(max(radians(positions[name]), float(low)), float(high))
    return positions


takes_chain = group("chain", Chain)  # Gives a command that has a parameter `chain` these options

Base = tuple[float, float, float, float]


def _two_arms(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel="Both arms (--arm both)", **more)


@dataclass
class Pair:
    """Two arms of a robot, or two robots."""

    frames: Annotated[
        tuple[str, str] | None,
        _two_arms("Frames of both end effectors; by default the ends of the robot's two arms.", metavar="LEFT RIGHT"),
    ] = None
    robot_right: Annotated[
        str | None, _two_arms("The right one of two robots, if it differs from --robot, the left one.")
    ] = None
    base_left: Annotated[
        Base | None, _two_arms("Base of the left of two robots: x, y, z [m] and yaw [deg].", metavar="X Y Z YAW")
    ] = None
    base_right: Annotated[Base | None, _two_arms("Base of the right robot.", metavar="X Y Z YAW")] = None
    tips: Annotated[
        str | None,
        _two_arms(
            "placed: both end effectors follow the paths of the hands, which are placed together; relative: only "
            "their relative position follows the hands. By default placed."
        ),
    ] = None

    def require_none(self) -> None:
        """Raise if one of the options was given."""
        given = {name.replace("_", "-"): value for name, value in vars(self).items()}
        require_none(given, "is for two arms", f"--arm {BOTH} takes both of the person")

    def load(self, robot: str, chain: Chain) -> "ArmGroup":
        """Load the two arms of a robot, or of two robots."""
        from maniport.arms import load_arms
        from maniport.arms.arm_group import two_bases

        instead = f"with --arm {BOTH} there are two: --frames LEFT RIGHT, --base-left and --base-right"
        require_none({"frame": chain.frame, "base": chain.base}, "is that of one arm", instead)
        placed = {"base-left": self.base_left, "base-right": self.base_right}
        given = [name for name, base in placed.items() if base is not None]
        missing = [name for name in placed if name not in given]
        if given and missing:
            raise InvalidInputError(f"--{given[0]} places one of two robots; give --{missing[0]}, too")
        bases = [(*base[:3], radians(base[3])) for base in placed.values() if base is not None] or None
        if self.robot_right is not None and bases is None:
            raise InvalidInputError(
                f"--robot-right names the right one of two robots; say where both stand with {two_bases()}"
            )
        robots = robot if self.robot_right is None else (robot, self.robot_right)
        options: dict[str, Any] = {"bases": bases, "joints": chain.joints}
        whole = load_arms(robots, self.frames, **options)
        if not chain.held:
            return whole
        units = {
            name: (unit, low, high)
            for arm in (*whole.arms, whole)  # a name that both robots have stands for both joints
            for name, unit, low, high in zip(arm.joint_names, arm.joint_units, arm.lower, arm.upper, strict=True)
        }
        return load_arms(robots, self.frames, **options, lock=_in_own_units(chain.held, units))


takes_pair = group("pair", Pair)  # Gives a command that has a parameter `pair` these options
