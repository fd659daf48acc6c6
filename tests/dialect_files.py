"""One motion of a person in the names, units, axes and files of many programs.

The person's trunk turns and leans, one arm moves as a model of the arm does and the other hangs. Bones keep their
lengths, so that a skeleton's file and a table of positions tell the same directions, and all trunk directions agree.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from maniport.arms import myoarm
from maniport.mocap import Recording, synthetic_recording

UPPER_ARM = 0.30
FOREARM = 0.26
HAND = 0.08
BONES = (("shoulder", "elbow", UPPER_ARM), ("elbow", "wrist", FOREARM), ("wrist", "hand", HAND))

_DATA = yaml.safe_load(
    (Path(__file__).parent / "mocap" / "data" / "programs.yaml").read_text(encoding="utf-8")
)
REST = _DATA["rest"]
SPINE = _DATA["parents"]
POINTS = _DATA["points"]
BESIDE = ("elbow_lateral", "elbow_medial", "wrist_radial", "wrist_ulnar")
"""Points beside the joints of an arm."""


@dataclass(frozen=True)
class Motion:
    """A person's parts over time [m], z up, and the joint angles of the arm that moves."""

    time: np.ndarray
    joint_angles: np.ndarray
    parts: dict[str, np.ndarray]
    trunk: np.ndarray

    def recording(self, names):
        return Recording(
            tuple(names), np.stack([self.parts[part] for part in names.values()], 1), self.time
        )


def motion(n=40, rate=50.0):
    """A second of motion of the right arm, well inside the limits of the model; the left arm hangs."""
    arm = myoarm(UPPER_ARM, FOREARM, HAND)
    time = np.arange(n) / rate
    middle = (arm.upper + arm.lower) / 2
    half = (arm.upper - arm.lower) / 2
    phase = np.arange(arm.dof)
    q = middle + 0.5 * half * np.sin(2 * np.pi * 0.4 * time[:, None] + phase)
    rest = np.clip(np.radians([0, 8, 0, 15, 0, 0, 0]), arm.lower, arm.upper)
    still = rest + 0.02 * np.sin(2 * np.pi * 0.4 * time[:, None] + phase)
    trunk = Rotation.from_euler(
        "zyx", np.radians([20, 6, 4]) * np.sin(2 * time[:, None] + np.arange(3))
    ).as_matrix()
    parts = {name: np.tile(np.array(place, dtype=float), (n, 1)) for name, place in REST.items()}
    for letter, sign, angles in (("r", 1.0, q), ("l", -1.0, still)):
        seen = synthetic_recording(arm, angles, time)
        mirror = np.array([1.0, sign, 1.0])
        at = parts[f"shoulder_{letter}"]
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
            parts[f"{name}_{letter}"] = parts[f"{middle}_{letter}"] + mirror * (
                seen.point(name) - seen.point(middle)
            )
    here = np.stack([0.1 * time, -0.05 * time, 0.02 * np.sin(3 * time)], axis=1)
    parts = {name: np.einsum("nij,nj->ni", trunk, place) + here for name, place in parts.items()}
    return Motion(time, q, parts, trunk)


def mirrored(names):
    """Names of both sides from those of the right side: (name, part) pairs, `R`/`L` exchanged as each dialect does."""
    pairs = dict(names)
    for name, part in names.items():
        if part.endswith("_r"):
            pairs[_left(name)] = f"{part[:-2]}_l"
    return pairs


def _left(name):
    for right, left in (
        ("Right", "Left"),
        ("right", "left"),
        ("_R", "_L"),
        (".R", ".L"),
        ("R_", "L_"),
    ):
        if right in name:
            return name.replace(right, left)
    if name.endswith("_r"):
        return f"{name[:-2]}_l"
    if name.startswith("r_"):
        return f"l_{name[2:]}"
    return name.replace("R", "L", 1)


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


SKELETONS = {name: Skeleton(**options) for name, options in _DATA["skeletons"].items()}


