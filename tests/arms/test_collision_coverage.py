"""Configurations that are reported free of collisions are free of them, by the exact meshes of real robots.

`MANIPORT_NIGHTLY=1` runs all arms of example-robot-data with 5000 configurations each.
"""

import os
from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
import pytest

from maniport.arms import load_arm
from maniport.arms.collisions import Collisions
from maniport.arms.loaders.packages import PACKAGES, find_robot
from maniport.arms.meshes.mesh_files import load_mesh
from real_robots import NEEDS_ROBOTS

NIGHTLY = bool(os.environ.get("MANIPORT_NIGHTLY"))
ROBOTS = PACKAGES["example-robot-data"]
NAMES = ("panda", *ROBOTS.names) if NIGHTLY else ("panda", "ur5")
COUNT, SAMPLES = (5000, 100) if NIGHTLY else (60, 40)
OVERLAPPING = 0.9  # meshes that meet in a larger share of the samples, and at rest, overlap by design
DEPTH = 1e-3  # contacts that are less deep do not count [m]


@NEEDS_ROBOTS
@pytest.mark.parametrize("name", NAMES)
def test_configurations_reported_free_are_free(name):
    arm = load_arm(name if name == "panda" else f"example-robot-data/{name}")
    collisions = Collisions.of(arm)
    if not collisions.checked:
        pytest.skip(f"{name} has no meshes")
    path = ROBOTS.installed()["panda"] if name == "panda" else find_robot(f"example-robot-data/{name}").path
    exact = ExactMeshes(path, arm.joint_names, arm.sample(SAMPLES, 1))
    unchecked = {frozenset(text.split(" against ")) for text in collisions.unchecked}
    q = arm.sample(COUNT, 7)
    free = q[~collisions.collides(q)]
    assert len(free) > 0.03 * COUNT
    assert [pair for row in free for pair in exact.touching(row) if frozenset(pair) not in unchecked] == []


class ExactMeshes:
    """Collisions of a URDF by Pinocchio and Coal, without code of the package's hulls.

    Joints with `joint_names` move; a gripper is open or closed, others are at rest. Configurations in `samples`,
    shape (n, dof), show which meshes overlap by design; those pairs are left out.
    """

    def __init__(self, path, joint_names, samples):
        self.model = pin.buildModelFromUrdf(str(path))
        root = next(folder for folder in Path(path).parents if folder.name == "example-robot-data")
        folders = [str(root.parent), str(root), str(root / "robots"), str(Path(path).parent)]
        self.objects = pin.buildGeomFromUrdf(self.model, str(path), pin.VISUAL, folders).geometryObjects
        self.data = self.model.createData()
        for part in self.objects:
            if Path(part.meshPath).suffix.lower() == ".dae":
                # Coal numbers the points of all meshes of a COLLADA file but the first wrongly: in Baxter's upper
                # elbow, edges of at most 94 mm become 317 mm long
                points, triangles = load_mesh(Path(part.meshPath))
                points, theirs = points * part.meshScale, np.array(part.geometry.vertices())
                for end in (np.min, np.max):
                    np.testing.assert_allclose(end(points, axis=0), end(theirs, axis=0), atol=1e-5)
                part.geometry = solid_of(points, triangles)
        self.joints = [self.model.getJointId(name) for name in joint_names]
        low, high = self.model.lowerPositionLimit, self.model.upperPositionLimit
        self.grippers = []
        for limit in (low, high):
            q = pin.neutral(self.model)
            for j in range(1, self.model.njoints):
                if self.model.joints[j].nq == 1:
                    i = self.model.joints[j].idx_q
                    beyond = self.joints[-1] in self.model.supports[j] and j not in self.joints
                    q[i] = limit[i] if beyond else np.clip(0.0, low[i], high[i])
            for joint in ElementTree.parse(path).getroot().findall("joint"):
                mimic = joint.find("mimic")
                if mimic is not None and self.model.existJointName(joint.get("name")):
                    names = joint.get("name"), mimic.get("joint")
                    own, leader = (self.model.joints[self.model.getJointId(name)] for name in names)
                    if own.nq == leader.nq == 1:
                        factor, offset = (float(mimic.get(key, n)) for key, n in (("multiplier", 1), ("offset", 0)))
                        q[own.idx_q] = factor * q[leader.idx_q] + offset
            self.grippers.append(q)
        supports = [{*self.model.supports[part.parentJoint]} for part in self.objects]
        parents, owners = self.model.parents, [part.parentJoint for part in self.objects]
        pairs = [
            (a, b) for a in range(len(owners)) for b in range(a)
            if parents[owners[a]] != owners[b] and parents[owners[b]] != owners[a]
            and (supports[a] ^ supports[b]) & {*self.joints}
        ]  # fmt: skip
        hits = dict.fromkeys(self._touching(pairs, self.grippers[0]), 0)
        for q in samples:
            for pair in self._touching(hits, next(self._full(q))):
                hits[pair] += 1
        overlapping = {self._names(pair) for pair, count in hits.items() if count > OVERLAPPING * len(samples)}
        self.pairs = [pair for pair in pairs if self._names(pair) not in overlapping]
        self.smaller = [smaller(part.geometry) for part in self.objects]

    def touching(self, q):
        """Names of the pairs of links that touch at a configuration (dof,), with the gripper open or closed."""
        full = list(self._full(q))
        return {
            self._names(pair) for q in full for pair in self._touching(self._touching(self.pairs, q), q, self.smaller)
        }

    def _full(self, q):
        for gripper in self.grippers:
            full = gripper.copy()
            for j, value in zip(self.joints, q, strict=True):
                i, nq = self.model.joints[j].idx_q, self.model.joints[j].nq
                full[i : i + nq] = [value] if nq == 1 else [np.cos(value), np.sin(value)]
            yield full

    def _touching(self, pairs, full, shapes=None):
        pin.forwardKinematics(self.model, self.data, full)
        poses = [self.data.oMi[part.parentJoint] * part.placement for part in self.objects]
        places = [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]
        geometries = [part.geometry for part in self.objects]
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        touching = []
        for a, b in pairs:
            result.clear()
            if coal.collide((shapes or geometries)[a], places[a], geometries[b], places[b], request, result) > 0:
                touching.append((a, b))
        return touching

    def _names(self, pair):
        return tuple(sorted(self.model.frames[self.objects[i].parentFrame].name for i in pair))


def solid_of(points, triangles):
    solid = coal.BVHModelOBBRSS()
    solid.beginModel(len(triangles), len(points))
    solid.addVertices(np.ascontiguousarray(points))
    solid.addTriangles(np.asarray(triangles, dtype=np.int64))
    solid.endModel()
    return solid


def smaller(shape):
    """A mesh that is smaller by `DEPTH` on each side of its box."""
    if not isinstance(shape, coal.BVHModelBase):
        return shape
    points = np.array(shape.vertices())
    middle, size = 0.5 * (points.min(axis=0) + points.max(axis=0)), np.ptp(points, axis=0)
    triangles = np.array([[shape.tri_indices(i)[k] for k in range(3)] for i in range(shape.num_tris)])
    return solid_of(middle + (points - middle) * np.maximum(1.0 - 2 * DEPTH / np.maximum(size, DEPTH), 0.5), triangles)
