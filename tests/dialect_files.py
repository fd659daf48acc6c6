"""One motion of a person in the names, units, axes and files of many programs.

The person's trunk turns and leans, one arm moves as a model of the arm does and the other hangs. Bones keep their
lengths, so that a skeleton's file and a table of positions tell the same directions, and all trunk directions agree.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.bodies import myoarm
from maniport.demonstrations import Recording, performed

UPPER_ARM, FOREARM, HAND = 0.30, 0.26, 0.08
BONES = (("shoulder", "elbow", UPPER_ARM), ("elbow", "wrist", FOREARM), ("wrist", "hand", HAND))

REST = {
    "pelvis": (0, 0, 1.0), "hip_r": (0, -0.09, 1.0), "hip_l": (0, 0.09, 1.0), "knee_r": (0, -0.09, 0.55),
    "knee_l": (0, 0.09, 0.55), "foot_r": (0, -0.09, 0.1), "foot_l": (0, 0.09, 0.1), "toe_r": (0.15, -0.09, 0.05),
    "toe_l": (0.15, 0.09, 0.05),
    "spine1": (0, 0, 1.1), "spine2": (0, 0, 1.2), "spine3": (0, 0, 1.3), "spine4": (0, 0, 1.4), "neck": (0, 0, 1.5),
    "neck2": (0, 0, 1.55), "head": (0, 0, 1.6), "crown": (0, 0, 1.75), "nose": (0.1, 0, 1.62),
    "eye_r": (0.09, -0.03, 1.65), "eye_l": (0.09, 0.03, 1.65), "ear_r": (0, -0.07, 1.62), "ear_l": (0, 0.07, 1.62),
    "c7": (-0.06, 0, 1.5), "t10": (-0.06, 0, 1.2), "jugular": (0.06, 0, 1.5), "sternum": (0.06, 0, 1.2),
    "clavicle_r": (0, -0.03, 1.45), "clavicle_l": (0, 0.03, 1.45),
    "shoulder_r": (0, -0.18, 1.45), "shoulder_l": (0, 0.18, 1.45),
}  # fmt: skip
"""Parts that move with the trunk [m], x forward, y to the left, z up."""
BESIDE = ("elbow_lateral", "elbow_medial", "wrist_radial", "wrist_ulnar")
"""Points beside the joints of an arm."""


@dataclass(frozen=True)
class Motion:
    """A person's parts over time [m], z up, and the joint angles of the arm that moves."""

    time: np.ndarray
    joint_angles: np.ndarray
    side: str
    parts: dict[str, np.ndarray]
    trunk: np.ndarray

    def recording(self, names, source="made"):
        """Points under other names: {name: part}, in metres."""
        return Recording(
            tuple(names), np.stack([self.parts[part] for part in names.values()], 1), self.time, "z", source
        )


def motion(side="right", n=40, rate=50.0):
    """A second of one arm's motion, well inside the model's limits; a left one is the right one's mirror image."""
    arm, time = myoarm(UPPER_ARM, FOREARM, HAND), np.arange(n) / rate
    middle, half = (arm.upper + arm.lower) / 2, (arm.upper - arm.lower) / 2
    phase = np.arange(arm.dof)
    q = middle + 0.5 * half * np.sin(2 * np.pi * 0.4 * time[:, None] + phase)
    rest = np.clip(np.radians([0, 8, 0, 15, 0, 0, 0]), arm.lower, arm.upper)
    still = rest + 0.02 * np.sin(2 * np.pi * 0.4 * time[:, None] + phase)
    trunk = Rotation.from_euler("zyx", np.radians([20, 6, 4]) * np.sin(2 * time[:, None] + np.arange(3))).as_matrix()
    parts = {name: np.tile(np.array(place, dtype=float), (n, 1)) for name, place in REST.items()}
    for letter, sign, angles in (("r", 1.0, q), ("l", -1.0, still)):
        seen = performed(arm, angles, time)
        mirror, at = np.array([1.0, sign, 1.0]), parts[f"shoulder_{letter}"]
        for start, end, length in (
            ("shoulder", "elbow", UPPER_ARM),
            ("elbow", "wrist", FOREARM),
            ("wrist", "hand", HAND),
        ):
            bone = mirror * (seen.point(end) - seen.point(start))
            at = at + length * bone / np.linalg.norm(bone, axis=-1, keepdims=True)
            parts[f"{end}_{letter}"] = at
        for name in BESIDE:
            middle = name.split("_")[0]
            parts[f"{name}_{letter}"] = parts[f"{middle}_{letter}"] + mirror * (seen.point(name) - seen.point(middle))
    here = np.stack([0.1 * time, -0.05 * time, 0.02 * np.sin(3 * time)], axis=1)
    if side == "left":
        reflected = np.array([1.0, -1.0, 1.0])
        other = {"r": "l", "l": "r"}
        parts = {
            (name[:-1] + other[name[-1]] if name[-2:] in ("_r", "_l") else name): place * reflected
            for name, place in parts.items()
        }
        trunk, here = reflected[:, None] * trunk * reflected, here * reflected
    parts = {name: np.einsum("nij,nj->ni", trunk, place) + here for name, place in parts.items()}
    return Motion(time, q, side, parts, trunk)


