"""One or several Pandas in MuJoCo, built from Franka's published parameters: tips, ellipsoids, contacts.

What the links look like comes from the package. Needs `pip install mujoco`.
"""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

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
TIPS = {FLANGE: 0.0, "panda_hand_tcp": 0.1034}
"""How far along the flange's axis [m]."""
MESHES = Path(__file__).parents[1] / "src/maniport/arms/data/panda_surfaces.npz"
APART = 2
"""Bodies so many joints apart are checked: one joint joins nearer ones."""
OPENING = 0.04
"""How far each finger opens [m]."""
FINGERS = {"panda_leftfinger": 1.0, "panda_rightfinger": -1.0}
"""Along the hand's y axis."""
Base = tuple[float, float, float, float]
"""Where an arm stands: x, y, z [m] and yaw [deg]."""


def pandas(tips: dict[str, str], bases: dict[str, Base], shapes: dict[str, tuple[Array, Any]]) -> mujoco.MjModel:
    """ArmGroup with the surfaces of their links, by what stands before their names, in the order of their joints."""
    spec = mujoco.MjSpec()
    for prefix, tip in tips.items():
        _stand(spec, prefix, tip, bases[prefix], shapes)
    return spec.compile()


def _stand(spec: Any, prefix: str, tip: str, base: Base, shapes: dict[str, tuple[Array, Any]]) -> None:
    """Put up an arm; where the tip is the hand's, the hand is there, too, its fingers both closed and open."""
    half = np.radians(base[3]) / 2
    body = spec.worldbody.add_body(
        name=f"{prefix}panda_link0", pos=base[:3], quat=[np.cos(half), 0.0, 0.0, np.sin(half)]
    )
    _add(spec, body, prefix, "panda_link0", shapes)
    for i, (a, d, alpha) in enumerate(CRAIG, start=1):
        turn = np.array([np.cos(alpha / 2), np.sin(alpha / 2), 0.0, 0.0])
        place = np.array([a, -d * np.sin(alpha), d * np.cos(alpha)])
        body = body.add_body(name=f"{prefix}panda_link{i}", pos=place, quat=turn)
        body.mass, body.inertia = 1.0, np.ones(3)
        if i < len(CRAIG):
            body.add_joint(name=f"{prefix}joint{i}", axis=[0, 0, 1])
        _add(spec, body, prefix, f"panda_link{i}", shapes)
    if tip != FLANGE:
        body = body.add_body(name=f"{prefix}{tip}", quat=[np.cos(np.pi / 8), 0.0, 0.0, -np.sin(np.pi / 8)])
        _add(spec, body, prefix, "panda_hand", shapes)
        for finger, way in FINGERS.items():
            for k, opening in enumerate((0.0, OPENING)):
                _add(spec, body, prefix, finger, shapes, np.array([0.0, way * opening, 0.0584]), f"_{k}")
    body.add_site(name=f"{prefix}tip", pos=[0.0, 0.0, TIPS[tip]])


def surfaces(path: Path = MESHES) -> dict[str, tuple[Array, Any]]:
    """Points and triangles of each link's surface, in the link's frame."""
    with np.load(path) as stored:
        return {
            str(name): (
                stored[f"grid_{i}"][:3] + stored[f"grid_{i}"][3] * stored[f"points_{i}"],
                stored[f"triangles_{i}"].astype(int),
            )
            for i, name in enumerate(stored["links"])
        }


def _add(
    spec: Any, body: Any, prefix: str, link: str, shapes: dict[str, tuple[Array, Any]],
    shift: Array | None = None, suffix: str = "",
) -> None:  # fmt: skip
    """Add a link's surface, shifted in its body's frame."""
    if link in shapes:
        name = f"{prefix}{link}{suffix}"
        if shift is not None:
            shapes[f"{link}{suffix}"] = shapes[link][0] + shift, shapes[link][1]
        points = shapes[f"{link}{suffix}"][0]
        spec.add_mesh(name=name, uservert=points.ravel().tolist())
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)


class Pandas:
    """Where the tips of arms are, what ellipsoids they make, whether an arm touches itself or another one."""

    def __init__(self, tips: dict[str, str], bases: dict[str, Base]):
        self.shapes = surfaces()
        self.model = pandas(tips, bases, self.shapes)
        self.data = mujoco.MjData(self.model)

    def tip(self, q: Array, prefix: str) -> tuple[Array, Array]:
        """Position (3,) [m] and M = J J^T (3, 3) of the velocity of an arm's tip."""
        self.data.qpos = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        jacobian, site = np.zeros((3, self.model.nv)), self.model.site(f"{prefix}tip").id
        mujoco.mj_jacSite(self.model, self.data, jacobian, None, site)
        return self.data.site_xpos[site].copy(), jacobian @ jacobian.T

    def near(self, q: Array) -> list[tuple[str, str]]:
        """Links of two arms, or `APART` joints apart on one, whose convex hulls meet."""
        self.data.qpos = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        deep = np.unique(self.data.contact.geom[self.data.contact.dist < 0.0], axis=0)
        bodies = self.model.geom_bodyid[deep]
        arms = self.model.body_rootid[bodies]
        apart = np.abs(np.diff(self.model.body_weldid[bodies], axis=1))[:, 0]
        far = (apart >= APART) | (arms[:, 0] != arms[:, 1])
        return [(self.model.geom(a).name, self.model.geom(b).name) for a, b in deep[far]]

    def meet(self, first: str, second: str) -> bool:
        """Whether the surfaces of two links cut one another at the configuration last given to `near`."""
        (a, a_sides), (b, b_sides) = (self._placed(name) for name in (first, second))
        low, high = np.maximum(a.min(axis=0), b.min(axis=0)), np.minimum(a.max(axis=0), b.max(axis=0))
        corners = [_within(points[sides], low, high) for points, sides in ((a, a_sides), (b, b_sides))]
        return any(_pierced(one, other) for one, other in (corners, corners[::-1]))

    def _placed(self, name: str) -> tuple[Array, Any]:
        body = self.data.body(self.model.geom_bodyid[self.model.geom(name).id])
        points, sides = self.shapes[name[name.index("panda_") :]]
        return points @ body.xmat.reshape(3, 3).T + body.xpos, sides

    def touching(self, q: Array) -> list[tuple[str, str]]:
        """Pairs of links whose surfaces cut one another."""
        return [pair for pair in self.near(q) if self.meet(*pair)]


def _within(triangles: Array, low: Array, high: Array) -> Array:
    """Triangles (t, 3, 3) that reach into a box."""
    return triangles[((triangles.max(axis=1) >= low) & (triangles.min(axis=1) <= high)).all(axis=1)]


def _pierced(triangles: Array, others: Array) -> bool:
    """Whether an edge of one of the triangles (t, 3, 3) goes through another (u, 3, 3), after Moeller and Trumbore."""
    if not len(triangles) or not len(others):
        return False
    origin, first, second = others[:, 0], others[:, 1] - others[:, 0], others[:, 2] - others[:, 0]
    normal = np.cross(first, second)
    for k in range(3):
        start, along = triangles[:, None, k], (triangles[:, (k + 1) % 3] - triangles[:, k])[:, None]
        slope = np.sum(along * normal, axis=-1)
        slope = np.where(slope == 0.0, np.nan, slope)
        there = np.sum((origin - start) * normal, axis=-1) / slope
        turned = np.cross(start - origin, along)
        u, v = -np.sum(turned * second, axis=-1) / slope, np.sum(turned * first, axis=-1) / slope
        if ((there >= 0.0) & (there <= 1.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)).any():
            return True
    return False
