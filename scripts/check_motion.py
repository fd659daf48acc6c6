"""Judge an exported motion of a Panda, or of two, by means that are not maniport's: MuJoCo, SciPy, Franka's own tables.

    python scripts/check_motion.py FOLDER [--tip panda_hand_tcp] [--damping 0.0048]
    python scripts/check_motion.py FOLDER --base-left 0 0.3 0 0 --base-right 0 -0.3 0 0

The second is for what `maniport transfer --arm both` wrote with these bases (x, y, z [m] and yaw [deg]): `joints.csv`
has the joints of both, `left` and `right` what each arm is asked for.

Reads `joints.csv`, `path.npz` and `placed_profile.npz` of a folder of results, and nothing that was computed from them:
of `joints.npz` only the damping that distances are defined with, of `demonstrated_profile.npz` the person's times. The
arm is built here from Franka's published Denavit-Hartenberg parameters; what its links look like comes from the
package. Needs `pip install mujoco`. Ends with 1 where something exceeds a limit.
"""

import argparse
import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

from pandas_in_mujoco import TIPS, Array, Base, Pandas

LIMITS = {  # Franka Control Interface, "Limits for Franka Emika Robot (FER)"
    "lower position": np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
    "upper position": np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
    "velocity": np.array([2.1750, 2.1750, 2.1750, 2.1750, 2.6100, 2.6100, 2.6100]),
    "acceleration": np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    "jerk": np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
}
ROUNDING = 1e-4
"""Share of a limit that the decimals of the file may cost."""
SIDES = "left", "right"
FILES = "path.npz", "placed_profile.npz"
EVERY = 5
"""Control steps from one that is asked for collisions to the next."""


