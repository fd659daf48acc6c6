"""Judge an exported motion of a Panda by means that are not maniport's: MuJoCo, SciPy, and Franka's own tables.

    python scripts/check_motion.py FOLDER [--tip panda_hand_tcp] [--damping 0.0048]

Reads `joints.csv`, `path.npz` and `placed_profile.npz` of a folder of results, and nothing that was computed from them:
of `joints.npz` only the damping that distances are defined with, of `demonstrated_profile.npz` the person's times. The
arm is built here from Franka's published Denavit-Hartenberg parameters; what its links look like comes from the
package. Needs `pip install mujoco`. Ends with 1 where something exceeds a limit.
"""

import argparse
import csv
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

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
LIMITS = {  # the same source: "Limits for Franka Emika Robot (FER)"
    "lower position": np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
    "upper position": np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
    "velocity": np.array([2.1750, 2.1750, 2.1750, 2.1750, 2.6100, 2.6100, 2.6100]),
    "acceleration": np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    "jerk": np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
}
ROUNDING = 1e-4
"""Share of a limit that the decimals of the file may cost."""
MESHES = Path(__file__).parents[1] / "src/maniport/bodies/data/panda_surfaces.npz"
APART = 3
"""From so many bodies from one another on along the chain links are looked at: joints hold nearer ones apart."""
FILES = ("joints.csv", "path.npz", "placed_profile.npz")
EVERY = 5
"""Control steps from one that is asked for collisions to the next."""


def panda(tip: str, shapes: dict[str, tuple[Array, Any]]) -> mujoco.MjModel:
    """The arm with the surfaces of its links; where the tip is the hand's, the hand is there, too."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="panda_link0")
    _add(spec, body, "panda_link0", shapes)
    for i, (a, d, alpha) in enumerate(CRAIG, start=1):
        turn = np.array([np.cos(alpha / 2), np.sin(alpha / 2), 0.0, 0.0])
        place = np.array([a, -d * np.sin(alpha), d * np.cos(alpha)])
        body = body.add_body(name=f"panda_link{i}", pos=place, quat=turn)
        body.mass, body.inertia = 1.0, np.ones(3)
        if i < len(CRAIG):
            body.add_joint(name=f"joint{i}", axis=[0, 0, 1])
        _add(spec, body, f"panda_link{i}", shapes)
    if tip != FLANGE:
        body = body.add_body(name=tip, quat=[np.cos(np.pi / 8), 0.0, 0.0, -np.sin(np.pi / 8)])
        _add(spec, body, "panda_hand", shapes)
    body.add_site(name=tip, pos=[0.0, 0.0, TIPS[tip]])
    return spec.compile()


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


def _add(spec: Any, body: Any, name: str, shapes: dict[str, tuple[Array, Any]]) -> None:
    if name in shapes:
        spec.add_mesh(name=name, uservert=shapes[name][0].ravel().tolist())
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)


class Panda:
    """Where its tip is, what ellipsoids it makes, whether it touches itself."""

    def __init__(self, tip: str):
        self.shapes = surfaces()
        self.model = panda(tip, self.shapes)
        self.data, self.site = mujoco.MjData(self.model), self.model.site(tip).id

    def tip(self, q: Array) -> tuple[Array, Array]:
        """Position (3,) [m] and M = J J^T (3, 3) of its velocity."""
        self.data.qpos = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, jacobian, None, self.site)
        return self.data.site_xpos[self.site].copy(), jacobian @ jacobian.T

    def near(self, q: Array) -> list[tuple[str, str]]:
        """Links, `APART` on the chain, whose convex hulls meet."""
        self.data.qpos = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        deep = np.unique(self.data.contact.geom[self.data.contact.dist < 0.0], axis=0)
        far = np.abs(np.diff(self.model.geom_bodyid[deep], axis=1))[:, 0] >= APART
        return [(self.model.geom(a).name, self.model.geom(b).name) for a, b in deep[far]]

    def meet(self, first: str, second: str) -> bool:
        """Whether the surfaces of two links cut one another at the configuration last given to `near`."""
        (a, a_sides), (b, b_sides) = (self._placed(name) for name in (first, second))
        low, high = np.maximum(a.min(axis=0), b.min(axis=0)), np.minimum(a.max(axis=0), b.max(axis=0))
        corners = [_within(points[sides], low, high) for points, sides in ((a, a_sides), (b, b_sides))]
        return any(_pierced(one, other) for one, other in (corners, corners[::-1]))

    def _placed(self, name: str) -> tuple[Array, Any]:
        body = self.data.body(self.model.geom_bodyid[self.model.geom(name).id])
        points, sides = self.shapes[name]
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
        u, v = np.sum(turned * second, axis=-1) / slope, -np.sum(turned * first, axis=-1) / slope
        if ((there >= 0.0) & (there <= 1.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)).any():
            return True
    return False


def read_joints(path: Path) -> tuple[Array, Array, Array]:
    """Times (m,), positions (m, 7), and what the file says the accelerations are (m, 7)."""
    with open(path, encoding="utf-8", newline="") as stream:
        table = csv.reader(stream)
        header = next(table)
        rows = np.array([[float(cell) for cell in row] for row in table])
    kinds = [[i for i, name in enumerate(header) if name.endswith(end)] for end in ("_rad", "_rad/s2")]
    if header[0] != "time_s" or [len(kind) for kind in kinds] != [7, 7]:
        sys.exit(f"{path}: expected time_s and positions and accelerations of 7 joints; found {', '.join(header)}")
    if not np.isfinite(rows).all():
        sys.exit(f"{path}: has values that are not finite")
    return rows[:, 0], rows[:, kinds[0]], rows[:, kinds[1]]


def distances(achieved: Array, target: Array, damping: float) -> Array:
    """Affine-invariant distances, by generalized eigenvalues."""
    lift = damping * np.eye(target.shape[-1])
    logs = [np.log(eigh(a + lift, b + lift, eigvals_only=True)) for a, b in zip(achieved, target, strict=True)]
    return np.linalg.norm(logs, axis=1)


def limits_used(time: Array, q: Array, told: Array) -> list[tuple[str, str, bool]]:
    """Rows of what is used of each limit; differences of neighbouring samples at the file's rate."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    uneven = float(np.ptp(np.diff(time)) / step)
    low, high = LIMITS["lower position"], LIMITS["upper position"]
    rows = [
        ("rate", f"{1.0 / step:.1f} Hz, steps differ by {uneven:.1%} of one", uneven < 0.01),
        _used("position", np.abs(q - 0.5 * (low + high)) / (0.5 * (high - low)), time),
    ]
    values = q
    for order, quantity in enumerate(("velocity", "acceleration", "jerk"), start=1):
        values = np.diff(values, axis=0) / step
        rows.append(_used(quantity, np.abs(values) / LIMITS[quantity], time + 0.5 * order * step))
    # at rest: what a controller that holds still before and after would have to make of the first and last step
    ends = np.abs(np.diff(q, axis=0)[[0, -1]]) / step**2 / LIMITS["acceleration"]
    rows.append(
        ("at rest at both ends", f"a start and stop of {ends.max():.3f} of the acceleration", bool(ends.max() <= 1))
    )
    apart = np.abs(np.diff(q, 2, axis=0) / step**2 - told[1:-1]) / LIMITS["acceleration"]
    rows.append(("accelerations as told", f"{apart.max():.3f} of the limits apart", bool(apart.max() <= 0.05)))
    return rows


