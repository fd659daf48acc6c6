"""Arms from robot models that a program holds: of Pinocchio, MuJoCo and yourdfpy."""

import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from maniport.arms.arm import Arm
from maniport.arms.chain import (
    PRISMATIC,
    REVOLUTE,
    Chain,
    CollisionShapes,
    Contact,
    ContactRules,
    Shape,
    moved_inertia,
)
from maniport.arms.loaders import mjcf, urdf
from maniport.arms.loaders.document import MeshPaths, body_inertia
from maniport.arms.loaders.model import Follower, RobotBody, RobotModel
from maniport.arms.loaders.serial import chain_to
from maniport.arms.meshes import moved, moved_points, solid, solid_core
from maniport.arms.restriction import restrict
from maniport.errors import FileFormatError, InvalidInputError
from maniport.util.validation import Array

if TYPE_CHECKING:
    import mujoco
    import yourdfpy

KINDS = "pinocchio.Model, mujoco.MjModel or yourdfpy.URDF"
FREE_FLYER = "JointModelFreeFlyer"
MIMIC = "JointModelMimic"
UNIVERSE = "universe"  # root of Pinocchio's models
EXCLUDE_SHIFT = 16  # MuJoCo's signature of a pair of bodies is (first << 16) + second


@dataclass(frozen=True, eq=False)
class HeldShapes:
    """Shapes of the links of a robot in memory."""

    visual: tuple[Shape, ...] = ()
    collision: tuple[Shape, ...] = ()
    missing: Mapping[str, str] = field(default_factory=dict)  # by link, why a shape is not there
    rules: ContactRules | None = None

    def drawn(self, links: Collection[str]) -> list[Shape]:
        """Return the visual shapes of some links, and the collision shapes of those without any."""
        with_visual = {shape.link for shape in self.visual}
        chosen = [shape for shape in self.visual if shape.link in links]
        for shape in self.collision:
            if shape.link in links and shape.link not in with_visual:
                chosen.append(shape)
        return chosen

    def checked(self, links: Collection[str]) -> CollisionShapes:
        """Return the collision shapes of some links, and the visual shapes of those without any."""
        with_collision = {shape.link for shape in self.collision}
        chosen = [shape for shape in self.collision if shape.link in links]
        for shape in self.visual:
            if shape.link in links and shape.link not in with_collision:
                chosen.append(shape)
        missing = {link: reason for link, reason in self.missing.items() if link in links}
        return CollisionShapes(chosen, missing, rules=self.rules)


def arm_of(
    model: "pin.Model | mujoco.MjModel | yourdfpy.URDF",
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    lock: Mapping[str, float] | None = None,
) -> Arm:
    """Make an arm from a robot model in memory; see `maniport.Arm.of`."""
    if isinstance(model, pin.Model):
        robot = _of_pinocchio(model, frame)
        shapes = None
        gravity = model.gravity.linear
    elif _is_of(model, "mujoco", "MjModel"):
        robot = _of_mujoco(model)
        shapes = _mujoco_shapes(model, robot)
        gravity = np.array(model.opt.gravity)
    elif _is_of(model, "yourdfpy", "URDF"):
        robot, shapes = _of_yourdfpy(model)
        gravity = np.array(Chain.gravity)
    else:
        raise InvalidInputError(f"model must be a {KINDS}; found {type(model).__name__}")

    chain = chain_to(robot, frame, joints)
    chain = replace(
        chain,
        gravity=tuple(np.asarray(gravity, dtype=np.float64).tolist()),
        shapes=None if shapes is None else shapes.drawn,
        collision_shapes=None if shapes is None else shapes.checked,
    )
    chain = restrict(chain, frame, joints, base, lock)
    for name, low, high in zip(chain.coordinates, chain.lower, chain.upper, strict=True):
        if not low > -np.inf or not high < np.inf:
            raise InvalidInputError(
                f"model: the prismatic joint {name!r} of {robot.name!r} has no limits; set them in the "
                "model, or exclude the joint with joints= or lock="
            )
    return Arm(chain)


def _is_of(model: object, package: str, kind: str) -> bool:
    """Whether an object is of a class of a package, which is not imported for that."""
    module = sys.modules.get(package)
    return module is not None and isinstance(model, getattr(module, kind))


