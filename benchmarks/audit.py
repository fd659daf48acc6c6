"""Faults that are planted in motions of robots, and whether an audit finds them: ``python -m benchmarks.audit``.

MuJoCo judges: a motion is clean where it finds no contact, and limits of positions, velocities, accelerations and
torques are kept with a margin. Each faulty motion has one planted kind of fault and none of the others.
"""

import argparse
import json
import os
import sys
import tempfile
import time as clock
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maniport.arms import Arm, load_arm
from maniport.arms.loaders.packages import find_robot
from maniport.audit import KINDS
from maniport.datasets.lerobot import STATE, Episode, Feature, write_lerobot
from maniport.util.optional import mujoco
from maniport.util.validation import Array

ROBOTS = ("robosuite/panda", "sawyer", "robosuite/xarm7")
RATE = 50  # of the motions [Hz]
FRAMES = 500  # of a motion
CLEAR = 0.9  # share of all limits that motions without a fault keep
PLANTED = 1.15  # share of a limit that a planted fault exceeds
FAULTY = 0.5  # share of the motions
TRIALS = 400  # candidates for one motion
TOUCH = 2e-3  # distance or depth within which hulls of meshes may differ [m]


@dataclass(frozen=True, eq=False)
class Judge:
    """A robot with stated limits, and MuJoCo's model of it."""

    arm: Arm
    model: object
    touching: frozenset[tuple[int, int]]  # bodies that touch at most postures
    velocity: Array  # (dof,) [rad/s]
    acceleration: Array
    effort: Array

    @classmethod
    def of(cls, arm: Arm, path: Path) -> "Judge":
        """Read the model, and state limits that some postures exceed at rest."""
        model = mujoco().MjModel.from_xml_path(str(path))
        model.dof_damping[:] = 0.0
        model.dof_frictionloss[:] = 0.0
        model.geom_margin[:] = TOUCH
        torques = np.abs(arm.gravity_torques(arm.sample(1024, 0)))
        effort = np.maximum(0.75 * np.quantile(torques, 0.98, axis=0), 5.0)
        velocity = np.full(arm.dof, 2.0) + 0.1 * np.arange(arm.dof)
        touching = _touching_bodies(arm, model)
        return cls(arm, model, touching, velocity, 8.0 * velocity, effort)

    def limits(self) -> dict[str, object]:
        """Return the content of a file for ``--limits``."""
        joints = {}
        for i, name in enumerate(self.arm.joint_names):
            joints[name] = {
                "velocity": float(self.velocity[i]),
                "acceleration": float(self.acceleration[i]),
                "effort": float(self.effort[i]),
            }
        return {"joints": joints}

    def shares(self, q: Array) -> dict[str, float]:
        """Return the largest share of each limit, of a position beyond a limit in units of 5 cm or 0.05 rad."""
        step = 1.0 / RATE
        velocities = np.gradient(q, step, axis=0)
        accelerations = np.zeros_like(q)
        accelerations[1:-1] = np.diff(q, 2, axis=0) / step**2
        beyond = np.maximum(q - self.arm.upper, self.arm.lower - q)
        collides, torques = self._simulated(q, velocities, accelerations)
        return {
            "position": 1.0 + float(beyond.max()) / 0.05,
            "velocity": float((np.abs(velocities) / self.velocity).max()),
            "acceleration": float((np.abs(accelerations) / self.acceleration).max()),
            "torque": float((np.abs(torques) / self.effort).max()),
            "collision": collides,
        }

    def _simulated(self, q: Array, velocities: Array, accelerations: Array) -> tuple[float, Array]:
        """Return the contacts of a motion, 2 for deep ones and 1 for near ones, and its torques (n, dof) by MuJoCo."""
        package = mujoco()
        data = package.MjData(self.model)
        places = [self.model.joint(name).qposadr[0] for name in self.arm.joint_names]
        rates = [self.model.joint(name).dofadr[0] for name in self.arm.joint_names]
        torques = np.zeros_like(q)
        collides = 0.0
        for row in range(len(q)):
            data.qpos[places] = q[row]
            data.qvel[rates] = velocities[row]
            data.qacc[rates] = accelerations[row]
            package.mj_fwdPosition(self.model, data)
            for pair, distance in _contacts(self.model, data):
                if pair not in self.touching:
                    collides = max(collides, 2.0 if distance < -TOUCH else 1.0)
            data.nefc = 0  # torques without those of contacts and of the stops of joints
            data.ncon = 0
            package.mj_fwdVelocity(self.model, data)
            package.mj_rne(self.model, data, 1, data.qfrc_inverse)
            inertia = self.model.dof_armature * data.qacc
            torques[row] = (data.qfrc_inverse + inertia)[rates]
        return collides, torques


