"""Options by topic, as classes that check their values, and the table of their units and help texts."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from maniport.errors import InvalidInputError, argument, unknown_name
from maniport.pipeline.option import (
    Flag,
    Integer,
    Names,
    Number,
    NumbersByName,
    Option,
    TextsByName,
    Vector,
    Vectors,
    Word,
)
from maniport.util.defaults import (
    AUTO,
    BOTH,
    DAMPING,
    MARGIN,
    METHODS,
    PERSON,
    POSITION_TOLERANCE,
    RATE,
    ROBOT,
    STUDENT_SAMPLES,
    TEACHER_SAMPLES,
    UNKNOWN,
)
from maniport.util.validation import Array, Bounds, as_choice, as_finite, as_rotation

if TYPE_CHECKING:
    from maniport.arms import EllipsoidSpec
    from maniport.motion import Cost, PlacementOptions

MOST_SAMPLES = 1_000_000  # of a domain; more change no result and need gigabytes
UNITS = ("m", "dm", "cm", "mm", "inch", "CMU")
SECTIONS = ("human", "robot", "transfer", "motion", "placement", "learning", "batch")

_TABLE: tuple[Option, ...] = (
    Names("recording", "", "Recording: file, folder of keypoints, or bundled name", is_file=True),
    Word("profile", "", "Target velocity ellipsoids, .npz", is_file=True),
    Word(
        "path",
        "",
        "Positions of the hand, one for each ellipsoid, .npz",
        is_file=True,
        common=True,
    ),
    Word(
        "teacher",
        "",
        "Robot whose motion of a dataset is the demonstration, instead of a person",
        is_file=True,
    ),
    Names(
        "teacher_frame",
        "",
        "End-effector frame of a teacher; of two arms LEFT,RIGHT",
        metavar="FRAME",
    ),
    Integer("episode", "", "Motion of the dataset of a teacher"),
    Word(
        "joint_unit",
        "",
        "Unit of a teacher's joints where the dataset states none",
        choices=("rad", "deg"),
    ),
    Names("columns", "", "Joint of each column of a teacher's dataset; - for none"),
    Integer("seed", "", "Random seed, to 2^32 - 1", maximum=2**32 - 1, common=True),
    Number(
        "unit",
        "human",
        "Unit, or meters per unit; recognized by default",
        choices=UNITS,
        bounds=Bounds(above=0.0),
        common=True,
    ),
    Number(
        "height",
        "human",
        "Height of the person, for files in any scale",
        "m",
        bounds=Bounds(minimum=0.5, maximum=2.5),
    ),
    Number(
        "fps",
        "human",
        "Frame rate, if the file has none",
        "Hz",
        bounds=Bounds(above=0.0, below=1e5),
        common=True,
    ),
    Number("start", "human", "Start of the part that is used", "s", common=True),
    Number("stop", "human", "End of the part that is used", "s", common=True),
    Word(
        "markers",
        "human",
        "JSON file of points by role",
        is_file=True,
        unchecked=True,
        common=True,
    ),
    Word("person", "human", "Model of the human arm", common=True),
    Word(
        "side",
        "human",
        "Arm of the person",
        choices=(AUTO, "right", "left", BOTH),
        common=True,
    ),
    Word("smooth", "human", "Smoothing of noisy points", choices=(AUTO, "off")),
    Names(
        "robot",
        "robot",
        "Name, or URDF, MJCF or xacro file; repeatable",
        repeated=True,
        metavar="NAME",
        is_file=True,
        common=True,
    ),
    Names(
        "frame",
        "robot",
        "End-effector frame; of two arms LEFT,RIGHT",
        metavar="FRAME",
        common=True,
    ),
    Names("joints", "robot", "Moving joints; the others are fixed", metavar="J1,J2,…"),
    Word("base", "robot", "First frame of the chain, such as a torso"),
    NumbersByName(
        "lock",
        "robot",
        "Fixed joint and its position [deg, or m]; repeatable",
        metavar="JOINT=POSITION",
        unchecked=True,
    ),
    Vectors(
        "pose",
        "robot",
        "Base pose of each of several robots [m, m, m, deg]; repeatable",
        "m,m,m,deg",
        metavar="X,Y,Z,YAW",
        count=4,
        unchecked=True,
    ),
    Vector(
        "payload",
        "robot",
        "Mass that the end effector carries, or one for each arm",
        "kg",
        metavar="kg",
        bounds=Bounds(minimum=0.0),
        common=True,
    ),
    Vector(
        "payload_center",
        "robot",
        "Center of the payload in the end-effector frame",
        "m",
        count=3,
    ),
    Word(
        "hand_targets",
        "robot",
        "Positions of several arms: placed paths, or relative",
        choices=("placed", "relative"),
    ),
    Names(
        "mesh_folders",
        "robot",
        "Folder of additional meshes or packages; repeatable",
        repeated=True,
        is_file=True,
    ),
    TextsByName(
        "xacro_args",
        "robot",
        "Arguments of a xacro file",
        metavar="NAME:=VALUE …",
        unchecked=True,
    ),
    Word(
        "method",
        "transfer",
        "Transfer method",
        choices=(AUTO, *METHODS),
        unchecked=True,
        common=True,
    ),
    Word(
        "ellipsoids",
        "transfer",
        "Ellipsoids",
        choices=("velocity", "force"),
        common=True,
    ),
    Word(
        "part",
        "transfer",
        "Part of the velocity",
        choices=("translation", "rotation", "full"),
    ),
    Vector(
        "joint_weights",
        "transfer",
        "Joint weights; default: unit for velocity, else joint-limits",
        choices=("unit", "joint-limits"),
        metavar="WORD|W1,W2,…",
        unchecked=True,
    ),
    Number(
        "damping",
        "transfer",
        "Relative damping of singular ellipsoids; 0 for none",
        bounds=Bounds(minimum=0.0),
    ),
    Vector(
        "base_rotation",
        "transfer",
        "Rotation from the person's trunk to the base; unknown: by icp",
        "deg",
        choices=(UNKNOWN,),
        metavar="ROLL,PITCH,YAW",
        count=3,
        unchecked=True,
    ),
    Integer(
        "n_teacher",
        "transfer",
        "Samples of the person's domain",
        minimum=2,
        maximum=MOST_SAMPLES,
    ),
    Integer(
        "n_student",
        "transfer",
        "Samples of the robot domain",
        minimum=2,
        maximum=MOST_SAMPLES,
    ),
    Flag("move", "motion", "Plan a trajectory", common=True),
    Number(
        "position_tolerance",
        "motion",
        "Position tolerance, 95th percentile",
        "mm",
        bounds=Bounds(above=0.0),
        common=True,
    ),
    Number(
        "speed_scale",
        "motion",
        "Maximum speed relative to the person",
        bounds=Bounds(above=0.0),
        common=True,
    ),
    Vector(
        "orientation",
        "motion",
        "Orientation: free, demonstrated, constant, or z axis X,Y,Z",
        choices=("free", "demonstrated", "constant"),
        metavar="WORD|X,Y,Z",
        count=3,
        common=True,
    ),
    Word(
        "orientation_axes",
        "motion",
        "Constrained axes: z (pointing) or all (whole)",
        choices=("pointing", "whole"),
    ),
    Number(
        "rate",
        "motion",
        "Sampling rate of joints.csv",
        "Hz",
        bounds=Bounds(minimum=10.0, maximum=10_000.0),
    ),
    Word(
        "limits",
        "motion",
        "YAML file of joint limits",
        is_file=True,
        common=True,
        unchecked=True,
    ),
    Number(
        "joint_limit_margin",
        "motion",
        "Free share of joint ranges at either end",
        "%",
        bounds=Bounds(minimum=0.0, maximum=0.4),
    ),
    Vector(
        "home",
        "motion",
        "Configuration at start and end [deg, or m]",
        metavar="Q1,Q2,…",
        unchecked=True,
    ),
    Number(
        "scale",
        "motion",
        "Scale of the path; searched by default",
        bounds=Bounds(above=0.0, maximum=10.0),
        common=True,
    ),
    Flag("real_time", "motion", "Placement and plan for the person's speed"),
    Word(
        "capability",
        "motion",
        "none, force, speed or both",
        choices=("none", "force", "speed", "both"),
        metavar="KIND",
        common=True,
    ),
    Number(
        "capability_weight",
        "motion",
        "Its weight beside the ellipsoids, 1 for equal ones",
        bounds=Bounds(minimum=0.0, maximum=100.0),
    ),
    Vector(
        "direction",
        "motion",
        "Direction of force and speed: the person's, along the path, or X,Y,Z in the base frame",
        choices=("person", "path"),
        metavar="WORD|X,Y,Z",
        count=3,
    ),
    Names(
        "directions",
        "motion",
        "File of their directions over time, as person.csv; one for each arm",
        repeated=True,
        metavar="FILE",
        is_file=True,
    ),
    Number(
        "yaw",
        "motion",
        "Rotation of the path about the vertical; searched by default",
        "deg",
    ),
    Vector(
        "offset",
        "motion",
        "Center of the path in the base frame; searched by default",
        "m",
        count=3,
    ),
    Vector(
        "workspace",
        "motion",
        "Box for the path in the base frame [m]; inf is open",
        metavar="X0,X1,Y0,Y1,Z0,Z1",
        count=6,
        unchecked=True,
    ),
    Flag("collisions", "motion", "Collision checking", unchecked=True),
    Number("table", "motion", "Height of a table in the base frame", "m", common=True),
    Word("obstacles", "motion", "YAML or JSON file of boxes", is_file=True, unchecked=True),
    Word("srdf", "motion", "SRDF file of link pairs that are not checked", is_file=True),
    Names(
        "export",
        "motion",
        "Formats: ros2, mcap, mujoco, parquet, rerun, lerobot",
        metavar="FORMAT,…",
        common=True,
    ),
    Number(
        "export_start",
        "motion",
        "Time of the first message of an exported bag, since 1970",
        "s",
        bounds=Bounds(minimum=0.0, maximum=2e9),
    ),
    Names("costs", "motion", "Further costs of the motion, of installed extensions"),
    Flag("place", "placement", "Place the path first", common=True),
    Number(
        "tilt",
        "placement",
        "Tilt of the base, or free to search it",
        "deg",
        choices=("free",),
        metavar="deg|free",
        common=True,
    ),
    Integer(
        "rank",
        "placement",
        "Rank of the placement that is written",
        minimum=1,
        common=True,
    ),
    Names(
        "segments",
        "learning",
        "Demonstrations [s]; once for all recordings, or for each",
        metavar="auto|A:B,C:D,…",
        repeated=True,
        numbers=True,
        common=True,
    ),
    Integer(
        "components",
        "learning",
        "Number of Gaussians; default: most likely held-out points",
        minimum=1,
        common=True,
    ),
    Number(
        "profile_rate",
        "batch",
        "Maximum rate of ellipsoids",
        "Hz",
        bounds=Bounds(above=0.0),
        common=True,
    ),
    Flag("pages", "batch", "Write a report for each pair", common=True),
)

OPTIONS = {option.name: option for option in _TABLE}
"""All options by name, in the order of help pages and files."""


Described = TypeVar("Described", bound="Options")


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options with values that are checked, in SI units; None is the default of each.

    ``maniport COMMAND --help-all`` describes the options.

    Raises
    ------
    InvalidInputError
        When a value is not allowed.
    """

    def __post_init__(self) -> None:
        defaults = {item.name: item.default for item in fields(self)}
        for name, option in OPTIONS.items():
            if name not in defaults:
                continue
            value = getattr(self, name)
            checked = defaults[name] if value is None else option.check(value)
            object.__setattr__(self, name, checked)

    def changed(self, *, allowed: Collection[str] = SECTIONS, **options: Any) -> Self:
        """Return the same with other values of options.

        Parameters
        ----------
        allowed : collection of str, optional
            Sections whose options are used, in addition to those without a section. Default: all.
        **options

        Raises
        ------
        UnknownNameError
            When there is no option of a name, or its section is not allowed.
        InvalidInputError
            When a value is not allowed.
        """
        mine = {item.name for item in fields(self)}
        sections = {"", *allowed}
        names = [
            name for name, option in OPTIONS.items() if name in mine and option.section in sections
        ]
        for name in options:
            if name not in names:
                raise unknown_name("option", name, names)
        return replace(self, **options)

    def changes(self, section: str) -> dict[str, object]:
        """Return the values of a section that differ from their defaults, by name."""
        changes = {}
        for item in fields(self):
            if item.name not in OPTIONS or OPTIONS[item.name].section != section:
                continue
            value = getattr(self, item.name)
            if value != item.default:
                changes[item.name] = value
        return changes