def _used(quantity: str, share: Array, time: Array) -> tuple[str, str, bool]:
    i, j = np.unravel_index(int(share.argmax()), share.shape)
    said = f"{share[i, j]:.4f} of its limit (joint {j + 1}, {time[i]:.3f} s)"
    return quantity, said, bool(share[i, j] <= 1.0 + ROUNDING)


def judge(folder: Path, tip: str | None, damping: float | None) -> list[tuple[str, str, bool | None]]:
    """Rows of the table: what, how much, whether it is within its limit (None: nothing is asked of it)."""
    time, q, told = read_joints(folder / "joints.csv")
    with np.load(folder / "placed_profile.npz") as profile, np.load(folder / "path.npz") as placed:
        target, at = profile["manipulability"], profile["time"]
        path = placed[next(name for name in placed.files if placed[name].shape == (len(at), 3))]
    if damping is None:
        with np.load(folder / "joints.npz") as stored:
            damping = float(stored["damping"])
    if at[0] < time[0] - 1e-6 or at[-1] > time[-1] + 1e-6:
        sys.exit(f"{folder}: points at {at[0]:.3f} to {at[-1]:.3f} s, joints at {time[0]:.3f} to {time[-1]:.3f} s")
    there = CubicSpline(time, q)(at)
    arms = {name: Panda(name) for name in ([tip] if tip else TIPS)}
    made = {name: [arm.tip(one) for one in there] for name, arm in arms.items()}
    errors = {name: np.linalg.norm([p for p, _ in tips] - path, axis=1) for name, tips in made.items()}
    tip = min(errors, key=lambda name: float(np.median(errors[name])))
    arm, error = arms[tip], errors[tip]
    d = distances(np.array([m for _, m in made[tip]]), target, damping)
    near = [i for i in range(0, len(q), EVERY) if arm.near(q[i])]
    touched = {i: pairs for i in near if (pairs := arm.touching(q[i]))}
    first = next(iter(touched), None)
    found = "" if first is None else f", first {' and '.join(touched[first][0])} at {time[first]:.2f} s"
    person = folder / "demonstrated_profile.npz"
    took = f"{np.ptp(np.load(person)['time']):.1f} s" if person.is_file() else "not known"
    return [
        ("tip", f"{tip}, {len(at)} points", None),
        (f"d, damping {damping:.4g}: median / 95 % / max", _spread(d) + f" at {at[d.argmax()]:.1f} s", None),
        ("d, root mean square", f"{np.sqrt(np.mean(d**2)):.3f}", None),
        ("tip beside its path [mm]: same", _spread(1e3 * error) + f" at {at[error.argmax()]:.1f} s", None),
        ("duration", f"{time[-1]:.1f} s, the person's {took}", None),
        *limits_used(time, q, told),
        (
            "self-collision, each fifth step",
            f"{len(touched)} of {len(range(0, len(q), EVERY))} by triangles{found}; {len(near)} by convex hulls",
            not touched,
        ),
    ]


def _spread(values: Array) -> str:
    return f"{np.median(values):.3f} / {np.percentile(values, 95):.3f} / {values.max():.3f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tip", choices=sorted(TIPS), help="default: the one that is nearer to the path")
    parser.add_argument("--damping", type=float, help="ε of d; default: the number in joints.npz")
    given = parser.parse_args()
    for name in FILES:
        if not (given.folder / name).is_file():
            sys.exit(f"{given.folder / name}: there is no such file; needed are {', '.join(FILES)}")
    rows = judge(given.folder, given.tip, given.damping)
    for name, said, within in rows:
        print(f"{'' if within is None else 'yes' if within else 'NO':4}{name:45}{said}")
    if not all(within for _, _, within in rows if within is not None):
        sys.exit(1)


if __name__ == "__main__":
    main()
