"""Check an exported motion of one or two Pandas without maniport: MuJoCo, SciPy and the limits that Franka publishes.

    python scripts/check_motion.py FOLDER [--frame panda_hand_tcp] [--damping 0.0048] [--payload 1.5]
    python scripts/check_motion.py FOLDER --base-left 0 0.3 0 0 --base-right 0 -0.3 0 0 [--payload 1.5,0.5]

The second form is for results of `maniport transfer --side both` with these bases (x, y, z [m] and yaw [deg]).

The script reads `joints.csv`, `path.npz` and `placed_profile.npz`; of `joints.npz` only the damping of the distances,
of `demonstrated_profile.npz` only the duration. Kinematics come from Franka's Denavit-Hartenberg parameters, meshes
and masses from the package; a payload [kg], of all arms or of each, is a point mass at the end effector. Needs `pip
install mujoco`. Exit code 1 if a limit is exceeded, links collide, or a servo with the exported torques is more than
5 mm away from the path.
"""

import argparse
import csv
import sys
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

from pandas_in_mujoco import FRAMES, Array, Base, Pandas

POSITION = np.array(
    [
        [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973],
        [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973],
    ]
)
DERIVATIVES = {  # like POSITION: Franka Control Interface, "Limits for Franka Emika Robot (FER)"
    "velocity": np.array([2.1750, 2.1750, 2.1750, 2.1750, 2.6100, 2.6100, 2.6100]),
    "acceleration": np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    "jerk": np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
}
TORQUE = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # [N m]
TORQUE_RATE = 1000.0  # [N m/s]
# of the servo, for unit inertia [1/s², 1/s]
STIFFNESS = 400.0
DAMPING = 40.0
SIDES = "left", "right"
Row = tuple[str, str, bool | None]
"""Name, value, and whether it is within its limit (None: no limit)."""


def read_joints(path: Path, prefixes: list[str]) -> tuple[Array, list[Array]]:
    """Return times (m,) [s], and positions, accelerations and torques (m, joints or 0) [rad, rad/s², N m]."""
    with open(path, encoding="utf-8", newline="") as stream:
        table = csv.reader(stream)
        header = next(table)
        rows = np.array([[float(cell) for cell in row] for row in table])
    columns = [
        [i for i, name in enumerate(header) if name.endswith(unit)]
        for unit in ("_rad", "_rad/s2", "_Nm")
    ]
    expected = [f"{prefix}panda_joint{i}_rad" for prefix in prefixes for i in range(1, 8)]
    if (
        header[0] != "time_s"
        or [header[i] for i in columns[0]] != expected
        or len(columns[1]) != len(expected)
    ):
        sys.exit(
            f"{path}: expected time_s and {expected[0]} to {expected[-1]} with accelerations; found {header}"
        )
    if not np.isfinite(rows).all():
        sys.exit(f"{path}: contains values that are not finite")
    return rows[:, 0], [rows[:, own] for own in columns]


def distances(achieved: Array, target: Array, damping: float) -> Array:
    """Return affine-invariant distances (n,) by generalized eigenvalues."""
    offset = damping * np.eye(target.shape[-1])
    logs = [
        np.log(eigh(a + offset, b + offset, eigvals_only=True))
        for a, b in zip(achieved, target, strict=True)
    ]
    return np.linalg.norm(logs, axis=1)


