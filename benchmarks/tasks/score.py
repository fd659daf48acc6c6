"""The five tasks, scored from joint positions alone, within the torque limits of the robot and against gravity.

Larger scores are better, except for the time of `react` and the displacement of `resist`. MuJoCo simulates an arm that
is built from its description: gravity, torque limits, a servo, and forces on its end effector. Contacts are left out.
Each joint has a rotor of `ROTOR` times its torque limit, as geared motors have (0.087 and 0.012 kg m² for the Panda),
and a critically damped position servo that reaches the torque limit at an error of 4 mrad. The servo also compensates
gravity, within the same limit.
"""

import os
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from benchmarks.tasks.task import MOST_BYTES, Task
from maniport.arms import Arm
from maniport.arms.directional import half_sphere, line_extent, polytope_extent
from maniport.errors import FileFormatError, InvalidInputError
from maniport.evaluation.capability import resemblance
from maniport.live.simulation import model_spec
from maniport.motion import MotionLimits
from maniport.motion.plan.roadmap import moved_to_positions
from maniport.util.input_limits import read_whole
from maniport.util.optional import mujoco
from maniport.util.validation import Array, as_finite, as_times, require_shape

STEP = 1e-3  # of the simulation [s]
ROTOR = 1e-3  # rotor inertia per torque limit [kg m² / (N m)]
YIELD = 5e-3  # displacement at which the end effector has yielded, and largest position error of the path [m]

SCORES = {
    "push": "N", "speed": "m/s", "react": "s", "resist": "mm", "carry": "kg",
    "resemblance_force": "", "resemblance_speed": "",
}  # fmt: skip
"""Scores and their units."""

LESS_IS_BETTER = ("react", "resist")

Scores = Mapping[str, float]
"""By the names of `SCORES`, and the largest ``position_error`` [mm] and shares of velocity and position limits."""


