"""Positions of joints that were typed in degrees, or in metres for prismatic joints."""

from dataclasses import replace
from math import degrees, inf, isfinite, radians
from typing import Any

from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.util.defaults import BOTH


def in_si_units(config: Config, typed: dict[str, Any]) -> Config:
    """Convert `lock` and `home`, where they were typed, to rad or m; this loads the robot."""
    if typed.get("lock"):
        joints = _joints(config)  # those that the robot lacks are refused when it is loaded
        lock = {name: _position("--lock", name, value, *joints.get(name, ("", -inf, inf)))
                for name, value in typed["lock"].items()}  # fmt: skip
        config = config.changed(lock=lock)
    if typed.get("home") is not None:
        from maniport.motion import MotionLimits

        arm = config.robot.load(config.human.side == BOTH)
        arm = MotionLimits.of(arm, config.motion.limits, config.motion.joint_limit_margin).arm
        if len(typed["home"]) != arm.dof:
            names = ", ".join(arm.joint_names)
            raise InvalidInputError(f"--home must have {arm.dof} numbers, for {names}; found {len(typed['home'])}")
        rows = zip(arm.joint_names, typed["home"], arm.joint_units, arm.lower, arm.upper, strict=True)
        config = config.changed(home=tuple(_position("--home", *row) for row in rows))
    return config


def _joints(config: Config) -> dict[str, tuple[str, float, float]]:
    """Return unit, lower and upper limit of all joints by name, also of those that do not move."""
    options, both = config.robot, config.human.side == BOTH
    if not (both or options.several):
        from maniport.arms.loaders import read_arm

        frame = options.frame[0] if options.frame else None
        chain = read_arm(options.robot[0], frame, options.joints or None, options.base)
        return dict(zip(chain.coordinates, zip(chain.units, chain.lower, chain.upper, strict=True), strict=True))
    group = replace(options, lock=None).load(both)
    limits = zip(group.joint_units, group.lower, group.upper, strict=True)
    return dict(zip(group.joint_names, limits, strict=True))


def _position(
    option: str, name: str, value: float, unit: str, low: float, high: float, rounding: float = 5e-3
) -> float:
    """Convert a position from degrees if the unit is rad; a limit that was rounded as printed counts as the limit."""
    turns = unit == "rad"
    least, most = (degrees(low), degrees(high)) if turns else (low, high)
    if isfinite(least) and not least - rounding <= value <= most + rounding:
        sign = "°" if turns else " m"
        raise InvalidInputError(
            f"{option}: {name} is {value:g}{sign}; allowed are {least:.2f}{sign} to {most:.2f}{sign}, with the margin"
        )
    return min(max(radians(value) if turns else value, float(low)), float(high))
