"""One or several Pandas in MuJoCo, built from the parameters that Franka publishes; meshes come from the package."""

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CRAIG = np.array(
    [  # a [m], d [m], alpha [rad] of joints 1 to 7 and the flange: Franka Control Interface, "Denavit-Hartenberg"
        [0.0, 0.333, 0.0],
        [0.0, 0.0, -np.pi / 2],
        [0.0, 0.316, np.pi / 2],
        [0.0825, 0.0, np.pi / 2],
        [-0.0825, 0.384, -np.pi / 2],
        [0.0, 0.0, np.pi / 2],
        [0.088, 0.0, np.pi / 2],
        [0.0, 0.107, 0.0],
    ]
)
FLANGE = "panda_link8"
FRAMES = {FLANGE: 0.0, "panda_hand_tcp": 0.1034}
"""End effectors, with the distance from the flange along its axis [m]."""
MESHES = Path(__file__).parents[1] / "src/maniport/arms/data/panda_surfaces.npz"
MASSES = (
    MESHES.parent / "panda.json"
)  # of the links, by frame; the hand's frame is turned by -45 deg
FINGERS = {"panda_leftfinger": 0.04, "panda_rightfinger": -0.04}
"""Travel along the y axis of the hand [m]; collisions are checked with closed and open fingers."""
Base = tuple[float, float, float, float]
"""Pose of a base: x, y, z [m] and yaw [deg]."""
Meshes = dict[str, tuple[Array, Any]]
"""Vertices (v, 3) [m] and triangles (t, 3) by link, in the frame of the link."""


def read_meshes(path: Path = MESHES) -> Meshes:
    """Read the meshes of all links."""
    with np.load(path) as stored:
        grids = [(str(name), stored[f"grid_{i}"], i) for i, name in enumerate(stored["links"])]
        return {
            name: (grid[:3] + grid[3] * stored[f"points_{i}"], stored[f"triangles_{i}"].astype(int))
            for name, grid, i in grids
        }