def documented(options: type[Described]) -> type[Described]:
    """Add the fields of a class of options to its documentation, with the texts of the table."""
    lines = [str(options.__doc__), "", "Attributes", "----------"]
    for item in fields(options):
        described = OPTIONS[item.name]
        unit = described.label.removeprefix(item.name)
        lines += [item.name, f"    {described.help}{unit}."]
    options.__doc__ = "\n".join(lines)
    return options


@documented
@dataclass(frozen=True, kw_only=True)
class HumanOptions(Options):
    """Which part of a recording is used, and of which person."""

    unit: str | float | None = None  # name, or meters per unit
    height: float | None = None  # of the person [m]
    fps: float | None = None  # frames per second [Hz]
    start: float | None = None  # [s]
    stop: float | None = None  # [s]
    markers: str | None = None
    person: str = PERSON
    side: str = AUTO
    smooth: str = AUTO


@documented
@dataclass(frozen=True, kw_only=True)
class RobotOptions(Options):
    """The arm, or the arms, and what they carry."""

    robot: tuple[str, ...] = (ROBOT,)
    frame: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    base: str | None = None
    lock: Mapping[str, float] | None = None  # positions of fixed joints [rad or m]
    pose: tuple[tuple[float, ...], ...] = ()  # x, y, z and yaw of each base [m, rad]
    payload: tuple[float, ...] = ()  # [kg]
    payload_center: tuple[float, ...] = (0.0, 0.0, 0.0)  # [m]
    hand_targets: str = "placed"
    mesh_folders: tuple[str, ...] = ()
    xacro_args: Mapping[str, str] | None = None


