"""Contact tasks in MuJoCo: a drawer, a lever and a push, which load the hand of a robot along a line.

The servos of a robot follow a part of the path of its joints. Each joint has a rotor of `ROTOR` times its torque limit,
as geared motors have (0.087 and 0.012 kg m² for the Panda), and a position servo that compensates gravity, reaches the
torque limit at an error of 4 mrad (4 mm), and is critically damped for the inertia at the beginning. Shapes are left
out, so that nothing but the load touches the robot.

The pace is the same for all motions: from rest to rest in 1 s with minimum jerk, then 0.3 s at rest.

A task succeeds if the hand stays within 20 mm of its reference, and no joint is at its torque limit for more than
0.1 s without interruption.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms import Arm
from maniport.errors import InvalidInputError
from maniport.live.simulation import model_spec
from maniport.util.optional import mujoco
from maniport.util.validation import Array

STEP = 1e-3  # of the simulation [s]
ROTOR = 1e-3  # rotor inertia per torque limit [kg m² / (N m)]
SATURATION = 4e-3  # error of a servo at which its torque is the limit [rad] or [m]
SATURATED = 0.999  # share of the torque limit that counts as at the limit
LARGEST_ERROR = 0.02  # of the hand [m]
LONGEST_SATURATION = 0.1  # of one joint, without interruption [s]

PULL = 1.0  # time for a drawer or a lever [s]
HOLD = 0.3  # time at rest afterwards, and of a push [s]
TRAVEL = 0.04  # along the line, over which a drawer or a lever is pulled [m]
FRICTION = 0.5  # share of the load of a drawer that is friction; the rest is a spring, at the end of the travel
DRAWER_MASS = 0.5  # [kg]
HANDLE_MASS = 0.05  # [kg]
LEVER = 0.25  # arm of the lever [m]
LEVER_INERTIA = 0.01  # [kg m²]
RAMP = 0.05  # time in which the torque on a lever and a push rise [s]


class Outcome(NamedTuple):
    """What happened in one attempt at a task."""

    error: float  # largest distance of the hand from its reference [m]
    saturation: float  # longest time that a joint was at its torque limit [s]

    @property
    def success(self) -> bool:
        """Whether both are within their limits."""
        return self.error < LARGEST_ERROR and self.saturation <= LONGEST_SATURATION


@dataclass(frozen=True, eq=False)
class Contact:
    """A part of the path of a robot's joints, and the line along which a load acts on the hand.

    Attributes
    ----------
    arm : Arm
        With masses, torque limits, and one joint for each degree of freedom.
    joint_positions : ndarray, shape (n, dof)
        At times that are evenly spaced in the motion [rad] or [m].
    line, bend : ndarray, shape (3,)
        Unit vectors in the base frame: along the line in the sense in which the hand moves, and across it, to the side
        to which the path bends.
    """

    arm: Arm
    joint_positions: Array
    line: Array
    bend: Array

    def pulled(self) -> Array:
        """Return joint positions (steps, dof) at the steps of a simulation, from the first to the last and at rest."""
        time = STEP * np.arange(round((PULL + HOLD) / STEP) + 1)
        elapsed = np.minimum(time / PULL, 1.0)
        progress = 10.0 * elapsed**3 - 15.0 * elapsed**4 + 6.0 * elapsed**5
        given = np.linspace(0.0, 1.0, len(self.joint_positions))
        columns = [np.interp(progress, given, column) for column in self.joint_positions.T]
        return np.stack(columns, axis=1)

    def held(self) -> Array:
        """Return the first joint positions at all steps of a push (steps, dof)."""
        return np.tile(self.joint_positions[0], (round(HOLD / STEP) + 1, 1))


def require_simulated(arm: Arm) -> None:
    """Raise `InvalidInputError` unless an arm has what a simulation needs."""
    limits = arm.effort_limits
    if arm.chain.inertia is None or limits is None or not np.all(np.isfinite(limits)):
        raise InvalidInputError(
            f"a simulation needs masses and torque limits, and {arm.name!r} lacks some"
        )
    if len(arm.chain.joints) != arm.dof or not np.array_equal(arm.chain.coupling, np.eye(arm.dof)):
        raise InvalidInputError(f"{arm.name!r} must have one joint for each degree of freedom")


def robot_spec(arm: Arm) -> Any:
    """Return a specification of a robot with servos, and a body at its hand."""
    mj = mujoco()
    spec = model_spec(arm)
    spec.option.timestep = STEP
    spec.option.integrator = mj.mjtIntegrator.mjINT_IMPLICITFAST
    place = arm.chain.frames[arm.frame].placement
    hand = spec.bodies[-1].add_body(name="hand", pos=place[:3, 3], quat=quaternion(place[:3, :3]))
    set_inertia(hand, 1e-6, 1e-9)
    assert arm.effort_limits is not None
    for i, (joint, limit) in enumerate(zip(spec.joints, arm.effort_limits, strict=True)):
        joint.name = f"joint{i}"
        joint.armature = ROTOR * limit
        joint.actgravcomp = True
        joint.actfrcrange = [-limit, limit]
        joint.actfrclimited = True
        servo = spec.add_actuator(
            name=f"servo{i}", target=joint.name, trntype=mj.mjtTrn.mjTRN_JOINT
        )
        servo.set_to_position(kp=limit / SATURATION)
    return spec


def set_inertia(body: Any, mass: float, inertia: float) -> None:
    """Give a body a mass at its origin [kg], and a moment of inertia that is equal about all axes [kg m²]."""
    body.explicitinertial = True
    body.mass = mass
    body.ipos = np.zeros(3)
    body.inertia = np.full(3, inertia)


def quaternion(rotation: Array) -> Array:
    """Return the quaternion of a rotation, real part first."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


