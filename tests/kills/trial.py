"""Commands that write a file or a folder, and a writer of folders: killed at a random moment, and what is left then."""

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
from typing import ClassVar
from unittest import mock

from maniport import __main__ as entry_point
from maniport import cli, load_arm, sample_domain
from maniport.mocap import shipped_recording
from maniport.util.atomic_io import folder_written_whole
from maniport.util.files import save_ellipsoids

HALF, MISSING = "half", "missing"
NAMES = ("transfer", "fit", "folder")
SMALL = ("--method", "parallel-transport", "--n-teacher", "64", "--n-student", "128")


@dataclass
class Command:
    """A command that writes one of two results, which differ in the damping and are known by all their bytes."""

    target: Path
    words: tuple[str, ...]
    results: dict[str, int] = field(default_factory=dict)
    longest: float = 0.0  # of a run [s]

    def arguments(self, which: int) -> list[str]:
        """Arguments of one of the two runs."""
        return ["maniport", *self.words, "--damping", ("0.01", "0.02")[which], "-o", str(self.target), "--quiet"]

    def warm(self) -> None:
        """Run both in this process, which loads and compiles what children need, and learn their results."""
        for which in range(2):
            began = time.monotonic()
            with mock.patch.object(sys, "argv", self.arguments(which)), suppress(SystemExit):
                cli.main()
            self.longest = time.monotonic() - began
            self.results[self._digest()] = which

    def run(self, which: int) -> None:
        """Run one of them as from a shell."""
        sys.argv = self.arguments(which)
        entry_point.main()

    def next(self, state: int | str) -> int:
        """Return the run whose result is not in place."""
        return 1 - state if isinstance(state, int) else 0

    def state(self) -> int | str:
        """Return whose result is in place, whole."""
        return self.results.get(self._digest(), HALF) if self.target.exists() else MISSING

    def _digest(self) -> str:
        """Digest all files."""
        files = sorted(self.target.iterdir()) if self.target.is_dir() else [self.target]
        contents = [file.name.encode() + file.read_bytes() for file in files]
        return hashlib.sha256(b"".join(hashlib.sha256(content).digest() for content in contents)).hexdigest()


@dataclass
class Writer:
    """Folders of files that repeat a number, one after the other as fast as possible."""

    target: Path
    longest: float = 0.05
    lines: ClassVar = {"a.npz": 2000, "b.npz": 30, "c.npz": 2000, "d.npz": 500}

    def warm(self) -> None:
        """Write the first."""
        self.write(0)

    def write(self, number: int) -> None:
        """Write one."""
        with folder_written_whole(self.target, self.lines, overwrite=True) as staging:
            for name, count in self.lines.items():
                (staging / name).write_bytes(f"{number:9}\n".encode() * count)

    def run(self, first: int) -> None:
        """Write without end."""
        while True:
            self.write(first)
            first += 1

    def next(self, state: int | str) -> int:
        """Return the next number."""
        return state + 1 if isinstance(state, int) else 0

    def state(self) -> int | str:
        """Return the number in all files, each of its whole length."""
        if not self.target.exists():
            return MISSING
        contents = {file.name: file.read_bytes().splitlines() for file in self.target.iterdir()}
        whole = {name: len(lines) for name, lines in contents.items()} == self.lines
        numbers = {line for lines in contents.values() for line in lines}
        return int(numbers.pop()) if whole and len(numbers) == 1 else HALF


def works(folder: Path) -> dict[str, Command | Writer]:
    """Return everything that is killed, each with a folder of its own below `folder`."""
    for name in NAMES:
        (folder / name).mkdir()
    for arm in ("myoarm", "panda"):
        save_ellipsoids(folder / f"{arm}.npz", sample_domain(load_arm(arm), 256, 0))
    words = ("transfer", str(shipped_recording("freeform")), "--start", "2", "--stop", "2.2", "--overwrite", *SMALL)
    domains = (str(folder / "myoarm.npz"), str(folder / "panda.npz"))
    return {
        "transfer": Command(folder / "transfer" / "out", words),
        "fit": Command(folder / "fit" / "adapter.npz", ("fit", *domains, "--method", "icp")),
        "folder": Writer(folder / "folder" / "out"),
    }


def forked(work: Command | Writer, which: int, log: Path) -> int:
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
        sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        work.run(which)
        code = 0
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException:  # noqa: BLE001 - a child must never return into the parent's work
        traceback.print_exc()
    finally:
        os._exit(code)


def ended(child: int, patience: float = 60.0) -> int | None:
    """Return the exit code of a child; None of one that goes on [s], which is ended."""
    for _ in range(int(patience / 0.002)):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def strike(work: Command | Writer, number: int, times: int, generator: random.Random, log: Path) -> Counter:
    """Send a signal to so many runs, each at a random moment, and count what is in place then."""
    count = Counter(struck=0, old=0, new=0, half=0, missing=0)
    while count["struck"] < times:
        before, earlier = work.state(), {*work.target.parent.iterdir()}
        child = forked(work, work.next(before), log)
        time.sleep(generator.uniform(0.0, work.longest))
        os.kill(child, number)
        code, after = ended(child), work.state()
        count["struck"] += code != 0  # others had ended before
        count["old" if after == before else after if after in (HALF, MISSING) else "new"] += 1
        if code not in (0, 130 if number == signal.SIGINT else -number):
            count[f"fault: ended with {code}: {log.read_text()[-500:]}"] += 1
        if number == signal.SIGINT and (rest := {*work.target.parent.iterdir()} - earlier - {work.target}):
            count[f"fault: left {sorted(path.name for path in rest)}"] += 1
    return count
