"""The robot of a configuration; light, since commands on robots alone need no more."""

from maniport.arms import Arm, ArmGroup, as_group, load_arm, load_arms
from maniport.errors import InvalidInputError, argument
from maniport.pipeline.options import RobotOptions, TransferOptions
from maniport.util.defaults import AUTO, BOTH
from maniport.util.validation import as_numbers


def load_robot(
    config: TransferOptions, both: bool | None = None, side: str | None = None
) -> Arm | ArmGroup:
    """Load the arm with its payload, of a person that of `side`, or a group where the options name several arms."""
    arm = _loaded(config, config.side == BOTH if both is None else both, side)
    payload = config.payload
    if not any(payload):
        if any(config.payload_center):
            raise InvalidInputError(
                f"{argument('payload_center')} needs {argument('payload')}; found none"
            )
        return arm
    group = as_group(arm)
    masses = payload if len(payload) > 1 else payload[0]
    checked = as_numbers(
        masses, f"{argument('payload')} of {arm.name!r}", len(group), broadcast=True
    )
    loaded = group.with_payload(checked, config.payload_center)
    if isinstance(arm, ArmGroup):
        return loaded
    return loaded.arms[0]


def load_single_arm(config: TransferOptions, side: str = AUTO) -> Arm:
    """Load the arm as `load_robot` does; raise where the options name several."""
    arm = load_robot(config, both=False, side=None if side == AUTO else side)
    if isinstance(arm, ArmGroup):
        raise InvalidInputError(
            f"{argument('robot')} must be one arm here; found {len(arm)}: {arm.name}"
        )
    return arm


def _loaded(config: RobotOptions, both: bool, side: str | None) -> Arm | ArmGroup:
    if not config.robot:
        raise InvalidInputError(f"{argument('robot')} is needed")
    robot: str | Arm | ArmGroup = config.robot[0]
    if isinstance(robot, Arm | ArmGroup):
        if any(arm.chain.payload for arm in as_group(robot).arms):  # run.yaml would lose it
            raise InvalidInputError(
                f"{argument('robot')} must have no payload of its own; use {argument('payload')}"
            )
        return robot
    if both or names_several(config):
        return _load_group(config)
    return load_arm(
        robot,
        config.frame[0] if config.frame else None,
        config.joints or None,
        config.mesh_folders,
        base=config.base,
        lock=config.lock,
        side=side,
        xacro_args=config.xacro_args,
    )


def _load_group(config: RobotOptions) -> ArmGroup:
    """Load several limbs of one robot, or several robots."""
    if config.base is not None:
        raise InvalidInputError(
            f"{argument('base')} is for one arm; the base of each robot is {argument('pose')}"
        )
    if len(config.robot) > 1 and not config.pose:
        raise InvalidInputError(
            f"{argument('robot')} of several robots needs {argument('pose')} of each"
        )
    return load_arms(
        config.robot[0] if len(config.robot) == 1 else config.robot,
        config.frame or None,
        bases=config.pose or None,
        joints=config.joints or None,
        lock=config.lock,
        mesh_folders=config.mesh_folders,
        xacro_args=config.xacro_args,
    )


def names_several(config: RobotOptions) -> bool:
    """Whether the options name several arms of robots."""
    return bool(config.pose) or len(config.robot) > 1 or len(config.frame) > 1
