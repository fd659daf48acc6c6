"""The human arm, scaled to a person's segment lengths.

Both models describe a right arm, have the same seven joints and express everything in a trunk frame with x forward,
y to the person's left and z up. Their frames ``shoulder``, ``elbow``, ``wrist`` and ``hand`` mark the ends of the
segments. At zero angles the arm hangs straight down with the palm toward the thigh. A left arm is the mirror image of
a right one: equal joint angles mean the mirrored configuration, and the table holds for both.

=================  ===========  ================================================================
joint              range [°]    positive direction, from the hanging arm
=================  ===========  ================================================================
``elv_angle``      -95 to 130   plane in which the arm is raised: 0 to the side, 90° forward
``shoulder_elv``   0 to 180     elevation: raises the arm in that plane
``shoulder_rot``   -110 to 120  axial rotation of the upper arm, inward
``elbow_flexion``  0 to 150     bends the elbow
``pro_sup``        -100 to 95   turns the palm backward (pronation)
``deviation``      -45 to 25    bends the wrist to the thumb; in rHuMan with the opposite sign
``flexion``        -90 to 95    bends the wrist to the palm
=================  ===========  ================================================================

The ranges are those of people. Limits of the published models are narrower: elbows of MyoSim and rHuMan stop at
130°, their wrists at 10° or 0° in one direction of deviation. Where a clinical measurement exists, the bound is the
largest of three means, rounded up to 5°: of the American Academy of Orthopaedic Surgeons (1994); of 109 male persons
by D. Boone and S. Azen (Journal of Bone and Joint Surgery 61-A, 1979); of 90 women by L. Macedo and D. Magee
(Physiotherapy Theory and Practice 25, 2009):

======================  =====  ============  ================
motion [°]              AAOS   Boone, Azen   Macedo, Magee
======================  =====  ============  ================
shoulder, lateral rot.  90     104           108
elbow, flexion          150    143           149
forearm, pronation      80     76            92
forearm, supination     80     82            96
wrist, flexion          80     76            93
wrist, extension        70     75            86
wrist, radial dev.      20     22            18
wrist, ulnar dev.       30     36            41
======================  =====  ============  ================

The elevation ends overhead, where another plane continues it. Its plane and the inward rotation keep the ranges of Saul
et al. (2015): clinical angles of the shoulder are measured in one posture each, the models' limits hold in all.

The arms have no masses: the weight of a person's arm is not considered.

The torque limits are those of the muscles of MyoSim in postures within MyoSim's own limits, see
``scripts/derive_myoarm.py``, for both models, all sizes and the whole range: rough values, since people differ by more
than a factor of two (Nijhof and Gabriel, Journal of Biomechanics 39, 2006).

`FRACTIONS` are lengths of segments as fractions of the body height. Upper arm and forearm are those of men by P. de
Leva (Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters, Journal of Biomechanics 29, 1996), between
centers of joints as in the models: 281.7 and 268.9 mm of 1741 mm. The hand is 0.108 of the height from the wrist to the
tip of the middle finger (R. Drillis, R. Contini, Body segment parameters, New York University, 1966), times 55.3 /
174.1: the distances of the middle of the third metacarpal and of that tip from the wrist in MyoSim's hand [mm].
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.arm import Arm
from maniport.arms.chain import LEFT, RIGHT, SIDES, read_embedded
from maniport.arms.restriction import mirrored
from maniport.util.validation import Array, as_choice, as_number

JOINTS = (
    "elv_angle",
    "shoulder_elv",
    "shoulder_rot",
    "elbow_flexion",
    "pro_sup",
    "deviation",
    "flexion",
)
FRACTIONS = {
    "upper arm": 0.2817 / 1.741,
    "forearm": 0.2689 / 1.741,
    "hand": 0.108 * 0.0553 / 0.1741,
}
"""Length of each segment as a fraction of the body height."""

LONGEST_SEGMENT = 1.0  # limit of segment lengths [m]; larger values are probably in another unit

BREADTH = 0.17  # distance of a shoulder from the middle of the trunk [m]


def myoarm(
    upper_arm: float | None = None, forearm: float | None = None, hand: float | None = None
) -> Arm:
    """Build the right arm of MyoSim: 7 degrees of freedom and a shoulder girdle that follows them.

    Kinematics of Saul et al. (2015). Raising the arm also turns the clavicle and the scapula, so that the shoulder
    moves; 11 dependent joints follow the elevation and its plane linearly.

    Parameters
    ----------
    upper_arm, forearm, hand : float, optional
        Distances from the shoulder to the elbow, the wrist (at zero pronation) and the middle of the third metacarpal
        [m], below 1; 0.2907, 0.2580 and 0.0553 by default.

    Returns
    -------
    Arm
        Origin of the base frame: the right sternoclavicular joint, where the collar bone meets the breastbone.
        ``shoulder`` is the center of the glenohumeral joint, ``elbow`` a point on the flexion axis (the origin of
        the ulna), ``wrist`` the center of the wrist joint (the origin of the lunate), ``hand`` the middle of the
        third metacarpal. The girdle keeps its size.

    References
    ----------
    Saul et al., Benchmarking of dynamic simulation predictions in two software platforms using an upper limb
    musculoskeletal model, Comput. Methods Biomech. Biomed. Eng. 18, 2015.
    """
    return _scaled("myoarm", upper_arm, forearm, hand)


def rhuman(
    upper_arm: float | None = None, forearm: float | None = None, hand: float | None = None
) -> Arm:
    """Build the right arm rHuMan: 7 degrees of freedom, with the shoulder fixed at the origin of the base frame.

    The table of Denavit-Hartenberg parameters and the lengths are those of Reithmeir, Figueredo and Haddadin (IROS
    2022, arXiv 2208.07588), after the kinematics of Saul et al. (2015).

    Parameters
    ----------
    upper_arm, forearm, hand : float, optional
        Lengths from shoulder to elbow, wrist and hand point [m], below 1; 0.302, 0.2795 and 0.05 by default.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """
    return _scaled("rhuman", upper_arm, forearm, hand)


def _scaled(name: str, *segments: float | None) -> Arm:
    """Build a model with other lengths of upper arm, forearm and hand [m]: scale what lies between their ends."""
    chain = replace(read_embedded(name), side=RIGHT)
    joints = list(chain.joints)
    frames = dict(chain.frames)
    ends = ("shoulder", "elbow", "wrist", "hand")
    points = Arm(chain).point_positions(np.zeros(len(chain.coordinates)), ends)
    for i, (segment, length) in enumerate(
        zip(("upper_arm", "forearm", "hand"), segments, strict=True)
    ):
        if length is not None:
            checked = as_number(length, f"{segment} [m]", above=0.0, below=LONGEST_SEGMENT)
            factor = np.ones((4, 4))
            end = frames[ends[i + 1]]
            factor[:3, 3] = checked / float(np.linalg.norm(points[i + 1] - points[i]))
            for k in range(frames[ends[i]].joint, end.joint):
                joints[k] = replace(joints[k], placement=joints[k].placement * factor)
            frames[ends[i + 1]] = replace(end, placement=end.placement * factor)
    return Arm(replace(chain, joints=tuple(joints), frames=frames))


PERSONS: dict[str, Callable[..., Arm]] = {"myoarm": myoarm, "rhuman": rhuman}
"""Models of the human arm by name, called with known segment lengths; they return a right arm with the seven joints and
four frames above."""


def human_arm(name: str, side: str = RIGHT, lengths: Mapping[str, float] | None = None) -> Arm:
    """Build an arm of a person; the left arm is the mirror image of the right one.

    `lengths` [m] are those of the segments ``"upper arm"``, ``"forearm"`` and ``"hand"``; the model has the others.
    """
    as_choice(name, "person", PERSONS)
    as_choice(side, "side", SIDES)
    arm = PERSONS[name](
        **{segment.replace(" ", "_"): length for segment, length in (lengths or {}).items()}
    )
    if arm.side in SIDES:
        chain = arm.chain
    else:
        chain = replace(arm.chain, side=RIGHT)
    return Arm(chain if chain.side == side else mirrored(chain))


def middle_of(arm: Arm) -> float:
    """Return the y coordinate of the middle of the trunk in the base frame of a human arm [m]."""
    shoulder = arm.point_positions(np.zeros(arm.dof), ("shoulder",))[0]
    return float(shoulder[1]) + (-BREADTH if arm.side == LEFT else BREADTH)


def hand_rotations(arm: Arm, q: ArrayLike) -> Array:
    """Compute hand orientations in the trunk frame, (..., 3, 3): z points along the hand, y out of the palm.

    With zero angles the arm hangs with the palm toward the thigh, a right arm's to the left.
    """
    zero = np.zeros(arm.dof)
    wrist, hand = arm.point_positions(zero, ("wrist", "hand"))
    along = (hand - wrist) / np.linalg.norm(hand - wrist)
    thigh = np.array([0.0, -1.0 if arm.side == LEFT else 1.0, 0.0])
    palm = thigh - (thigh @ along) * along
    palm /= np.linalg.norm(palm)
    hanging = np.stack([np.cross(palm, along), palm, along], axis=1)
    return np.asarray(arm.forward(q)[..., :3, :3] @ arm.forward(zero)[:3, :3].T @ hanging)
