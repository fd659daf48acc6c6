"""Names that people's recordings bring: for each family of names, the points that play each role.

A table, written for the right arm; `other_side` gives the names of the left one. What is added to it is known to
`fit_arm`, to the readers, which look for an upper arm and a trunk, and to ``maniport info``.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from maniport.errors import InvalidInputError, unknown_name

Group = tuple[str, ...]

POINTS = ("shoulder", "elbow", "wrist", "hand")
"""Roles that one point plays, or the mean of several."""

DIRECTIONS = {
    "elbow_axis": "medial to lateral",
    "wrist_axis": "ulnar to radial",
    "trunk_up": "low to high",
    "trunk_front": "back to front",
    "trunk_left": "right to left",
}
"""Roles that two such points play, and from which to which."""

ROLES = (*POINTS, *DIRECTIONS)
ARM = ("shoulder", "elbow", "wrist")
"""Roles without which there is no arm."""

TRUNK = ("trunk_up", "trunk_front", "trunk_left")

DIALECTS: dict[str, Mapping[str, Sequence[Any]]] = {
    "points named after their roles": {
        "shoulder": ["shoulder"], "elbow": ["elbow"], "wrist": ["wrist"], "hand": ["hand"],
        "elbow_axis": [("elbow_medial", "elbow_lateral")], "wrist_axis": [("wrist_ulnar", "wrist_radial")],
        "trunk_up": [("trunk_low", "trunk_high")], "trunk_front": [("trunk_back", "trunk_front")],
        "trunk_left": [("trunk_right", "trunk_left")],
    },
    "joint angles": {
        "shoulder": ["right_shoulder"], "elbow": ["right_elbow"], "wrist": ["right_wrist"], "hand": ["right_hand"],
        "elbow_axis": [("right_elbow_medial", "right_elbow_lateral")],
        "wrist_axis": [("right_wrist_ulnar", "right_wrist_radial")],
    },
    "landmarks of the ISB without a side": {  # "rs" in small letters: R is for radius
        "shoulder": ["GH", "AC"], "elbow": [["EL", "EM"]], "wrist": [["rs", "US"]],
        "elbow_axis": [("EM", "EL")], "wrist_axis": [("US", "rs")],
    },
    "Motive": {
        "shoulder": ["RUArm"], "elbow": ["RFArm"], "wrist": ["RHand"], "hand": ["EndSiteRHand"],
        "trunk_up": [("Chest", "Neck"), ("Ab", "Neck")], "trunk_left": [("RUArm", "LUArm")],
    },
    "Poser, DAZ": {
        "shoulder": ["rShldr"], "elbow": ["rForeArm"], "wrist": ["rHand"], "hand": ["rMid1"],
        "trunk_up": [("abdomen", "neck")], "trunk_left": [("rShldr", "lShldr")],
    },
    "3ds Max Biped": {
        "shoulder": ["Bip01 R UpperArm"], "elbow": ["Bip01 R Forearm"], "wrist": ["Bip01 R Hand"],
        "trunk_left": [("Bip01 R UpperArm", "Bip01 L UpperArm")],
    },
    "VRoid": {
        "shoulder": ["J_Bip_R_UpperArm"], "elbow": ["J_Bip_R_LowerArm"], "wrist": ["J_Bip_R_Hand"],
        "hand": ["J_Bip_R_Middle1"], "trunk_left": [("J_Bip_R_UpperArm", "J_Bip_L_UpperArm")],
    },
    "Blender": {
        "shoulder": ["upper_arm.R"], "elbow": ["forearm.R"], "wrist": ["hand.R"],
        "trunk_left": [("upper_arm.R", "upper_arm.L")],
    },
    "Unreal": {
        "shoulder": ["upperarm_r"], "elbow": ["lowerarm_r"], "wrist": ["hand_r"], "hand": ["middle_01_r"],
        "trunk_left": [("upperarm_r", "upperarm_l")],
    },
    "Kinect": {
        "shoulder": ["ShoulderRight"], "elbow": ["ElbowRight"], "wrist": ["WristRight"], "hand": ["HandRight"],
        "trunk_left": [("ShoulderRight", "ShoulderLeft")],
    },
    "ARKit": {
        "shoulder": ["right_arm_joint"], "elbow": ["right_forearm_joint"], "wrist": ["right_hand_joint"],
        "hand": ["right_handMid_1_joint"],
        "trunk_left": [("right_arm_joint", "left_arm_joint")],
    },
    "OpenCap": {
        "shoulder": ["r_shoulder_study", "r_shoulder"],
        "elbow": [["r_lelbow_study", "r_melbow_study"], ["r_lelbow", "r_melbow"]],
        "wrist": [["r_lwrist_study", "r_mwrist_study"], ["r_lwrist", "r_mwrist"]],
        "elbow_axis": [("r_melbow_study", "r_lelbow_study"), ("r_melbow", "r_lelbow")],
        "wrist_axis": [("r_mwrist_study", "r_lwrist_study"), ("r_mwrist", "r_lwrist")],
        "trunk_up": [(["r.PSIS_study", "L.PSIS_study"], "C7_study"), (["r.PSIS", "L.PSIS"], "C7")],
        "trunk_left": [("r_shoulder_study", "L_shoulder_study"), ("r_shoulder", "L_shoulder")],
    },
    "collar, up and low arm": {
        "shoulder": ["RightUpArm"], "elbow": ["RightLowArm"], "wrist": ["RightHand"], "hand": ["EndSiteRightHand"],
        "trunk_left": [("RightUpArm", "LeftUpArm")],
    },
    "Xsens MVNX": {
        "shoulder": ["RightUpperArm"], "elbow": ["RightForeArm"], "wrist": ["RightHand"],
        "trunk_up": [("T8", "Neck")], "trunk_left": [("RightUpperArm", "LeftUpperArm")],
    },
    "VRM, Unity": {
        "shoulder": ["RightUpperArm"], "elbow": ["RightLowerArm"], "wrist": ["RightHand"],
        "hand": ["RightMiddleProximal", "EndSiteRightHand"], "trunk_left": [("RightUpperArm", "LeftUpperArm")],
    },
    "OpenPose, HALPE, Pose2Sim, SMPL": {
        "shoulder": ["RShoulder"], "elbow": ["RElbow"], "wrist": ["RWrist"], "hand": ["R_Hand"],
        "trunk_left": [("RShoulder", "LShoulder")],
    },
    "MediaPipe, COCO, SMPL-X, AMASS, Xsens BVH": {
        "shoulder": ["RightShoulder"], "elbow": ["RightElbow"], "wrist": ["RightWrist"],
        "hand": ["right_middle1", "right_hand", ["right_index", "right_pinky"], "EndSiteRightWrist"],
        "trunk_left": [("RightShoulder", "LeftShoulder")],
    },
    "centers of joints, Visual3D": {
        "shoulder": ["RSJC"], "elbow": ["REJC"], "wrist": ["RWJC"], "trunk_left": [("RSJC", "LSJC")],
    },
    "hips and shoulders": {
        "trunk_up": [
            (["RightUpLeg", "LeftUpLeg"], ["RightArm", "LeftArm"]),
            (["RightHip", "LeftHip"], ["RightShoulder", "LeftShoulder"]),
            (["RHip", "LHip"], ["RShoulder", "LShoulder"]),
            (["HipRight", "HipLeft"], ["ShoulderRight", "ShoulderLeft"]),
            (["thigh_r", "thigh_l"], ["upper_arm_r", "upper_arm_l"]),
            (["RASI", "LASI", "RPSI", "LPSI"], ["RSHO", "LSHO"]), (["RHJC", "LHJC"], ["RSJC", "LSJC"]),
        ],
    },
    "spines of skeletons": {
        "trunk_up": [
            ("Spine", "Neck"), ("LowerBack", "Neck"), ("Hips", "Neck"), ("Chest", "Neck"), ("Spine1", "Neck1"),
            ("Spine", "Neck1"), ("Hips", "Neck1"), ("Spine1", "Neck"), ("MidHip", "Neck"), ("Hip", "Neck"),
            ("Pelvis", "Neck"), ("Pelvis", "Thorax"), ("spine_01", "neck_01"), ("spine_1_joint", "neck_1_joint"),
            ("hips_joint", "neck_1_joint"), ("SpineBase", "SpineShoulder"), ("SpineNavel", "Neck"),
            ("Bip01 Spine", "Bip01 Neck"), ("J_Bip_C_Spine", "J_Bip_C_Neck"),
        ],
    },
    "Plug-in Gait, landmarks of the ISB and other marker sets": {
        "shoulder": [["RFSH", "RBSH"], "RSHO", "RAC", "RACR"],
        "elbow": [["RELB", "RIEL"], ["RELB", "RELBM"], ["RLEL", "RMEL"], ["REL", "REM"], "RELB"],
        "wrist": [["ROWR", "RIWR"], ["RWRA", "RWRB"], ["RRS", "RUS"], ["RFAradius", "RFAulna"]],
        "hand": [["RIHAND", "ROHAND"], "RFIN"],
        "elbow_axis": [("RIEL", "RELB"), ("RELBM", "RELB"), ("RMEL", "RLEL"), ("REM", "REL")],
        "wrist_axis": [("RWRB", "RWRA"), ("ROWR", "RIWR"), ("RUS", "RRS"), ("RFAulna", "RFAradius")],
        "trunk_up": [
            (["T10", "STRN"], ["C7", "CLAV"]), (["T8", "PX"], ["C7", "IJ"]), ("T10", "C7"), ("STRN", "CLAV"),
        ],
        "trunk_front": [
            (["C7", "T10"], ["CLAV", "STRN"]), (["C7", "T8"], ["IJ", "PX"]), (["C7", "T10"], "STRN"),
            (["C7", "T10"], "CLAV"), ("C7", "CLAV"),
        ],
        "trunk_left": [(["RFSH", "RBSH"], ["LFSH", "LBSH"]), ("RSHO", "LSHO"), ("RAC", "LAC"), ("RACR", "LACR")],
    },
    "LAFAN1, CMU, Mixamo, Rokoko, Noitom, Nokov, SOMA": {
        "shoulder": ["RightArm"], "elbow": ["RightForeArm"], "wrist": ["RightHand"],
        "hand": ["RFingers", "RightHandMiddle1", "EndSiteRightHand"], "trunk_left": [("RightArm", "LeftArm")],
    },
}  # fmt: skip
"""For each family of names and each role the ways in which it may be played, the first that is there counts.

