"""Configuration of a run: all options, from Python, the command line or a YAML file such as ``run.yaml``."""

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from maniport.errors import FileFormatError, InvalidInputError, argument, unknown_name
from maniport.pipeline.option import option, options_of, plain
from maniport.util.atomic_io import write_text
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
)
from maniport.util.files import line_of, read_settings, settings_text
from maniport.util.validation import Array, as_finite, as_rotation
from maniport.version import __version__

if TYPE_CHECKING:
    from maniport.arms import EllipsoidSpec
    from maniport.motion import PlacementOptions

CONFIG = "run.yaml"  # file of the configuration in a result folder
MOST_SAMPLES = 1_000_000  # of a domain; more change no result and need gigabytes
UNITS, AXES = ("m", "dm", "cm", "mm", "inch", "CMU"), ("pointing", "whole")

SECTIONS = "human", "robot", "transfer", "motion", "placement", "learning", "batch"
_run, _human, _robot, _transfer, _motion, _placement, _learning, _batch = (
    partial(option, section) for section in ("", *SECTIONS)
)


@dataclass(frozen=True, kw_only=True)
class Config:
    """Configuration of a run: an attribute for each option, in SI units.

    ``maniport COMMAND --help-all`` describes the options; ``costs`` are in Python only.

    Attributes
    ----------
    verb : str
        Command that a saved configuration repeats.

    Raises
    ------
    InvalidInputError
        When a value is not allowed.
    """

    recording: tuple[str, ...] = _run(
        (), "Recording: file, folder of keypoints, or bundled name", is_file=True
    )
    profile: str | None = _run(None, "Target velocity ellipsoids, .npz", is_file=True)
    path: str | None = _run(
        None, "Positions of the hand, one for each ellipsoid, .npz", is_file=True, common=True
    )
    seed: int = _run(0, "Random seed, to 2^32 - 1", minimum=0, maximum=2**32 - 1, common=True)

    unit: str | float | None = _human(
        None,
        "Unit, or meters per unit; recognized by default",
        choices=UNITS,
        above=0.0,
        common=True,
    )
    height: float | None = _human(
        None, "Height of the person, for files in any scale", "m", minimum=0.5, maximum=2.5
    )
    fps: float | None = _human(
        None, "Frame rate, if the file has none", "Hz", above=0.0, below=1e5, common=True
    )
    start: float | None = _human(None, "Start of the part that is used", "s", common=True)
    stop: float | None = _human(None, "End of the part that is used", "s", common=True)
    markers: str | None = _human(
        None, "JSON file of points by role", is_file=True, unchecked=True, common=True
    )
    person: str = _human(PERSON, "Model of the human arm", common=True)
    side: str = _human(
        AUTO, "Arm of the person", choices=(AUTO, "right", "left", BOTH), common=True
    )
    smooth: str = _human(AUTO, "Smoothing of noisy points", choices=(AUTO, "off"))

    robot: tuple[str, ...] = _robot(
        (ROBOT,), "Name, or URDF, MJCF or xacro file; repeatable", repeated=True, metavar="NAME", is_file=True,
        common=True,
    )  # fmt: skip
    frame: tuple[str, ...] = _robot(
        (), "End-effector frame; of two arms LEFT,RIGHT", metavar="FRAME", common=True
    )
    joints: tuple[str, ...] = _robot((), "Moving joints; the others are fixed", metavar="J1,J2,…")
    base: str | None = _robot(None, "First frame of the chain, such as a torso")
    lock: Mapping[str, float] | None = _robot(
        None,
        "Fixed joint and its position [deg, or m]; repeatable",
        metavar="JOINT=POSITION",
        unchecked=True,
    )
    pose: tuple[tuple[float, ...], ...] = _robot(
        (), "Base pose of each of several robots [m, m, m, deg]; repeatable", "m,m,m,deg", metavar="X,Y,Z,YAW", count=4,
        repeated=True, unchecked=True,
    )  # fmt: skip
    payload: tuple[float, ...] = _robot(
        (),
        "Mass that the end effector carries, or one for each arm",
        "kg",
        metavar="kg",
        minimum=0.0,
        common=True,
    )
    payload_center: tuple[float, ...] = _robot(
        (0.0,) * 3, "Center of the payload in the end-effector frame", "m", count=3
    )
    hand_targets: str = _robot(
        "placed",
        "Positions of several arms: placed paths, or relative",
        choices=("placed", "relative"),
    )
    mesh_folders: tuple[str, ...] = _robot(
        (), "Folder of additional meshes or packages; repeatable", repeated=True, is_file=True
    )
    xacro_args: Mapping[str, str] | None = _robot(
        None, "Arguments of a xacro file", metavar="NAME:=VALUE …", unchecked=True
    )

    method: str = _transfer(
        AUTO, "Transfer method", choices=(AUTO, *METHODS), unchecked=True, common=True
    )
    ellipsoids: str = _transfer(
        "velocity", "Ellipsoids", choices=("velocity", "force", "acceleration"), common=True
    )
    part: str = _transfer(
        "translation", "Part of the velocity", choices=("translation", "rotation", "full")
    )
    joint_weights: str | tuple[float, ...] | None = _transfer(
        None, "Joint weights; default: unit for velocity, else joint-limits", choices=("unit", "joint-limits"),
        metavar="WORD|W1,W2,…", unchecked=True,
    )  # fmt: skip
    damping: float = _transfer(
        DAMPING, "Relative damping of singular ellipsoids; 0 for none", minimum=0.0
    )
    base_rotation: tuple[float, ...] = _transfer(
        (0.0,) * 3,
        "Rotation from human trunk to robot base",
        "deg",
        metavar="ROLL,PITCH,YAW",
        count=3,
        unchecked=True,
    )
    n_teacher: int = _transfer(
        TEACHER_SAMPLES, "Samples of the human domain", minimum=2, maximum=MOST_SAMPLES
    )
    n_student: int = _transfer(
        STUDENT_SAMPLES, "Samples of the robot domain", minimum=2, maximum=MOST_SAMPLES
    )

    move: bool = _motion(True, "Plan a trajectory", common=True)
    position_tolerance: float = _motion(
        POSITION_TOLERANCE, "Position tolerance, 95th percentile", "mm", above=0.0, common=True
    )
    speed_scale: float = _motion(
        1.0, "Maximum speed relative to the person", above=0.0, common=True
    )
    orientation: str | tuple[float, ...] = _motion(
        "free", "Orientation: free, demonstrated, constant, or z axis X,Y,Z",
        choices=("free", "demonstrated", "constant"), metavar="WORD|X,Y,Z", count=3, common=True,
    )  # fmt: skip
    orientation_axes: str = _motion(
        "pointing", "Constrained axes: z (pointing) or all (whole)", choices=AXES
    )
    rate: float = _motion(RATE, "Sampling rate of joints.csv", "Hz", minimum=10.0, maximum=10_000.0)
    limits: str | None = _motion(
        None, "YAML file of joint limits", is_file=True, common=True, unchecked=True
    )
    joint_limit_margin: float = _motion(
        MARGIN, "Free share of joint ranges at either end", "%", minimum=0.0, maximum=0.4
    )
    home: tuple[float, ...] | None = _motion(
        None, "Configuration at start and end [deg, or m]", metavar="Q1,Q2,…", unchecked=True
    )
    scale: float | None = _motion(
        None, "Scale of the path; searched by default", above=0.0, maximum=10.0, common=True
    )
    real_time: bool = _motion(False, "Placement and plan for the person's speed")
    workspace: tuple[float, ...] | None = _motion(
        None, "Box for the path in the base frame [m]; inf is open", metavar="X0,X1,Y0,Y1,Z0,Z1", count=6,
        unchecked=True,
    )  # fmt: skip
    collisions: bool = _motion(True, "Collision checking", unchecked=True)
    table: float | None = _motion(None, "Height of a table in the base frame", "m", common=True)
    obstacles: str | None = _motion(
        None, "YAML or JSON file of boxes", is_file=True, unchecked=True
    )
    srdf: str | None = _motion(None, "SRDF file of link pairs that are not checked", is_file=True)
    export: tuple[str, ...] = _motion(
        (), "Formats: ros2, mcap, mujoco, parquet, rerun", metavar="FORMAT,…", common=True
    )
    costs: tuple[Any, ...] = _motion((), "Further costs of the motion", unchecked=True, typed=False)

    place: bool = _placement(False, "Place the path first", common=True)
    tilt: str | float | None = _placement(
        None,
        "Tilt of the base, or free to search it",
        "deg",
        ("free",),
        metavar="deg|free",
        common=True,
    )
    rank: int = _placement(1, "Rank of the placement that is written", minimum=1, common=True)

    segments: tuple[str, ...] = _learning(
        (), "Demonstrations [s]; once for all recordings, or for each", metavar="auto|A:B,C:D,…", repeated=True,
        common=True,
    )  # fmt: skip
    components: int | None = _learning(
        None, "Number of Gaussians; default: minimum of the BIC", minimum=1, common=True
    )

    profile_rate: float = _batch(
        10.0, "Maximum rate of the ellipsoids of a recording", "Hz", above=0.0, common=True
    )
    pages: bool = _batch(False, "Write a report for each pair", common=True)

    verb: str = field(default="transfer", compare=False)

    def __post_init__(self) -> None:
        for name, described in OPTIONS.items():
            object.__setattr__(self, name, described.check(getattr(self, name)))
        around = [
            name for name in ("table", "obstacles", "srdf") if getattr(self, name) is not None
        ]
        if around and self.collisions is False:
            raise InvalidInputError(
                f"{argument(around[0])} needs collision checking; found {argument('no_collisions')}"
            )
        if not isinstance(self.orientation, str) and self.orientation_axes != "pointing":
            raise InvalidInputError(
                "orientation_axes must be 'pointing' for a vector as orientation; found 'whole'"
            )
        if not isinstance(self.orientation, str) and not any(self.orientation):
            raise InvalidInputError("orientation must not be a zero vector")
        if self.export and not self.move:
            raise InvalidInputError(
                f"{argument('export')} needs a trajectory; found {argument('no_move')}"
            )
        if self.workspace is not None:
            _ = self.placement  # raises where it is wrong

    @property
    def spec(self) -> "EllipsoidSpec":
        """Kind, part and joint weights of the ellipsoids."""
        from maniport.arms import EllipsoidSpec

        usual = None if self.ellipsoids == "velocity" else "joint-limits"
        weights = (
            usual
            if self.joint_weights is None
            else None
            if self.joint_weights == "unit"
            else self.joint_weights
        )
        return EllipsoidSpec(self.ellipsoids, self.part, weights)

    @property
    def rotation(self) -> Array:
        """Base rotation as a matrix, shape (3, 3)."""
        from scipy.spatial.transform import Rotation

        value = as_finite(self.base_rotation, "base_rotation")
        if value.shape == (3,):
            return np.asarray(Rotation.from_euler("xyz", value).as_matrix())
        return as_rotation(value, "base_rotation", 3)

    @property
    def placement(self) -> "PlacementOptions":
        """What is fixed of a placement."""
        from maniport.motion.placement.options import PlacementOptions

        box: Any = self.workspace
        if isinstance(box, list | tuple) and len(box) == 6:
            box = (box[0:2], box[2:4], box[4:6])
        return PlacementOptions(scale=self.scale, tilt=self.tilt or 0.0, workspace=box)

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
        names = [name for name, described in OPTIONS.items() if described.section in ("", *allowed)]
        for name in options:
            if name not in names:
                raise unknown_name("option", name, names)
        return replace(self, **options)

    def changes(self, section: str) -> dict[str, Any]:
        """Return the values of a section that differ from their defaults, by name."""
        return {
            name: getattr(self, name)
            for name, described in OPTIONS.items()
            if described.section == section and getattr(self, name) != getattr(Config, name)
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write YAML with absolute paths; objects of Python become names, or files that load the same arm."""
        from maniport.arms import Arm
        from maniport.transfer import name_of

        values, content, arm = (
            dict(vars(self)),
            dict[str, Any](),
            self.robot[0] if self.robot else None,
        )
        if not isinstance(self.method, str):
            values["method"] = name_of(self.method)
        if isinstance(arm, Arm):
            base = arm.chain.base if arm.chain.base_pose is None else None
            lock, source = dict(arm.chain.locked) or None, arm.chain.source or arm.name
            arguments = dict(arm.chain.xacro_args) or None
            values |= {"robot": (source,), "frame": (arm.frame,), "base": base, "lock": lock}
            values["xacro_args"] = arguments
        for name, described in OPTIONS.items():
            if described.typed:
                part = content.setdefault(described.section, {}) if described.section else content
                part[name] = plain(values[name], described.is_file)
        head = f"# maniport {__version__}; SI units. Repeat: maniport {self.verb} --config {CONFIG} -o FOLDER\n"
        write_text(path, head + settings_text(content))

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], base: "Config | None" = None, names: Collection[str] = ()
    ) -> "Config":
        """Read a configuration.

        Parameters
        ----------
        path : str or path
        base : Config, optional
            Values of options that the file lacks. Default: those of this class.
        names : collection of str
            Options that are used. Default: all.

        Raises
        ------
        FileFormatError
            When the file is no readable YAML, has an unknown key or a value that is not allowed.
        """
        config, file = base or cls(), os.fspath(path)
        top = [name for name, described in OPTIONS.items() if not described.section]
        for key, value in read_settings(path, [*top, *SECTIONS]).items():
            if key in SECTIONS and not isinstance(value, dict):
                kind = type(value).__name__
                raise FileFormatError(
                    f"{file}{line_of(path, key)}: {key} must be a mapping of options; found {kind}"
                )
            section = key if key in SECTIONS else ""
            allowed = [
                name
                for name, described in OPTIONS.items()
                if described.section == section and described.typed
            ]
            for name, setting in value.items() if section else [(key, value)]:
                try:
                    if name not in allowed:
                        raise unknown_name("key", name, allowed)
                    OPTIONS[name].check_setting(setting)
                    if name in names or not names:
                        config = replace(config, **{name: setting})
                except InvalidInputError as error:
                    raise FileFormatError(
                        f"{file}{line_of(path, section, name)}: {error}"
                    ) from None
        return config


OPTIONS = options_of(Config)
"""Descriptions of all options by name."""

BATCH = Config(
    method="length-field", rate=100.0, verb="batch"
)  # a selection would take seconds for each pair
LIVE = Config(real_time=True, verb="live")
"""Defaults of a batch, and of live control."""
