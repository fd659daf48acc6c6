"""Which part of a robot moves: options that all verbs share which take a robot."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maniport.cli.groups import group, require_none
from maniport.defaults import AUTO
from maniport.errors import InvalidInputError

if TYPE_CHECKING:
    from maniport.bodies import Arm


NO_ROBOT = "name the robot with --robot"

ROUNDED = 5e-3
"""Limits are told with two decimals, and what was told may be given [deg] or [m]."""


class Chain:
    """What the options below were set to.

    Parameters
    ----------
    frame, base : str or None
        As `maniport.load_arm` takes them.
    joints : list of str or None
        Names, or several with commas between them.
    lock : list of str or None
        Texts such as ``lift=0.2``.
    """

    def __init__(self, frame: str | None, joints: list[str] | None, base: str | None, lock: list[str] | None):
        self.frame, self.base = frame, base
        names = [name.strip() for text in joints or () for name in text.split(",") if name.strip()]
        if joints and not names:
            raise InvalidInputError(f"--joints must be names with commas between them; found {','.join(joints)!r}")
        self.joints = names or None
        self.lock: dict[str, float] = {}
        for text in lock or ():
            name, value = (part.strip() for part in text.rpartition("=")[::2])
            try:
                position = float(value)
            except ValueError:
                raise InvalidInputError(
                    f"--lock must be a joint and its position, such as lift=0.2; found {text!r}"
                ) from None
            if name in self.lock:
                raise InvalidInputError(f"--lock: {name} is held twice; found {self.lock[name]:g} and {position:g}")
            self.lock[name] = position

    def require_none(self, why: str) -> None:
        """Raise when one of the options was given; `why` says what is missing for it."""
        given = {"frame": self.frame, "joints": self.joints, "base": self.base, "lock": self.lock or None}
        require_none(given, "chooses a part of a robot", why)

    def load(self, robot: str, side: str = AUTO, height: float | None = None) -> "Arm":
        """The arm that is meant of a robot, by name or from a file; of a person the right one where `side` is auto."""
        from maniport.bodies import load_arm

        whose: dict[str, Any] = {"side": None if side == AUTO else side, "height": height}
        return load_arm(robot, self.frame, self.joints, base=self.base, lock=self._positions(robot), **whose)

    def _positions(self, robot: str) -> dict[str, float]:
        """Where joints are held [rad or m]; they are given in degrees and metres."""
        from maniport.bodies.readers import read_arm

        if not self.lock:
            return {}
        whole = read_arm(robot, self.frame, self.joints, self.base)
        return in_own_units(
            self.lock,
            dict(zip(whole.coordinates, zip(whole.units, whole.lower, whole.upper, strict=True), strict=True)),
        )


def in_own_units(lock: Mapping[str, float], joints: Mapping[str, tuple[str, float, float]]) -> dict[str, float]:
    """Where joints are held [rad or m], from degrees and metres; `joints`: unit and limits of those there are."""
    from math import degrees, isfinite, radians

    found = dict(lock)  # of others it is said that they are not there
    for name, (unit, low, high) in joints.items():
        if name in found and unit == "rad":
            if isfinite(low) and not degrees(low) - ROUNDED <= found[name] <= degrees(high) + ROUNDED:
                raise InvalidInputError(
                    f"--lock: {name} is {found[name]:g}°; allowed are {degrees(low):.2f}° to {degrees(high):.2f}°"
                )
            found[name] = min(max(radians(found[name]), float(low)), float(high))
    return found


def _option(help: str, **more: Any) -> Any:
    return typer.Option(help=help, rich_help_panel="Which part of the robot moves", **more)


def _options(
    frame: Annotated[str | None, _option("Frame at the tip; by default what carries the gripper.")] = None,
    joints: Annotated[
        list[str] | None, _option("Joints that move, with commas between them; the others are held.", metavar="J1,J2,…")
    ] = None,
    base: Annotated[
        str | None, _option("Frame with which the chain begins, such as a torso; positions are told in it.")
    ] = None,
    lock: Annotated[
        list[str] | None,
        _option(
            "A joint that is held, and where, in degrees, of sliding joints in metres; may be given several times.",
            metavar="JOINT=POSITION",
        ),
    ] = None,
) -> None:
    """Nothing: its parameters are the options."""


takes_chain = group("chain", _options, Chain)
"""Gives a verb that has a parameter `chain` these options."""