class Simulation:
    """A robot at rest whose servos follow joint positions, and what is attached to its hand.

    Parameters
    ----------
    arm : Arm
    positions : ndarray, shape (steps, dof)
        At each step of the simulation [rad] or [m].
    attach : callable, optional
        Adds bodies to the specification, at a position of the hand.
    """

    def __init__(
        self,
        arm: Arm,
        positions: Array,
        attach: Callable[[Any, Array], None] | None = None,
    ):
        self.mujoco = mujoco()
        self.dof = arm.dof
        self.limits = np.asarray(arm.effort_limits)
        self.hands = arm.forward(positions)[:, :3, 3]
        spec = robot_spec(arm)
        if attach is not None:
            attach(spec, self.hands[0])
        for body in spec.bodies[1:]:
            body.gravcomp = 1.0
        self.model = spec.compile()
        self.data = self.mujoco.MjData(self.model)
        self.data.qpos[: self.dof] = positions[0]
        self.hand = self.model.body("hand").id
        # servos damp the difference from the velocity of the reference
        self.references = positions + self._damp() * np.gradient(positions, STEP, axis=0)

    def _damp(self) -> Array:
        """Damp the servos critically; return the ratios of damping and stiffness (dof,) [s]."""
        model = self.model
        data = self.data
        dof = self.dof
        self.mujoco.mj_forward(model, data)
        inertia = np.empty(dof)
        for i in range(dof):
            unit = np.zeros(model.nv)
            unit[i] = 1.0
            row = np.empty(model.nv)
            self.mujoco.mj_mulM(model, data, row, unit)
            inertia[i] = row[i]
        stiffness = self.limits / SATURATION
        damping = 2.0 * np.sqrt(stiffness * inertia)
        model.actuator_biasprm[:, 2] = -damping
        return damping / stiffness

    def run(self, load: Callable[[float], None]) -> Outcome:
        """Simulate until the end or a failure; `load` applies forces at a time [s]."""
        model = self.model
        data = self.data
        longest = 0.0
        largest = 0.0
        saturated = np.zeros(self.dof)
        for i in range(len(self.references)):
            data.ctrl[:] = self.references[i]
            load(i * STEP)
            error = float(np.linalg.norm(self._hand_position() - self.hands[i]))
            self.mujoco.mj_step(model, data)
            torques = np.abs(data.qfrc_actuator[: self.dof])
            saturated += STEP
            saturated[torques < SATURATED * self.limits] = 0.0
            longest = max(longest, float(saturated.max()))
            largest = max(largest, error)
            if not Outcome(largest, longest).success:
                break
        return Outcome(largest, longest)

    def _hand_position(self) -> Array:
        self.mujoco.mj_kinematics(self.model, self.data)
        return np.asarray(self.data.xpos[self.hand])


