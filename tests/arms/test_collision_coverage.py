"""Configurations that are reported free of collisions are free of them, by the exact shapes that robots declare.

Robots of a URDF are compared with their collision meshes, robots of an MJCF with MuJoCo, in both directions.
`MANIPORT_NIGHTLY=1` runs all arms of example-robot-data with 5000 configurations each.
"""

import importlib.util
import os
from itertools import combinations
from pathlib import Path

import coal
import mujoco
import numpy as np
import pytest
from mjcf_robots import ROBOTS

from maniport.arms import load_arm
from maniport.arms.collisions import Collisions
from maniport.arms.loaders import robot_limbs
from maniport.arms.loaders.packages import PACKAGES
from real_robots import NEEDS_ROBOTS

NIGHTLY = bool(os.environ.get("MANIPORT_NIGHTLY"))
NAMES = ("panda", *PACKAGES["example-robot-data"].names) if NIGHTLY else ("panda", "ur5")
COUNT, SAMPLES = (5000, 100) if NIGHTLY else (60, 40)
OVERLAPPING = (
    0.9  # meshes that meet in a larger share of the samples, and at rest, overlap by design
)
DEPTH = 1e-3  # contacts that are less deep do not count [m]


@pytest.mark.slow
@NEEDS_ROBOTS
@pytest.mark.parametrize("name", NAMES)
def test_configurations_reported_free_are_free(name):
    arm = load_arm(f"example-robot-data/{name}")
    collisions = Collisions.of(arm)
    if not collisions.checked:
        pytest.skip(f"{name} has no meshes")
    unchecked = {frozenset(text.split(" against ")) for text in collisions.unchecked}
    q = arm.sample(COUNT, 7)
    rest = np.clip(0.0, arm.lower, arm.upper)
    free = q[~collisions.collides(q)]
    assert len(free) > 0.03 * COUNT
    for a, b in combinations(meshes(arm), 2):
        if abs(a[1] - b[1]) > 1 and frozenset((a[0], b[0])) not in unchecked:
            touching = free[touch(arm, free, a, b)]
            if len(touching) and touch(arm, touching, (*a[:2], smaller(a[2])), b).any():
                by_design = touch(arm, np.concatenate([[rest], arm.sample(SAMPLES, 1)]), a, b)
                assert by_design[0], (a[0], b[0])
                assert by_design.mean() > OVERLAPPING, (a[0], b[0])


def meshes(arm):
    """Names, numbers of joints and exact meshes of all shapes; grippers are open, then closed."""
    for shape in arm.geometry.checked.shapes:
        points, triangles = shape.mesh
        frame = arm.chain.frames.get(shape.link)
        if frame is not None and arm.chain.holds(shape.link):
            name = shape.link
            joint = frame.joint
            placements = frame.placement[None]
        else:
            body = arm.chain.attached[shape.link]
            name = body.group
            joint = body.joint
            placements = body.placements
        for place in placements[:1] if len(placements) == 1 else placements[[0, -1]]:
            yield name, joint, (points @ place[:3, :3].T + place[:3, 3], triangles)


def touch(arm, q, *ends):
    """Whether two bodies touch at configurations (n, dof), shape (n,)."""
    request = coal.CollisionRequest()
    result = coal.CollisionResult()
    solids = [solid_of(*mesh) for *_, mesh in ends]
    touching = np.zeros(len(q), dtype=bool)
    for i, poses in enumerate(arm.link_poses(q)):
        places = [
            coal.Transform3s(poses[joint][:3, :3], poses[joint][:3, 3]) for _, joint, _ in ends
        ]
        result.clear()
        touching[i] = coal.collide(solids[0], places[0], solids[1], places[1], request, result) > 0
    return touching


def solid_of(points, triangles):
    solid = coal.BVHModelOBBRSS()
    solid.beginModel(len(triangles), len(points))
    solid.addVertices(np.ascontiguousarray(points))
    solid.addTriangles(np.asarray(triangles, dtype=np.int64))
    solid.endModel()
    return solid


