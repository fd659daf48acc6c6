"""Run the examples and write one small picture of each for the gallery.

    python scripts/make_gallery.py [FOLDER]

Writes ``*.png`` into the folder, by default ``docs/gallery``. Their captions are in ``captions.json``.
"""

import contextlib
import io
import runpy
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

import maniport as mp
from maniport.motion import ArmMotion
from maniport.report.figures import TEXT, column_figure, laid_out
from maniport.report.page.content import ACHIEVED, OTHERS, PERSON, REFERENCE, TARGET

HOME = Path(__file__).parents[1]
WIDTH = 700
"""Width of the pictures [pixels]."""
COLORS = 256
"""Number of colors: pale blue and green stay distinct, and pictures stay below 100 kB."""


def ellipsoid_task(folder: Path) -> Figure:
    """Plot the distance to the target with and without the ellipsoid task (example 05)."""
    with np.load(folder / "joints.npz") as arrays:
        figure, (axes,) = panels(1, 1.9)
        for name, role, style in (("without", REFERENCE, "--"), ("with", ACHIEVED, "-")):
            label = f"{name} the ellipsoid task"
            axes.plot(
                arrays["time"],
                arrays[f"distance_{name}"],
                style,
                color=role.color,
                label=label,
                linewidth=1.4,
            )
    axes.set(xlabel="time [s]", ylabel="distance d to the target")
    axes.legend(frameon=False, fontsize=TEXT)
    return laid_out(figure)


def path_and_distance(motion: ArmMotion) -> Figure:
    """Plot the end-effector path, and the distance with the pointwise optimum found (example 06)."""
    figure, (side, axes) = panels(2, 3.6)
    error = motion.distance
    best = motion.pointwise_best
    side.plot(
        motion.path[:, 1],
        motion.path[:, 2],
        color=REFERENCE.color,
        linewidth=0.8,
        linestyle="--",
        zorder=1,
    )
    dots = side.scatter(*motion.path[:, 1:].T, c=error, s=9, cmap="viridis", zorder=2)
    side.set(xlabel="y [m]", ylabel="z [m]")
    side.set_title("end-effector path, front view", fontsize=TEXT)
    side.set_aspect("equal", adjustable="datalim")
    figure.colorbar(dots, ax=side).set_label("distance d", fontsize=TEXT)
    axes.fill_between(
        motion.time, best, color=REFERENCE.pale, alpha=0.5, label="pointwise optimum found"
    )
    axes.plot(motion.time, error, color=ACHIEVED.color, label="planned motion", linewidth=1.4)
    axes.set(xlabel="time [s]", ylabel="distance d", ylim=(0.0, 1.3 * error.max()))
    axes.legend(loc="upper right", frameon=False, fontsize=TEXT)
    return laid_out(figure)


def learned_profile(folder: Path) -> Figure:
    """Plot sizes of the demonstrated ellipsoids and distances from their mean, with bands (example 07)."""
    with np.load(folder / "profiles.npz") as arrays:
        time, mean, demonstrated, covariance = (
            arrays[name] for name in ("time", "mean", "demonstrated", "covariance")
        )
    # The size of a mean is the mean of the sizes; single semi-axes of a mean resemble no demonstration.
    draws = np.random.default_rng(0).standard_normal((1000, len(time), 6))
    tangents = np.einsum("nij,snj->sni", np.linalg.cholesky(covariance), draws)
    sizes = size(mean) * np.exp(tangents[..., :3].sum(axis=-1) / 6.0)
    away = np.percentile(np.linalg.norm(tangents, axis=-1), 95.0, axis=0)
    figure, (above, below) = panels(2, 3.4)
    above.fill_between(
        time, *np.percentile(sizes, [2.5, 97.5], axis=0), color=TARGET.pale, alpha=0.6
    )
    above.plot(time, size(demonstrated).T, color=PERSON.color, linewidth=0.7)
    above.plot(time, size(mean), color=TARGET.color, linewidth=1.6)
    above.set_ylabel("size: geometric mean of the\nsemi-axes [m/s per rad/s]", fontsize=TEXT)
    below.fill_between(time, 0.0, away, color=TARGET.pale, alpha=0.6, label="expected (95 %)")
    below.plot(time, mp.spd.distance(demonstrated, mean).T, color=PERSON.color, linewidth=0.7)
    below.plot([], [], color=PERSON.color, linewidth=0.7, label="demonstrations")
    below.plot([], [], color=TARGET.color, linewidth=1.6, label="mean")
    below.set_xlabel("time [s]", fontsize=TEXT)
    below.set_ylabel("distance d from the mean", fontsize=TEXT)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=TEXT)
    return laid_out(figure)


def size(ellipsoids: np.ndarray) -> np.ndarray:
    """Return the geometric mean of the semi-axes of ellipsoids (..., 3, 3)."""
    return np.linalg.det(ellipsoids) ** (1 / 6)


