"""Robots with shapes, measures of these, and models of Pinocchio as references."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from fuzz.mesh_examples import stl
from fuzz.robot_examples import LIMIT, WITH_MESHES
from maniport.arms import Arm, Surface, load_arm
from maniport.arms.chain import PRISMATIC


def volume(surface: Surface) -> float:
    """Volume within a closed surface; positive when its triangles are counter-clockwise from outside."""
    a, b, c = (surface.points[column] for column in surface.triangles.T)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def drawn(arm: Arm, q: np.ndarray) -> np.ndarray:
    """All corners of an arm in its base frame, in a fixed order."""
    poses = arm.link_poses(q)
    points = [s.points @ poses[s.joint, :3, :3].T + poses[s.joint, :3, 3] for s in arm.surfaces()]
    return ordered(np.concatenate(points))


def ordered(points: np.ndarray) -> np.ndarray:
    """Points without repetition, sorted along a skew direction."""
    points = points[np.argsort(points @ (1.0, 0.618034, 0.414214))]
    return points[np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-7])]


def write_digger(folder: Path) -> Path:
    """An arm with a box, a scaled mesh, a cylinder and a ball, a lamp on its side and a tooth that moves."""
    (folder / "boom.stl").write_bytes(stl())
    path = folder / "digger.urdf"
    path.write_text(WITH_MESHES)
    return path


def one_link(folder: Path, geometry: str, origin: str = "") -> Arm:
    """An arm whose one moving link shows one thing, from a file in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "one.urdf"
    path.write_text(
        f'<robot name="one"><link name="base"/><link name="tip"><visual>{origin}<geometry>{geometry}</geometry>'
        f'</visual></link><joint name="j" type="revolute"><parent link="base"/><child link="tip"/>{LIMIT}</joint>'
        "</robot>"
    )
    return load_arm(path)


def model_of(chain):
    """Build Pinocchio's model of all joints of a chain, in the base frame."""
    model = pin.Model()
    model.gravity.linear = np.array(chain.gravity)
    for k, joint in enumerate(chain.joints):
        kind = (
            pin.JointModelPrismaticUnaligned
            if joint.kind == PRISMATIC
            else pin.JointModelRevoluteUnaligned
        )
        model.addJoint(k, kind(joint.axis), pin.SE3(joint.placement), joint.name)
        model.armature[-1] = joint.armature
        if chain.inertia is None or not chain.inertia[k + 1].any():
            continue
        own = chain.inertia[k + 1]
        numbers = [
            own[0, 0],
            own[5, 1],
            own[3, 2],
            own[4, 0],
            *own[[3, 3, 4, 3, 4, 5], [3, 4, 4, 5, 5, 5]],
        ]
        body = pin.Inertia.FromDynamicParameters(np.array(numbers))
        model.appendBodyToJoint(k + 1, body, pin.SE3.Identity())
    return model


def inertias(arm, q):
    """Return joint-space inertias (n, dof, dof) of the bodies of a chain, by Pinocchio."""
    chain = arm.chain
    model = model_of(chain)
    data = model.createData()
    results = []
    for positions in q @ chain.coupling.T + chain.offset:
        upper = np.triu(pin.crba(model, data, positions))
        results.append(chain.coupling.T @ (upper + np.triu(upper, 1).T) @ chain.coupling)
    return np.array(results)