def add_handle(spec: Any, body: Any, position: Array) -> None:
    """Add a handle that slides freely along y and z of a drawer or lever, and connect it to the hand."""
    mj = mujoco()
    handle = body.add_body(name="handle", pos=position)
    set_inertia(handle, HANDLE_MASS, 1e-5)
    for axis in ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]):
        handle.add_joint(type=mj.mjtJoint.mjJNT_SLIDE, axis=axis)
    # sites, since bodies would keep the distance that they have at joint positions of zero
    handle.add_site(name="handle")
    spec.body("hand").add_site(name="hand")
    grip = spec.add_equality(
        type=mj.mjtEq.mjEQ_CONNECT,
        objtype=mj.mjtObj.mjOBJ_SITE,
        name1="hand",
        name2="handle",
    )
    grip.solref = [2.0 * STEP, 1.0]
    grip.solimp = [0.99, 0.999, 1e-3, 0.5, 2.0]


def drawer(contact: Contact, load: float) -> Outcome:
    """Pull a drawer along the line, against friction of half the load and a spring that has the rest at the end."""
    mj = mujoco()
    frame = np.stack([contact.line, contact.bend, np.cross(contact.line, contact.bend)], axis=1)

    def attach(spec: Any, hand: Array) -> None:
        body = spec.worldbody.add_body(name="drawer", pos=hand, quat=quaternion(frame))
        set_inertia(body, DRAWER_MASS, 1e-3)
        slide = body.add_joint(name="slide", type=mj.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])
        slide.frictionloss = FRICTION * load
        slide.solref_friction = [2.0 * STEP, 1.0]
        slide.solimp_friction = [0.9999, 0.9999, 1e-3, 0.5, 2.0]  # not viscous at low speed
        spring = (1.0 - FRICTION) * load / TRAVEL
        slide.stiffness = np.array([spring, 0.0, 0.0]) if np.ndim(slide.stiffness) else spring
        add_handle(spec, body, np.zeros(3))

    simulation = Simulation(contact.arm, contact.pulled(), attach)
    return simulation.run(lambda time: None)


def lever(contact: Contact, load: float) -> Outcome:
    """Turn a lever whose hand moves along the line at first, against a torque of the load times the arm."""
    mj = mujoco()
    frame = np.stack([contact.line, -contact.bend, -np.cross(contact.line, contact.bend)], axis=1)

    def attach(spec: Any, hand: Array) -> None:
        pivot = hand + LEVER * contact.bend
        body = spec.worldbody.add_body(name="lever", pos=pivot, quat=quaternion(frame))
        set_inertia(body, 1.0, LEVER_INERTIA)  # its mass is at the pivot, where it does not count
        body.add_joint(name="hinge", type=mj.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, -1.0])
        add_handle(spec, body, np.array([0.0, LEVER, 0.0]))

    simulation = Simulation(contact.arm, contact.pulled(), attach)
    hinge = simulation.model.joint("hinge").dofadr[0]

    def resist(time: float) -> None:
        simulation.data.qfrc_applied[hinge] = -load * LEVER * min(1.0, time / RAMP)

    return simulation.run(resist)


def brace(contact: Contact, load: float) -> Outcome:
    """Hold the first configuration against a push along the line; the worse of both senses counts."""
    outcomes = []
    for sense in (1.0, -1.0):
        simulation = Simulation(contact.arm, contact.held())
        force = sense * load * contact.line

        def push(time: float, simulation: Simulation = simulation, force: Array = force) -> None:
            simulation.data.xfrc_applied[simulation.hand, :3] = force * min(1.0, time / RAMP)

        outcomes.append(simulation.run(push))
    error = max(outcome.error for outcome in outcomes)
    return Outcome(error, max(outcome.saturation for outcome in outcomes))


TASKS = {"drawer": drawer, "lever": lever, "brace": brace}