def read_joints(path: Path, prefixes: list[str]) -> tuple[Array, Array, Array]:
    """Times (m,), positions (m, joints), and what the file says the accelerations are (m, joints)."""
    with open(path, encoding="utf-8", newline="") as stream:
        table = csv.reader(stream)
        header = next(table)
        rows = np.array([[float(cell) for cell in row] for row in table])
    kinds = [[i for i, name in enumerate(header) if name.endswith(end)] for end in ("_rad", "_rad/s2")]
    wanted = [f"{prefix}panda_joint{i}_rad" for prefix in prefixes for i in range(1, 8)]
    if header[0] != "time_s" or [header[i] for i in kinds[0]] != wanted or len(kinds[1]) != len(wanted):
        sys.exit(
            f"{path}: expected time_s, positions and accelerations of {len(wanted)} joints, {wanted[0]} to "
            f"{wanted[-1]}; found {', '.join(header)}"
        )
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
    limits = {name: np.tile(one, q.shape[1] // len(one)) for name, one in LIMITS.items()}
    low, high = limits["lower position"], limits["upper position"]
    rows = [
        ("rate", f"{1.0 / step:.1f} Hz, steps differ by {uneven:.1%} of one", uneven < 0.01),
        _used("position", np.abs(q - 0.5 * (low + high)) / (0.5 * (high - low)), time),
    ]
    values = q
    for order, quantity in enumerate(("velocity", "acceleration", "jerk"), start=1):
        values = np.diff(values, axis=0) / step
        rows.append(_used(quantity, np.abs(values) / limits[quantity], time + 0.5 * order * step))
    # at rest: what a controller that holds still before and after would have to make of the first and last step
    ends = np.abs(np.diff(q, axis=0)[[0, -1]]) / step**2 / limits["acceleration"]
    rows.append(
        ("at rest at both ends", f"a start and stop of {ends.max():.3f} of the acceleration", bool(ends.max() <= 1))
    )
    apart = np.abs(np.diff(q, 2, axis=0) / step**2 - told[1:-1]) / limits["acceleration"]
    rows.append(("accelerations as told", f"{apart.max():.3f} of the limits apart", bool(apart.max() <= 0.05)))
    return rows


def _used(quantity: str, share: Array, time: Array) -> tuple[str, str, bool]:
    i, j = np.unravel_index(int(share.argmax()), share.shape)
    joint = f"joint {j + 1}" if share.shape[1] == 7 else f"{SIDES[j // 7]} joint {j % 7 + 1}"
    said = f"{share[i, j]:.4f} of its limit ({joint}, {time[i]:.3f} s)"
    return quantity, said, bool(share[i, j] <= 1.0 + ROUNDING)


def judge(
    folder: Path, tip: str | None, damping: float | None, bases: dict[str, Base] | None = None
) -> list[tuple[str, str, bool | None]]:
    """Rows of the table: what, how much, whether it is within its limit (None: nothing is asked of it).

    The bases are those of two arms, by side.
    """
    stands = {"": (0.0, 0.0, 0.0, 0.0)} if bases is None else {f"{side}_": base for side, base in bases.items()}
    time, q, told = read_joints(folder / "joints.csv", list(stands))
    rows: list[tuple[str, str, bool | None]] = []
    tips = {}
    for prefix in stands:
        asked = Asked.read(folder, prefix, damping)
        arms = [tip] if tip else list(TIPS)
        tips[prefix], own = asked.judged({name: Pandas(dict.fromkeys(stands, name), stands) for name in arms}, time, q)
        rows += own
    model = Pandas(tips, stands)
    near = [i for i in range(0, len(q), EVERY) if model.near(q[i])]
    touched = {i: pairs for i in near if (pairs := model.touching(q[i]))}
    first = next(iter(touched), None)
    found = "" if first is None else f", first {' and '.join(touched[first][0])} at {time[first]:.2f} s"
    person = folder / next(iter(stands)).strip("_") / "demonstrated_profile.npz"
    took = f"{np.ptp(np.load(person)['time']):.1f} s" if person.is_file() else "not known"
    return [
        *rows,
        ("duration", f"{time[-1]:.1f} s, the person's {took}", None),
        *limits_used(time, q, told),
        (
            "self-collision, each fifth step" if bases is None else "collision of either or both, each fifth step",
            f"{len(touched)} of {len(range(0, len(q), EVERY))} by triangles{found}; {len(near)} by convex hulls",
            not touched,
        ),
    ]


@dataclass(frozen=True)
class Asked:
    """What an arm is asked for at some times (n,): ellipsoids (n, 3, 3) with a damping, and a path (n, 3) [m]."""

    prefix: str
    time: Array
    target: Array
    path: Array
    damping: float

    @classmethod
    def read(cls, folder: Path, prefix: str, damping: float | None) -> "Asked":
        """Read it from a folder, that of one of two arms from one in it."""
        own = folder / prefix.strip("_")
        with np.load(own / "placed_profile.npz") as profile, np.load(own / "path.npz") as placed:
            target, at = profile["manipulability"], profile["time"]
            path = placed[next(name for name in placed.files if placed[name].shape == (len(at), 3))]
        if damping is None:
            with np.load(own / "joints.npz") as stored:
                damping = float(stored["damping"])
        return cls(prefix, at, target, path, damping)

    def judged(
        self, models: dict[str, Pandas], time: Array, q: Array
    ) -> tuple[str, list[tuple[str, str, bool | None]]]:
        """The tip that is nearer to the path, and rows of how the arm follows."""
        at, side = self.time, self.prefix.replace("_", ", ")
        if at[0] < time[0] - 1e-6 or at[-1] > time[-1] + 1e-6:
            sys.exit(f"{side}points at {at[0]:.3f} to {at[-1]:.3f} s, joints at {time[0]:.3f} to {time[-1]:.3f} s")
        there = CubicSpline(time, q)(at)
        made = {name: [model.tip(one, self.prefix) for one in there] for name, model in models.items()}
        errors = {name: np.linalg.norm([p for p, _ in tips] - self.path, axis=1) for name, tips in made.items()}
        tip = min(errors, key=lambda name: float(np.median(errors[name])))
        d, error = distances(np.array([m for _, m in made[tip]]), self.target, self.damping), errors[tip]
        return tip, [
            (f"{side}tip", f"{tip}, {len(at)} points", None),
            (
                f"{side}d, damping {self.damping:.4g}: median / 95 % / max",
                _spread(d) + f" at {at[d.argmax()]:.1f} s",
                None,
            ),
            (f"{side}d, root mean square", f"{np.sqrt(np.mean(d**2)):.3f}", None),
            (
                f"{side}tip beside its path [mm]: same",
                _spread(1e3 * error) + f" at {at[error.argmax()]:.1f} s",
                None,
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
    for side in SIDES:
        said = f"where the {side} of two arms stands: x, y, z [m] and the yaw [deg]"
        parser.add_argument(f"--base-{side}", nargs=4, type=float, metavar=("X", "Y", "Z", "YAW"), help=said)
    given = parser.parse_args()
    bases = {side: base for side, base in zip(SIDES, (given.base_left, given.base_right), strict=True) if base}
    if len(bases) == 1:
        sys.exit("--base-left and --base-right are given together, or neither")
    for name in ("joints.csv", *(str(Path(side) / name) for side in bases or [""] for name in FILES)):
        if not (given.folder / name).is_file():
            sys.exit(f"{given.folder / name}: there is no such file; needed are joints.csv and {', '.join(FILES)}")
    rows = judge(given.folder, given.tip, given.damping, bases or None)
    for name, said, within in rows:
        print(f"{'' if within is None else 'yes' if within else 'NO':4}{name:52}{said}")
    if not all(within for _, _, within in rows if within is not None):
        sys.exit(1)


if __name__ == "__main__":
    main()