Each way is written as in the argument ``markers`` of `fit_arm`: a name or a list of names whose mean it is; for a
direction a pair (from, to) of these. The arm is that of the family with most of its roles in the recording, the later
one of equals, so that what is added goes before; the trunk may come from another. Upper and lower case, spaces, ``_``,
``.``, ``-`` and what stands before a colon (``Nick01:RELB``, ``mixamorig:RightArm``) make no difference.
"""

LEGS = (
    ("RightFoot", "RightUpLeg"), ("RightFoot", "RightThigh"), ("RightFoot", "RightUpperLeg"), ("RightFoot", "RightLeg"),
    ("RightAnkle", "RightHip"), ("RAnkle", "RHip"), ("RightFoot", "RightHip"), ("RFoot", "RThigh"),
    ("foot_r", "thigh_r"), ("right_foot_joint", "right_upLeg_joint"), ("AnkleRight", "HipRight"), ("RANK", "RASI"),
)  # fmt: skip
"""Lower and upper end of a leg, of the right side, in several families."""

COLLARS = {"rightshoulder", "leftshoulder", "rshoulder", "lshoulder"}
"""Collar bones in some families, shoulders in others: without elbow or wrist they tell nothing."""

MOST_BODIES = 20
"""So many prefixes are tried as those of bodies."""

END = "EndSite"
"""Begins the names of the ends of chains in BVH files; that of the joint follows."""
_WORDS = {"right": "left", "Right": "Left", "RIGHT": "LEFT", "r": "l", "R": "L"}
_OTHER = _WORDS | {left: right for right, left in _WORDS.items()}
_WORD = re.compile("|".join(word for word in _OTHER if len(word) > 1))
_LETTER = re.compile(r"(?<![A-Za-z])[RrLl](?![a-z0-9])")


def other_side(name: str) -> str:
    """The name of the same point on the other side of the body; the same name where it has no side."""
    before, colon, bare = name.rpartition(":")
    if bare.startswith(END):
        return before + colon + END + other_side(bare.removeprefix(END))
    pattern = _WORD if _WORD.search(bare) else _LETTER
    return before + colon + pattern.sub(lambda found: _OTHER[found[0]], bare, count=1)


def key(name: str) -> str:
    """What is compared of a name."""
    return re.sub(r"[_ .\-]", "", name.rpartition(":")[2]).lower()


def body_of(name: str) -> str:
    """What stands before a point's own name, as programs write whose it is; empty where nothing does."""
    return name.rpartition(":")[0]


