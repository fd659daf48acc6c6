"""Chains: the description of an arm's kinematics that readers return and `Arm` uses.

A chain is a sequence of one-degree-of-freedom joints from the base to the end effector. It may have more joints than
degrees of freedom: each joint's position is an affine function of the arm's coordinates, ``q_joint = coupling @ q +
offset``. That covers the shoulder girdle of the human arm, the mimic joints of robots and joints that are locked.
"""

import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.errors import InvalidInputError
from maniport.util.validation import MAX_POSITION, Array, as_finite, as_numbers, as_rotation

REVOLUTE = "revolute"
PRISMATIC = "prismatic"
SIDES = RIGHT, LEFT = "right", "left"

SOFT_LIMITS = "soft-limits"
IGNORED_SOFT_LIMITS = "ignored-soft-limits"
IGNORED_INCLUDES = "ignored-includes"
IMPLAUSIBLE_INERTIA = "implausible-inertia"
IGNORED_GRAVITY = "ignored-gravity"
"""Kinds of remarks about the description of a robot."""

UNIT = 1e-6  # tolerance of the length of axes and rotations: files have six digits

Triangles = NDArray[np.int32]
Mesh = tuple[Array, Triangles]
"""Points [m], shape (n, 3), and triangles as rows of three indices of points, shape (m, 3)."""


@dataclass(frozen=True)
class Joint:
    """One joint with one degree of freedom."""

    name: str
    kind: str  # "revolute" or "prismatic"
    axis: Array  # unit vector (3,) in the joint's own frame
    placement: Array  # pose (4, 4) of its frame in that of the joint before it, or the base, at position zero
    armature: float = 0.0  # inertia of its rotor, in the joint's own coordinate [kg m²] or [kg]

    def __post_init__(self) -> None:
        if not abs(float(np.linalg.norm(self.axis)) - 1.0) < UNIT:
            raise InvalidInputError(
                f"joint {self.name!r} must have an axis of finite length above 0"
            )
        _require_rigid(self.placement, f"joint {self.name!r}")

    def motion(self, positions: ArrayLike) -> Array:
        """Compute the motions of the joint to positions (...) [rad] or [m], shape (..., 4, 4)."""
        moved = np.asarray(positions, dtype=np.float64)[..., None] * self.axis
        motions = np.broadcast_to(np.eye(4), (*moved.shape[:-1], 4, 4)).copy()
        if self.kind == PRISMATIC:
            motions[..., :3, 3] = moved
        else:
            turns = Rotation.from_rotvec(moved.reshape(-1, 3)).as_matrix()
            motions[..., :3, :3] = turns.reshape(*moved.shape, 3)
        return motions


BELOW = 0.05
"""Frames that are this far below the base plane show that the robot does not stand on it [m]; some feet and
screws have their frames a little below."""


@dataclass(frozen=True)
class Frame:
    """A frame fixed to the chain."""

    joint: int  # after so many joints (0: to the base)
    placement: Array  # pose (4, 4) in the frame of the last of them
    parent: str | None = None  # name of the frame that it is attached to, where that is known

    def __post_init__(self) -> None:
        _require_rigid(self.placement, "a frame")


@dataclass(frozen=True)
class Contact:
    """Bits of a geom of an MJCF that decide, with those of another, whether the two can touch."""

    body: str
    geom: int  # number of the geom in its file
    contype: int
    conaffinity: int
    is_plane: bool = False


