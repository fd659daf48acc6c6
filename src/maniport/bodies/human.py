"""The human arm, scaled to a person's segment lengths.

Both models describe a right arm, have the same seven joints and express everything in a trunk frame with x forward,
y to the person's left and z up. Their frames ``shoulder``, ``elbow``, ``wrist`` and ``hand`` mark the ends of the
segments. At zero angles the arm hangs straight down with the palm towards the thigh. A left arm is the mirror image of
a right one: equal joint angles mean the mirrored posture, and the table holds for both.

=================  ================================================================================================
joint              positive direction, from the hanging arm
=================  ================================================================================================
``elv_angle``      plane in which the arm is raised: 0 to the side, 90° forward
``shoulder_elv``   elevation: raises the arm in that plane
``shoulder_rot``   axial rotation of the upper arm, inward
``elbow_flexion``  bends the elbow
``pro_sup``        turns the palm backward (pronation)
``deviation``      bends the wrist to the side: in MyoArm to the thumb, in rHuMan to the little finger
``flexion``        bends the wrist to the palm
=================  ================================================================================================
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies.anthropometry import FRACTIONS, as_height, segment_length
from maniport.bodies.arm import Arm
from maniport.bodies.chain import LEFT, RIGHT, SIDES, Chain, Frame, pose
from maniport.bodies.denavit_hartenberg import chain_from_dh
from maniport.bodies.embedded import read_embedded
from maniport.bodies.mirroring import mirrored
from maniport.validation import Array, as_choice, as_number

JOINTS = ("elv_angle", "shoulder_elv", "shoulder_rot", "elbow_flexion", "pro_sup", "deviation", "flexion")
LONGEST_SEGMENT = 1.0
"""No segment of a human arm is as long as this [m]; larger values are most likely in another unit."""

BREADTH = 0.17
"""How far a shoulder is from the middle of the trunk [m]."""

TO_THE_LEFT = np.array([0.0, 1.0, 0.0])

RHUMAN_LENGTHS = (0.302, 0.2795, 0.05)
RHUMAN_LOWER = (-90.0, 0.0, -80.0, 0.0, -90.0, 0.0, -60.0)
RHUMAN_UPPER = (130.0, 180.0, 40.0, 130.0, 90.0, 25.0, 60.0)


def myoarm(upper_arm: float | None = None, forearm: float | None = None, hand: float | None = None) -> Arm:
    """The right arm of MyoSim: 7 degrees of freedom and a shoulder girdle that follows them.

    Kinematics of Saul et al. (2015). Raising the arm also turns the clavicle and the scapula, so that the shoulder
    moves; 11 dependent joints follow the elevation and its plane linearly.

    Parameters
    ----------
    upper_arm : float, optional
        Distance from the centre of the shoulder joint to the elbow [m], 0.2907 by default.
    forearm : float, optional
        Distance from the elbow to the wrist at zero pronation [m], 0.2580 by default.
    hand : float, optional
        Distance from the wrist to the middle of the third metacarpal [m], 0.0553 by default.

    Returns
    -------
    Arm
        Origin of the base frame: the right sternoclavicular joint, where the collar bone meets the breastbone.
        ``shoulder`` is the centre of the glenohumeral joint, ``elbow`` a point on the flexion axis (the origin of
        the ulna), ``wrist`` the centre of the wrist joint (the origin of the lunate), ``hand`` the middle of the
        third metacarpal. The girdle keeps its size.

    Raises
    ------
    InvalidInputError
        When a length is not between 0 and 1 m.

    See Also
    --------
    rhuman : the other model, with a shoulder that stays.
    maniport.demonstrations.fit_arm : scales it to a person.

    References
    ----------
    Saul et al., Benchmarking of dynamic simulation predictions in two software platforms using an upper limb
    musculoskeletal model, Comput. Methods Biomech. Biomed. Eng. 18, 2015.
    """
    lengths = _checked(upper_arm, forearm, hand)
    chain = replace(read_embedded("myoarm"), side=RIGHT)
    ends = ("shoulder", "elbow", "wrist", "hand")
    points = Arm(chain).point_positions(np.zeros(len(chain.coordinates)), ends)
    for i, length in enumerate(lengths):
        if length is not None:
            factor = length / float(np.linalg.norm(points[i + 1] - points[i]))
            chain = _scale_between(chain, ends[i], ends[i + 1], factor)
    return Arm(chain)


def rhuman(upper_arm: float | None = None, forearm: float | None = None, hand: float | None = None) -> Arm:
    """The right arm rHuMan: 7 degrees of freedom, with the shoulder fixed in the trunk.

    The table of Denavit-Hartenberg parameters, the lengths and the limits are those of Reithmeir, Figueredo and
    Haddadin (IROS 2022, arXiv 2208.07588), after the kinematics of Saul et al. (2015).

    Parameters
    ----------
    upper_arm : float, optional
        Length from shoulder to elbow [m], 0.302 by default.
    forearm : float, optional
        Length from elbow to wrist [m], 0.2795 by default.
    hand : float, optional
        Length from wrist to the hand point [m], 0.05 by default.

    Returns
    -------
    Arm
        Origin of the base frame: the centre of the shoulder.

    Raises
    ------
    InvalidInputError
        When a length is not between 0 and 1 m.

    See Also
    --------
    myoarm : the other model, with a shoulder girdle.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """
    given = _checked(upper_arm, forearm, hand)
    upper, fore, palm = (
        default if length is None else length for length, default in zip(given, RHUMAN_LENGTHS, strict=True)
    )
    # Eight joints and a fixed last row: the elevation plane turns the arm before the elevation and back after it.
    half = np.pi / 2
    table: list[list[float]] = [
        [0, 0, 0, half], [0, 0, 0, half], [0, 0, 0, 0], [half, upper, 0, half], [0, 0, 0, half],
        [0, -fore, 0, half], [half, 0, 0, -half], [half, 0, 0, half], [np.pi, -palm, 0, np.pi],
    ]  # fmt: skip
    names = ["elv_angle", "shoulder_elv", "elv_angle_return", *JOINTS[2:]]
    # The table's x axis points to the person's right; the trunk frame's points forward.
    whole = chain_from_dh("rhuman", table, -np.pi, np.pi, base=pose(rpy=(0, 0, -half)), joint_names=[*names, "fixed"])
    joints = list(whole.joints[:8])
    joints[3] = replace(joints[3], axis=-joints[3].axis)  # the table counts axial rotation outward
    coupling = np.zeros((8, 7))
    coupling[np.arange(8), [0, 1, 0, 2, 3, 4, 5, 6]] = 1.0
    fixed = whole.joints[8].placement @ whole.frames["link9"].placement
    return Arm(
        replace(
            whole,
            joints=tuple(joints),
            frames={
                "shoulder": whole.frames["base"],
                "elbow": whole.frames["link4"],
                "wrist": whole.frames["link6"],
                "hand": Frame(8, fixed),
            },
            frame="hand",
            coordinates=JOINTS,
            lower=np.radians(RHUMAN_LOWER),
            upper=np.radians(RHUMAN_UPPER),
            coupling=coupling,
            offset=np.zeros(8),
            side=RIGHT,
        )
    )


PERSONS: dict[str, Callable[..., Arm]] = {"myoarm": myoarm, "rhuman": rhuman}
"""Models of the human arm by name, each called with the lengths that are known. What is added here, `load_arm`,
`fit_arm` and the main job take: a right arm with the seven joints and the four frames above."""


def human_arm(
    name: str, side: str = RIGHT, height: float | None = None, lengths: Mapping[str, float] | None = None
) -> Arm:
    """One arm of a person.

    Parameters
    ----------
    name : str
        One of `PERSONS`.
    side : {"right", "left"}
        Which arm; the left one is the mirror image of the right one.
    height : float, optional
        Body height [m], from 1 to 2.5, for the segments whose lengths are not given; see
        `maniport.bodies.anthropometry`. Without it they are the model's own.
    lengths : mapping of str to float, optional
        Lengths of ``"upper arm"``, ``"forearm"`` and ``"hand"`` [m] that are known.

    Raises
    ------
    InvalidInputError
        When there is no such person or side, or a length or the height is not one of a person.
    """
    as_choice(name, "person", PERSONS)
    as_choice(side, "side", SIDES)
    tall, known = as_height(height), dict(lengths or {})
    if tall is not None:
        known = {segment: segment_length(segment, tall) for segment in FRACTIONS} | known
    arm = PERSONS[name](**{segment.replace(" ", "_"): length for segment, length in known.items()})
    chain = arm.chain if arm.side in SIDES else replace(arm.chain, side=RIGHT)
    return Arm(chain if chain.side == side else mirrored(chain))


def middle_of(arm: Arm) -> float:
    """Where the middle of the trunk is beside the origin of a human arm's base frame, to the left [m]."""
    shoulder = arm.point_positions(np.zeros(arm.dof), ("shoulder",))[0]
    return float(shoulder[1]) + (-BREADTH if arm.side == LEFT else BREADTH)