class SimulatedArm:
    """Simulation of one arm with masses and torque limits, and one coordinate for each joint."""

    def __init__(self, arm: Arm, payload: float = 0.0):
        limits, chain = arm.effort_limits, arm.chain
        if chain.inertia is None or limits is None or not np.all(np.isfinite(limits)):
            raise InvalidInputError(
                f"a simulation needs masses and torque limits, and {arm.name!r} lacks some"
            )
        if len(chain.joints) != arm.dof or not np.array_equal(chain.coupling, np.eye(arm.dof)):
            raise InvalidInputError(f"{arm.name!r} must have one joint for each degree of freedom")
        self.arm, self.limits, self.payload, self.mujoco = (
            arm,
            np.asarray(limits),
            payload,
            mujoco(),
        )

    @cached_property
    def model(self) -> Any:
        """Model without geometry."""
        mj, spec, place = (
            self.mujoco,
            model_spec(self.arm),
            self.arm.chain.frames[self.arm.frame].placement,
        )
        spec.option.timestep, spec.option.integrator = STEP, mj.mjtIntegrator.mjINT_IMPLICITFAST
        quaternion = Rotation.from_matrix(place[:3, :3]).as_quat(scalar_first=True)
        end = spec.bodies[-1].add_body(
            name="end_effector", pos=place[:3, 3], quat=quaternion, explicitinertial=True
        )
        end.mass, end.ipos, end.inertia = max(self.payload, 1e-6), np.zeros(3), np.full(3, 1e-9)
        for body in spec.bodies[1:]:
            body.gravcomp = 1.0
        for i, (joint, limit) in enumerate(zip(spec.joints, self.limits, strict=True)):
            joint.name, joint.armature = f"joint{i}", ROTOR * limit
            joint.actgravcomp, joint.actfrcrange, joint.actfrclimited = True, [-limit, limit], True
            stiffness = limit / 4e-3
            servo = spec.add_actuator(
                name=f"servo{i}", target=joint.name, trntype=mj.mjtTrn.mjTRN_JOINT
            )
            servo.set_to_position(kp=stiffness, kv=2.0 * np.sqrt(stiffness * ROTOR * limit))
            spec.add_sensor(
                type=mj.mjtSensor.mjSENS_JOINTACTFRC,
                objtype=mj.mjtObj.mjOBJ_JOINT,
                objname=joint.name,
            )
        spec.add_sensor(
            type=mj.mjtSensor.mjSENS_FRAMEPOS, objtype=mj.mjtObj.mjOBJ_BODY, objname="end_effector"
        )
        return spec.compile()

    def pushed(self, q: Array, forces: Array) -> tuple[Array, Array]:
        """Hold configurations (n, dof) while forces (n, steps, 3) [N] act on the end effector.

        Returns torques of the motors (n, steps, dof) [N m] and displacements of the end effector (n, steps, 3) [m].
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
        return sensed[..., :-3], sensed[..., -3:] - self.arm.forward(q)[:, None, :3, 3]

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


_simulated = lru_cache(4)(SimulatedArm)


def score(task: Task, q: Array) -> Scores:
    """Score joint positions (n, dof) at the waypoints of a task [rad] or [m], by medians over the instants.

    A task that a robot cannot do at all scores 0, or infinity where less is better.
    """
    arm, positions = task.arm, as_finite(q, "q")
    require_shape(positions, "q", (len(task.time), arm.dof))
    simulated, own, u = _simulated(arm), positions[task.instants], half_sphere()
    errors = np.linalg.norm(arm.forward(positions)[:, :3, 3] - task.path, axis=1)
    middle, half = 0.5 * (arm.upper + arm.lower), 0.5 * (arm.upper - arm.lower)
    return {
        "push": float(np.median(push(simulated, own, task.force_directions))),
        "speed": float(np.median(_extents(arm, own, task.speed_directions, "velocity"))),
        "react": float(np.median(react(simulated, own, task.speed_directions))),
        "resist": float(np.median(resist(simulated, own, task.force_directions))),
        "carry": carry(simulated, task.time, positions),
        "resemblance_force": resemblance(line_extent(arm, own, u, "force"), task.person_force),
        "resemblance_speed": resemblance(line_extent(arm, own, u, "velocity"), task.person_speed),
        "position_error": 1e3 * float(errors.max()),
        "velocity_share": velocity_share(arm, task.time, positions),
        "position_share": float((np.abs(positions - middle) / half).max()),
    }


def is_valid(scores: Scores) -> bool:
    """Return whether a motion follows the path within the limits of its joints."""
    within = max(scores["velocity_share"], scores["position_share"]) <= 1.0 + 1e-9
    return within and scores["position_error"] <= 1e3 * YIELD


def _extents(arm: Arm, q: Array, directions: Array, kind: str = "force") -> Array:
    """Largest force or speed of configurations (n, dof), each along its own direction, (n,) [N] or [m/s]."""
    return np.array(
        [polytope_extent(arm, q[i], directions[i : i + 1], kind)[0, 0] for i in range(len(q))]
    )


def push(simulated: SimulatedArm, q: Array, directions: Array) -> Array:
    """Push along lines until a motor saturates or the end effector yields; the weaker sense counts, (n,) [N].

    The force grows by that of the linear program in 0.4 s, at most by half of it more.
    """
    n, ramp, weaker = len(q), np.arange(0.0, 1.5, STEP / 0.4), np.full(len(q), np.inf)
    for u in (directions, -directions):
        largest = _extents(simulated.arm, q, u)
        forces = np.where(np.isfinite(largest), largest, 0.0)[:, None] * ramp
        torques, moved = simulated.pushed(
            q, -forces[..., None] * u[:, None]
        )  # the reaction acts on the arm
        ended = np.any(np.abs(torques) >= 0.999 * simulated.limits, axis=2) | (
            np.linalg.norm(moved, axis=2) > YIELD
        )
        last = np.where(ended.any(axis=1), ended.argmax(axis=1), len(ramp) - 1)
        weaker = np.minimum(weaker, forces[np.arange(n), last])
    return weaker


def resist(
    simulated: SimulatedArm,
    q: Array,
    directions: Array,
    impulse: float = 5.0,
    duration: float = 0.01,
) -> Array:
    """Hold configurations against an impulse [N s]; the larger peak displacement of both senses counts, (n,) [mm]."""
    forces, peaks = np.zeros((len(q), 300, 3)), np.zeros(len(q))
    for u in (directions, -directions):
        forces[:, : round(duration / STEP)] = impulse / duration * u[:, None]
        peaks = np.maximum(
            peaks, np.linalg.norm(simulated.pushed(q, forces)[1], axis=2).max(axis=1)
        )
    return 1e3 * peaks


def react(
    simulated: SimulatedArm, q: Array, directions: Array, distance: float = 0.1, steps: int = 20
) -> Array:
    """Move along a line from rest to rest within velocity, acceleration and torque limits; the slower sense, (n,) [s].

    The line is followed by the pseudoinverse with a minimum-jerk profile. In T times the time, velocities are 1 / T,
    and accelerations and torques without gravity 1 / T² times as large: the limits determine the shortest time.
    """
    arm, limits, slower = (
        simulated.arm,
        MotionLimits.of(simulated.arm, joint_limit_margin=0.0),
        np.zeros(len(q)),
    )
    share = np.linspace(0.0, 1.0, steps + 1)  # of the line
    s = np.linspace(0.0, 1.0, 2 * steps + 1)  # of the time
    profile = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
    first, second = 30.0 * (s * (1.0 - s)) ** 2, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
    start = arm.forward(q)[:, :3, 3]
    for u in (directions, -directions):
        line, reached = [q], np.ones(len(q), dtype=bool)
        for part in share[1:]:
            moved, error = moved_to_positions(arm, line[-1], start + part * distance * u)
            line.append(moved)
            reached &= error < 1e-3
        path = CubicSpline(share, np.stack(line, axis=1), axis=1)
        at, slope, curvature = (path(profile, order) for order in range(3))
        motion = (
            at,
            slope * first[:, None],
            curvature * first[:, None] ** 2 + slope * second[:, None],
        )
        states = [values.reshape(-1, arm.dof) for values in motion]
        held = simulated.torques(states[0], 0.0 * states[1], 0.0 * states[2])
        moving = simulated.torques(*states) - held
        left = np.maximum(limits.effort - np.sign(moving) * held, 1e-9)
        squares = np.maximum(np.abs(moving) / left, np.abs(states[2]) / limits.acceleration)
        times = (
            np.maximum(np.abs(states[1]) / limits.velocity, np.sqrt(squares))
            .reshape(len(q), -1)
            .max(axis=1)
        )
        slower = np.maximum(slower, np.where(reached, times, np.inf))
    return slower


def carry(simulated: SimulatedArm, time: Array, q: Array, per_waypoint: int = 4) -> float:
    """Compute the largest payload along the whole path [kg], a point mass at the end effector.

    Torques are linear in the payload, so that two evaluations determine it.
    """
    motion = CubicSpline(time, q)
    finer = np.interp(
        np.arange(per_waypoint * (len(time) - 1) + 1) / per_waypoint, np.arange(len(time)), time
    )
    states = [motion(finer, order) for order in range(3)]
    empty = simulated.torques(*states)
    per_mass = _simulated(simulated.arm, simulated.payload + 1.0).torques(*states) - empty
    left = simulated.limits - np.sign(per_mass) * empty
    return max(0.0, float((left / np.maximum(np.abs(per_mass), 1e-9)).min()))


def velocity_share(arm: Arm, time: Array, q: Array) -> float:
    """Largest share of a velocity limit between waypoints (n, dof) at times (n,)."""
    assert arm.velocity_limits is not None
    return float((np.abs(np.diff(q, axis=0)) / np.diff(time)[:, None] / arm.velocity_limits).max())


def read_motion(path: str | os.PathLike[str], task: Task) -> Array:
    """Read joint positions from a CSV file, and interpolate them linearly at the times of a task; shape (n, dof).

    The first line has the names of `Task.columns`, as in files that `maniport` writes; other columns are ignored.
    """
    head, *lines = read_whole(path, (".csv",), MOST_BYTES).decode(
        "utf-8", "replace"
    ).splitlines() or [""]
    names = [name.strip() for name in head.split(",")]
    if missing := [name for name in task.columns if name not in names]:
        raise FileFormatError(f"{path}: missing columns: {', '.join(missing)}")
    try:
        table = np.array(
            [[float(cell) for cell in line.split(",")] for line in lines if line.strip()]
        )
        columns = as_finite(table, "values")[:, [names.index(name) for name in task.columns]]
        time = as_times(columns[:, 0], "time_s", fewest=2)
        if time[0] > task.time[0] + 1e-6 or time[-1] < task.time[-1] - 1e-6:
            span = f"{task.time[0]:g} to {task.time[-1]:g} s"
            raise InvalidInputError(
                f"time_s must cover {span}; found {time[0]:g} to {time[-1]:g} s"
            )
    except (ValueError, IndexError) as error:
        raise FileFormatError(f"{path}: {error}") from None
    return np.stack([np.interp(task.time, time, column) for column in columns[:, 1:].T], axis=1)
