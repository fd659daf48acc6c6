"""Two arms of a robot, or two robots: options of the verb that moves both."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli.chain import Chain, in_own_units
from maniport.cli.groups import group, require_none
from maniport.defaults import BOTH
from maniport.errors import InvalidInputError

if TYPE_CHECKING:
    from maniport.bodies import Arms

Base = tuple[float, float, float, float]


class Pair:
    """What the options below were set to.

    Parameters
    ----------
    frames : (str, str) or None
        As `maniport.load_arms` takes them.
    robot_right : str or None
        The right one of two robots that differ.
    base_left, base_right : four floats or None
        x, y, z [m] and yaw [deg].
    tips : str or None
        As `maniport.transfer_both` takes it.
    """

    def __init__(
        self,
        frames: tuple[str, str] | None,
        robot_right: str | None,
        base_left: Base | None,
        base_right: Base | None,
        tips: str | None,
    ):
        self.frames, self.robot_right, self.given_tips = frames, robot_right, tips
        self.bases = {"base-left": base_left, "base-right": base_right}

    def require_none(self) -> None:
        """Raise when one of the options was given."""
        own = {"frames": self.frames, "robot-right": self.robot_right, **self.bases, "tips": self.given_tips}
        require_none(own, "is for two arms", f"--arm {BOTH} takes both of the person")

    @property
    def tips(self) -> dict[str, str]:
        """What is asked for of the tips, as `maniport.transfer_both` takes it."""
        return {} if self.given_tips is None else {"tips": self.given_tips}

    def load(self, robot: str, chain: Chain) -> "Arms":
        """The two arms that are meant of a robot, or of two."""
        from math import radians

        from maniport.bodies import load_arms
        from maniport.bodies.arms import two_bases

        instead = f"with --arm {BOTH} there are two: --frames LEFT RIGHT, --base-left and --base-right"
        require_none({"frame": chain.frame, "base": chain.base}, "is that of one arm", instead)
        given = [name for name, base in self.bases.items() if base is not None]
        if len(given) == 1:
            other = next(name for name in self.bases if name not in given)
            raise InvalidInputError(f"--{given[0]} places one of two robots; give --{other}, too")
        bases = [(*base[:3], radians(base[3])) for base in self.bases.values() if base is not None] or None
        if self.robot_right is not None and bases is None:
            raise InvalidInputError(
                f"--robot-right names the right one of two robots; say where both stand with {two_bases()}"
            )
        robots = robot if self.robot_right is None else (robot, self.robot_right)
        whole = load_arms(robots, self.frames, bases=bases, joints=chain.joints)
        if not chain.lock:
            return whole
        units = {
            name: (unit, low, high)
            for arm in (*whole.each, whole)  # where both robots have a joint of a name it is that of both
            for name, unit, low, high in zip(arm.joint_names, arm.joint_units, arm.lower, arm.upper, strict=True)
        }
        lock = in_own_units(chain.lock, units)
        return load_arms(robots, self.frames, bases=bases, joints=chain.joints, lock=lock)


def _option(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel="Both arms (--arm both)", **more)


def _options(
    frames: Annotated[
        tuple[str, str] | None,
        _option("Frames at both tips of the robot; by default the ends of its two arms.", metavar="LEFT RIGHT"),
    ] = None,
    robot_right: Annotated[
        str | None, _option("The right one of two robots, where it is another than --robot, the left one.")
    ] = None,
    base_left: Annotated[
        Base | None,
        _option("Where the left of two robots stands: x, y, z [m] and the yaw [deg].", metavar="X Y Z YAW"),
    ] = None,
    base_right: Annotated[Base | None, _option("Where the right one stands.", metavar="X Y Z YAW")] = None,
    tips: Annotated[
        str | None,
        _option(
            "placed: both tips are on the paths of the hands, which have one place; relative: they go as the hands do "
            "beside one another alone, wherever the arms make the ellipsoids better. By default placed."
        ),
    ] = None,
) -> None:
    """Nothing: its parameters are the options."""


takes_pair = group("pair", _options, Pair)
"""Gives a verb that has a parameter `pair` these options."""
