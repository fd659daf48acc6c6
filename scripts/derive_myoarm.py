"""Derive the embedded human arm, ``src/maniport/arms/data/myoarm.json``, from the package ``myo-sim``.

Usage: ``pip install myo-sim`` and then ``python scripts/derive_myoarm.py [--check]``; ``--check`` compares the file
with what would be written and changes nothing.

The script walks from the body ``myoarm_r_root`` (at the right sternoclavicular joint) to the third metacarpal, turns
the joint equalities of the MuJoCo model into the factors by which dependent joints follow the independent ones, and
drops everything else: meshes, fingers, inertia. Of the muscles it keeps what torque they reach at each coordinate.

The limits are `RANGES`, ranges of motion of people. MyoSim's own are narrower (elbow to 130°, wrist 45° to palm and
back, 10° to the little finger) and hold for its muscles: beyond them lengths of muscles and their paths around bones
are not modeled. So torques are those of postures within MyoSim's limits.
"""

import argparse
import json
import math
import sys
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.stats import qmc

TARGET = Path(__file__).parents[1] / "src" / "maniport" / "arms" / "data" / "myoarm.json"
ROOT = "myoarm_r_root"
TIP = "thirdmc_r"
COORDINATES = (
    "elv_angle",
    "shoulder_elv",
    "shoulder_rot",
    "elbow_flexion",
    "pro_sup",
    "deviation",
    "flexion",
)
POSTURES = 4096  # for the torques of muscles
RANGES = {
    "elv_angle": (-95, 130),
    "shoulder_elv": (0, 180),
    "shoulder_rot": (-110, 120),
    "elbow_flexion": (0, 150),
    "pro_sup": (-100, 95),
    "deviation": (-45, 25),
    "flexion": (-90, 95),
}
"""Limits of the coordinates [degrees]; ``maniport/arms/human.py`` names their sources."""

FRAMES = {
    "clavicle": "clavicle_r",
    "scapula": "scapula_r",
    "shoulder": "humerus_r",
    "elbow": "ulna_r",
    "radius": "radius_r",
    "wrist": "lunate_r",
    "hand": "thirdmc_r",
}


