"""The robot executes a profile: the hand path is placed before it, and it follows; with what is written of that."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.files import save_ellipsoids, save_path
from maniport.folders import folder_written_whole
from maniport.notebook import ShownInNotebooks
from maniport.steps import Progress, Step
from maniport.telling.formats import files_of
from maniport.tracking import Control, PlacedPath, StartBank, TrackResult, feasibility_gap, place_path, track
from maniport.tracking.objective import DAMPING, Damping, fitted_damping
from maniport.validation import Array, as_finite, as_generator, as_number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLACED_POINTS = 250
"""Points of a path that its place is judged by, at most; more take longer and change little."""

MOTION_FILES = ("placed_profile.npz", "path.npz", "joints.csv", "joints.npz", *files_of("motion"))
FILES = (*MOTION_FILES, "summary.md", "summary.json", "report.html")
"""The files that `Execution.save` writes."""


@dataclass(frozen=True)
class Execution(ShownInNotebooks):
    """A robot's motion along a profile.

    Attributes
    ----------
    robot : Arm
    placement : PlacedPath or None
        Where the hand path was placed; None where it was taken as it is, or there is none.
    motion : TrackResult
        The joint trajectory and what it achieves.
    gap : ndarray, shape (n,)
        Feasibility gap: distance from each wanted ellipsoid to the nearest that the robot can make, wherever its hand
        is.
    tempo : float
        Speed of the motion over that of the profile.
    part : str
        Which ellipsoids, as in `Arm.manipulability`.
    random_state : int
        Seed of the searches.
    sources : tuple of str
        The files that profile and path came from, as far as they did.
    """

    robot: Arm
    placement: PlacedPath | None
    motion: TrackResult
    gap: Array
    tempo: float
    part: str = "translation"
    random_state: int = 0
    sources: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"Execution({self.robot.name!r}, tempo {self.tempo:g}, {self.motion!r})"

    def _facts(self) -> dict[str, object]:
        placed = None if self.placement is None else self.placement.summary
        gap = f"{np.median(self.gap):.2f} (median), {np.percentile(self.gap, 95):.2f} (95 %)"
        return {"tempo": f"{self.tempo:g}", "hand path": placed, "feasibility gap": gap, **self.motion._facts()}

    @property
    def best_distance(self) -> Array | None:
        """Smallest distance with the hand on its path, found for each time by itself, shape (n,).

        Linear between the points that the place was judged by; None where the path was not placed.
        """
        if self.placement is None:
            return None
        each = 1 + (len(self.motion.time) - 1) // PLACED_POINTS
        return np.interp(self.motion.time, self.motion.time[::each], self.placement.distance)

    def summary(self) -> dict[str, Any]:
        """All numbers, ready for JSON."""
        placed = self.placement
        return {
            "tempo": self.tempo,
            "random_state": self.random_state,
            "sources": list(self.sources),
            "feasibility_gap": {"median": float(np.median(self.gap)), "p95": float(np.percentile(self.gap, 95))},
            "placement": None if placed is None else _placement_numbers(placed),
            "motion": self.motion.summary(),
        }

    def as_markdown(self) -> str:
        """Write the numbers as a short page to read."""
        return "\n".join([f"# The motion of {self.robot.name}", "", *motion_lines(self.summary())])

    def save(self, folder: str | os.PathLike[str], progress: Progress | None = None) -> None:
        """Write everything to a folder, whole or not at all.

        Parameters
        ----------
        folder : str or path-like
        progress : callable, optional
            Called with the name of a step and the fraction done.

        Raises
        ------
        OutputError
            When the folder holds other things, or cannot be written.
        """
        from maniport.telling.page import write_report
        from maniport.telling.reports import of_execution  # viewing is slow to load

        step = Step(progress, "write the results")
        with folder_written_whole(folder, FILES) as staging:
            self.write_motion(staging)
            step(0.5)
            write_report(staging / "report.html", of_execution(self))
            text = json.dumps(self.summary(), indent=2, ensure_ascii=False) + "\n"
            (staging / "summary.json").write_text(text, encoding="utf-8")
            (staging / "summary.md").write_text(self.as_markdown(), encoding="utf-8")
        step.end(f"in {os.fspath(folder)}/")

    def write_motion(self, folder: Path) -> None:
        """Write `MOTION_FILES` into a folder that is there."""
        from maniport.telling import figures  # matplotlib is slow to load

        save_ellipsoids(folder / "placed_profile.npz", self.motion.target, self.motion.time)
        if self.motion.path is not None:
            save_path(folder / "path.npz", self.motion.path, self.motion.time)
        self.motion.save_joints_csv(folder / "joints.csv")
        self.motion.save_joints(folder / "joints.npz")
        figures.save(self.figure(), folder / "motion")

    def figure(self) -> Figure:
        """Draw how well the robot follows over time, and its joints within their limits."""
        from maniport.telling import figures

        found, names = self.motion, self.motion.joint_names
        limits = zip(self.robot.lower.tolist(), self.robot.upper.tolist(), strict=True)
        return figures.motion(
            found.time,
            found.distance,
            dict(zip(names, found.joint_positions.T, strict=True)),
            dict(zip(names, limits, strict=True)),
            found.position_error,
            dict(zip(names, found.joint_units, strict=True)),
        )


def follow(
    robot: Arm,
    profile: ArrayLike,
    time: ArrayLike | None,
    path: ArrayLike | None = None,
    *,
    place: bool = True,
    turn: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    tempo: float = 1.0,
    rate: float = 100.0,
    damping: Damping = DAMPING,
    acceleration_limits: ArrayLike | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
) -> Execution:
    """Place a hand path before a robot and let it follow the target ellipsoids along it.

    Parameters
    ----------
    robot : Arm
    profile : array_like, shape (n, d, d)
        Target velocity ellipsoids.
    time : array_like, shape (n,)
        [s].
    path : array_like, shape (n, 3), optional
        Hand positions [m]; without them the robot follows the ellipsoids alone.
    place : bool
        Whether the path may be moved, scaled and turned about the vertical (`maniport.tracking.place_path`).
    turn : array_like, shape (3, 3), optional
        Rotation that the ellipsoids were turned by already and the path was not.
    spec : EllipsoidSpec
        Which ellipsoids.
    tempo : float
        Speed of the motion over that of the profile. Robots are often slower than people.
    rate, acceleration_limits
        See `maniport.tracking.track`.
    damping : float or Regularization
        What is added to all eigenvalues before ellipsoids are compared; see `maniport.tracking.track`.
    random_state : int
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Returns
    -------
    Execution
    """
    if time is None:
        raise InvalidInputError("the profile has no times; write it with an array 'time' (n,) in seconds")
    pace = as_number(tempo, "tempo", above=0.0)
    control: dict[str, Any] = {"rate": rate, "acceleration_limits": acceleration_limits}
    Control(**control)  # a wrong value shall be told before any long work
    generator = as_generator(random_state)
    bank = StartBank.build(robot, random_state=generator, spec=spec)
    same: dict[str, Any] = {"spec": spec, "bank": bank, "progress": progress}
    same["damping"] = fitted_damping(robot, damping, spec, positive=True)
    placement, target, tips = None, profile, path
    if path is not None and place:
        points, ellipsoids = as_finite(path, "path"), as_finite(profile, "profile")
        each = slice(None, None, 1 + (len(points) - 1) // PLACED_POINTS)
        placement = place_path(points[each], ellipsoids[each], robot, turn=turn, random_state=generator, **same)
        target, tips = placement.turned(ellipsoids), placement.apply(points)
    motion = track(robot, target, time=np.asarray(time) / pace, path=tips, **control, **same)
    gap = feasibility_gap(robot, motion.target, **same)
    return Execution(robot, placement, motion, gap, pace, spec.part, random_state)


def _placement_numbers(placed: PlacedPath) -> dict[str, Any]:
    return {
        "scale": placed.scale,
        "yaw_deg": float(np.degrees(placed.yaw)),
        "offset_m": placed.offset.tolist(),
        "distance_median": float(np.median(placed.distance)),
        "distance_p95": float(np.percentile(placed.distance, 95)),
        "points_out_of_reach": int((~placed.reachable).sum()),
        "farthest_out_of_reach_m": float(placed.position_error.max()) if not placed.reachable.all() else 0.0,
    }


def motion_lines(summary: Mapping[str, Any]) -> list[str]:
    """Tell where the hand path lies before the robot, and how well the robot follows."""
    placement, motion, gap = summary["placement"], summary["motion"], summary["feasibility_gap"]
    distance, error, jerk = motion["distance"], motion["position_error_mm"], motion["jerk"]
    lines = [
        "- Feasibility gap, from what is wanted to the nearest found for the robot, wherever its hand is: "
        f"{gap['median']:.2f} (median), {gap['p95']:.2f} (95 %)."
    ]
    if placement is not None:
        place = ", ".join(f"{value:.3f}" for value in placement["offset_m"])
        lines += [
            f"- Hand path: {placement['scale']:.3f} times as large, turned by {placement['yaw_deg']:.1f}° about the "
            f"vertical together with its ellipsoids, its middle at ({place}) m.",
            f"- Best that the robot can do with its hand there, each point by itself: distance of the ellipsoids "
            f"{placement['distance_median']:.2f} (median), {placement['distance_p95']:.2f} (95 %).",
        ]
        if placement["points_out_of_reach"]:
            lines.append(
                f"- Out of reach: {placement['points_out_of_reach']} points of the path, by up to "
                f"{1e3 * placement['farthest_out_of_reach_m']:.1f} mm."
            )
    lines.append(
        f"- Achieved at tempo {summary['tempo']:g}: distance of the ellipsoids {distance['median']:.2f} (median), "
        f"{distance['p95']:.2f} (95 %)"
        + (
            f"; hand {error['median']:.2f} mm (median), {error['p95']:.2f} mm (95 %) beside its path"
            if error is not None
            else ""
        )
        + f"; jerk {jerk['rms']:.0f} rad/s³ (root mean square), {jerk['peak']:.0f} rad/s³ (peak)."
    )
    lines.append("- Points: " + ", ".join(f"{count} {word}" for word, count in motion["status"].items()) + ".")
    if motion["held_at_s"]:
        lines.append(f"- No answer at {len(motion['held_at_s'])} control steps: the last safe configuration was held.")
    if motion["status"].get("velocity limit"):
        slower = 0.5 * summary["tempo"]
        lines.append(f"- Too fast for the robot in places: give a smaller tempo (--tempo {slower:g}).")
    unlimited = motion["joints_without_known_velocity_limit"]
    if unlimited:
        lines.append(f"- Without known velocity limit: {', '.join(unlimited)}.")
    return [
        *lines,
        "",
        "A distance of 0.1 is one axis that is 5 % too long, 1 one that is 65 % too long. Ellipsoid and hand position "
        "together ask more of an arm than its joints can give; the hand goes first.",
        "",
    ]