@documented
@dataclass(frozen=True, kw_only=True)
class MapOptions(Options):
    """The ellipsoids, and the map between those of the person and those of the robot."""

    method: str = AUTO
    ellipsoids: str = "velocity"
    part: str = "translation"
    joint_weights: str | tuple[float, ...] | None = None
    damping: float = DAMPING
    base_rotation: str | tuple[float, ...] = (0.0, 0.0, 0.0)  # roll, pitch, yaw [rad]; or "unknown"
    n_teacher: int = TEACHER_SAMPLES
    n_student: int = STUDENT_SAMPLES

    @property
    def spec(self) -> "EllipsoidSpec":
        """Kind, part and joint weights of the ellipsoids."""
        from maniport.arms import EllipsoidSpec

        weights = self.joint_weights
        if weights is None and self.ellipsoids != "velocity":
            weights = "joint-limits"
        if weights == "unit":
            weights = None
        return EllipsoidSpec(self.ellipsoids, self.part, weights)

    @property
    def known_rotation(self) -> Array | None:
        """Base rotation as a matrix, shape (3, 3); None where it is unknown."""
        if isinstance(self.base_rotation, str) and self.base_rotation == UNKNOWN:
            return None
        return self.rotation

    @property
    def rotation(self) -> Array:
        """Base rotation as a matrix, shape (3, 3).

        Raises
        ------
        InvalidInputError
            When it is unknown, or no rotation.
        """
        from scipy.spatial.transform import Rotation

        if isinstance(self.base_rotation, str):
            as_choice(self.base_rotation, "base_rotation", (UNKNOWN,))
            raise InvalidInputError(
                f"{argument('base_rotation', UNKNOWN)} needs {argument('method', 'icp')}, which estimates it; "
                "or give roll, pitch and yaw"
            )
        value = as_finite(self.base_rotation, "base_rotation")
        if value.shape == (3,):
            return np.asarray(Rotation.from_euler("xyz", value).as_matrix())
        return as_rotation(value, "base_rotation", 3)