def main() -> int:
    """Write or check the file; the exit code is 1 when a check fails."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--check", action="store_true", help="compare with the file instead of writing it"
    )
    text = render(derive(load_model()))
    if parser.parse_args().check:
        there = json.loads(TARGET.read_text(encoding="utf-8"))
        made = json.loads(text)
        same = {**there, "source": ""} == {
            **made,
            "source": "",
        }  # which names the version of the package
        print(f"{TARGET.name} is {'up to date' if same else 'different from what myo-sim gives'}")
        return 0 if same else 1
    TARGET.write_text(text, encoding="utf-8")
    print(f"wrote {TARGET} ({len(text)} bytes)")
    return 0


def load_model() -> mujoco.MjModel:
    """Load the right arm of MyoSim."""
    import myo_sim

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, _ = myo_sim.load("myoarm_r")
    return model


def derive(model: mujoco.MjModel) -> dict[str, Any]:
    """Describe the chain from the root to the hand."""
    bodies = path_to(model, TIP)
    follows = couplings(model)
    joints: list[dict[str, Any]] = []
    places: dict[str, tuple[int, np.ndarray]] = {}
    coordinates: list[dict[str, Any]] = []
    for name, strength in zip(COORDINATES, strengths(model, follows), strict=True):
        lower, upper = RANGES[name]
        coordinates.append(
            {
                "name": name,
                "lower": math.radians(lower),
                "upper": math.radians(upper),
                "effort": float(f"{strength:.2g}"),
            }
        )
    offset = np.zeros(
        3
    )  # from the last joint's frame to the current body, whose axes are parallel to it
    for body in bodies:
        name = model.body(body).name
        if not np.allclose(model.body_quat[body], [1, 0, 0, 0], atol=1e-15):
            raise RuntimeError(
                f"body {name} is rotated; the script expects parallel axes along the arm"
            )
        offset = offset + model.body_pos[body]
        for joint in range(
            model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]
        ):
            short = shorten(model.joint(joint).name)
            hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
            if not hinge or np.any(model.jnt_pos[joint]) or model.qpos0[model.jnt_qposadr[joint]]:
                raise RuntimeError(
                    f"joint {short} is not a hinge at its body's origin with zero at rest"
                )
            entry: dict[str, Any] = {"name": short}
            if short not in COORDINATES:
                entry["follows"] = follows[short]
            entry |= {"axis": clean(model.jnt_axis[joint]), "xyz": clean(offset)}
            joints.append(entry)
            offset = np.zeros(3)
        places[name] = (len(joints), offset)
    return {
        "name": "myoarm",
        "source": f"MyoSim, model myoarm_r of the Python package myo-sim {version('myo-sim')} "
        "(https://github.com/MyoHub/myo_sim); kinematics of Saul et al. (2015), Comput. Methods Biomech. "
        "Biomed. Eng. 18(13). Derived by scripts/derive_myoarm.py: the joints, axes, offsets and couplings of the "
        "right arm only. Limits: ranges of motion of people, see maniport/arms/human.py. effort [N m]: the torque of "
        "all muscles that turn a coordinate in one direction, fully active and at rest (force-length curve, no passive "
        f"force), median over {POSTURES} postures within MyoSim's own limits, of the weaker direction; two digits.",
        "licence": "Apache-2.0",
        "convention": "xyz [m] and rpy [rad] place a joint in the frame of the joint before it, as in URDF; frames sit "
        "on the joint of that number, 0 being the base; follows: factors on the coordinates; the base turns the "
        "model's axes (x forward, y up, z right) to x forward, y left, z up",
        "base": {"xyz": [0, 0, 0], "rpy": [math.pi / 2, 0, 0]},
        "coordinates": coordinates,
        "joints": joints,
        "frames": [
            {"name": name, "joint": places[body][0], "xyz": clean(places[body][1])}
            for name, body in FRAMES.items()
        ],
        "frame": "hand",
    }


def path_to(model: mujoco.MjModel, end: str) -> list[int]:
    """Bodies after the root down to the end."""
    body = model.body(end).id
    bodies = []
    while body != model.body(ROOT).id:
        bodies.append(body)
        body = int(model.body_parentid[body])
    return bodies[::-1]


def couplings(model: mujoco.MjModel) -> dict[str, dict[str, float]]:
    """Factors of the dependent joints, from equality constraints ``q1 = c₁ q2``."""
    factors = {}
    for i in range(model.neq):
        if model.eq_type[i] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[i]:
            continue
        coefficients = model.eq_data[i][:5]
        if coefficients[0] or np.any(coefficients[2:]):
            raise RuntimeError(f"equality {i} is not a plain factor: {coefficients}")
        follower, leader = (
            shorten(model.joint(j).name) for j in (model.eq_obj1id[i], model.eq_obj2id[i])
        )
        factors[follower] = {leader: float(coefficients[1])}
    return factors


def own_limits(model: mujoco.MjModel, name: str) -> tuple[float, float]:
    """MyoSim's limits [rad] of a coordinate; the model's radians are rounded degrees."""
    lower, upper = model.joint(f"{name}_r").range
    return math.radians(round(math.degrees(lower))), math.radians(round(math.degrees(upper)))


def strengths(model: mujoco.MjModel, follows: dict[str, dict[str, float]]) -> np.ndarray:
    """Torque [N m] that the muscles reach at each coordinate, in the weaker direction, within MyoSim's limits."""
    motion = np.zeros((model.nv, len(COORDINATES)))  # of all joints per coordinate
    for joint in range(model.njnt):
        name = shorten(model.joint(joint).name)
        for leader, factor in (follows.get(name) or {name: 1.0}).items():
            if leader in COORDINATES:
                motion[model.jnt_dofadr[joint], COORDINATES.index(leader)] = factor
    lower, upper = np.transpose([own_limits(model, name) for name in COORDINATES])
    postures = qmc.scale(qmc.Sobol(len(COORDINATES), rng=0).random(POSTURES), lower, upper)
    data = mujoco.MjData(model)
    moments = np.zeros((model.nu, model.nv))
    torques = np.empty((2, *postures.shape))
    for k, posture in enumerate(postures):
        data.qpos[:] = motion @ posture
        mujoco.mj_fwdPosition(model, data)
        mujoco.mju_sparse2dense(
            moments,
            data.actuator_moment,
            data.moment_rownnz,
            data.moment_rowadr,
            data.moment_colind,
        )
        muscles = zip(
            data.actuator_length,
            model.actuator_lengthrange,
            model.actuator_acc0,
            model.actuator_gainprm,
            strict=True,
        )
        # negative, as muscles pull; at rest
        forces = [
            mujoco.mju_muscleGain(length, 0.0, span, scale, curve[:9])
            for length, span, scale, curve in muscles
        ]
        pulls = np.array(forces)[:, None] * (moments @ motion)
        torques[:, k] = np.maximum(pulls, 0.0).sum(axis=0), np.maximum(-pulls, 0.0).sum(axis=0)
    return np.median(torques, axis=1).min(axis=0)


def shorten(name: str) -> str:
    """Drop the suffix of the right side."""
    return name.removesuffix("_r")


def clean(vector: np.ndarray) -> list[float]:
    """Plain numbers for JSON, every bit kept."""
    return [float(x) + 0.0 for x in vector]


def render(data: dict[str, Any]) -> str:
    """JSON with one joint, coordinate or frame a line."""
    lines = []
    for key, value in data.items():
        if isinstance(value, list):
            rows = ",\n".join(f"    {json.dumps(row)}" for row in value)
            lines.append(f"  {json.dumps(key)}: [\n{rows}\n  ]")
        else:
            lines.append(f"  {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    sys.exit(main())