def find_roles(names: Iterable[str], side: str = "right", body: str | None = None) -> tuple[str, dict[str, Any]]:
    """Find the family of names of a recording, and the points that play each role."""
    every = list(names)
    whole = whole_bodies(every, side)
    return _found(whole.get(body or "", next(iter(whole.values()), every)), side)


def whole_bodies(names: Iterable[str], side: str) -> dict[str, list[str]]:
    """The points of each body that has a whole arm and a trunk, by what stands before a colon."""
    bodies: dict[str, list[str]] = {}
    for name in names:
        bodies.setdefault(body_of(name), []).append(name)
    wanted = {*ARM, "trunk_up"}
    if len(bodies) == 1:
        return bodies
    return {body: own for body, own in list(bodies.items())[:MOST_BODIES] if wanted <= _found(own, side)[1].keys()}


def _found(names: Sequence[str], side: str) -> tuple[str, dict[str, Any]]:
    by_key = {key(name): name for name in reversed(names)}
    played = {family: _played(family, by_key, side) for family in reversed(DIALECTS)}
    best = max(played, key=lambda one: (sum(role in played[one] for role in ARM), len(played[one].keys() - TRUNK)))
    found = dict(played[best])
    for role in TRUNK:
        if role not in found:
            found |= next(({role: one[role]} for one in played.values() if role in one), {})
    if not found.keys() & set(ARM[1:]) and COLLARS & set(map(key, found.get("shoulder", ()))):
        del found["shoulder"]
        found.pop("trunk_left", None)
    return best, {role: found[role] for role in ROLES if role in found}


