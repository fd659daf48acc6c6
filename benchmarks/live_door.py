"""How long a frame takes through the UDP door of ``maniport live``, 500 of them a second.

``python -m benchmarks.live_door [quick]`` prints it, in a process of its own that serves; another one sends frames by
the clock, whether they are answered or not, and notes when each answer comes.
"""

import gc
import json
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
from threadpoolctl import threadpool_limits

import maniport as mp
from maniport.live.serving import serve
from maniport.live.transport import Datagrams
from maniport.mocap import shipped_recording
from maniport.motion import place_path

from .inputs import DAMPING
from .measure import Row, duration, fresh_process, within

RATE = 500.0  # Hz
PART = (20.0, 28.0)
"""Of the shipped recording of a ladder that is played [s]."""
ROUNDS = 5
"""In which that is done; of each figure the least counts, since others use the machine, too."""
MEDIAN, MOST = 1e-3, 2e-3
"""What is asked for: the frame's own work and as much again for the way; done before the next frame comes [s]."""


def rows(quick: bool) -> Iterator[Row]:
    """The round trip, and the frames that were not worked."""
    found = fresh_process("-m", "benchmarks.live_door", *(["quick"] if quick else []))[1]
    about = f"{found['frames']} frames at {RATE:.0f} Hz through loopback, Panda with limits and collisions; of"
    about += f" {found['rounds']} rounds the least; the largest {duration(found['largest'])}"
    yield within("live: round trip of a frame by UDP, median", found["median"], MEDIAN, duration, about)
    yield within("live: round trip of a frame by UDP, 99.9 %", found["most"], MOST, duration, about)
    yield within("live: processor time of the door for a frame", found["busy"], MEDIAN, duration, about)
    note = "of the round with the fewest: a newer one had come before they were worked"
    yield within(
        "live: frames at 500 Hz that were skipped", found["skipped"], 0.001, lambda share: f"{share:.2%}", note
    )


def measured(rounds: int) -> dict[str, float]:
    """Serve a sender several times; the least of what each time gave."""
    recording, robot = mp.read_recording(shipped_recording("ladder")).crop(*PART), mp.load_arm("panda")
    person = mp.fit_arm(recording)
    adapter = mp.ParallelTransport(damping=DAMPING, base_rotation=np.eye(3))
    adapter.fit(mp.sample_domain(person.arm, 4096, 0), mp.sample_domain(robot, 16384, 1))
    shown = person.joint_angles[::8]
    target = adapter.transform(person.arm.manipulability(shown))
    path = place_path(person.arm.forward(shown)[:, :3, 3], target, robot, turn=adapter.map_rotation_)
    found = []
    for _ in range(rounds):
        live, transport = mp.Live(person, adapter, robot, path=path), Datagrams(0)
        stop, signal = socket.socketpair()
        sender = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.live_door", "send", str(transport.about["udp"])], stdout=subprocess.PIPE
        )
        waiting = threading.Thread(target=lambda one=sender, end=signal: (one.wait(), end.send(b"!")))
        waiting.start()
        gc.collect()
        gc.freeze()  # as the command does
        began = time.thread_time()
        with threadpool_limits(1):
            summary = serve(live, transport, stop)
        busy = (time.thread_time() - began) / max(summary.answered + summary.unprompted, 1)
        waiting.join()
        assert sender.stdout is not None
        found.append({**json.loads(sender.stdout.read()), "busy": busy})
        transport.close()
        stop.close()
        signal.close()
    return {**{name: min(one[name] for one in found) for name in found[0]}, "rounds": rounds}


def sent(port: int) -> dict[str, float]:
    """Send frames by the clock; the times until their answers, and what share had none."""
    door = ("127.0.0.1", port)
    recording = mp.read_recording(shipped_recording("ladder")).crop(*PART).resample(RATE)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.sendto(b"{}", door)
        names = json.loads(link.recv(1 << 16))["points"]
        positions = recording.select(names).positions
        lines = [json.dumps({"t": i / RATE, "points": places.tolist()}).encode() for i, places in enumerate(positions)]
        left, took = np.zeros(len(lines)), np.full(len(lines), np.nan)
        began, i = time.perf_counter(), 0
        end = began + len(lines) / RATE + 0.1
        while (now := time.perf_counter()) < end:
            due = began + i / RATE if i < len(lines) else end
            if now >= due:
                left[i] = now
                link.sendto(lines[i], door)
                i += 1
            elif select.select([link], [], [], due - now)[0]:
                answer = json.loads(link.recv(1 << 16))
                if (sent := answer.get("frame")) is not None:
                    k = round(sent * RATE)
                    took[k] = time.perf_counter() - left[k]
    known = took[~np.isnan(took)]
    median, most = np.quantile(known, [0.5, 0.999])
    return {
        "median": median, "most": most, "largest": known.max(), "frames": len(lines),
        "skipped": 1.0 - len(known) / len(lines),
    }  # fmt: skip


if __name__ == "__main__":
    if sys.argv[1:2] == ["send"]:
        print(json.dumps(sent(int(sys.argv[2]))))
    else:
        print(json.dumps(measured(1 if "quick" in sys.argv[1:] else ROUNDS)))