def _of_pinocchio(model: pin.Model, wanted: str | None) -> RobotModel:
    """Read a model of Pinocchio, whose bodies are its frames of the type BODY."""
    robot = RobotModel(Path(f"pinocchio.Model {model.name!r}"), model.name, urdf.shapes)
    robot.bodies[UNIVERSE] = RobotBody(UNIVERSE, None, np.eye(4), inertia=np.zeros((6, 6)))
    tree = _PinocchioTree(model, robot)
    for number in range(model.njoints):
        frames = tree.frames.get(number, [])
        if number:
            bodies = [i for i in frames if model.frames[i].type == pin.BODY]
            first = bodies[0] if bodies else None
            body = _moving_body(robot, model, number, first, tree)
            robot.bodies[body.name] = body
            tree.carriers[number] = body.name
            tree.placed[body.name] = body.placement
        for i in frames:
            tree.add_frame(i, number, wanted)
        body = robot.bodies[tree.carriers[number]]
        to_body = np.asarray(np.linalg.inv(tree.placed[body.name]))
        inertia = moved_inertia(model.inertias[number].matrix(), to_body)
        robot.bodies[body.name] = replace(body, inertia=inertia)
    return robot


class _PinocchioTree:
    """Bodies of a robot that were read from a model of Pinocchio so far.

    Attributes
    ----------
    frames : dict of int to list of int
        Indices of the frames on each joint.
    owners : dict of int to str
        Body of each frame, by its index.
    carriers : dict of int to str
        Body that each joint moves.
    placed : dict of str to ndarray, shape (4, 4)
        Pose of each body in the frame of its joint.
    """

    def __init__(self, model: pin.Model, robot: RobotModel):
        self.model = model
        self.robot = robot
        self.owners: dict[int, str] = {0: UNIVERSE}
        self.placed: dict[str, Array] = {UNIVERSE: np.eye(4)}
        self.carriers: dict[int, str] = {0: UNIVERSE}
        self.frames: dict[int, list[int]] = {}
        for index, frame in enumerate(model.frames):
            self.frames.setdefault(frame.parentJoint, []).append(index)

    def add_frame(self, index: int, joint: int, wanted: str | None) -> None:
        """Add a frame on a joint: a body, or a site where it is for operations or wanted."""
        frame = self.model.frames[index]
        moving = self.carriers[joint]
        above = self.owners.get(frame.parentFrame, moving)
        parent_joint = self.model.frames[frame.parentFrame].parentJoint
        if frame.parentFrame == index or parent_joint != joint:
            above = moving
        placement = frame.placement.homogeneous
        relative = np.linalg.inv(self.placed[above]) @ placement
        is_site = frame.type == pin.OP_FRAME or frame.name == wanted
        if frame.type == pin.BODY and frame.name != moving:
            body = RobotBody(frame.name, above, relative, inertia=np.zeros((6, 6)))
            self.robot.bodies[frame.name] = body
            self.placed[frame.name] = placement
            above = frame.name
        elif is_site and frame.name not in self.robot.bodies:
            self.robot.sites[frame.name] = (above, relative)
        self.owners[index] = above


def _moving_body(
    robot: RobotModel,
    model: pin.Model,
    number: int,
    first: int | None,
    tree: _PinocchioTree,
) -> RobotBody:
    """Return the body that a joint of Pinocchio moves; without a frame of a body it has the joint's name."""
    name = model.names[number]
    body_name = name
    placement = np.eye(4)
    if first is not None:
        body_name = model.frames[first].name
        placement = model.frames[first].placement.homogeneous
    parent = tree.carriers[model.parents[number]]
    if model.existFrame(name, pin.JOINT):
        frame = model.frames[model.getFrameId(name, pin.JOINT)]
        parent = tree.owners.get(frame.parentFrame, parent)
    at = np.linalg.inv(tree.placed[parent]) @ model.jointPlacements[number].homogeneous

    joint = model.joints[number]
    kind = joint.shortname()
    if kind == FREE_FLYER:
        return RobotBody(body_name, parent, at @ placement)
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    motion = np.asarray(data.S, dtype=np.float64).reshape(6, -1)
    slides = np.any(motion[:3])
    turns = np.any(motion[3:])
    if motion.shape[1] != 1 or slides == turns:
        return RobotBody(body_name, parent, at @ placement, blocked=kind)

    if slides:
        axis = motion[:3, 0]
    else:
        axis = motion[3:, 0]
    bounds = (-np.inf, np.inf)
    speed = np.inf
    effort = np.inf
    armature = 0.0
    if kind == MIMIC:
        rule = joint.extract()
        axis = axis / rule.scaling
        leader = _joint_at(model, joint.idx_q)
        robot.followers[name] = Follower(leader, float(rule.scaling), float(rule.offset))
    else:
        if joint.nq == 1:  # continuous joints have the cosine and the sine of the angle
            low = float(model.lowerPositionLimit[joint.idx_q])
            bounds = (low, float(model.upperPositionLimit[joint.idx_q]))
        speed = float(model.velocityLimit[joint.idx_v])
        effort = float(model.effortLimit[joint.idx_v])
        armature = float(model.armature[joint.idx_v])
    moving = robot.joint(
        name, PRISMATIC if slides else REVOLUTE, axis, at, bounds, speed, effort, armature
    )
    return RobotBody(body_name, parent, placement, (moving,))