def _contacts(model: object, data: object) -> list[tuple[tuple[int, int], float]]:
    """Return the bodies of each contact, and their distance [m]."""
    found = []
    for number in range(data.ncon):
        geoms = (data.contact.geom1[number], data.contact.geom2[number])
        first, second = sorted(int(model.geom_bodyid[geom]) for geom in geoms)
        found.append(((first, second), float(data.contact.dist[number])))
    return found


def _touching_bodies(arm: Arm, model: object) -> frozenset[tuple[int, int]]:
    """Return the pairs of bodies that touch at more than half of the postures, by design."""
    package = mujoco()
    data = package.MjData(model)
    places = [model.joint(name).qposadr[0] for name in arm.joint_names]
    counts: dict[tuple[int, int], int] = {}
    postures = arm.sample(128, 1)
    for posture in postures:
        data.qpos[places] = posture
        package.mj_fwdPosition(model, data)
        for pair in {pair for pair, _ in _contacts(model, data)}:
            counts[pair] = counts.get(pair, 0) + 1
    return frozenset(pair for pair, count in counts.items() if 2 * count > len(postures))


def motions(
    judge: Judge, count: int, seed: int, frames: int = FRAMES
) -> Iterator[tuple[str, Array]]:
    """Yield motions (frames, dof), each with its planted kind of fault, or an empty text."""
    generator = np.random.default_rng(seed)
    for number in range(count):
        planted = ""
        if number < FAULTY * count:
            planted = KINDS[number % len(KINDS)]
        yield planted, _motion(judge, planted, generator, frames)


def _motion(judge: Judge, planted: str, generator: np.random.Generator, frames: int) -> Array:
    """Return a motion with one kind of fault, or none, as MuJoCo finds it."""
    for _ in range(TRIALS):
        q = _candidate(judge, planted, generator, frames)
        shares = judge.shares(q)
        if planted and shares[planted] < PLANTED:
            continue
        others = [share for kind, share in shares.items() if kind != planted]
        if max(others) < CLEAR:
            return q
    raise RuntimeError(f"{judge.arm.name}: no motion with {planted or 'no fault'} was found")


def _candidate(judge: Judge, planted: str, generator: np.random.Generator, frames: int) -> Array:
    """Return a smooth motion around a posture, with a fault of a kind."""
    arm = judge.arm
    time = np.arange(frames) / RATE
    middle = 0.5 * (arm.lower + arm.upper)
    half = 0.5 * (arm.upper - arm.lower)
    span = 0.85 if planted == "collision" else 0.6
    center = middle + span * half * generator.uniform(-1.0, 1.0, arm.dof)
    frequencies = generator.uniform(0.3, 1.0, arm.dof)
    phases = generator.uniform(0.0, 2.0 * np.pi, arm.dof)
    q = center + 0.06 * half * np.sin(frequencies * time[:, None] + phases)

    joint = int(generator.integers(arm.dof))
    peak = generator.uniform(0.3, 0.7) * time[-1]
    width = 0.12 * time[-1]
    window = np.exp(-0.5 * ((time - peak) / width) ** 2)
    if planted == "position":
        near = arm.upper[joint] - 0.1
        q[:, joint] += near - q[:, joint].max()
        q[:, joint] += (arm.upper[joint] + 0.06 - q[:, joint].max()) * window
    if planted == "velocity":
        frequency = 4.0
        height = 1.3 * judge.velocity[joint] / frequency
        q[:, joint] += height * window * np.sin(frequency * (time - peak))
    if planted == "acceleration":
        frequency = 20.0
        height = 1.4 * judge.acceleration[joint] / frequency**2
        q[:, joint] += height * window * np.sin(frequency * (time - peak))
    return q


