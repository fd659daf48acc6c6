"""Options of motion planning that several commands share: mm, degrees and percent; SI units in the library."""

import inspect
from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.cli.application import group
from maniport.cli.robots import ROUNDED
from maniport.errors import InvalidInputError
from maniport.util.defaults import BATCH_EFFORT, BATCH_RATE, EFFORT, MARGIN, POSITION_TOLERANCE, RATE

MOTION, AROUND, FILES = "How the robot moves", "What it is kept apart from", "What is written besides"


class Motion:
    """Values of the options below, by the names of the parameters of `_options`."""

    def __init__(self, **given: Any):
        from maniport.util.validation import as_number

        self.given = given
        self.export: list[str] = given["export"] or []
        as_number(given["position_tolerance"], "--position-tolerance [mm]", above=0.0)
        as_number(given["speed_scale"], "--speed-scale", above=0.0)
        as_number(given["joint_limit_margin"], "--joint-limit-margin [%]", minimum=0.0, maximum=40.0)
        as_number(given["rate"], "--rate [Hz]", minimum=10.0)
        around = [name for name in ("table", "obstacles", "srdf") if given[name] is not None]
        if around and not given["collisions"]:
            raise InvalidInputError(f"--{around[0]} says what to keep apart from, --no-collisions to keep from nothing")

    @property
    def typed(self) -> dict[str, str]:
        """What differs from the defaults, as it is typed, but for what takes a person or a path that is placed."""
        told = {}
        for name, parameter in inspect.signature(_options).parameters.items():
            value = self.given[name]
            person = name == "orientation" and "," not in value
            if value == parameter.default or person or name in ("workspace", "export"):
                continue
            if name == "collisions":
                told["--no-collisions"] = ""
            else:
                told[f"--{name.replace('_', '-')}"] = f"{value:.12g}" if isinstance(value, float) else str(value)
        return told

    def require_exports(self) -> None:
        """Raise unless all formats are there."""
        from maniport.report.write import export_files

        export_files(self.export)

    @property
    def orientation(self) -> Any:
        """As the library takes it: a word or a direction."""
        text = self.given["orientation"]
        try:
            return [float(word) for word in text.split(",")] if "," in text else text
        except ValueError:
            raise InvalidInputError(
                f"--orientation: a direction is three numbers such as 0,0,-1; found {text!r}"
            ) from None

    def direction(self) -> Any:
        """The same where there is no person: a direction or None."""
        from maniport.pipeline.targets import facing

        found = self.orientation
        if isinstance(found, str) and found != "free":
            raise InvalidInputError(
                f"--orientation: a profile holds no hand; give free or a direction such as 0,0,-1; found {found!r}"
            )
        if isinstance(found, str):
            return None
        facing(found, self.given["orientation_axes"])
        return found

    def control(self, arm: Any) -> dict[str, Any]:
        """The same for an arm, as the library takes it, checked."""
        from maniport.arms.collisions import Collisions
        from maniport.motion import MotionLimits, PlanControl

        given = self.given
        limits = MotionLimits.of(arm, given["limits"], 0.01 * given["joint_limit_margin"])
        around = {name: given[name] for name in ("table", "obstacles", "srdf") if given[name] is not None}
        ready = PlanControl(
            position_tolerance=1e-3 * given["position_tolerance"],
            speed_scale=given["speed_scale"],
            rate=given["rate"],
            motion_limits=limits,
            orientation_axes=given["orientation_axes"],
            planning_effort=given["planning_effort"],
            workspace=None if given["workspace"] is None else [given["workspace"][i : i + 2] for i in (0, 2, 4)],
            collisions=Collisions.of(arm, **around) if around else given["collisions"],
            home=None if given["home"] is None else _posture(given["home"], limits.arm),
        ).resolved(arm)
        return {name: getattr(ready, name) for name in ready.__dataclass_fields__}


def _in(panel: str, help: str, **more: Any) -> Any:
    """An option whose help stands in a panel."""
    return typer.Option(help=help, rich_help_panel=panel, **more)


