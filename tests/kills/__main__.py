"""Kill commands that write, by SIGKILL and Ctrl-C at random moments, and count what is in place then: ``make kills``.

They run in children of a process that has everything loaded, so that the moments are those of the work.
"""

import argparse
import hashlib
import os
import random
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

from maniport import __main__ as entry_point
from maniport import cli, load_arm, sample_domain
from maniport.mocap import shipped_recording
from maniport.util.files import save_ellipsoids

HALF = "half"
MISSING = "missing"
NAMES = ("transfer", "fit")
SMALL = ("--method", "parallel-transport", "--n-teacher", "64", "--n-student", "128")


@dataclass
class Command:
    """A command that writes one of two results, which differ in the damping and are known by all their bytes."""

    target: Path
    words: tuple[str, ...]
    results: dict[str, int] = field(default_factory=dict)
    longest: float = 0.0  # of a run [s]

    def arguments(self, which: int) -> list[str]:
        return [
            "maniport",
            *self.words,
            "--damping",
            ("0.01", "0.02")[which],
            "-o",
            str(self.target),
            "--quiet",
        ]

    def warm(self) -> None:
        """Run both in this process, which loads and compiles what children need, and learn their results."""
        for which in range(2):
            began = time.monotonic()
            with mock.patch.object(sys, "argv", self.arguments(which)), suppress(SystemExit):
                cli.main()
            self.longest = time.monotonic() - began
            self.results[self._digest()] = which

    def state(self) -> int | str:
        return self.results.get(self._digest(), HALF) if self.target.exists() else MISSING

    def _digest(self) -> str:
        files = sorted(self.target.iterdir()) if self.target.is_dir() else [self.target]
        contents = [file.name.encode() + file.read_bytes() for file in files]
        return hashlib.sha256(
            b"".join(hashlib.sha256(content).digest() for content in contents)
        ).hexdigest()


def works(folder: Path) -> dict[str, Command]:
    """Return everything that is killed, each with a folder of its own below `folder`."""
    for name in NAMES:
        (folder / name).mkdir()
    for arm in ("myoarm", "panda"):
        save_ellipsoids(folder / f"{arm}.npz", sample_domain(load_arm(arm), 256, 0))
    words = (
        "transfer",
        str(shipped_recording("freeform")),
        "--start",
        "2",
        "--stop",
        "2.2",
        "--overwrite",
        *SMALL,
    )
    domains = (str(folder / "myoarm.npz"), str(folder / "panda.npz"))
    return {
        "transfer": Command(folder / "transfer" / "out", words),
        "fit": Command(folder / "fit" / "adapter.npz", ("fit", *domains, "--method", "icp")),
    }


def forked(work: Command, which: int, log: Path) -> int:
    """Run in a child that has everything loaded; return its process id."""
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # until the child is ready for it
    child = os.fork()
    if child:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        return child
    code = 1
    try:
        signal.signal(signal.SIGINT, entry_point._interrupt)
        tempfile.tempdir = str(work.target.parent)  # leftovers there are seen, too
        with open(log, "w") as stream:
            os.dup2(stream.fileno(), 1)
            os.dup2(stream.fileno(), 2)
        sys.stdout = sys.__stdout__
        sys.stderr = sys.__stderr__
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        sys.argv = work.arguments(which)
        entry_point.main()
        code = 0
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException:  # noqa: BLE001 - a child must never return into the parent's work
        traceback.print_exc()
    finally:
        os._exit(code)


def ended(child: int, patience: float = 60.0) -> int | None:
    """Return the exit code of a child; end a child that runs longer [s], and return None."""
    for _ in range(int(patience / 0.002)):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def strike(work: Command, number: int, times: int, generator: random.Random, log: Path) -> Counter:
    """Send a signal to so many runs, each at a random moment, and count what is in place then."""
    count = Counter(struck=0, old=0, new=0, half=0, missing=0)
    while count["struck"] < times:
        before = work.state()
        earlier = {*work.target.parent.iterdir()}
        child = forked(work, 1 - before if isinstance(before, int) else 0, log)
        time.sleep(generator.uniform(0.0, work.longest))
        os.kill(child, number)
        code = ended(child)
        after = work.state()
        count["struck"] += code != 0  # others had ended before
        count["old" if after == before else after if after in (HALF, MISSING) else "new"] += 1
        if code not in (0, 130 if number == signal.SIGINT else -number):
            count[f"fault: ended with {code}: {log.read_text()[-500:]}"] += 1
        if number == signal.SIGINT and (
            rest := {*work.target.parent.iterdir()} - earlier - {work.target}
        ):
            count[f"fault: left {sorted(path.name for path in rest)}"] += 1
    return count


def main() -> int:
    """Strike all works, or some; the exit code is 1 if anything is half or missing, or ended with an error."""
    parser = argparse.ArgumentParser(
        prog="python -m kills", description="Kill commands at random moments."
    )
    parser.add_argument(
        "works", nargs="*", default=NAMES, help=f"some of: {', '.join(NAMES)}; default: all"
    )
    parser.add_argument("-n", type=int, default=200, help="strikes of each work by each signal")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    generator = random.Random(arguments.seed)
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        every = works(Path(folder))
        for key in arguments.works:
            every[key].warm()
            for number in (signal.SIGKILL, signal.SIGINT):
                count = strike(every[key], number, arguments.n, generator, Path(folder) / "log")
                print(key, number.name, dict(count), flush=True)
                bad += sum(count.values()) - count["struck"] - count["old"] - count["new"]
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