def replay(result: tuple[np.ndarray, ...]) -> Figure:
    """Plot the joint lag of a Panda with masses, and torques relative to their limits (example 08)."""
    time, planned, achieved, torque = result
    lag = np.degrees(achieved - planned)
    figure, (above, below) = panels(2, 3.2)
    for i, color in enumerate((PERSON.color, TARGET.color, ACHIEVED.color, *OTHERS)):
        above.plot(time, lag[:, i], color=color, linewidth=0.9, label=f"joint {i + 1}")
        below.plot(time, 100.0 * torque[:, i], color=color, linewidth=0.9)
    above.set(ylabel="lag [°]")
    figure.legend(loc="outside upper center", frameon=False, fontsize=TEXT, ncols=4)
    below.set(xlabel="time [s]", ylabel="torque [% of the limit]")
    return laid_out(figure)


def live_states(folder: Path) -> Figure:
    """Plot the distance to the target and the state of the live controller (example 10)."""
    with np.load(folder / "live.npz") as arrays:
        time = arrays["time"]
        states = arrays["state"]
        figure, (axes,) = panels(1, 1.9)
        axes.plot(time, arrays["distance"], color=ACHIEVED.color, linewidth=1.4)
    height = axes.get_xaxis_transform()
    for state, alpha in (("approaching", 0.3), ("holding", 0.6)):
        style = {"color": REFERENCE.pale, "alpha": alpha, "label": state, "transform": height}
        axes.fill_between(time, 0, 1, where=states == state, **style)
    axes.set(xlabel="time [s]", ylabel="distance d to the target", ylim=(0.0, None))
    figure.legend(loc="outside upper center", frameon=False, fontsize=TEXT, ncols=3)
    return laid_out(figure)


def both_paths(result: Any) -> Figure:
    """Plot target and achieved paths of both end effectors from above (example 11)."""
    figure, (axes,) = panels(1, 1.6)
    for output in result.arms:
        motion = output.motion
        arm = output.robot
        positions = arm.forward(motion.joint_positions)[:, :3, 3]
        axes.plot(
            motion.path[:, 1], motion.path[:, 0], color=TARGET.color, linewidth=2.2, label="target"
        )
        axes.plot(
            positions[:, 1],
            positions[:, 0],
            color=ACHIEVED.color,
            linewidth=0.9,
            label="end effector",
        )
        base = arm.skeleton(motion.joint_positions[:1])[0, 0]
        axes.plot(base[1], base[0], "s", color=REFERENCE.color, markersize=5, label="base")
    axes.set(xlabel="to the left, y [m]", ylabel="forward, x [m]", aspect="equal")
    axes.invert_xaxis()
    figure.legend(
        *(items[:3] for items in axes.get_legend_handles_labels()),
        loc="outside upper center",
        frameon=False,
        fontsize=TEXT,
        ncols=3,
    )
    return laid_out(figure)


def accuracy_bars(accuracies: Mapping[str, float]) -> Figure:
    """Draw the share of right classes of each method."""
    figure = Figure(figsize=(6.0, 2.6), layout="constrained")
    axes = figure.subplots()
    names = list(accuracies)
    axes.barh(names, [100.0 * value for value in accuracies.values()], color=ACHIEVED.color)
    axes.invert_yaxis()
    axes.set_xlim(50.0, 100.0)
    axes.set_xlabel("accuracy in another session [%]")
    return figure


def panels(count: int, height: float) -> tuple[Figure, tuple[Axes, ...]]:
    """Return a figure with stacked axes."""
    with rc_context({"font.size": TEXT, "axes.spines.top": False, "axes.spines.right": False}):
        figure = column_figure(height)
        return figure, tuple(np.atleast_1d(figure.subplots(count, 1)))


Drawing = Callable[[Path, Any], Path | Figure]
PICTURES: dict[str, Drawing] = {
    "01": lambda folder, _: folder / "arm.png",
    "02": lambda folder, _: folder / "geodesics.png",
    "03": lambda folder, _: folder / "ladder_arm.png",
    "04": lambda folder, _: folder / "adapted.png",
    "05": lambda folder, _: ellipsoid_task(folder),
    "06": lambda _, motion: path_and_distance(motion),
    "07": lambda folder, _: learned_profile(folder),
    "08": lambda _, output: replay(output[2]),
    "09": lambda folder, _: folder / "polytope.png",
    "10": lambda folder, _: live_states(folder),
    "11": lambda _, result: both_paths(result),
    "12": lambda folder, _: folder / "force.png",
    "13": lambda _, output: accuracy_bars(output[0]),
}
"""Picture of each example from its output folder and its return value."""


def small(picture: Path | Figure, target: Path) -> None:
    """Write a picture with few colors at screen width."""
    stream = io.BytesIO()
    if isinstance(picture, Figure):
        picture.savefig(stream, format="png", dpi=300)
        picture = stream
    with Image.open(picture) as image:
        height = round(image.height * WIDTH / image.width)
        resized = image.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS)
    resized.quantize(COLORS, dither=Image.Dither.NONE).save(target, optimize=True)


def main(folder: Path) -> None:
    """Make the pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    for example in sorted((HOME / "examples").glob("[0-9]*.py")):
        target = folder / f"{example.stem}.png"
        with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(io.StringIO()):
            output = runpy.run_path(str(example))["main"](Path(name))
            small(PICTURES[example.stem[:2]](Path(name), output), target)
        print(f"{target.name}: {target.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HOME / "docs" / "gallery")