class Pandas:
    """Kinematics, ellipsoids and collisions of Pandas; arms are identified by the prefix of their names."""

    def __init__(self, frames: dict[str, str], bases: dict[str, Base], payload: ArrayLike = 0.0):
        # one for all, or of each arm [kg]
        self.meshes = read_meshes()
        payloads = np.broadcast_to(payload, len(frames))
        self.masses = json.loads(MASSES.read_text(encoding="utf-8"))["masses"]
        spec = mujoco.MjSpec()
        spec.option.timestep = 1e-3
        for (prefix, frame), own in zip(frames.items(), payloads, strict=True):
            self._add_arm(spec, prefix, frame, bases[prefix], float(own))
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)

    def _add_arm(self, spec: Any, prefix: str, frame: str, base: Base, payload: float) -> None:
        half = np.radians(base[3]) / 2
        orientation = [np.cos(half), 0.0, 0.0, np.sin(half)]
        body = spec.worldbody.add_body(name=f"{prefix}panda_link0", pos=base[:3], quat=orientation)
        self._add_mesh(spec, body, prefix, "panda_link0")
        for i, (a, d, alpha) in enumerate(CRAIG, start=1):
            position = np.array([a, -d * np.sin(alpha), d * np.cos(alpha)])
            orientation = [np.cos(alpha / 2), np.sin(alpha / 2), 0.0, 0.0]
            body = body.add_body(name=f"{prefix}panda_link{i}", pos=position, quat=orientation)
            if i < len(CRAIG):
                body.add_joint(name=f"{prefix}joint{i}", axis=[0, 0, 1])
            self._add_mesh(spec, body, prefix, f"panda_link{i}")
            self._add_masses(body, f"panda_link{i}")
        turned = body.add_body(
            name=f"{prefix}mounted_hand", quat=[np.cos(np.pi / 8), 0.0, 0.0, -np.sin(np.pi / 8)]
        )
        self._add_masses(turned, "panda_hand")
        if frame != FLANGE:
            body = body.add_body(
                name=f"{prefix}{frame}", quat=[np.cos(np.pi / 8), 0.0, 0.0, -np.sin(np.pi / 8)]
            )
            self._add_mesh(spec, body, prefix, "panda_hand")
            for finger, travel in FINGERS.items():
                for k in (0, 1):
                    self._add_mesh(
                        spec, body, prefix, finger, np.array([0.0, k * travel, 0.0584]), f"_{k}"
                    )
        body.add_site(name=f"{prefix}end_effector", pos=[0.0, 0.0, FRAMES[frame]])
        if payload > 0.0:
            position = [0.0, 0.0, FRAMES[frame]]
            body.add_body(
                pos=position,
                ipos=np.zeros(3),
                mass=payload,
                inertia=np.full(3, 1e-9),
                explicitinertial=True,
            )

    def _add_masses(self, body: Any, link: str) -> None:
        for part in (part for part in self.masses if part["frame"] == link):
            body.add_body(
                ipos=part["center"],
                mass=part["mass"],
                fullinertia=part["inertia"],
                explicitinertial=True,
            )

    def _add_mesh(
        self,
        spec: Any,
        body: Any,
        prefix: str,
        link: str,
        offset: Array | None = None,
        suffix: str = "",
    ) -> None:
        if link not in self.meshes:
            return
        if offset is not None:
            self.meshes[f"{link}{suffix}"] = self.meshes[link][0] + offset, self.meshes[link][1]
        name = f"{prefix}{link}{suffix}"
        spec.add_mesh(name=name, uservert=self.meshes[f"{link}{suffix}"][0].ravel().tolist())
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, mass=0.0)

    def end_effector(self, q: Array, prefix: str) -> tuple[Array, Array]:
        """Return the position (3,) [m] of the end effector and M = J Jᵀ (3, 3)."""
        self.data.qpos = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        jacobian = np.zeros((3, self.model.nv))
        site = self.model.site(f"{prefix}end_effector").id
        mujoco.mj_jacSite(self.model, self.data, jacobian, None, site)
        return self.data.site_xpos[site].copy(), jacobian @ jacobian.T

    def torques(self, q: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the joint torques (joints,) [N m] of a state, by MuJoCo's inverse dynamics without contacts."""
        self.data.qpos = q
        self.data.qvel = velocity
        self.data.qacc = acceleration
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        mujoco.mj_inverse(self.model, self.data)
        self.model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        return np.array(self.data.qfrc_inverse)

    def simulate(self, q: Array, velocity: Array, torques: Array, servo: Any) -> Array:
        """Return the positions (steps, joints) of a simulation by steps of 1 ms that starts at rest.

        `servo` returns torques from the wanted position, velocity and torques (joints,), the actual position and
        velocity, and the joint-space inertia (joints, joints) there.
        """
        model = self.model
        data = self.data
        mujoco.mj_resetData(model, data)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        data.qpos = q[0]
        data.qvel = velocity[0]
        reached = np.empty(q.shape)
        inertia = np.empty((model.nv, model.nv))
        for i, wanted in enumerate(zip(q, velocity, torques, strict=True)):
            reached[i] = data.qpos
            mujoco.mj_step1(model, data)
            for row, unit in zip(
                inertia, np.eye(model.nv), strict=True
            ):  # mj_fullM differs between versions
                mujoco.mj_mulM(model, data, row, unit)
            data.qfrc_applied = servo(*wanted, data.qpos, data.qvel, inertia)
            mujoco.mj_step2(model, data)
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        return reached

    def near(self, q: Array) -> list[tuple[str, str]]:
        """Return pairs of links whose convex hulls overlap: of two arms, or at least two joints apart on one arm."""
        self.data.qpos = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        pairs = np.unique(self.data.contact.geom[self.data.contact.dist < 0.0], axis=0)
        bodies = self.model.geom_bodyid[pairs]
        arms = self.model.body_rootid[bodies]
        joints_apart = np.abs(np.diff(self.model.body_weldid[bodies], axis=1))[:, 0]
        checked = (joints_apart >= 2) | (arms[:, 0] != arms[:, 1])
        return [(self.model.geom(a).name, self.model.geom(b).name) for a, b in pairs[checked]]

    def collisions(self, q: Array) -> list[tuple[str, str]]:
        """Return pairs of links whose meshes intersect."""
        return [pair for pair in self.near(q) if self._intersect(*pair)]

    def _intersect(self, first: str, second: str) -> bool:
        placed = [self._placed(name) for name in (first, second)]
        low = np.maximum(*(vertices.min(axis=0) for vertices, _ in placed))
        high = np.minimum(*(vertices.max(axis=0) for vertices, _ in placed))
        a, b = (_in_box(vertices[triangles], low, high) for vertices, triangles in placed)
        return _edges_pierce(a, b) or _edges_pierce(b, a)

    def _placed(self, name: str) -> tuple[Array, Any]:
        body = self.data.body(self.model.geom_bodyid[self.model.geom(name).id])
        vertices, triangles = self.meshes[name[name.index("panda_") :]]
        return vertices @ body.xmat.reshape(3, 3).T + body.xpos, triangles


def _in_box(triangles: Array, low: Array, high: Array) -> Array:
    """Return the triangles (t, 3, 3) that overlap an axis-aligned box."""
    return triangles[((triangles.max(axis=1) >= low) & (triangles.min(axis=1) <= high)).all(axis=1)]


def _edges_pierce(triangles: Array, others: Array) -> bool:
    """Return whether an edge of a triangle (t, 3, 3) intersects another (u, 3, 3), after Moeller and Trumbore."""
    if not len(triangles) or not len(others):
        return False
    origin = others[:, 0]
    first = others[:, 1] - others[:, 0]
    second = others[:, 2] - others[:, 0]
    normal = np.cross(first, second)
    for k in range(3):
        start = triangles[:, None, k]
        edge = (triangles[:, (k + 1) % 3] - triangles[:, k])[:, None]
        slope = np.sum(edge * normal, axis=-1)
        slope = np.where(slope == 0.0, np.nan, slope)
        position = np.sum((origin - start) * normal, axis=-1) / slope
        moment = np.cross(start - origin, edge)
        u = -np.sum(moment * second, axis=-1) / slope
        v = np.sum(moment * first, axis=-1) / slope
        if ((position >= 0.0) & (position <= 1.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)).any():
            return True
    return False