def mirrored(names):
    """Names of both sides from those of the right side: (name, part) pairs, `R`/`L` exchanged as each dialect does."""
    pairs = dict(names)
    for name, part in names.items():
        if part.endswith("_r"):
            pairs[_left(name)] = f"{part[:-2]}_l"
    return pairs


def _left(name):
    for right, left in (("Right", "Left"), ("right", "left"), ("_R", "_L"), (".R", ".L"), ("R_", "L_")):
        if right in name:
            return name.replace(right, left)
    if name.endswith("_r"):
        return f"{name[:-2]}_l"
    if name.startswith("r_"):
        return f"l_{name[2:]}"
    return name.replace("R", "L", 1)


# ---- positions ----------------------------------------------------------------------------------------------------

POINTS = {
    "SMPL": {"Pelvis": "pelvis", "R_Hip": "hip_r", "Spine1": "spine1", "Spine2": "spine2", "Spine3": "spine3",
             "Neck": "neck", "Head": "head", "R_Collar": "clavicle_r", "R_Shoulder": "shoulder_r", "R_Elbow": "elbow_r",
             "R_Wrist": "wrist_r", "R_Hand": "hand_r"},
    "SMPL-X": {"pelvis": "pelvis", "right_hip": "hip_r", "spine1": "spine1", "spine2": "spine2", "spine3": "spine3",
               "neck": "neck", "head": "head", "right_collar": "clavicle_r", "right_shoulder": "shoulder_r",
               "right_elbow": "elbow_r", "right_wrist": "wrist_r", "right_middle1": "hand_r"},
    "OpenPose": {"Nose": "nose", "Neck": "neck", "RShoulder": "shoulder_r", "RElbow": "elbow_r", "RWrist": "wrist_r",
                 "MidHip": "pelvis", "RHip": "hip_r"},
    "HALPE": {"Nose": "nose", "Head": "head", "Neck": "neck", "Hip": "pelvis", "RShoulder": "shoulder_r",
              "RElbow": "elbow_r", "RWrist": "wrist_r", "RHip": "hip_r"},
    "COCO": {"nose": "nose", "right_eye": "eye_r", "right_ear": "ear_r", "right_shoulder": "shoulder_r",
             "right_elbow": "elbow_r", "right_wrist": "wrist_r", "right_hip": "hip_r"},
    "MediaPipe": {"nose": "nose", "right_shoulder": "shoulder_r", "right_elbow": "elbow_r", "right_wrist": "wrist_r",
                  "right_index": "hand_r", "right_hip": "hip_r"},
    "ARKit": {"hips_joint": "pelvis", "spine_1_joint": "spine1", "spine_4_joint": "spine2", "spine_7_joint": "spine4",
              "neck_1_joint": "neck", "head_joint": "head", "right_shoulder_1_joint": "clavicle_r",
              "right_arm_joint": "shoulder_r", "right_forearm_joint": "elbow_r", "right_hand_joint": "wrist_r"},
    "MVNX": {"Pelvis": "pelvis", "L5": "spine1", "L3": "spine2", "T12": "spine3", "T8": "spine4", "Neck": "neck",
             "Head": "head", "RightShoulder": "clavicle_r", "RightUpperArm": "shoulder_r", "RightForeArm": "elbow_r",
             "RightHand": "wrist_r"},
    "ISB": {"C7": "c7", "T8": "t10", "IJ": "jugular", "PX": "sternum", "RAC": "shoulder_r", "REL": "elbow_lateral_r",
            "REM": "elbow_medial_r", "RRS": "wrist_radial_r", "RUS": "wrist_ulnar_r"},
    "ISB without side": {"C7": "c7", "T8": "t10", "IJ": "jugular", "PX": "sternum", "AC": "shoulder_r",
                         "EL": "elbow_lateral_r", "EM": "elbow_medial_r", "RS": "wrist_radial_r",
                         "US": "wrist_ulnar_r"},
    "Plug-in Gait": {"C7": "c7", "T10": "t10", "CLAV": "jugular", "STRN": "sternum", "RSHO": "shoulder_r",
                     "RELB": "elbow_r", "RWRA": "wrist_radial_r", "RWRB": "wrist_ulnar_r", "RFIN": "hand_r"},
    "Visual3D": {"C7": "c7", "RSJC": "shoulder_r", "REJC": "elbow_r", "RWJC": "wrist_r", "RHJC": "hip_r"},
    "OpenCap": {"Neck": "neck", "midHip": "pelvis", "r_shoulder_study": "shoulder_r",
                "r_lelbow_study": "elbow_lateral_r", "r_melbow_study": "elbow_medial_r",
                "r_lwrist_study": "wrist_radial_r", "r_mwrist_study": "wrist_ulnar_r", "C7_study": "c7",
                "r.ASIS_study": "hip_r"},
    "snake case": {"hips": "pelvis", "spine": "spine1", "chest": "spine3", "neck": "neck", "head": "head",
                   "right_upper_arm": "shoulder_r", "right_lower_arm": "elbow_r", "right_hand": "wrist_r"},
}  # fmt: skip
"""For each family what its points are called: {name: part}, of the right side and the middle."""

