"""A robot arm in MuJoCo, built from its description: gravity, torque limits, a servo, and forces on its end effector.

Contacts are left out. Each joint has a rotor of `ROTOR` times its torque limit, as geared motors have (0.087 and
0.012 kg m² for the Panda), and a critically damped position servo that reaches the torque limit at an error of
4 mrad. The servo also compensates gravity, within the same limit.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from maniport.arms import Arm
from maniport.arms.chain import PRISMATIC
from maniport.errors import InvalidInputError
from maniport.util.optional import mujoco
from maniport.util.validation import Array

STEP = 1e-3  # of the simulation [s]
ROTOR = 1e-3  # rotor inertia per torque limit [kg m² / (N m)]


class SimulatedArm:
    """Simulation of one arm with masses and torque limits, and one coordinate for each joint."""

    def __init__(self, arm: Arm, payload: float = 0.0):
        limits, chain = arm.effort_limits, arm.chain
        if chain.inertia is None or limits is None or not np.all(np.isfinite(limits)):
            raise InvalidInputError(f"a simulation needs masses and torque limits, and {arm.name!r} lacks some")
        if len(chain.joints) != arm.dof or not np.array_equal(chain.coupling, np.eye(arm.dof)):
            raise InvalidInputError(f"{arm.name!r} must have one joint for each degree of freedom")
        self.arm, self.limits, self.payload, self.mujoco = arm, np.asarray(limits), payload, mujoco()

    @cached_property
    def with_payload(self) -> "SimulatedArm":
        """The same arm with 1 kg more at its end effector."""
        return SimulatedArm(self.arm, self.payload + 1.0)

    @cached_property
    def model(self) -> Any:
        """Model without geometry."""
        mj, chain, spec = self.mujoco, self.arm.chain, self.mujoco.MjSpec()
        spec.option.timestep, spec.option.gravity = STEP, chain.gravity
        spec.option.integrator = mj.mjtIntegrator.mjINT_IMPLICITFAST
        spec.compiler.balanceinertia = True
        body, bodies = spec.worldbody, []
        for i, (joint, limit) in enumerate(zip(chain.joints, self.limits, strict=True)):
            body = body.add_body(pos=joint.placement[:3, 3], quat=_quaternion(joint.placement))
            kind = mj.mjtJoint.mjJNT_SLIDE if joint.kind == PRISMATIC else mj.mjtJoint.mjJNT_HINGE
            own = body.add_joint(name=f"joint{i}", type=kind, axis=joint.axis, armature=ROTOR * limit)
            own.actgravcomp, own.actfrcrange, own.actfrclimited = True, [-limit, limit], True
            _set_inertia(body, np.asarray(chain.inertia)[i + 1])
            bodies.append(body)
        end_frame = chain.frames[self.arm.frame]
        end = body.add_body(name="end_effector", pos=end_frame.placement[:3, 3], quat=_quaternion(end_frame.placement))
        end.mass, end.ipos, end.inertia = max(self.payload, 1e-6), np.zeros(3), np.full(3, 1e-9)
        end.explicitinertial = True
        for part in (*bodies, end):
            part.gravcomp = 1.0
        for i, limit in enumerate(self.limits):
            stiffness = limit / 4e-3
            servo = spec.add_actuator(name=f"servo{i}", target=f"joint{i}", trntype=mj.mjtTrn.mjTRN_JOINT)
            servo.set_to_position(kp=stiffness, kv=2.0 * np.sqrt(stiffness * ROTOR * limit))
            spec.add_sensor(type=mj.mjtSensor.mjSENS_JOINTACTFRC, objtype=mj.mjtObj.mjOBJ_JOINT, objname=f"joint{i}")
        spec.add_sensor(type=mj.mjtSensor.mjSENS_FRAMEPOS, objtype=mj.mjtObj.mjOBJ_BODY, objname="end_effector")
        return spec.compile()

    def pushed(self, q: Array, forces: Array) -> tuple[Array, Array]:
        """Hold configurations (n, dof) while forces (n, steps, 3) [N] act on the end effector.

        Returns
        -------
        tuple of ndarray, shapes (n, steps, dof) and (n, steps, 3)
            Torques of the motors [N m] and displacements of the end effector [m].
        """
        from mujoco import rollout

        mj, model, (count, steps, _) = self.mujoco, self.model, forces.shape
        data, state = mj.MjData(model), mj.mjtState
        start = np.zeros((count, mj.mj_stateSize(model, state.mjSTATE_FULLPHYSICS)))
        start[:, 1 : 1 + model.nq] = q  # after the time
        wrenches = np.zeros((count, steps, model.nbody, 6))
        wrenches[:, :, model.body("end_effector").id, :3] = forces
        servo = np.broadcast_to(q[:, None], (count, steps, model.nu))
        control = np.concatenate([servo, wrenches.reshape(count, steps, -1)], axis=2)
        parts = int(state.mjSTATE_CTRL) | int(state.mjSTATE_XFRC_APPLIED)
        _, sensed = rollout.rollout(model, data, start, control, control_spec=parts)
        positions = sensed[..., -3:]
        return sensed[..., :-3], positions - self.arm.forward(q)[:, None, :3, 3]

    def torques(self, q: Array, velocity: Array, acceleration: Array) -> Array:
        """Compute the torques (n, dof) [N m] of a motion by MuJoCo's inverse dynamics."""
        mj, model = self.mujoco, self.model
        data, result = mj.MjData(model), np.empty(q.shape)
        model.body_gravcomp[:] = 0.0
        for i, states in enumerate(zip(q, velocity, acceleration, strict=True)):
            data.qpos, data.qvel, data.qacc = states
            mj.mj_inverse(model, data)
            result[i] = data.qfrc_inverse
        model.body_gravcomp[1:] = 1.0
        return result


def _set_inertia(body: Any, inertia: Array) -> None:
    """Set the mass of a body by a spatial inertia (6, 6) about its origin."""
    mass = float(inertia[0, 0])
    across = inertia[3:, :3] / mass  # the cross-product matrix of the center of mass
    center = np.array([across[2, 1], across[0, 2], across[1, 0]])
    about = inertia[3:, 3:] + mass * across @ across
    body.mass, body.ipos, body.explicitinertial = mass, center, True
    body.fullinertia = [about[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _quaternion(pose: Array) -> NDArray[np.float64]:
    """Quaternion of a pose, w first."""
    return np.asarray(Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True))
