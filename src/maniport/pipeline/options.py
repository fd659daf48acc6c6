"""Options of a run in sections, each with its type, unit, range, default and description; values have SI units."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from maniport.errors import FileFormatError, InvalidInputError, argument
from maniport.pipeline.option import Options, option
from maniport.util import defaults
from maniport.util.defaults import AUTO, BOTH
from maniport.util.input_limits import SETTINGS_BYTES, read_whole

if TYPE_CHECKING:
    from maniport.arms import EllipsoidSpec
    from maniport.mocap import Recording
    from maniport.motion import PlanSettings

UNIT, JOINT_LIMITS = "unit", "joint-limits"  # joint weights
FREE, CONSTANT = "free", "constant"  # orientation of the end effector, or tilt of the base


@dataclass(frozen=True, kw_only=True)
class HumanOptions(Options):
    """Import of the recording, and the model of the person."""

    unit: str | None = option(
        None, "Unit of length; recognized by default", choices=("m", "dm", "cm", "mm", "inch", "CMU"), common=True
    )
    fps: float | None = option(None, "Frame rate, if the file has none", "Hz", above=0.0, below=1e5, common=True)
    start: float | None = option(None, "Start of the part that is used", "s", common=True)
    stop: float | None = option(None, "End of the part that is used", "s", common=True)
    markers: str | None = option(None, "JSON file of points by role", is_file=True, unchecked=True, common=True)
    person: str = option(defaults.PERSON, "Arm model: myoarm, rhuman", common=True)
    side: str = option(AUTO, "Arm of the person", choices=(AUTO, "right", "left", BOTH), common=True)
    smooth: str = option(AUTO, "Smoothing of noisy points", choices=(AUTO, "off"))

    @property
    def fit_options(self) -> dict[str, Any]:
        """Arguments of `maniport.fit_arm`."""
        names = ("person", "side", "smooth")
        return {"markers": self.roles(), **{name: getattr(self, name) for name in names}}

    def read(self, recording: "Recording | str | os.PathLike[str]") -> "Recording":
        """Read a recording, or the part of it that is used."""
        from maniport.mocap import Recording, read_recording

        if not isinstance(recording, Recording):
            recording = read_recording(recording, unit=self.unit, rate=self.fps)
        return recording if self.start is None and self.stop is None else recording.crop(self.start, self.stop)

    def roles(self) -> Mapping[str, Any] | None:
        """Return the names of points by role, from the file if there is one."""
        if not isinstance(self.markers, str):
            return self.markers
        where = f"marker file {self.markers!r}"
        try:
            roles = json.loads(read_whole(self.markers, (), SETTINGS_BYTES))  # bytes: in UTF-8 or UTF-16
        except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
            raise FileFormatError(f"{where} is not readable JSON: {error}") from None
        if not isinstance(roles, dict):
            raise FileFormatError(f'{where} must map roles to lists of points, such as {{"elbow": ["RELB", "RIEL"]}}')
        return roles


@dataclass(frozen=True, kw_only=True)
class RobotOptions(Options):
    """Robot, of one or several arms (of two the left one first), and the joints that move."""

    robot: tuple[str, ...] = option(
        (defaults.ROBOT,), "Name, or URDF, MJCF or xacro file; repeatable", metavar="NAME", repeated=True,
        is_file=True, common=True,
    )  # fmt: skip
    frame: tuple[str, ...] = option((), "End-effector frame; of two arms LEFT,RIGHT", metavar="FRAME", common=True)
    joints: tuple[str, ...] = option((), "Moving joints; the others are fixed", metavar="J1,J2,…")
    base: str | None = option(None, "First frame of the chain, such as a torso")
    lock: Mapping[str, float] | None = option(
        None, "Fixed joint and its position [deg, or m]; repeatable", metavar="JOINT=POSITION", unchecked=True
    )
    pose: tuple[tuple[float, ...], ...] = option(
        (), "Base pose of each of several robots [m, m, m, deg]; repeatable", "m,m,m,deg", metavar="X,Y,Z,YAW", count=4,
        repeated=True, unchecked=True,
    )  # fmt: skip
    payload: float = option(0.0, "Mass that the end effector carries", "kg", minimum=0.0, common=True)
    payload_center: tuple[float, ...] = option(
        (0.0, 0.0, 0.0), "Center of the payload in the end-effector frame", "m", metavar="X,Y,Z", count=3
    )
    hand_targets: str = option(
        "placed", "Positions of several arms: placed paths, or relative positions", choices=("placed", "relative")
    )
    mesh_folders: tuple[str, ...] = option(
        (), "Folder of additional meshes; repeatable", metavar="FOLDER", repeated=True, is_file=True
    )

    def named(self) -> "RobotOptions":
        """Return options that load the same arm from its file or by its name, where it is an object."""
        from maniport.arms import Arm

        arm: Any = self.robot[0] if self.robot else None
        if not isinstance(arm, Arm):
            return self
        chain, base = arm.chain, arm.chain.base if arm.chain.stand is None else None
        locked, source = dict(chain.locked) or None, chain.source or arm.name
        return replace(self, robot=(source,), frame=(arm.frame,), base=base, lock=locked)

    @property
    def several(self) -> bool:
        """Whether the options name several arms."""
        return bool(self.pose) or len(self.robot) > 1 or len(self.frame) > 1

    def load(self, both: bool = False, side: str = AUTO) -> Any:
        """Load the arm, or a group where `both` or other options mean several, with the payload; side: of a person."""
        arm = self._load(both, side)
        if any(self.payload_center) and not self.payload:
            raise InvalidInputError(f"{argument('payload_center')} needs {argument('payload')}; found none")
        if not self.payload:
            return arm
        if not hasattr(arm, "with_payload"):
            raise InvalidInputError(f"{argument('payload')} is for one arm; found {len(arm)}: {arm.name}")
        return arm.with_payload(self.payload, self.payload_center)

    def _load(self, both: bool, side: str) -> Any:
        from maniport.arms import Arm, ArmGroup, as_group, load_arm, load_arms

        if isinstance(robot := self.robot[0], Arm | ArmGroup):
            if any(arm.chain.payload for arm in as_group(robot).arms):  # run.yaml would lose it
                raise InvalidInputError(
                    f"{argument('robot')} must have no payload of its own; use {argument('payload')}"
                )
            return robot
        options: dict[str, Any] = {"joints": self.joints or None, "lock": self.lock, "mesh_folders": self.mesh_folders}
        if not (both or self.several):
            options["side"] = None if side == AUTO else side
            return load_arm(robot, self.frame[0] if self.frame else None, base=self.base, **options)
        if self.base is not None:
            raise InvalidInputError(f"{argument('base')} is for one arm; the base of each robot is {argument('pose')}")
        if len(self.robot) > 1 and not self.pose:
            raise InvalidInputError(f"{argument('robot')} of several robots needs {argument('pose')} of each")
        robots = robot if len(self.robot) == 1 else self.robot
        return load_arms(robots, self.frame or None, bases=self.pose or None, **options)

    def load_arm(self, side: str = AUTO) -> Any:
        """Load the arm; raise where options name several."""
        from maniport.arms import ArmGroup

        arm = self.load(False, side)
        if isinstance(arm, ArmGroup):
            raise InvalidInputError(f"{argument('robot')} must be one arm here; found {len(arm)}: {arm.name}")
        return arm


@dataclass(frozen=True, kw_only=True)
class TransferOptions(Options):
    """Ellipsoids, and the map from the human to the robot domain."""

    method: str = option(
        defaults.METHOD, "Transfer method", common=True, unchecked=True,
        choices=(AUTO, "icp", "length-field", "parallel-transport", "nearest-neighbor", "mean-transport", "identity"),
    )  # fmt: skip
    ellipsoids: str = option("velocity", "Ellipsoids", choices=("velocity", "force", "acceleration"), common=True)
    part: str = option("translation", "Part of the velocity", choices=("translation", "rotation", "full"))
    joint_weights: str | tuple[float, ...] | None = option(
        None, "Joint weights; default: unit for velocity, else joint-limits", unchecked=True,
        choices=(UNIT, JOINT_LIMITS), metavar="WORD|W1,W2,…",
    )  # fmt: skip
    damping: float = option(defaults.DAMPING, "Relative damping of singular ellipsoids; 0 for none", minimum=0.0)
    base_rotation: tuple[float, ...] = option(
        (0.0, 0.0, 0.0), "Rotation from human trunk to robot base", "deg", metavar="ROLL,PITCH,YAW", count=3,
        unchecked=True,
    )  # fmt: skip
    n_teacher: int = option(defaults.TEACHER_SAMPLES, "Samples of the human domain", minimum=2)
    n_student: int = option(defaults.STUDENT_SAMPLES, "Samples of the robot domain", minimum=2)

    @property
    def spec(self) -> "EllipsoidSpec":
        """Kind, part and joint weights."""
        from maniport.arms import EllipsoidSpec

        usual = None if self.ellipsoids == "velocity" else JOINT_LIMITS
        weights = usual if self.joint_weights is None else None if self.joint_weights == UNIT else self.joint_weights
        return EllipsoidSpec(self.ellipsoids, self.part, weights)

    @property
    def rotation(self) -> Any:
        """Base rotation as a matrix, shape (3, 3)."""
        from scipy.spatial.transform import Rotation

        from maniport.util.validation import as_finite, as_rotation

        value = as_finite(self.base_rotation, "base_rotation")
        if value.shape == (3,):
            return Rotation.from_euler("xyz", value).as_matrix()
        return as_rotation(value, "base_rotation", 3)


@dataclass(frozen=True, kw_only=True)
class MotionOptions(Options):
    """Trajectory of the robot."""

    move: bool = option(True, "Plan a trajectory", common=True)
    position_tolerance: float = option(
        defaults.POSITION_TOLERANCE, "Position tolerance, 95th percentile", "mm", above=0.0, common=True
    )
    speed_scale: float = option(1.0, "Maximum speed relative to the person", above=0.0, common=True)
    orientation: str | tuple[float, ...] = option(
        FREE, "Orientation: free, demonstrated, constant, or z axis X,Y,Z", choices=(FREE, "demonstrated", CONSTANT),
        metavar="WORD|X,Y,Z", count=3, common=True,
    )  # fmt: skip
    orientation_axes: str = option(
        "pointing", "Constrained axes: z (pointing) or all (whole)", choices=("pointing", "whole")
    )
    rate: float = option(defaults.RATE, "Sampling rate of joints.csv", "Hz", minimum=10.0, maximum=10_000.0)
    limits: str | None = option(None, "YAML file of joint limits", is_file=True, common=True, unchecked=True)
    joint_limit_margin: float = option(
        defaults.MARGIN, "Share of joint ranges kept free at either end", "%", minimum=0.0, maximum=0.4
    )
    home: tuple[float, ...] | None = option(
        None, "Configuration at start and end [deg, or m]", metavar="Q1,Q2,…", unchecked=True
    )
    scale: float | None = option(None, "Scale of the path; searched by default", above=0.0, maximum=10.0, common=True)
    real_time: bool = option(False, "Placement that the robot can follow at the person's speed")
    workspace: tuple[float, ...] | None = option(
        None, "Box for the path in the base frame [m]; inf is open", metavar="X0,X1,Y0,Y1,Z0,Z1", count=6,
        unchecked=True,
    )  # fmt: skip
    collisions: bool = option(True, "Collision checking", unchecked=True)
    table: float | None = option(None, "Height of a table in the base frame", "m", common=True)
    obstacles: str | None = option(None, "YAML or JSON file of boxes", is_file=True, unchecked=True)
    srdf: str | None = option(None, "SRDF file of link pairs that are not checked", is_file=True)
    export: tuple[str, ...] = option((), "Formats: ros2, mcap, mujoco, parquet, rerun", metavar="FORMAT,…", common=True)
    costs: tuple[Any, ...] = option((), "Further costs of the motion", unchecked=True, typed=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        around = [name for name in ("table", "obstacles", "srdf") if getattr(self, name) is not None]
        if around and self.collisions is False:
            raise InvalidInputError(
                f"{argument(around[0])} needs collision checking; found {argument('no_collisions')}"
            )
        if not isinstance(self.orientation, str) and self.orientation_axes != "pointing":
            raise InvalidInputError("orientation_axes must be 'pointing' for a vector as orientation; found 'whole'")
        if not isinstance(self.orientation, str) and not any(self.orientation):
            raise InvalidInputError("orientation must not be a zero vector")
        if self.workspace is not None:
            _ = self.bounds  # raises where it is wrong
        if self.export and not self.move:
            raise InvalidInputError(f"{argument('export')} needs a trajectory; found {argument('no_move')}")

    @property
    def bounds(self) -> Any:
        """Bounds of the placed path, shape (2, 3), infinite where it is open [m]."""
        from maniport.motion.placement.place_path import as_workspace

        box: Any = self.workspace
        return as_workspace([box[i : i + 2] for i in (0, 2, 4)] if box is not None and len(box) == 6 else box)

    def control(self, arm: Any) -> "PlanSettings":
        """Return the settings of `maniport.motion.plan_motion` for an arm, checked."""
        from maniport.arms.collisions import Collisions
        from maniport.motion import MotionLimits, PlanSettings

        limits: Any = self.limits
        if not isinstance(limits, MotionLimits):
            limits = MotionLimits.of(arm, limits, self.joint_limit_margin)
        around = {name: getattr(self, name) for name in ("table", "obstacles", "srdf")}
        checked = any(value is not None for value in around.values())
        names = {item.name for item in fields(PlanSettings)} & {item.name for item in fields(self)}
        return PlanSettings(
            **{name: getattr(self, name) for name in names - {"collisions"}},
            motion_limits=limits,
            collisions=Collisions.of(limits.arm, **around) if checked else self.collisions,
        ).resolved(arm)


@dataclass(frozen=True, kw_only=True)
class PlacementOptions(Options):
    """Placement of a path without a person."""

    place: bool = option(False, "Place the path first", common=True)
    tilt: str | float | None = option(
        None, "Tilt of the base, or free to search it", "deg", (FREE,), metavar="deg|free", common=True
    )
    rank: int = option(1, "Rank of the placement that is written", minimum=1, common=True)


@dataclass(frozen=True, kw_only=True)
class LearningOptions(Options):
    """Learning of a profile from several demonstrations."""

    segments: tuple[str, ...] = option(
        (), "Demonstrations [s]; once for all recordings, or for each", metavar="auto|A:B,C:D,…", repeated=True,
        common=True,
    )  # fmt: skip
    components: int | None = option(None, "Number of Gaussians; default: minimum of the BIC", minimum=1, common=True)


@dataclass(frozen=True, kw_only=True)
class BatchOptions(Options):
    """Results of each pair of a batch."""

    profile_rate: float = option(10.0, "Maximum rate of the ellipsoids of a recording", "Hz", above=0.0, common=True)
    pages: bool = option(False, "Write a report for each pair", common=True)