Workspace = Annotated[
    tuple[float, float, float, float, float, float] | None,
    _in(MOTION, "x0 x1 y0 y1 z0 z1: box for the path in the base frame [m]; inf is open.", metavar="BOX"),
]
Effort = Annotated[str, _in(MOTION, "Planning effort: full, or quick for many recordings.")]
Table = Annotated[float | None, _in(AROUND, "Height of a floor or table in the robot's base frame [m].")]


def _options(
    position_tolerance: Annotated[float, _in(MOTION, "Position tolerance, 95th percentile [mm].")] = 1e3
    * POSITION_TOLERANCE,
    speed_scale: Annotated[float, _in(MOTION, "Largest speed relative to the person's; limits may reduce it.")] = 1.0,
    rate: Annotated[float, _in(MOTION, "Rows of joints.csv per second [Hz].")] = RATE,
    limits: Annotated[
        Path | None, _in(MOTION, "YAML file of joint limits; default: the robot's own, others assumed.")
    ] = None,
    joint_limit_margin: Annotated[
        float, _in(MOTION, "Share of each joint's range that is kept free at either end [%].")
    ] = 100.0 * MARGIN,
    orientation: Annotated[
        str,
        _in(MOTION, "Orientation of the end effector: free, demonstrated, constant, or its z axis, such as 0,0,-1."),
    ] = "free",
    orientation_axes: Annotated[
        str, _in(MOTION, "Kept part of the orientation: pointing (fingers) or whole.")
    ] = "pointing",
    planning_effort: Effort = EFFORT,
    workspace: Workspace = None,
    home: Annotated[
        str | None,
        _in(MOTION, "Configuration at start and end [deg; m for prismatic joints].", metavar="Q1,Q2,…"),
    ] = None,
    table: Table = None,
    obstacles: Annotated[Path | None, _in(AROUND, "YAML or JSON file of boxes in the base frame.")] = None,
    srdf: Annotated[Path | None, _in(AROUND, "SRDF: pairs of links that need not be checked.")] = None,
    collisions: Annotated[bool, _in(AROUND, "Collision checking with the robot itself and these.")] = True,
    export: Annotated[
        list[str] | None,
        _in(
            FILES,
            "Further formats: ros2 (joints.yaml), mcap (joints.mcap), mujoco (joints_mujoco.npz), "
            "parquet (joints.parquet), rerun (motion.rrd); repeatable.",
        ),
    ] = None,
) -> None:
    """Define the options; nothing else."""


moves = group("motion", _options, Motion)  # Gives a verb that has a parameter `motion` these options
moves_many = group("motion", _options, Motion, planning_effort=BATCH_EFFORT, rate=BATCH_RATE)
"""The same for a verb that plans many motions."""


def _posture(text: str, arm: Any) -> Any:
    """Joint positions [rad or m] of an arm, from degrees and metres with commas between them."""
    import numpy as np

    names = ", ".join(arm.joint_names)
    try:
        numbers = np.array([float(word) for word in text.split(",")])
    except ValueError:
        raise InvalidInputError(
            f"--home must be numbers with commas between them, for {names}; found {text!r}"
        ) from None
    if len(numbers) != arm.dof:
        raise InvalidInputError(f"--home must have {arm.dof} numbers, for {names}; found {len(numbers)}")
    turns = np.array([unit == "rad" for unit in arm.joint_units])
    least, most = (np.where(turns, np.degrees(side), side) for side in (arm.lower, arm.upper))
    for name, found, low, high, turn in zip(arm.joint_names, numbers, least, most, turns, strict=True):
        if not low - ROUNDED <= found <= high + ROUNDED:
            unit = "°" if turn else " m"
            raise InvalidInputError(
                f"--home: {name} is {found:g}{unit}; allowed are {low:.2f}{unit} to {high:.2f}{unit}, with the margin"
            )
    return np.clip(np.where(turns, np.radians(numbers), numbers), arm.lower, arm.upper)