def hand_rotations(arm: Arm, q: ArrayLike) -> Array:
    """How a person's hand is turned: z points from the wrist along it, y out of the palm.

    Parameters
    ----------
    arm : Arm
        A human arm: with zero angles it hangs with the palm towards the thigh, a right arm's to the left.
    q : array_like, shape (..., dof)
        [rad]

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Rotations from these axes to the trunk frame.
    """
    zero = np.zeros(arm.dof)
    wrist, hand = arm.point_positions(zero, ("wrist", "hand"))
    along = (hand - wrist) / np.linalg.norm(hand - wrist)
    thigh = -TO_THE_LEFT if arm.side == LEFT else TO_THE_LEFT
    palm = thigh - (thigh @ along) * along
    palm /= np.linalg.norm(palm)
    hanging = np.stack([np.cross(palm, along), palm, along], axis=1)
    return np.asarray(arm.forward(q)[..., :3, :3] @ arm.forward(zero)[:3, :3].T @ hanging)


def _checked(upper_arm: float | None, forearm: float | None, hand: float | None) -> list[float | None]:
    lengths = {"upper_arm [m]": upper_arm, "forearm [m]": forearm, "hand [m]": hand}
    return [None if x is None else as_number(x, name, above=0.0, below=LONGEST_SEGMENT) for name, x in lengths.items()]


def _scale_between(chain: Chain, start: str, end: str, factor: float) -> Chain:
    """Scale the translations of the joints and frames between two frames that sit at the origins of their joints."""
    first, last = chain.frames[start].joint, chain.frames[end].joint
    scaled = tuple(
        replace(joint, placement=_scaled(joint.placement, factor)) if first < i <= last else joint
        for i, joint in enumerate(chain.joints, start=1)
    )
    frames = dict(chain.frames)
    if first == last:
        frames[end] = Frame(last, _scaled(chain.frames[end].placement, factor))
    return replace(chain, joints=scaled, frames=frames)


def _scaled(placement: np.ndarray, factor: float) -> np.ndarray:
    result = placement.copy()
    result[:3, 3] *= factor
    return result