@documented
@dataclass(frozen=True, kw_only=True)
class MotionOptions(Options):
    """The plan of the motion, the place of its path and what is around the robot."""

    # plan
    move: bool = True
    position_tolerance: float = POSITION_TOLERANCE  # [m]
    speed_scale: float = 1.0
    orientation: str | tuple[float, ...] = "free"
    orientation_axes: str = "pointing"
    rate: float = RATE  # [Hz]
    limits: str | None = None
    joint_limit_margin: float = MARGIN
    home: tuple[float, ...] | None = None  # [rad or m]
    costs: tuple["Cost", ...] = ()
    export: tuple[str, ...] = ()
    export_start: float = 0.0  # [s since 1970]

    # placement
    scale: float | None = None
    yaw: float | None = None  # [rad]
    offset: tuple[float, ...] | None = None  # [m]
    real_time: bool = False
    workspace: tuple[float, ...] | None = None  # [m]

    # force and speed
    capability: str = "both"
    capability_weight: float = 0.1
    direction: str | tuple[float, ...] = "person"
    directions: tuple[str, ...] = ()  # files, in place of `direction`

    # surroundings
    collisions: bool = True
    table: float | None = None  # height in the base frame [m]
    obstacles: str | None = None
    srdf: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("table", "obstacles", "srdf"):
            if getattr(self, name) is not None and self.collisions is False:
                raise InvalidInputError(
                    f"{argument(name)} needs collision checking; found {argument('no_collisions')}"
                )
        if not isinstance(self.orientation, str):
            if self.orientation_axes != "pointing":
                raise InvalidInputError(
                    "orientation_axes must be 'pointing' for a vector as orientation; found 'whole'"
                )
            if not any(self.orientation):
                raise InvalidInputError("orientation must not be a zero vector")
        if not isinstance(self.direction, str) and not any(self.direction):
            raise InvalidInputError(f"{argument('direction')} must not be a zero vector")
        if self.directions and self.direction != "person":
            raise InvalidInputError(
                f"{argument('directions')} takes the place of {argument('direction')}; "
                f"found {self.direction!r}, too"
            )
        if self.directions and self.capability == "none":
            raise InvalidInputError(
                f"{argument('directions')} needs force or speed as a target; "
                f"found {argument('capability', 'none')}"
            )
        if self.export and not self.move:
            raise InvalidInputError(
                f"{argument('export')} needs a trajectory; found {argument('no_move')}"
            )
        if self.workspace is not None:
            _ = self.placement  # raises where it is wrong

    @property
    def placement(self) -> "PlacementOptions":
        """What is fixed of a placement."""
        from maniport.motion.placement.options import PlacementOptions

        box: Any = self.workspace  # also in Python: a pair for each axis
        if isinstance(box, list | tuple) and len(box) == 6:
            box = (box[0:2], box[2:4], box[4:6])
        return PlacementOptions(scale=self.scale, yaw=self.yaw, offset=self.offset, workspace=box)


@documented
@dataclass(frozen=True, kw_only=True)
class TransferOptions(MotionOptions, MapOptions, RobotOptions, HumanOptions):
    """All options of `maniport.transfer_recording`, by name."""

    seed: int = 0