def smaller(mesh):
    """A mesh that is smaller by `DEPTH` on each side of its box."""
    points, triangles = mesh
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    size = np.ptp(points, axis=0)
    return middle + (points - middle) * np.maximum(
        1.0 - 2 * DEPTH / np.maximum(size, DEPTH), 0.5
    ), triangles


CASES = Path(__file__).parent / "cases"
MARGIN = 0.005  # contacts nearer than this to zero distance may be decided either way [m]


def mujoco_distances(path, arm, q, omitted=()):
    """Smallest distance of two geoms that can touch in MuJoCo, at most 5 cm, shape (n,)."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    model.geom_margin[:] = 0.05
    model.geom_gap[:] = 0.0
    addresses = [model.jnt_qposadr[model.joint(name).id] for name in arm.joint_names]
    distances = np.full(len(q), 0.05)
    for i, positions in enumerate(q):
        data.qpos[:] = model.qpos0
        data.qpos[addresses] = positions
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        for contact in data.contact:
            bodies = {model.body(model.geom_bodyid[geom]).name for geom in contact.geom}
            if bodies not in omitted:
                distances[i] = min(distances[i], contact.dist)
    return distances


def require_agreement(path, arm, count=150):
    """Configurations collide as in MuJoCo, except for pairs that the result names as not checked."""
    collisions = Collisions.of(arm)
    omitted = [{*pair} for pair in collisions.always]
    q = arm.sample(count, 7)
    distances = mujoco_distances(path, arm, q, omitted)
    hit = collisions.collides(q)
    assert not np.any(~hit & (distances < -MARGIN))
    assert not np.any(hit & (distances > MARGIN))
    return collisions, hit


@pytest.mark.parametrize("name", ["collision_geom.xml", "collision_group.xml"])
def test_declared_geoms_of_any_group_are_checked(name):
    collisions, hit = require_agreement(CASES / name, load_arm(CASES / name))
    assert 0.7 < hit.mean() < 0.9
    assert collisions.shapes.visual == collisions.unchecked == ()
    assert "tip" in collisions.shapes.collision


@pytest.mark.parametrize("name", ROBOTS)
def test_geoms_touch_as_in_mujoco(tmp_path, name):
    path = tmp_path / "robot.xml"
    path.write_text(ROBOTS[name])
    arm = load_arm(path, frame=f"b{ROBOTS[name].count('<joint')}")
    collisions, hit = require_agreement(path, arm)
    assert collisions.shapes.visual == ()
    assert 0.0 < hit.mean() < 1.0


@pytest.mark.parametrize("kind", ["contact", "constraint"])
def test_bodies_of_a_model_without_contacts_are_listed_as_unchecked(tmp_path, kind):
    text = (CASES / "collision_geom.xml").read_text()
    path = tmp_path / "robot.xml"
    flag = f'<option><flag {kind}="disable"/></option><worldbody>'
    path.write_text(text.replace("<worldbody>", flag, 1))
    arm = load_arm(path)
    collisions = Collisions.of(arm)
    q = arm.sample(50, 7)
    assert not collisions.collides(q).any()
    assert (mujoco_distances(path, arm, q) == 0.05).all()
    assert {"l3", "tip"} <= {*collisions.unchecked}


ROBOSUITE = importlib.util.find_spec("robosuite")
NEEDS_ROBOSUITE = pytest.mark.skipif(ROBOSUITE is None, reason="robosuite is not installed")


@NEEDS_ROBOSUITE
@pytest.mark.parametrize("name", ["panda", "ur5e", "xarm7", "sawyer", "jaco", "tiago"])
def test_robots_of_robosuite_touch_as_in_mujoco(name):
    folder = Path(next(iter(ROBOSUITE.submodule_search_locations)))
    path = folder / "models" / "assets" / "robots" / name / "robot.xml"
    frame = max(robot_limbs(str(path))[0], key=lambda limb: len(limb.joints)).frame
    collisions, _ = require_agreement(path, load_arm(path, frame=frame))
    assert len(collisions.pairs) > 8