def write_bvh(path, skeleton, made):
    """A BVH file of a motion, angles to 1e-6 degrees."""
    names = mirrored(skeleton.names)
    by_part = {part: name for name, part in names.items()}
    above = mirrored_parts()
    world = (
        np.eye(3)[[1, 2, 0]] if skeleton.up == "y" else np.eye(3)
    )  # y up: x to the left, z forward

    def parent(part):
        part = above.get(part)
        return part if part is None or part in by_part else parent(part)

    parts = [part for part in ("pelvis", *above) if part in by_part]
    children = {part: [other for other in parts if parent(other) == part] for part in parts}
    places = {part: made.parts[part] @ world.T for part in [*parts, "hand_r", "hand_l", "crown"]}
    rest = _rest_places(world)
    turns = {}
    zero = {}
    for part in parts:
        tip = next(iter(children[part]), {"wrist_r": "hand_r", "wrist_l": "hand_l"}.get(part))
        moves = part in ("shoulder_r", "elbow_r", "wrist_r", "shoulder_l", "elbow_l", "wrist_l")
        trunk = world @ made.trunk @ world.T
        turns[part] = trunk
        zero[part] = np.eye(3)
        if moves:
            bone = rest[tip] - rest[part]
            turns[part] = (
                onto(np.einsum("nij,j->ni", trunk, bone), places[tip] - places[part]) @ trunk
            )
            if skeleton.bones == "x":  # the bone's own frame lies otherwise than the body's at rest
                zero[part] = onto(np.array([[1.0, 0.0, 0.0]]), bone[None])[0]
    lines = ["HIERARCHY"]
    rows = []

    def write(part, depth):
        above_ = parent(part)
        pad = "\t" * depth
        base = np.eye(3) if above_ is None else zero[above_]
        offset = (
            np.zeros(3) if above_ is None else base.T @ (rest[part] - rest[above_]) / skeleton.unit
        )
        lines.append(f"{pad}{'ROOT' if above_ is None else 'JOINT'} {by_part[part]}")
        lines.append(pad + "{")
        lines.append(f"{pad}\tOFFSET " + " ".join(f"{x:.6f}" for x in offset))
        places_too = above_ is None or skeleton.all_move
        kinds = [
            *(f"{axis}position" for axis in "XYZ" if places_too),
            *(f"{axis}rotation" for axis in skeleton.order),
        ]
        lines.append(f"{pad}\tCHANNELS {len(kinds)} " + " ".join(kinds))
        if places_too:
            rows.append(
                places[part] / skeleton.unit
                if above_ is None
                else np.tile(offset, (len(made.time), 1))
            )
        own = turns[part] @ zero[part]
        local = own if above_ is None else np.swapaxes(turns[above_] @ zero[above_], 1, 2) @ own
        rows.append(Rotation.from_matrix(local).as_euler(skeleton.order, degrees=True))
        for child in children[part]:
            write(child, depth + 1)
        if not children[part]:
            tip = {"wrist_r": "hand_r", "wrist_l": "hand_l", "head": "crown"}.get(part)
            last = np.array([0, 0.05, 0]) if tip is None else rest[tip] - rest[part]
            last = " ".join(f"{x:.6f}" for x in zero[part].T @ last / skeleton.unit)
            inner = pad + "\t"
            lines.extend([f"{inner}End Site", inner + "{", f"{inner}\tOFFSET {last}", inner + "}"])
        lines.append(pad + "}")

    write("pelvis", 0)
    step = float(made.time[1] - made.time[0])
    lines += ["MOTION", f"Frames: {len(made.time)}", f"Frame Time: {step:.6f}"]
    lines += [" ".join(f"{x:.6f}" for x in row) for row in np.concatenate(rows, axis=1)]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return Path(path)


def mirrored_parts():
    left = {
        f"{part[:-2]}_l": (f"{on[:-2]}_l" if on.endswith("_r") else on)
        for part, on in SPINE.items()
        if part.endswith("_r")
    }
    return SPINE | left


def _rest_places(world):
    places = {part: world @ np.array(place, dtype=float) for part, place in REST.items()}
    for letter, sign in (("r", -1.0), ("l", 1.0)):
        at = np.array(REST[f"shoulder_{letter}"], dtype=float)
        for _, name, length in BONES:
            at = at + np.array([0.0, sign * length, 0.0])
            places[f"{name}_{letter}"] = world @ at
    return places


def onto(start, end):
    """The smallest rotations that turn directions (n, 3) onto others, shape (n, 3, 3)."""
    a = start / np.linalg.norm(start, axis=-1, keepdims=True)
    b = end / np.linalg.norm(end, axis=-1, keepdims=True)
    axis = np.cross(a, b)
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(length, np.sum(a * b, axis=-1, keepdims=True))
    return Rotation.from_rotvec(axis / np.where(length > 1e-12, length, 1.0) * angle).as_matrix()
