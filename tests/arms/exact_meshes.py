"""Collisions of a robot by Pinocchio and Coal on its exact meshes, which share no code with the package's hulls."""

from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from maniport.arms.meshes.mesh_files import load_mesh

OVERLAPPING = 0.9
"""Meshes that meet in a larger share of the samples, and at rest, overlap as they are drawn."""


DEPTH = 1e-3
"""Contacts that are less deep do not count [m]."""


class ExactMeshes:
    """A robot from a URDF, of which some joints move; a gripper is open or closed, all else at rest.

    Parameters
    ----------
    path : Path
        The URDF.
    joint_names : sequence of str
        The joints that move, in the order of the configurations.
    samples : ndarray, shape (n, dof)
        Configurations that show which meshes overlap as they are drawn; those pairs are left out.
    """

    def __init__(self, path, joint_names, samples):
        self.model = pin.buildModelFromUrdf(str(path))
        root = Path(path)
        while root.name != "example-robot-data":
            root = root.parent
        folders = [str(root.parent), str(root), str(root / "robots"), str(Path(path).parent)]
        self.geometry = pin.buildGeomFromUrdf(self.model, str(path), pin.VISUAL, folders)
        self.data, self.objects = self.model.createData(), self.geometry.geometryObjects
        for one in self.objects:
            _correct(one)
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
            self._follow(path, q)
            self.grippers.append(q)
        self.pairs = list(self._pairs())
        overlapping = {self._names(pair) for pair in self._overlapping(samples)}
        self.pairs = [pair for pair in self.pairs if self._names(pair) not in overlapping]
        self.smaller = [_smaller(one.geometry) for one in self.objects]

    def touching(self, q):
        """Names of the pairs of links that touch at a configuration (dof,), with the gripper open or closed."""
        found = set()
        for full in self._full(q):
            places = self._places(full)
            struck = [pair for pair in self.pairs if self._touch(pair, places)]
            found |= {self._names((a, b)) for a, b in struck if self._meet(self.smaller[a], places[a], b, places[b])}
        return found

    def _follow(self, path, q):
        """Let joints follow those that they mimic."""
        for joint in ElementTree.parse(path).getroot().findall("joint"):
            mimic = joint.find("mimic")
            if mimic is not None and self.model.existJointName(joint.get("name")):
                own, leader = (self.model.joints[self.model.getJointId(name)] for name in
                               (joint.get("name"), mimic.get("joint")))  # fmt: skip
                factor, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
                if own.nq == leader.nq == 1:
                    q[own.idx_q] = factor * q[leader.idx_q] + offset

    def _full(self, q):
        for gripper in self.grippers:
            full = gripper.copy()
            for j, value in zip(self.joints, q, strict=True):
                i, nq = self.model.joints[j].idx_q, self.model.joints[j].nq
                full[i : i + nq] = [value] if nq == 1 else [np.cos(value), np.sin(value)]
            yield full

    def _places(self, full):
        pin.forwardKinematics(self.model, self.data, full)
        poses = [self.data.oMi[one.parentJoint] * one.placement for one in self.objects]
        return [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]

    def _pairs(self):
        """Pairs of shapes that move against one another and that no joint joins directly."""
        moving, parents = set(self.joints), self.model.parents
        for a, one in enumerate(self.objects):
            for b, other in enumerate(self.objects[:a]):
                i, j = one.parentJoint, other.parentJoint
                apart = {*self.model.supports[i]} ^ {*self.model.supports[j]}
                if parents[i] != j and parents[j] != i and apart & moving:
                    yield a, b

    def _overlapping(self, samples):
        """Pairs whose meshes meet at rest and in nearly all samples."""
        rest = self._places(self.grippers[0])
        suspect = [pair for pair in self.pairs if self._touch(pair, rest)]
        hits = np.zeros(len(suspect))
        for q in samples:
            places = self._places(next(self._full(q)))
            hits += [self._touch(pair, places) for pair in suspect]
        return {pair for pair, share in zip(suspect, hits / len(samples), strict=True) if share > OVERLAPPING}

    def _touch(self, pair, places):
        a, b = pair
        return self._meet(self.objects[a].geometry, places[a], b, places[b])

    def _meet(self, shape, place, b, other):
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        return coal.collide(shape, place, self.objects[b].geometry, other, request, result) > 0

    def _names(self, pair):
        return tuple(sorted(self.model.frames[self.objects[i].parentFrame].name for i in pair))


def _correct(part):
    """Replace the triangles of a COLLADA file of several meshes: Coal numbers the points of all but the first wrongly.

    In Baxter's upper elbow that makes edges of 317 mm of edges that are 94 mm long in the file at most.
    """
    if Path(part.meshPath).suffix.lower() != ".dae":
        return
    points, triangles = load_mesh(Path(part.meshPath))
    points = points * part.meshScale
    theirs = np.array(part.geometry.vertices())
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(points, axis=0), end(theirs, axis=0), atol=1e-5)
    part.geometry = _solid(points, triangles)


def _solid(points, triangles):
    solid = coal.BVHModelOBBRSS()
    solid.beginModel(len(triangles), len(points))
    solid.addVertices(np.ascontiguousarray(points))
    solid.addTriangles(np.asarray(triangles, dtype=np.int64))
    solid.endModel()
    return solid


def _smaller(shape):
    """A mesh that is a millimetre smaller on each side of its box, so that what is less deep does not count."""
    if not isinstance(shape, coal.BVHModelBase):
        return shape
    points = np.array(shape.vertices())
    middle, size = 0.5 * (points.min(axis=0) + points.max(axis=0)), np.ptp(points, axis=0)
    triangles = np.array([[shape.tri_indices(i)[k] for k in range(3)] for i in range(shape.num_tris)])
    return _solid(middle + (points - middle) * np.maximum(1.0 - 2 * DEPTH / np.maximum(size, DEPTH), 0.5), triangles)