# ---- skeletons ----------------------------------------------------------------------------------------------------

SPINE = {"spine1": "pelvis", "spine2": "spine1", "spine3": "spine2", "spine4": "spine3", "neck": "spine4",
         "neck2": "neck", "head": "neck2", "hip_r": "pelvis", "knee_r": "hip_r", "foot_r": "knee_r",
         "toe_r": "foot_r", "clavicle_r": "spine4", "shoulder_r": "clavicle_r", "elbow_r": "shoulder_r",
         "wrist_r": "elbow_r", "hand_r": "wrist_r"}  # fmt: skip
"""What each part hangs on; where a dialect leaves one out, what is beyond it hangs on the next."""


@dataclass(frozen=True)
class Skeleton:
    """How a program writes BVH: names of the right side and the middle, order of rotations, unit, axis up, text."""

    names: dict[str, str]
    order: str = "ZXY"
    unit: float = 0.01
    up: str = "y"
    all_move: bool = False
    bones: str = "body"
    """``"body"``: at zero angles the person stands as T; ``"x"``: every bone then lies along its own x."""


LEG = {"RightUpLeg": "hip_r", "RightLeg": "knee_r", "RightFoot": "foot_r", "RightToeBase": "toe_r"}
SPINES = {"Hips": "pelvis", "Spine": "spine1", "Spine1": "spine2", "Spine2": "spine3", "Neck": "neck", "Head": "head"}
SIDE = {"RightShoulder": "clavicle_r", "RightArm": "shoulder_r", "RightForeArm": "elbow_r", "RightHand": "wrist_r"}