def limit_rows(time: Array, q: Array, accelerations: Array) -> list[Row]:
    """Return the largest share of each limit, by finite differences at the rate of the file."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    arms = q.shape[1] // 7
    unevenness = float(np.ptp(np.diff(time)) / step)
    (low, high), limits = (
        np.tile(POSITION, arms),
        {name: np.tile(row, arms) for name, row in DERIVATIVES.items()},
    )
    rows: list[Row] = [
        ("rate", f"{1.0 / step:.1f} Hz, steps differ by {unevenness:.1%}", unevenness < 0.01)
    ]
    rows.append(_share("position", np.abs(q - 0.5 * (low + high)) / (0.5 * (high - low)), time))
    values = q
    for order, name in enumerate(DERIVATIVES, start=1):
        values = np.diff(values, axis=0) / step
        rows.append(_share(name, np.abs(values) / limits[name], time + 0.5 * order * step))
    # A controller that holds its position before and after the motion applies these accelerations at both ends.
    ends = float((np.abs(np.diff(q, axis=0)[[0, -1]]) / step**2 / limits["acceleration"]).max())
    error = float(
        (
            np.abs(np.diff(q, 2, axis=0) / step**2 - accelerations[1:-1]) / limits["acceleration"]
        ).max()
    )
    rows.append(
        (
            "at rest at both ends",
            f"starts and stops with {ends:.3f} of the acceleration limit",
            ends <= 1.0,
        )
    )
    rows.append(
        ("accelerations of the file", f"differ by {error:.3f} of the limits", error <= 0.05)
    )
    return rows


def torque_rows(model: Pandas, prefixes: list[str], time: Array, states: list[Array]) -> list[Row]:
    """Return the largest shares of torque limits, and the position error of a servo that simulates the motion.

    `states` are positions, accelerations and torques of the file. The servo adds these torques, or without them those
    of inverse dynamics, to those of springs and dampers in proportion to the inertia, and is reduced to the torque
    limits.
    """
    q, accelerations, planned = states
    velocity = np.gradient(q, time, axis=0)
    arms = q.shape[1] // 7
    limits = np.tile(TORQUE, arms)
    torques = np.array(
        [model.torques(*state) for state in zip(q, velocity, accelerations, strict=True)]
    )
    planned = planned if planned.size else torques
    rates = np.abs(np.diff(torques, axis=0)) / np.diff(time)[:, None]
    rows = [
        _share("torque", np.abs(torques) / limits, time),
        _share("torque rate", rates / TORQUE_RATE, time[1:]),
    ]
    steps = np.arange(0.0, time[-1], 1e-3)
    wanted = [
        np.stack([np.interp(steps, time, column) for column in own.T], 1)
        for own in (q, velocity, planned)
    ]

    def servo(
        position: Array, speed: Array, torque: Array, at: Array, at_speed: Array, inertia: Array
    ) -> Array:
        pull = inertia @ (STIFFNESS * (position - at) + DAMPING * (speed - at_speed))
        return np.clip(torque + pull, -limits, limits)

    reached = model.simulate(*wanted, servo)
    ends = [
        np.array([[model.end_effector(row, prefix)[0] for prefix in prefixes] for row in rows])
        for rows in (wanted[0][::5], reached[::5])
    ]
    errors = np.linalg.norm(ends[0] - ends[1], axis=2).max(axis=1)
    text = _summary(1e3 * errors, steps[::5])
    return [
        *rows,
        ("position error of a servo [mm]: median / 95 % / max", text, bool(errors.max() <= 5e-3)),
    ]


def _share(name: str, share: Array, time: Array) -> Row:
    i, j = np.unravel_index(int(share.argmax()), share.shape)
    joint = f"joint {j + 1}" if share.shape[1] == 7 else f"{SIDES[j // 7]} joint {j % 7 + 1}"
    decimals = 1e-4  # share of a limit that rounding in the file may cost
    return (
        name,
        f"{share[i, j]:.4f} of its limit ({joint}, {time[i]:.3f} s)",
        bool(share[i, j] <= 1.0 + decimals),
    )


def tracking_rows(
    folder: Path,
    prefix: str,
    models: dict[str, Pandas],
    damping: float | None,
    time: Array,
    q: Array,
) -> tuple[str, list[Row]]:
    """Return the frame that is nearer to the path, and distances and position errors of an arm at the waypoints."""
    folder = folder / prefix.strip("_")
    label = prefix.replace("_", ", ")
    with np.load(folder / "placed_profile.npz") as profile, np.load(folder / "path.npz") as placed:
        target = profile["manipulability"]
        waypoints = profile["time"]
        path = placed[
            next(name for name in placed.files if placed[name].shape == (len(waypoints), 3))
        ]
    if damping is None:
        with np.load(folder / "joints.npz") as stored:
            damping = float(stored["damping"])
    if waypoints[0] < time[0] - 1e-6 or waypoints[-1] > time[-1] + 1e-6:
        sys.exit(
            f"{label}waypoints from {waypoints[0]:.3f} to {waypoints[-1]:.3f} s, joints to {time[-1]:.3f} s"
        )
    configurations = CubicSpline(time, q)(waypoints)
    poses = {
        name: [model.end_effector(row, prefix) for row in configurations]
        for name, model in models.items()
    }
    errors = {
        name: np.linalg.norm([p for p, _ in rows] - path, axis=1) for name, rows in poses.items()
    }
    frame = min(errors, key=lambda name: float(np.median(errors[name])))
    distance = distances(np.array([m for _, m in poses[frame]]), target, damping)
    rms = np.sqrt(np.mean(distance**2))
    return frame, [
        (f"{label}end effector", f"{frame}, {len(waypoints)} waypoints", None),
        (
            f"{label}distance (damping {damping:.4g}): median / 95 % / max",
            _summary(distance, waypoints),
            None,
        ),
        (f"{label}distance, root mean square", f"{rms:.3f}", None),
        (
            f"{label}position error [mm]: median / 95 % / max",
            _summary(1e3 * errors[frame], waypoints),
            None,
        ),
    ]


def _summary(values: Array, time: Array) -> str:
    median, high, largest = np.percentile(values, [50, 95, 100])
    return f"{median:.3f} / {high:.3f} / {largest:.3f} at {time[values.argmax()]:.1f} s"


def check(
    folder: Path,
    frame: str | None = None,
    damping: float | None = None,
    bases: dict[str, Base] | None = None,
    payload: ArrayLike = 0.0,
) -> list[Row]:
    """Return the rows of the table; `bases` are those of two arms by side, `payload` [kg] is of all arms or each."""
    arms = (
        {f"{side}_": base for side, base in bases.items()} if bases else {"": (0.0, 0.0, 0.0, 0.0)}
    )
    time, states = read_joints(folder / "joints.csv", list(arms))
    q, accelerations, _ = states
    models = {
        name: Pandas(dict.fromkeys(arms, name), arms) for name in ([frame] if frame else FRAMES)
    }
    rows: list[Row] = []
    frames = {}
    for prefix in arms:
        frames[prefix], tracking = tracking_rows(folder, prefix, models, damping, time, q)
        rows += tracking
    model = Pandas(frames, arms, payload)
    steps = range(0, len(q), 5)
    near = [i for i in steps if model.near(q[i])]
    collisions = {i: pairs for i in near if (pairs := model.collisions(q[i]))}
    first = next(
        (f"; first {' and '.join(p[0])} at {time[i]:.2f} s" for i, p in collisions.items()), ""
    )
    demonstrated = folder / next(iter(arms)).strip("_") / "demonstrated_profile.npz"
    human = (
        f" (human {np.ptp(np.load(demonstrated)['time']):.1f} s)" if demonstrated.is_file() else ""
    )
    rows.append(("duration", f"{time[-1]:.1f} s{human}", None))
    rows += limit_rows(time, q, accelerations) + torque_rows(model, list(arms), time, states)
    text = f"{len(collisions)} of {len(steps)} by triangles{first}; {len(near)} by convex hulls"
    return [*rows, ("collisions, every fifth sample", text, not collisions)]


def _masses(text: str) -> tuple[float, ...]:
    try:
        masses = tuple(map(float, text.split(",")))
    except ValueError:
        masses = (-1.0,)
    if not all(0.0 <= mass < np.inf for mass in masses):
        raise argparse.ArgumentTypeError(
            f"expected numbers of at least 0 kg, separated by commas; found {text}"
        )
    return masses


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--frame", choices=sorted(FRAMES), help="end effector; default: the one nearer to the path"
    )
    parser.add_argument(
        "--damping", type=float, help="damping of the distance; default: that of joints.npz"
    )
    text = "mass at the end effector, or one for each arm [kg]"
    parser.add_argument("--payload", type=_masses, default=(0.0,), metavar="KG", help=text)
    for side in SIDES:
        text = f"base of the {side} arm: x, y, z [m], yaw [deg]"
        parser.add_argument(
            f"--base-{side}", nargs=4, type=float, metavar=("X", "Y", "Z", "YAW"), help=text
        )
    options = parser.parse_args()
    bases = {
        side: base
        for side, base in zip(SIDES, (options.base_left, options.base_right), strict=True)
        if base
    }
    if len(bases) == 1:
        sys.exit("--base-left and --base-right: expected both or neither")
    if len(options.payload) not in {1, len(bases) or 1}:
        sys.exit(
            f"--payload: expected 1 number, or 2 with both bases; found {len(options.payload)}"
        )
    needed = [
        f"{side}/{name}".lstrip("/")
        for side in bases or [""]
        for name in ("path.npz", "placed_profile.npz")
    ]
    for name in ("joints.csv", *needed):
        if not (options.folder / name).is_file():
            sys.exit(
                f"{options.folder / name}: no such file; needed are joints.csv and {', '.join(needed)}"
            )
    rows = check(options.folder, options.frame, options.damping, bases or None, options.payload)
    for name, value, within in rows:
        print(f"{'' if within is None else 'yes' if within else 'NO':4}{name:52}{value}")
    if any(within is False for _, _, within in rows):
        sys.exit(1)


if __name__ == "__main__":
    main()
