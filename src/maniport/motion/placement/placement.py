"""Placements of a path relative to a robot, and the problem of finding one.

A search has seven components of a placement: log scale, yaw, tilt and heading of the base [rad], and the position of
the path's center [m]. The path is rotated by the yaw about the vertical. The base is tilted toward the heading, so the
vertical is rotated by the inverse in its frame.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.chain import rotation_about
from maniport.errors import InvalidInputError
from maniport.motion.demands import Demand
from maniport.motion.directions import DirectionTarget
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.problem import ArmProblem
from maniport.motion.targets import TargetTrajectory, as_rotations
from maniport.spd.kernels import congruence
from maniport.util.files import save_ellipsoids, save_path
from maniport.util.notebook import NotebookDisplay
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_finite, require_shape

DATA_FILES = ("placed_profile.npz", "path.npz")  # What `Placement.write_data` writes
SCALE = 0
YAW = 1
TILT = 2
HEADING = 3
OFFSET = slice(4, 7)
SIZE = 7
REACHED = 5e-3  # Largest position error of a waypoint that counts as reached [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class Placement(NotebookDisplay):
    """A placed path in a robot's workspace, with its ellipsoids and a trajectory; made by `place_path`.

    p_robot = scale · rotation · map_rotation · (p − center) + offset, with rotation = base_orientationᵀ · Rz(yaw).

    Attributes
    ----------
    scale, yaw : float
        Factor of the path's size, and rotation about the vertical [rad], within ±π.
    tilt, heading : float
        Lean of the base from upright, and its direction: 0 is that of its own x axis, π/2 of y [rad].
    offset : ndarray, shape (3,)
        Position of the path's center in the robot's base frame [m].
    path : ndarray, shape (n, 3)
        Target positions of the end effector in the robot's base frame [m].
    profile : ndarray, shape (n, d, d)
        Target ellipsoids, rotated by `rotation`.
    spec : EllipsoidSpec
        Kind, part and joint weights of the ellipsoids.
    base_orientation : ndarray, shape (3, 3)
        Rotation of the base in a world whose z axis is up; the identity without tilt.
    center : ndarray, shape (3,)
        Mean of the waypoints of the path before the placement [m].
    map_rotation : ndarray, shape (3, 3)
        Rotation of the ellipsoids by the adapter, which also rotates the path.
    joint_positions : ndarray, shape (n, dof)
        Trajectory by which the placement was chosen [rad or m], a start for a plan: its times are not yet chosen.
    distance, position_error : ndarray, shape (m,)
        Affine-invariant distances and position errors [m] of this trajectory at its waypoints.
    """

    scale: float
    yaw: float
    tilt: float
    heading: float
    offset: Array
    path: Array
    profile: Array
    spec: EllipsoidSpec
    base_orientation: Array
    center: Array
    map_rotation: Array
    joint_positions: Array
    distance: Array
    position_error: Array

    @classmethod
    def of(
        cls,
        place: Array,
        *,
        path: Array,
        profile: Array,
        spec: EllipsoidSpec,
        center: Array,
        map_rotation: Array,
        joint_positions: Array,
        distance: Array,
        position_error: Array,
    ) -> "Placement":
        """Make a placement of its components (7,)."""
        tilt = float(place[TILT])
        return cls(
            scale=float(np.exp(place[SCALE])),
            yaw=_within_half_turn(place[YAW]),
            tilt=tilt,
            heading=_within_half_turn(place[HEADING]) if tilt else 0.0,
            offset=place[OFFSET],
            path=path,
            profile=profile,
            spec=spec,
            base_orientation=base_rotations(place[None])[0],
            center=center,
            map_rotation=map_rotation,
            joint_positions=joint_positions,
            distance=distance,
            position_error=position_error,
        )

    @property
    def rms(self) -> float:
        """Root mean square of the distances."""
        return float(np.sqrt(np.mean(self.distance**2)))

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """Whether each position error is at most 5 mm, shape (m,)."""
        return np.asarray(self.position_error <= REACHED)

    @property
    def rotation(self) -> Array:
        """Rotation of path and ellipsoids in the base frame, shape (3, 3)."""
        return np.asarray(self.base_orientation.T @ rotation_about(2, self.yaw))

    def apply(self, points: ArrayLike) -> Array:
        """Place other points of the same motion, shape (..., 3) [m], such as those of a denser path."""
        positions = as_finite(points, "points")
        if positions.shape[-1:] != (3,):
            raise InvalidInputError(f"points must have shape (..., 3); found {positions.shape}")
        rotation = self.rotation @ self.map_rotation
        return np.asarray(self.scale * (positions - self.center) @ rotation.T + self.offset)

    def turned(self, profile: ArrayLike) -> Array:
        """Rotate other ellipsoids of the same motion, shape (n, d, d), such as those of a denser path."""
        ellipsoids = as_finite(profile, "profile")
        size = self.spec.size
        require_shape(ellipsoids, "profile", ("n", size, size))
        return congruence(self.spec.rotation(self.rotation), ellipsoids)

    def moved(self, target: TargetTrajectory) -> TargetTrajectory:
        """Return targets of the same motion where they are placed, in the robot's base frame."""
        directions = tuple(each.turned(self.rotation) for each in target.directions)
        rotations = None
        if target.rotations is not None:
            rotations = self.rotation @ self.map_rotation @ target.rotations
            rotations = as_rotations(rotations)  # without the rounding of the product
        return replace(
            target,
            ellipsoids=self.turned(target.ellipsoids),
            positions=self.apply(target.path),
            rotations=rotations,
            directions=directions,
        )

    def write_data(self, folder: Path, time: ArrayLike | None = None) -> None:
        """Write `DATA_FILES` into an existing folder: ellipsoids and path, with their times (n,) [s] if known."""
        save_ellipsoids(folder / DATA_FILES[0], self.profile, time)
        save_path(folder / DATA_FILES[1], self.path, time)

    def __repr__(self) -> str:
        if self.tilt:
            lean = f", base tilted by {np.degrees(self.tilt):.1f}°"
        else:
            lean = ""
        place = f"scale {self.scale:.3f}, yaw {np.degrees(self.yaw):.1f}°{lean}"
        missed = int(np.sum(~self.reachable))
        return (
            f"Placement({len(self.path)} points, {place}, distance {np.median(self.distance):.2f} (median), "
            f"{missed} of {len(self.distance)} waypoints out of reach)"
        )


