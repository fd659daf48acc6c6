"""Ten motions of a Panda, transferred to an xArm7 and back: ``python -m benchmarks.robot_teacher``.

How near is the ellipsoid profile that returns to the one that left, and how near is the best constant ellipsoid?
"""

import argparse

import numpy as np

import maniport as mp
from maniport import spd
from maniport.arms import Arm, load_arm
from maniport.arms.collisions import Collisions
from maniport.pipeline import Config
from maniport.util.validation import Array

ROBOTS = ("panda", "xarm7")
DURATION = 3.0  # of a motion [s]
RATE = 50.0  # [Hz]
AMPLITUDE = 0.2  # of sines, as a share of half of a joint's range
TRIALS = 1000  # random motions, of which the first without a collision is taken


def motion(arm: Arm, collisions: Collisions, seed: int) -> Array:
    """Return a smooth random motion (n, dof) within the limits and without collisions."""
    generator = np.random.default_rng(seed)
    time = np.arange(int(DURATION * RATE) + 1) / RATE
    middle = 0.5 * (arm.lower + arm.upper)
    half = 0.5 * (arm.upper - arm.lower)
    for _ in range(TRIALS):
        center = middle + 0.6 * half * generator.uniform(-1.0, 1.0, arm.dof)
        frequencies = generator.uniform(0.8, 2.0, arm.dof)
        phases = generator.uniform(0.0, 2.0 * np.pi, arm.dof)
        q = center + AMPLITUDE * half * np.sin(frequencies * time[:, None] + phases)
        if not np.any(collisions.collides(q)):
            return q
    raise RuntimeError(f"no motion without a collision was found with seed {seed}")


def returned(arm: Arm, other: str, q: Array, seed: int) -> tuple[Array, Array, Array]:
    """Return ellipsoids (n, d, d): of the motion, those that return in its frame, and the constant mean."""
    time = np.arange(len(q)) / RATE
    config = Config(seed=seed, capability="none")
    there = mp.transfer_demonstration(mp.Demonstration.of_arm(arm, q, time), other, config)
    middle = there.arm.motion
    student = mp.Demonstration.of_arm(there.arm.robot, middle.joint_positions, middle.time)
    back = mp.transfer_demonstration(student, arm, config)
    rotation = back.arm.placement.rotation @ there.arm.placement.rotation
    ellipsoids = rotation.T @ back.arm.motion.achieved @ rotation
    original = arm.ellipsoids(q)
    mean = spd.mean(original + damping(arm) * np.eye(3))
    return original, ellipsoids, mean


def damping(arm: Arm) -> float:
    """Return what is added to eigenvalues before ellipsoids are compared, as in transfers."""
    from maniport.arms import VELOCITY
    from maniport.motion.targets import damping_of
    from maniport.util.defaults import DAMPING

    return damping_of(arm, VELOCITY, DAMPING).epsilon


def main() -> None:
    """Print the distances of each motion, and of all together."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robot_teacher", description=__doc__)
    parser.add_argument("--count", type=int, default=10, help="motions")
    options = parser.parse_args()
    arm = load_arm(ROBOTS[0])
    collisions = Collisions.of(arm)
    shift = damping(arm) * np.eye(3)
    back = []
    constant = []
    for seed in range(options.count):
        q = motion(arm, collisions, seed)
        original, ellipsoids, mean = returned(arm, ROBOTS[1], q, seed)
        back.append(spd.distance(original + shift, ellipsoids + shift))
        constant.append(spd.distance(original + shift, np.broadcast_to(mean, original.shape)))
        print(f"motion {seed}: {line(back[-1])}; constant mean {line(constant[-1])}", flush=True)
    print(f"all: {line(np.concatenate(back))}; constant mean {line(np.concatenate(constant))}")


def line(distances: Array) -> str:
    """Return median and 95th percentile."""
    return f"{np.median(distances):.2f} / {np.percentile(distances, 95):.2f}"


if __name__ == "__main__":
    main()