def _joint_at(model: pin.Model, index: int) -> str:
    """Return the name of the joint that has a coordinate of its own at an index of configurations."""
    for name, joint in zip(model.names, model.joints, strict=True):
        if joint.nq and joint.idx_q == index:
            return str(name)
    raise LookupError(f"no joint of {model.name!r} has the coordinate {index}")


def _of_yourdfpy(model: "yourdfpy.URDF") -> tuple[RobotModel, HeldShapes]:
    """Read a model of yourdfpy by its description, in which its names of meshes are those of files."""
    path = Path(f"yourdfpy.URDF {model.robot.name!r}")
    root = ElementTree.fromstring(model.write_xml_string())
    robot = urdf.read(path, root)
    folders = set[Path]()
    for mesh in root.iter("mesh"):
        file = Path(mesh.get("filename", "")).absolute()
        mesh.set("filename", str(file))
        folders.add(file.parent)
    declared, _ = urdf.shapes(path, root, robot.bodies, MeshPaths(path, tuple(sorted(folders))))
    visual = []
    collision = []
    missing: dict[str, str] = {}
    for declared_shape in declared:
        try:
            shape = declared_shape.make()
        except FileFormatError as error:
            missing[declared_shape.link] = str(error)
            continue
        if declared_shape.collision:
            collision.append(shape)
        else:
            visual.append(shape)
    return robot, HeldShapes(tuple(visual), tuple(collision), missing)


def _pose(position: Array, quaternion: Array) -> Array:
    """Return the pose (4, 4) of a position (3,) [m] and a quaternion (4,), w first."""
    w, x, y, z = (quaternion / np.linalg.norm(quaternion)).tolist()
    matrix = np.eye(4)
    matrix[:3, :3] = pin.Quaternion(w, x, y, z).toRotationMatrix()
    matrix[:3, 3] = position
    return matrix


def _names(model: "mujoco.MjModel", kind: str, count: int) -> list[str]:
    """Return the names of the bodies, joints or sites of a model; those without one are numbered."""
    accessor = getattr(model, kind)
    names = []
    for i in range(count):
        names.append(accessor(i).name or f"{kind}{i}")
    return names