def write_dataset(
    folder: Path, judge: Judge, count: int, seed: int, frames: int = FRAMES
) -> list[str]:
    """Write motions as a LeRobot dataset; return the planted kind of each."""
    names = tuple(f"{name}.pos" for name in judge.arm.joint_names)
    features = (Feature(STATE, names), Feature("action", names))
    planted = []

    def episodes() -> Iterator[Episode]:
        for kind, q in motions(judge, count, seed, frames):
            planted.append(kind)
            yield Episode(kind or "clean", "Move", {STATE: q, "action": q})

    write_lerobot(folder, episodes(), features, RATE, judge.arm.name, overwrite=True)
    return planted


def score(planted: list[str], rows: list[dict[str, object]]) -> dict[str, float]:
    """Return the share of planted faults of each kind that were found, and the share of false alarms.

    A false alarm is a finding of a kind that was not planted in the motion.
    """
    found: dict[str, list[bool]] = {kind: [] for kind in KINDS}
    false = []
    for kind, row in zip(planted, rows, strict=True):
        failed = set(filter(None, str(row["failed"]).split(",")))
        if kind:
            found[kind].append(kind in failed)
        false.append(bool(failed - {kind}))
    result = {kind: float(np.mean(hits)) for kind, hits in found.items() if hits}
    result["false alarms"] = float(np.mean(false))
    return result


def processor_time() -> float:
    """Return the processor time of this process, and of its workers that have ended [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def main() -> None:
    """Plant faults in motions of each robot, audit them by the command, and print what it found."""
    import pyarrow.parquet as parquet
    import yaml
    from typer.testing import CliRunner

    from maniport.cli import app

    parser = argparse.ArgumentParser(prog="python -m benchmarks.audit", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="motions of all robots")
    parser.add_argument("--frames", type=int, default=FRAMES, help="frames of a motion")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    for number, name in enumerate(ROBOTS):
        count = options.count // len(ROBOTS) + (number < options.count % len(ROBOTS))
        with tempfile.TemporaryDirectory() as text:
            folder = Path(text)
            arm = load_arm(name)
            file = find_robot(name)
            assert file is not None
            judge = Judge.of(arm, file.path)
            limits = folder / "limits.yaml"
            limits.write_text(yaml.safe_dump(judge.limits()))
            planted = write_dataset(folder / "set", judge, count, number, options.frames)
            begun = clock.perf_counter()
            worked = processor_time()
            words = [
                *("audit", str(folder / "set"), "--robot", name, "--unit", "rad"),
                *("--limits", str(limits), "-o", str(folder / "out"), "--quiet"),
                *("--processes", str(options.processes)),
            ]
            done = CliRunner().invoke(app, words)
            seconds = clock.perf_counter() - begun
            worked = processor_time() - worked
            if done.exit_code != 1:
                sys.exit(f"{name}: exit code {done.exit_code}: {done.output}{done.exception}")
            numbers = json.loads((folder / "out" / "audit.json").read_text())
            rows = parquet.read_table(folder / "out" / "episodes.parquet").to_pylist()
            shares = score(planted, rows)
            texts = ", ".join(f"{kind} {100.0 * share:.1f} %" for kind, share in shares.items())
            speed = 60e-6 * numbers["frames"] / seconds
            cost = 1e6 * worked / numbers["frames"]
            print(
                f"{name}: {count} motions: {texts}; {speed:.2f} million frames a minute, "
                f"{cost:.0f} s of processor time for a million frames",
                flush=True,
            )


if __name__ == "__main__":
    main()