SKELETONS = {
    "LAFAN1": Skeleton({**SPINES, **LEG, **SIDE}, "ZYX", bones="x"),
    "Xsens": Skeleton({"Hips": "pelvis", "Chest": "spine1", "Chest2": "spine2", "Chest3": "spine3", "Chest4": "spine4",
                       "Neck": "neck", "Head": "head", "RightCollar": "clavicle_r", "RightShoulder": "shoulder_r",
                       "RightElbow": "elbow_r", "RightWrist": "wrist_r", "RightHip": "hip_r", "RightKnee": "knee_r",
                       "RightAnkle": "foot_r", "RightToe": "toe_r"}, "YXZ"),
    "Nokov": Skeleton({"Hips": "pelvis", "Spine": "spine1", "Spine1": "spine3", "Neck": "neck", "Head": "head", **LEG,
                       **SIDE}, "ZYX", all_move=True),
    "Noitom": Skeleton({**SPINES, "Neck1": "neck2", **LEG, **SIDE}, "YXZ", all_move=True),
    "SOMA": Skeleton({"Hips": "pelvis", "Spine1": "spine1", "Spine2": "spine2", "Chest": "spine4", "Neck1": "neck",
                      "Neck2": "neck2", "Head": "head", "RightLeg": "hip_r", "RightShin": "knee_r",
                      "RightFoot": "foot_r", **SIDE}),
    "Motive": Skeleton({"Hip": "pelvis", "Ab": "spine1", "Chest": "spine3", "Neck": "neck", "Head": "head",
                        "RThigh": "hip_r", "RShin": "knee_r", "RFoot": "foot_r", "RShoulder": "clavicle_r",
                        "RUArm": "shoulder_r", "RFArm": "elbow_r", "RHand": "wrist_r"}, "XYZ", 0.001),
    "Rokoko": Skeleton({"Hips": "pelvis", "Spine": "spine1", "Spine2": "spine2", "Spine3": "spine3", "Neck": "neck",
                        "Head": "head", "RightThigh": "hip_r", "RightShin": "knee_r", "RightFoot": "foot_r", **SIDE},
                       "YXZ"),
    "Unreal": Skeleton({"pelvis": "pelvis", "spine_01": "spine1", "spine_02": "spine2", "spine_03": "spine3",
                        "neck_01": "neck", "head": "head", "thigh_r": "hip_r", "calf_r": "knee_r", "foot_r": "foot_r",
                        "clavicle_r": "clavicle_r", "upperarm_r": "shoulder_r", "lowerarm_r": "elbow_r",
                        "hand_r": "wrist_r"}, "ZXY", up="z", bones="x"),
    "CMU": Skeleton({"Hips": "pelvis", "LowerBack": "spine1", "Spine": "spine2", "Spine1": "spine3", "Neck": "neck",
                     "Neck1": "neck2", "Head": "head", **LEG, **SIDE}, "ZYX", 0.0254 / 0.45),
    "Mixamo": Skeleton({f"mixamorig:{name}": part for name, part in {**SPINES, **LEG, **SIDE,
                        "RightHandMiddle1": "hand_r"}.items()}, "ZXY"),
}  # fmt: skip