def _within_half_turn(angle: float) -> float:
    """Return an angle within ±π [rad]."""
    return float(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi)


def base_rotations(places: Array) -> Array:
    """Rotations of the base in a world whose z axis is up, shape (k, 3, 3)."""
    heading = rotation_about(2, places[:, HEADING])
    return np.asarray(heading @ rotation_about(1, places[:, TILT]) @ np.swapaxes(heading, 1, 2))


def path_rotations(places: Array) -> Array:
    """Rotations of the path in the frame of the base, shape (k, 3, 3)."""
    level = places[:, TILT, None, None] == 0.0
    base = np.where(level, np.eye(3), np.swapaxes(base_rotations(places), 1, 2))
    return np.asarray(base @ rotation_about(2, places[:, YAW]))


@dataclass(frozen=True)
class ArmPath:
    """A path around the common center with its ellipsoids, and the arm that follows it."""

    arm: Arm
    target: TargetTrajectory  # before the placement; positions relative to the center
    reachability_map: ReachabilityMap
    velocity: Array | float = np.inf  # largest speeds of the joints (dof,)
    demanded: tuple[Demand, ...] = ()  # before the placement

    @property
    def path(self) -> Array:
        """Positions relative to the center, rotated as the ellipsoids, shape (n, 3) [m]."""
        return self.target.path

    def rotations(self, places: Array) -> Array:
        """Rotations of ellipsoids at placements (b, 7), shape (b, d, d)."""
        return self.target.spec.rotation(path_rotations(places))

    def positions(self, places: Array) -> Array:
        """Positions at placements (b, 7), shape (b, n, 3) [m]."""
        rotations = np.swapaxes(path_rotations(places), 1, 2)
        scale = np.exp(places[:, SCALE])[:, None, None]
        return np.asarray(scale * self.path @ rotations + places[:, None, OFFSET])

    def placed(self, places: Array) -> TargetTrajectory:
        """Targets at placements (b, 7), those of all waypoints of a placement before those of the next."""
        ellipsoids = congruence(self.rotations(places)[:, None], self.target.ellipsoids)
        return replace(
            self.target,
            time=np.tile(self.target.time, len(places)),
            positions=self.positions(places).reshape(-1, 3),
            ellipsoids=ellipsoids.reshape(-1, *ellipsoids.shape[2:]),
            directions=self.directions(places),
        )

    def directions(self, places: Array) -> tuple[DirectionTarget, ...]:
        """Lines at placements (b, 7), those of all waypoints of a placement before those of the next."""
        rotations = path_rotations(places)
        return tuple(each.turned(rotations) for each in self.target.directions)

    def demands(self, places: Array) -> list[Demand]:
        """Demands with vectors (k, n, 3) at placements (k, 7)."""
        turns = np.exp(places[:, SCALE])[:, None, None] * np.swapaxes(path_rotations(places), 1, 2)
        return [(spec, vectors @ turns) for spec, vectors in self.demanded]

    def thinned(self, rows: NDArray[np.intp]) -> "ArmPath":
        """Return the path with some of its waypoints."""
        demanded = tuple((spec, vectors[rows]) for spec, vectors in self.demanded)
        return replace(self, target=self.target[rows], demanded=demanded)

    def problem(self, places: Array) -> ArmProblem:
        """Return targets and costs of the arm at placements (b, 7)."""
        return ArmProblem.of(self.arm, self.placed(places))

    def derivatives(self, places: Array, free: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """Return derivatives of positions in k free components of placements (b, 7), shape (b, n, 3, k).

        Further, generators of rotations of ellipsoids (b, k, d, d) and of vectors (b, k, 3, 3).
        """
        rotations = path_rotations(places)
        scale = np.exp(places[:, SCALE])[:, None, None]
        positions = scale * self.path @ np.swapaxes(rotations, 1, 2)
        vertical = rotations[:, :, 2]
        axes = np.zeros((len(places), SIZE, 3))
        axes[:, YAW] = vertical
        axes[:, TILT, 0] = np.sin(places[:, HEADING])
        axes[:, TILT, 1] = -np.cos(places[:, HEADING])
        axes[:, HEADING] = np.array([0.0, 0.0, 1.0]) - vertical
        shifts = np.cross(axes[:, None], positions[:, :, None]).swapaxes(2, 3)
        shifts[..., SCALE] = positions
        shifts[..., OFFSET] = np.eye(3)
        turns = np.cross(np.eye(3), axes[:, free][:, :, None])
        return shifts[..., free], self.target.spec.rotation(turns), turns


@dataclass(frozen=True)
class PlacementProblem:
    """Paths of one or several arms with one common placement, and bounds of it."""

    arms: tuple[ArmPath, ...]
    outline: Array  # (m, 3), all waypoints of all arms, which stay in the workspace
    time: Array  # (n,) [s]
    fixed: Array  # (7,), the fixed components of the placement; nan where free
    lower: Array  # (7,), bounds of placements
    upper: Array  # (7,)
    workspace: Array  # (2, 3), lower and upper bounds of the paths [m]

    @property
    def free(self) -> NDArray[np.bool_]:
        """Free components of a placement, shape (7,)."""
        return np.isnan(self.fixed)

    @property
    def duration(self) -> float:
        """Time from the first to the last waypoint [s]."""
        return float(self.time[-1] - self.time[0])

    def thinned(self, count: int) -> "PlacementProblem":
        """Return the same with `count` evenly spaced waypoints of each path."""
        rows = evenly_spaced(len(self.time), count)
        arms = tuple(arm.thinned(rows) for arm in self.arms)
        return replace(self, arms=arms, time=self.time[rows])

    def costs(self, places: Array, samples: int) -> Array:
        """Mean cost of placements (k, 7) by the samples next to each waypoint, summed over the arms, shape (k,)."""
        total = np.zeros(len(places))
        for arm in self.arms:
            target = arm.placed(places)
            demands = [(spec, vectors.reshape(-1, 3)) for spec, vectors in arm.demands(places)]
            costs = arm.reachability_map.costs(target, samples, demands)
            total += costs.reshape(len(places), -1).mean(axis=1)
        return total

    def outlines(self, places: Array) -> Array:
        """Paths (b, m, 3) at placements; of one arm turned about its first axis, to the same side [m]."""
        paths = np.concatenate([arm.positions(places) for arm in self.arms], axis=1)
        axis = self.arms[0].reachability_map.axis
        if len(self.arms) > 1 or axis is None:
            return paths
        _, angles = axis.cylindrical(paths.mean(axis=1))
        turns = axis.rotations(-angles)
        return np.asarray((paths - axis.origin) @ np.swapaxes(turns, 1, 2))

    def inside(self, places: Array) -> Array:
        """Those of the placements (k, 7) that fit into the workspace, shifted and shrunk where free."""
        moved, inside = self.within(places)
        return np.asarray(moved[inside])

    def within(self, places: Array, rounding: float = 1e-9) -> tuple[Array, NDArray[np.bool_]]:
        """Shift placements (k, 7) into the workspace, and shrink the path, where free; and which fit, (k,)."""
        places = places.copy()
        free = self.free
        (least, most) = self.workspace
        if not np.any(np.isfinite(self.workspace)):
            return places, np.ones(len(places), bool)
        turned = self.outline @ np.swapaxes(path_rotations(places), 1, 2)
        low = turned.min(axis=1)
        high = turned.max(axis=1)
        if free[SCALE]:
            with np.errstate(divide="ignore", invalid="ignore"):
                fixed = np.fmin(
                    (most - places[:, OFFSET]) / high, (least - places[:, OFFSET]) / low
                )
                largest = np.where(
                    free[OFFSET], (most - least) / (high - low), np.maximum(fixed, 0.0)
                ).min(axis=1)
                places[:, SCALE] = np.minimum(places[:, SCALE], np.log(largest) - rounding)
        scale = np.exp(places[:, SCALE, None])
        ends = least - scale * low, most - scale * high
        inside = np.minimum(np.maximum(places[:, OFFSET], ends[0]), ends[1])
        places[:, OFFSET] = np.where(free[OFFSET], inside, places[:, OFFSET])
        kept = (places[:, OFFSET] >= ends[0] - rounding) & (places[:, OFFSET] <= ends[1] + rounding)
        return places, kept.all(axis=1) & (places[:, SCALE] >= self.lower[SCALE] - rounding)