def find_legs(names: Iterable[str]) -> list[tuple[str, str]]:
    """The lower and the upper end of each leg that is there."""
    by_key = {key(name): name for name in names}
    pairs = [pair for right in LEGS for pair in (right, tuple(map(other_side, right)))]
    return [(by_key[key(low)], by_key[key(high)]) for low, high in pairs if {key(low), key(high)} <= by_key.keys()]


def ways(family: str, role: str, side: str = "right") -> list[Any]:
    """The ways of a family to play a role on one side: groups of names, or pairs of groups."""
    choices = DIALECTS[family].get(role, ())
    if isinstance(choices, str):
        raise InvalidInputError(f"DIALECTS[{family!r}][{role!r}] must be a list of choices; found {choices!r}")
    mirrored = side == "left" and role not in TRUNK  # the trunk's left is its left for either arm
    return [as_choice_of_names(role, one, f"DIALECTS[{family!r}][{role!r}]", mirrored) for one in choices]


def as_choice_of_names(role: str, choice: Any, where: str, mirrored: bool = False) -> Any:
    """Check what is to play a role, and write it as a tuple of names, or for a direction as a pair of these."""
    if role not in DIRECTIONS:
        nested = isinstance(choice, Sequence) and len(choice) == 1 and isinstance(choice[0], list | tuple)
        return _as_group(choice[0] if nested else choice, where, mirrored)  # groups are nested in pairs, and often here
    if isinstance(choice, str) or not isinstance(choice, Sequence) or len(choice) != 2:
        raise InvalidInputError(f"{where} must be a pair of points or of lists (from, to); found {choice!r}")
    return tuple(_as_group(part, where, mirrored) for part in choice)


def _as_group(choice: Any, where: str, mirrored: bool) -> Group:
    names = (choice,) if isinstance(choice, str) else tuple(choice) if isinstance(choice, Sequence) else ()
    if not names or not all(isinstance(name, str) for name in names):
        raise InvalidInputError(f"{where} must be one name or a list of names; found {choice!r}")
    return tuple(other_side(name) for name in names) if mirrored else names


def _played(family: str, by_key: Mapping[str, str], side: str) -> dict[str, Any]:
    """The roles that a family's names play among the points that there are."""
    found: dict[str, Any] = {}
    for role in DIALECTS[family]:
        if role not in ROLES:
            raise unknown_name("role", role, ROLES, f"in DIALECTS[{family!r}]")
        there = (_there(role, way, by_key) for way in ways(family, role, side))
        found |= next(({role: one} for one in there if one), {})
    return found


def _there(role: str, way: Any, by_key: Mapping[str, str]) -> Any:
    """The recording's own names for one way to play a role; None unless all are there."""
    if role in DIRECTIONS:
        pair = tuple(_there("", group, by_key) for group in way)
        return pair if all(pair) else None
    own = tuple(by_key.get(key(name), "") for name in way)
    return own if all(own) else None