def _of_mujoco(model: "mujoco.MjModel") -> RobotModel:
    """Read a compiled model of MuJoCo; free joints are at rest, as in an MJCF."""
    from mujoco import mjtJoint

    name = model.names[: model.names.index(b"\0")].decode(errors="replace")
    robot = RobotModel(Path(f"mujoco.MjModel {name!r}"), name, mjcf.shapes)
    bodies = _names(model, "body", model.nbody)
    joint_names = _names(model, "joint", model.njnt)
    robot.bodies[bodies[0]] = RobotBody(bodies[0], None, np.eye(4), inertia=np.zeros((6, 6)))
    for number in range(1, model.nbody):
        parent = bodies[model.body_parentid[number]]
        placement = _pose(model.body_pos[number], model.body_quat[number])
        moments = [*model.body_inertia[number].tolist(), 0.0, 0.0, 0.0]
        at_center = _pose(model.body_ipos[number], model.body_iquat[number])
        where = f"{robot.path}: body {bodies[number]!r}"
        inertia = body_inertia(where, float(model.body_mass[number]), moments, at_center)
        first = int(model.body_jntadr[number])
        indices = range(first, first + int(model.body_jntnum[number]))
        kinds = [int(model.jnt_type[i]) for i in indices]
        if int(mjtJoint.mjJNT_BALL) in kinds:
            blocked = RobotBody(bodies[number], parent, placement, blocked="ball", inertia=inertia)
            robot.bodies[bodies[number]] = blocked
            continue
        joints = []
        for i, kind in zip(indices, kinds, strict=True):
            if kind == int(mjtJoint.mjJNT_FREE):
                continue
            at = np.eye(4)
            at[:3, 3] = model.jnt_pos[i]
            low = -np.inf
            high = np.inf
            if model.jnt_limited[i]:
                low, high = model.jnt_range[i].tolist()
            moving = robot.joint(
                joint_names[i],
                PRISMATIC if kind == int(mjtJoint.mjJNT_SLIDE) else REVOLUTE,
                np.array(model.jnt_axis[i]),
                placement @ at,
                (low, high),
                effort=_mujoco_effort(model, i),
                armature=float(model.dof_armature[model.jnt_dofadr[i]]),
            )
            rest = moving.motion(-float(model.qpos0[model.jnt_qposadr[i]]))
            joints.append(replace(moving, placement=moving.placement @ rest))
            placement = np.asarray(np.linalg.inv(at), dtype=np.float64)
        robot.bodies[bodies[number]] = RobotBody(
            bodies[number], parent, placement, tuple(joints), inertia=inertia
        )

    for i, site in enumerate(_names(model, "site", model.nsite)):
        owner = bodies[model.site_bodyid[i]]
        robot.sites.setdefault(site, (owner, _pose(model.site_pos[i], model.site_quat[i])))
    _add_mujoco_followers(robot, model, joint_names)
    return robot


def _add_mujoco_followers(
    robot: RobotModel, model: "mujoco.MjModel", joint_names: Sequence[str]
) -> None:
    """Add the joints that equality constraints of a model bind to others or fix."""
    from mujoco import mjtEq

    for i in range(model.neq):
        if int(model.eq_type[i]) != int(mjtEq.mjEQ_JOINT) or not model.eq_active0[i]:
            continue
        follower = int(model.eq_obj1id[i])
        leader = int(model.eq_obj2id[i])
        c = model.eq_data[i][:5]
        rest = model.qpos0[model.jnt_qposadr[follower]]
        if leader < 0:
            rule = Follower(None, float(c[1]), float(c[0] + rest), not np.any(c[2:]))
        else:
            offset = c[0] + rest - c[1] * model.qpos0[model.jnt_qposadr[leader]]
            rule = Follower(joint_names[leader], float(c[1]), float(offset), not np.any(c[2:]))
        robot.followers[joint_names[follower]] = rule


def _mujoco_effort(model: "mujoco.MjModel", joint: int) -> float:
    """Largest torque [N m] or force [N] of a joint and of all its actuators, in the weaker direction."""
    from mujoco import mjtBias, mjtTrn

    limit = np.inf
    if model.jnt_actfrclimited[joint]:
        limit = float(np.abs(model.jnt_actfrcrange[joint]).min())
    on_joints = (int(mjtTrn.mjTRN_JOINT), int(mjtTrn.mjTRN_JOINTINPARENT))
    actuators = []
    for i in range(model.nu):
        on_joint = int(model.actuator_trntype[i]) in on_joints
        if on_joint and model.actuator_trnid[i][0] == joint:
            actuators.append(i)
    if not actuators:
        return limit
    total = 0.0
    for i in actuators:
        force = np.inf
        if model.actuator_forcelimited[i]:
            force = float(np.abs(model.actuator_forcerange[i]).min())
        is_plain = int(model.actuator_biastype[i]) == int(mjtBias.mjBIAS_NONE)
        if is_plain and model.actuator_ctrllimited[i]:
            gain = abs(float(model.actuator_gainprm[i][0]))
            force = min(force, gain * float(np.abs(model.actuator_ctrlrange[i]).min()))
        total += abs(float(model.actuator_gear[i][0])) * force
    return min(total, limit)