@dataclass(frozen=True)
class ContactRules:
    """Pairs of geoms that an MJCF excludes from contacts, as MuJoCo decides."""

    carriers: Mapping[str, str]  # first of the bodies that are welded to each body
    parents: Mapping[str, str]  # carrier of the body that each carrier is attached to
    root: str  # carrier of all that cannot move
    excluded: frozenset[frozenset[str]]  # pairs of bodies in <exclude>
    explicit: frozenset[frozenset[int]]  # pairs of geoms in <pair>, whatever else holds
    filter_parents: bool = True
    enabled: bool = True  # whether the model has contacts at all

    def decide(self, geoms: Sequence[Contact]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Decide which pairs of geoms can touch, and which of the others <exclude> or the bits exclude.

        Both have the shape (geoms, geoms). Welded bodies cannot touch, nor can two that a joint connects unless one of
        them is fixed to the world.
        """
        numbers = dict(zip(self.parents, range(len(self.parents)), strict=True))
        carriers = np.array([numbers[self.carriers[geom.body]] for geom in geoms], dtype=np.intp)
        parents = np.array([numbers[parent] for parent in self.parents.values()])[carriers]
        joined = parents[:, None] == carriers
        joined |= joined.T
        fixed = carriers == numbers[self.root]
        joined &= ~(fixed[:, None] | fixed)
        joined &= self.filter_parents
        joined |= carriers[:, None] == carriers

        contypes = np.array([geom.contype for geom in geoms], dtype=np.int64)
        conaffinities = np.array([geom.conaffinity for geom in geoms], dtype=np.int64)
        match = (contypes[:, None] & conaffinities) != 0
        match |= match.T
        places: dict[str | int, list[int]] = {}
        for place, geom in enumerate(geoms):
            places.setdefault(geom.body, []).append(place)
            places.setdefault(geom.geom, []).append(place)
        for pair in self.excluded:
            _fill(match, [places.get(body, []) for body in pair], False)
        if not self.enabled:
            match[:] = False
            return match, ~joined
        touching = match & ~joined
        for numbered in self.explicit:
            _fill(touching, [places.get(geom, []) for geom in numbered], True)
        return touching, ~match & ~joined & ~touching


def _fill(pairs: NDArray[np.bool_], ends: Sequence[Sequence[int]], value: bool) -> None:
    """Set the symmetric entries of a matrix of pairs between two sets of rows."""
    first = ends[0]
    second = ends[-1]
    pairs[np.ix_(first, second)] = value
    pairs[np.ix_(second, first)] = value


@dataclass(frozen=True, eq=False)
class Shape:
    """A visual or collision shape of a link, in the frame of the link.

    Attributes
    ----------
    link : str
    mesh : Mesh
    collision : bool
        Whether the description declares it as a collision shape.
    core : ndarray, shape (k, 3), or None
        Points whose convex hull, enlarged by `radius`, is the shape [m]; None for a mesh that may be concave.
    radius : float
        Largest distance of the shape from the hull of its core [m].
    contact : Contact or None
        Contact bits of a geom of an MJCF.
    stand_in : bool
        Whether it is drawn in place of a visual shape whose mesh is missing.
    """

    link: str
    mesh: Mesh
    collision: bool = False
    core: Array | None = None
    radius: float = 0.0
    contact: Contact | None = None
    stand_in: bool = False


@dataclass(frozen=True, eq=False)
class CollisionShapes:
    """Shapes of links that are checked for collisions.

    Attributes
    ----------
    shapes : list of Shape
    missing : mapping of str to str
        Links of which at least one shape is not among them, with the reason.
    replaced : mapping of str to str
        Links with visual shapes, since their collision shapes cannot be read, with the reason.
    undrawn : tuple of str
        Links with collision shapes whose visual meshes are missing.
    rules : ContactRules or None
        Contacts that the description excludes.
    """

    shapes: Sequence[Shape]
    missing: Mapping[str, str] = field(default_factory=dict)
    replaced: Mapping[str, str] = field(default_factory=dict)
    undrawn: tuple[str, ...] = ()
    rules: ContactRules | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """A body off the chain, such as a finger, a leg or the other arm."""

    joint: int  # number of joints of the chain that move it (0: fixed to the base)
    placements: Array  # (k, 4, 4) in the frame of the last of them; several from open to closed for a gripper
    group: str  # name shared by all bodies of a finger; the own name of other bodies

    def moved(self, joint: int, transform: Array) -> "Body":
        """Attach the body after `joint` joints; `transform`, (4, 4), is the pose of the present frame in that frame."""
        return replace(self, joint=joint, placements=transform @ self.placements)


@dataclass(frozen=True)
class Chain:
    """Joints from base to end effector, the frames on them and the coordinates that move them."""

    name: str
    joints: tuple[Joint, ...]
    frames: Mapping[str, Frame]
    frame: str  # name of the end effector
    coordinates: tuple[str, ...]  # names of the degrees of freedom
    lower: Array  # (dof,) their limits [rad] or [m]
    upper: Array
    coupling: Array  # (joints, dof): joint positions per coordinate
    offset: Array  # (joints,): their positions at zero coordinates [rad] or [m]
    velocity_limits: Array | None = None  # (dof,) [rad/s] or [m/s]; infinite where unknown
    effort_limits: Array | None = None  # (dof,) [N m] or [N]; infinite where unknown
    # spatial inertia (joints + 1, 6, 6) of all that is fixed to the link after each joint (0: the base), linear rows
    # first, about the origin of the link's frame; None where the description has no masses
    inertia: Array | None = None
    payload: float = 0.0  # mass in it that the end effector carries [kg]
    gravity: tuple[float, ...] = (
        0.0,
        0.0,
        -9.81,
    )  # acceleration of free fall in the base frame [m/s²]
    # read shapes of links by name, to draw them and to check them; `mesh_folders` and `xacro_args` are optional.
    # Without the second, the drawn shapes are checked.
    shapes: Callable[..., Iterable[Shape]] | None = None
    collision_shapes: Callable[..., CollisionShapes] | None = None
    others: Mapping[str, Body] | None = (
        None  # bodies off the chain; None if the chain is the whole robot
    )
    base: str | None = None  # reference frame of all results if not the first frame of the file
    base_pose: Array | None = None  # pose (4, 4) of the robot's base in that frame if it differs
    on_base_plane: bool = True  # whether z = 0 is the base plane of the description or of a world
    locked: Mapping[str, float] = field(
        default_factory=dict
    )  # positions of locked coordinates [rad] or [m]
    unlimited: tuple[str, ...] = ()  # revolute joints without limits, limited to one turn
    # what a report says of the description: for each kind, such as `SOFT_LIMITS`, details by joint or link
    remarks: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    source: str = ""  # argument of `load_arm`
    xacro_args: Mapping[str, str] = field(default_factory=dict)  # argument of `load_arm`
    side: str | None = None  # of a person, "right" or "left"

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each degree of freedom: ``"rad"``, or ``"m"`` if it moves prismatic joints only."""
        turns = np.array([joint.kind == REVOLUTE for joint in self.joints])
        units = []
        for column in self.coupling.T:
            units.append("rad" if np.any(turns & (column != 0)) else "m")
        return tuple(units)

    def ancestors(self, frame: str) -> list[str]:
        """Return a frame and all frames that it is attached to, the nearest first."""
        names = [frame]
        above = self.frames[frame].parent
        while above is not None and above in self.frames and above not in names:
            names.append(above)
            above = self.frames[above].parent
        return names

    def holds(self, link: str) -> bool:
        """Return whether a link is on the chain and not attached beyond the end effector."""
        return link in self.frames and self.frame not in self.ancestors(link)[1:]

    @property
    def stands(self) -> bool:
        """Whether the base stands on the plane z = 0, unlike a torso, a pelvis or the top of a pedestal.

        It is the root of the description, or in its plane, and no part of the robot that the arm does not move is
        below that plane.
        """
        if self.side is not None or not self.on_base_plane:
            return False
        heights = []
        for frame in self.frames.values():
            if frame.joint == 0:
                heights.append(frame.placement[2, 3])
        for body in self.attached.values():
            if body.joint == 0:
                heights.append(body.placements[:, 2, 3].min())
        return bool(min(heights, default=0.0) >= -BELOW)

    @property
    def attached(self) -> dict[str, Body]:
        """Bodies off the chain and frames beyond the end effector."""
        if self.others is None:
            return {}
        bodies = {}
        for name, frame in self.frames.items():
            if not self.holds(name):
                bodies[name] = Body(frame.joint, frame.placement[None], name)
        return bodies | dict(self.others)


def point_mass(mass: float, point: Array) -> Array:
    """Spatial inertia (6, 6), linear rows first, of a mass [kg] at a point (3,) [m], about the origin."""
    return np.asarray(pin.Inertia(mass, point, np.zeros((3, 3))).matrix())


def moved_inertia(inertia: Array, pose: Array) -> Array:
    """Spatial inertia (..., 6, 6) about another frame in which its present frame has the pose (4, 4)."""
    force = pin.SE3(pose).dualAction  # transforms forces and momenta
    return np.asarray(force @ inertia @ force.T)


def _require_rigid(placement: Array, what: str) -> None:
    """Require a rotation and a translation within ±MAX_POSITION [m]."""
    turn = placement[:3, :3]
    shift = placement[:3, 3]
    if not (np.abs(turn @ turn.T - np.eye(3)).max() < UNIT and np.abs(shift).max() <= MAX_POSITION):
        raise InvalidInputError(
            f"{what} must be placed by a rotation and by finite meters, within ±{MAX_POSITION:g}; "
            f"found {np.array2string(placement[:3], precision=3, separator=', ')}".replace("\n", "")
        )


def check_names(names: Sequence[str], argument: str) -> tuple[str, ...]:
    """Require a sequence of at least one name, without repetitions."""
    if isinstance(names, str) or not isinstance(names, Iterable):
        listed: tuple[str, ...] = ()
    else:
        listed = tuple(names)
    if not listed or not all(isinstance(name, str) for name in listed):
        raise InvalidInputError(
            f"{argument} must be a sequence of names, such as ('first', 'second'); found {names!r}"
        )
    repeated = sorted({name for name in listed if listed.count(name) > 1})
    if repeated:
        raise InvalidInputError(
            f"{argument} must name each once; found more than once: {', '.join(repeated)}"
        )
    return listed


def rotation_about(axis: int, angle: float | Array) -> Array:
    """Rotation matrices about the x (0), y (1) or z (2) axis, shape (..., 3, 3); exact at multiples of 90°."""
    cos = np.cos(angle)
    sin = np.sin(angle)
    quarters = np.asarray(angle) / (np.pi / 2)
    exact = quarters == np.round(quarters)
    first = (axis + 1) % 3
    second = (axis + 2) % 3
    cos = np.where(exact, np.round(cos) + 0.0, cos)  # + 0.0: without −0
    sin = np.where(exact, np.round(sin) + 0.0, sin)
    matrix = np.zeros((*exact.shape, 3, 3))
    matrix[..., axis, axis] = 1.0
    matrix[..., first, first] = matrix[..., second, second] = cos
    matrix[..., second, first] = sin
    matrix[..., first, second] = 0.0 - sin
    return matrix


def pose(xyz: Sequence[float] = (0.0, 0.0, 0.0), rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
    """Pose from a translation [m] and roll, pitch, yaw [rad] about fixed axes, as in URDF; shape (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = (
        rotation_about(2, rpy[2]) @ rotation_about(1, rpy[1]) @ rotation_about(0, rpy[0])
    )
    matrix[:3, 3] = xyz
    return matrix


def as_pose(value: ArrayLike, name: str) -> Array:
    """Convert a rotation, shape (3, 3), or a pose, shape (4, 4), to a pose."""
    matrix = as_finite(value, name)
    result = np.eye(4)
    if matrix.shape == (4, 4) and np.array_equal(matrix[3], result[3]):
        result[:3, 3] = as_numbers(
            matrix[:3, 3], name, 3, minimum=-MAX_POSITION, maximum=MAX_POSITION
        )
    elif matrix.shape != (3, 3):
        raise InvalidInputError(
            f"{name} must be a rotation, shape (3, 3), or a pose, shape (4, 4), with last row 0 0 0 1; "
            f"found shape {matrix.shape}"
            + (f" and last row {matrix[3]}" if matrix.shape == (4, 4) else "")
        )
    as_rotation(matrix[:3, :3], name)
    result[:3, :3] = matrix[
        :3, :3
    ]  # not orthogonalized, which would add rounding to exact quarter turns
    return result


def read_embedded(name: str, without: Collection[str] = ()) -> Chain:
    """Read a chain that ships with the package, ``arms/data/<name>.json`` (lengths in meters, angles in radians).

    What the frames in `without` carry is not mounted: it has no mass, and there are no bodies off the chain.
    """
    folder = Path(__file__).parent / "data"
    data = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    coordinates = data["coordinates"]
    names = [entry["name"] for entry in coordinates]
    coupling = np.zeros((len(data["joints"]), len(names)))
    joints: list[Joint] = []
    for row, entry in enumerate(data["joints"]):
        for coordinate, factor in entry.get("follows", {entry["name"]: 1.0}).items():
            coupling[row, names.index(coordinate)] = factor
        axis = np.array(entry["axis"], dtype=np.float64)
        axis = axis / np.linalg.norm(axis)
        placement = _pose_of(entry)
        if not joints:
            placement = pose(**data["base"]) @ placement
        joints.append(Joint(entry["name"], entry.get("kind", REVOLUTE), axis, placement))

    frames = {}
    for entry in data["frames"]:
        frames[entry["name"]] = Frame(entry["joint"], _pose_of(entry), entry.get("parent"))
    masses = [entry for entry in data.get("masses", ()) if entry["frame"] not in without]
    inertia = np.zeros((len(joints) + 1, 6, 6))
    for entry in masses:
        carrier = frames[entry["frame"]]
        inertia[carrier.joint] += _inertia_of(entry, carrier.placement)
    others = None
    if "others" in data and not without:
        others = {}
        for entry in data["others"]:
            placements = np.array([pose(**place) for place in entry["placements"]])
            others[entry["name"]] = Body(entry["joint"], placements, entry["name"])
    shapes = None
    collision_shapes = None
    surfaces = folder / f"{name}_surfaces.npz"
    if surfaces.exists():
        shapes = partial(read_shapes, surfaces)
        collision_shapes = partial(read_collision_shapes, surfaces)
    return Chain(
        name=data["name"],
        joints=tuple(joints),
        frames=frames,
        frame=data["frame"],
        coordinates=tuple(names),
        lower=_numbers_of(coordinates, "lower"),
        upper=_numbers_of(coordinates, "upper"),
        coupling=coupling,
        offset=np.zeros(len(joints)),
        velocity_limits=_numbers_of(coordinates, "velocity"),
        effort_limits=_numbers_of(coordinates, "effort"),
        inertia=inertia if np.any(inertia) else None,
        shapes=shapes,
        collision_shapes=collision_shapes,
        others=others,
    )


def _pose_of(entry: Mapping[str, Sequence[float]]) -> Array:
    """Pose (4, 4) of an entry with a translation and perhaps a rotation."""
    return pose(entry["xyz"], entry.get("rpy", (0, 0, 0)))


def _inertia_of(entry: Mapping[str, ArrayLike], placement: Array) -> Array:
    """Spatial inertia (6, 6) of an entry with mass, center and moments in a frame with a placement (4, 4)."""
    about_center = np.array(entry["inertia"])[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
    inertia = pin.Inertia(entry["mass"], np.array(entry["center"]), about_center)
    return np.asarray(pin.SE3(placement).act(inertia).matrix())


def _numbers_of(coordinates: Sequence[Mapping[str, float]], key: str) -> Array:
    """Numbers of coordinates by their key (dof,), infinite where there are none."""
    return np.array([entry.get(key, np.inf) for entry in coordinates], dtype=np.float64)


def read_shapes(path: Path, links: Collection[str], collision: bool = False) -> list[Shape]:
    """Read visual or collision shapes of some links; points are stored on a grid of 65 536 steps."""
    shapes = []
    with np.load(path, allow_pickle=False) as data:
        for i, link in enumerate(data["links"].tolist()):
            if link not in links or data["collision"][i] != collision:
                continue
            *corner, step = data[f"grid_{i}"]
            points = np.array(corner) + step * data[f"points_{i}"]
            triangles = data[f"triangles_{i}"].astype(np.int32)
            shapes.append(Shape(link, (points, triangles), collision))
    return shapes


def read_collision_shapes(path: Path, links: Collection[str]) -> CollisionShapes:
    """Read the collision shapes of some links."""
    return CollisionShapes(read_shapes(path, links, collision=True))