def write_bvh(path, skeleton, made, end="\n", indent="\t"):
    """A BVH file of a motion, angles to 1e-6 degrees."""
    names = mirrored(skeleton.names)
    by_part = {part: name for name, part in names.items()}
    above = mirrored_parts()
    world = np.eye(3)[[1, 2, 0]] if skeleton.up == "y" else np.eye(3)  # y up: x to the left, z forward

    def parent(part):
        part = above.get(part)
        return part if part is None or part in by_part else parent(part)

    parts = [part for part in ("pelvis", *above) if part in by_part]
    children = {part: [other for other in parts if parent(other) == part] for part in parts}
    places = {part: made.parts[part] @ world.T for part in [*parts, "hand_r", "hand_l", "crown"]}
    rest = _rest_places(world)
    turns, zero = {}, {}
    for part in parts:
        tip = next(iter(children[part]), {"wrist_r": "hand_r", "wrist_l": "hand_l"}.get(part))
        moves = part in ("shoulder_r", "elbow_r", "wrist_r", "shoulder_l", "elbow_l", "wrist_l")
        trunk = world @ made.trunk @ world.T
        turns[part] = trunk
        zero[part] = np.eye(3)
        if moves:
            bone = rest[tip] - rest[part]
            turns[part] = _onto(np.einsum("nij,j->ni", trunk, bone), places[tip] - places[part]) @ trunk
            if skeleton.bones == "x":  # the bone's own frame lies otherwise than the body's at rest
                zero[part] = _onto(np.array([[1.0, 0.0, 0.0]]), bone[None])[0]
    lines, rows = ["HIERARCHY"], []

    def write(part, depth):
        above_ = parent(part)
        pad = indent * depth
        base = np.eye(3) if above_ is None else zero[above_]
        offset = np.zeros(3) if above_ is None else base.T @ (rest[part] - rest[above_]) / skeleton.unit
        lines.append(f"{pad}{'ROOT' if above_ is None else 'JOINT'} {by_part[part]}")
        lines.append(pad + "{")
        lines.append(f"{pad}{indent}OFFSET " + " ".join(f"{x:.6f}" for x in offset))
        places_too = above_ is None or skeleton.all_move
        kinds = [*(f"{axis}position" for axis in "XYZ" if places_too), *(f"{axis}rotation" for axis in skeleton.order)]
        lines.append(f"{pad}{indent}CHANNELS {len(kinds)} " + " ".join(kinds))
        if places_too:
            rows.append(places[part] / skeleton.unit if above_ is None else np.tile(offset, (len(made.time), 1)))
        own = turns[part] @ zero[part]
        local = own if above_ is None else np.swapaxes(turns[above_] @ zero[above_], 1, 2) @ own
        rows.append(Rotation.from_matrix(local).as_euler(skeleton.order, degrees=True))
        for child in children[part]:
            write(child, depth + 1)
        if not children[part]:
            tip = {"wrist_r": "hand_r", "wrist_l": "hand_l", "head": "crown"}.get(part)
            last = np.array([0, 0.05, 0]) if tip is None else rest[tip] - rest[part]
            last = " ".join(f"{x:.6f}" for x in zero[part].T @ last / skeleton.unit)
            inner = pad + indent
            lines.extend([f"{inner}End Site", inner + "{", f"{inner}{indent}OFFSET {last}", inner + "}"])
        lines.append(pad + "}")

    write("pelvis", 0)
    step = float(made.time[1] - made.time[0])
    lines += ["MOTION", f"Frames: {len(made.time)}", f"Frame Time: {step:.6f}"]
    lines += [" ".join(f"{x:.6f}" for x in row) for row in np.concatenate(rows, axis=1)]
    Path(path).write_bytes((end.join(lines) + end).encode())
    return Path(path)


def mirrored_parts():
    """What each part hangs on, of both sides."""
    left = {f"{part[:-2]}_l": (f"{on[:-2]}_l" if on.endswith("_r") else on)
            for part, on in SPINE.items() if part.endswith("_r")}  # fmt: skip
    return SPINE | left


def _rest_places(world):
    """Where the parts are when the person stands as T."""
    places = {part: world @ np.array(place, dtype=float) for part, place in REST.items()}
    for letter, sign in (("r", -1.0), ("l", 1.0)):
        at = np.array(REST[f"shoulder_{letter}"], dtype=float)
        for _, name, length in BONES:
            at = at + np.array([0.0, sign * length, 0.0])
            places[f"{name}_{letter}"] = world @ at
    return places


def _onto(start, end):
    """The smallest rotations that turn directions (n, 3) onto others, shape (n, 3, 3)."""
    a = start / np.linalg.norm(start, axis=-1, keepdims=True)
    b = end / np.linalg.norm(end, axis=-1, keepdims=True)
    axis = np.cross(a, b)
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(length, np.sum(a * b, axis=-1, keepdims=True))
    return Rotation.from_rotvec(axis / np.where(length > 1e-12, length, 1.0) * angle).as_matrix()
