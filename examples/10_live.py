"""Live control of a robot.

`maniport.Live` receives a recording frame by frame in real time and returns joint positions. The first seconds of the
recording give segment lengths, adapter and placement. At 24.5 s the points are missing for half a second: the robot
brakes, stops, and follows again. It does so without consent (`auto_engage`), since it is not a real one. `--view` shows
both arms in a browser; `--fast` uses simulated time.

    python 10_live.py [FOLDER] [--view] [--fast]
"""

import sys
import tempfile
import time as clock
from itertools import groupby
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.mocap import shipped_recording
from maniport.motion import TargetTrajectory, place_path, plan_motion

CALIBRATION = 24.0  # end of the part that is used for calibration [s]
GAP = 24.5, 25.0  # missing points [s]


def calibrate(recording, robot, clock):
    """Return the fitted person and the live controller."""
    person = mp.fit_arm(recording)
    adapter = mp.ScaledTransport(damping=0.01, base_rotation=np.eye(3))
    adapter.fit(mp.sample_domain(person.arm, 2048, 0), mp.sample_domain(robot, 8192, 1))
    joints = person.joint_angles[::8]
    target = adapter.transform(person.arm.manipulability(joints))
    hand = person.arm.forward(joints)[:, :3, 3]
    targets = TargetTrajectory.checked(robot, person.time[::8], target, positions=hand)
    path = place_path(robot, targets, map_rotation=adapter.map_rotation_)[0]
    motion = plan_motion(robot, path.moved(targets), starts=[path.joint_positions])
    plan = motion.trajectory.joint_positions
    return person, mp.Live(
        person,
        adapter,
        robot,
        path=path,
        start=plan[0],
        reference=plan,
        clock=clock,
        auto_engage=True,
    )


def play(live, recording, fast, page):
    """Return the state of the controller for each frame, and the computing times [s]."""
    frames = recording.select(live.points).positions.copy()
    frames[(recording.time >= GAP[0]) & (recording.time < GAP[1])] = np.nan
    states, seconds, start = [], [], clock.perf_counter() - recording.time[0]
    for points, t in zip(frames, recording.time, strict=True):
        if not fast:
            clock.sleep(max(0.0, start + t - clock.perf_counter()))
        begin = clock.perf_counter()
        states.append(live.step(points, t))
        seconds.append(clock.perf_counter() - begin)
        if page is not None:
            page.show(states[-1])
    return states, seconds


def main(folder, *options):
    """Follow eight seconds of climbing a ladder with the Panda."""
    folder.mkdir(parents=True, exist_ok=True)
    recording, robot = (
        mp.read_recording(shipped_recording("ladder")).crop(20.0, 28.0),
        mp.load_arm("panda"),
    )
    person, live = calibrate(
        recording.crop(stop=CALIBRATION), robot, None if "--fast" in options else clock.monotonic
    )
    page = None
    if "--view" in options:
        from maniport.viewer.server import Onlooker  # needs viser

        page = Onlooker(person.arm, robot)
        input(f"open {page.url} and press Enter")
    states, seconds = play(live, recording, "--fast" in options, page)
    for name, group in groupby(states, key=lambda state: state.state):
        times, d = zip(*((state.time, state.distance) for state in group), strict=True)
        print(f"{times[0]:5.2f} to {times[-1]:5.2f} s: {name:10} d {np.median(d):.2f} (median)")
    errors = [1e3 * state.position_error for state in states if state.position_error is not None]
    print(
        "position error [mm], median, 95 %, max: {:.0f}, {:.0f}, {:.0f}".format(
            *np.quantile(errors, [0.5, 0.95, 1])
        )
    )
    print(f"computing time of a step: {1e3 * np.median(seconds):.1f} ms (median)")
    names = "time", "joint_positions", "state", "distance"
    np.savez(
        folder / "live.npz", **{name: [getattr(state, name) for state in states] for name in names}
    )
    print(f"joints in {folder}")


if __name__ == "__main__":
    folders = [word for word in sys.argv[1:] if not word.startswith("--")] or [
        tempfile.mkdtemp(prefix="maniport-")
    ]
    main(Path(folders[0]), *sys.argv[1:])