def _mujoco_shapes(model: "mujoco.MjModel", robot: RobotModel) -> HeldShapes:
    """Return the geoms of a model: those with contacts are collision shapes, the others visual."""
    from mujoco import mjtGeom

    bodies = _names(model, "body", model.nbody)
    kinds = {
        int(mjtGeom.mjGEOM_SPHERE): "sphere",
        int(mjtGeom.mjGEOM_CAPSULE): "capsule",
        int(mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
        int(mjtGeom.mjGEOM_CYLINDER): "cylinder",
        int(mjtGeom.mjGEOM_BOX): "box",
        int(mjtGeom.mjGEOM_PLANE): "plane",
        int(mjtGeom.mjGEOM_MESH): "mesh",
    }
    pairs = set()
    for i in range(model.npair):
        pairs.add(frozenset((int(model.pair_geom1[i]), int(model.pair_geom2[i]))))
    paired = set[int]().union(*pairs)
    visual = []
    hidden = []
    collision = []
    missing: dict[str, str] = {}
    for i in range(model.ngeom):
        link = bodies[model.geom_bodyid[i]]
        kind = kinds.get(int(model.geom_type[i]))
        contype = int(model.geom_contype[i])
        conaffinity = int(model.geom_conaffinity[i])
        touches = bool(contype or conaffinity or i in paired)
        is_plane = kind == "plane"
        if is_plane and not touches:
            continue
        if kind is None:
            missing[link] = f"a geom of the type {int(model.geom_type[i])} is not supported"
            continue
        contact = None
        if touches:
            contact = Contact(link, i, contype, conaffinity, is_plane)
        shape = _mujoco_shape(model, i, kind, link, contact)
        if touches:
            collision.append(shape)
        elif model.geom_group[i] > mjcf.LAST_DRAWN_GROUP:
            hidden.append(shape)
        else:
            visual.append(shape)
    drawn = {shape.link for shape in visual}
    visual += [shape for shape in hidden if shape.link not in drawn]
    rules = _mujoco_rules(model, bodies, frozenset(pairs))
    return HeldShapes(tuple(visual), tuple(collision), missing, rules)


def _mujoco_rules(
    model: "mujoco.MjModel", bodies: Sequence[str], explicit: frozenset[frozenset[int]]
) -> ContactRules:
    """Return the contacts that a model excludes; `explicit` are the pairs of geoms that touch in any case."""
    from mujoco import mjtDisableBit

    carriers = {}
    parents = {}
    for i, body in enumerate(bodies):
        welded = int(model.body_weldid[i])
        carriers[body] = bodies[welded]
        above = int(model.body_parentid[welded])
        parents[bodies[welded]] = bodies[model.body_weldid[above]]
    excluded = _excluded_pairs(model.exclude_signature.tolist(), bodies)
    disabled = int(model.opt.disableflags)
    return ContactRules(
        carriers,
        parents,
        bodies[0],
        excluded,
        explicit,
        filter_parents=not disabled & int(mjtDisableBit.mjDSBL_FILTERPARENT),
        enabled=not disabled & int(mjtDisableBit.mjDSBL_CONTACT),
    )


def _excluded_pairs(signatures: Iterable[int], bodies: Sequence[str]) -> frozenset[frozenset[str]]:
    """Return the pairs of bodies of MuJoCo's signatures."""
    pairs = set()
    for signature in signatures:
        first = signature >> EXCLUDE_SHIFT
        second = signature & ((1 << EXCLUDE_SHIFT) - 1)
        pairs.add(frozenset((bodies[first], bodies[second])))
    return frozenset(pairs)


def _mujoco_shape(
    model: "mujoco.MjModel", geom: int, kind: str, link: str, contact: Contact | None
) -> Shape:
    """Return the shape of a geom in the frame of its body; a mesh with contacts is its convex hull."""
    placement = _pose(model.geom_pos[geom], model.geom_quat[geom])
    if kind == "mesh":
        number = int(model.geom_dataid[geom])
        start = int(model.mesh_vertadr[number])
        points = model.mesh_vert[start : start + int(model.mesh_vertnum[number])]
        first = int(model.mesh_faceadr[number])
        triangles = model.mesh_face[first : first + int(model.mesh_facenum[number])]
        mesh = moved(
            (np.array(points, dtype=np.float64), np.array(triangles, dtype=np.int32)), placement
        )
        if contact is None:
            return Shape(link, mesh)
        core = mesh[0][np.unique(mesh[1])]
        return Shape(link, mesh, True, core, 0.0, contact)
    if kind == "plane":
        placement = placement @ mjcf.PLANE_PLACEMENT
        kind = "box"
        sizes = list(mjcf.PLANE_SIZES)
    else:
        factors = np.array(mjcf.SIZES[kind])
        sizes = (factors * model.geom_size[geom][: len(factors)]).tolist()
    core, radius = solid_core(kind, *sizes)
    mesh = moved(solid(kind, *sizes), placement)
    return Shape(link, mesh, contact is not None, moved_points(core, placement), radius, contact)
