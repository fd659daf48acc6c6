"""What is killed: commands that write a folder or a file, and the writer of folders alone."""

import hashlib
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar
from unittest import mock

from maniport import __main__ as entry_point
from maniport import cli, load_arm, sample_domain
from maniport.mocap import shipped_recording
from maniport.pipeline import transfer_recording
from maniport.util.atomic_io import folder_written_whole
from maniport.util.files import save_ellipsoids

HALF, MISSING = "half", "missing"
NAMES = ("motion", "ellipsoids", "fit", "folder")


@dataclass
class Command:
    """A command that writes one of two results, which differ in the damping and are known by all their bytes."""

    name: str
    target: Path
    words: tuple[str, ...]
    known: dict[str, int] = field(default_factory=dict)

    def arguments(self, which: int) -> list[str]:
        """Arguments of one of the two runs."""
        return ["maniport", *self.words, "--damping", ("0.01", "0.02")[which], "-o", str(self.target), "--quiet"]

    def warm(self) -> None:
        """Run both in this process, which loads and compiles what children need, and learn their results."""
        for which in range(2):
            with mock.patch.object(sys, "argv", self.arguments(which)), suppress(SystemExit):
                cli.main()
            self.known[self._digest()] = which

    def run(self, which: int) -> None:
        """Run one of them as from a shell."""
        sys.argv = self.arguments(which)
        entry_point.main()

    def next(self, state: int | str) -> int:
        """Return the run whose result is not in place."""
        return 1 - state if isinstance(state, int) else 0

    def state(self) -> int | str:
        """Return whose result is in place, whole."""
        return self.known.get(self._digest(), HALF) if self.target.exists() else MISSING

    def _digest(self, clock: str = r"(Time to fit(?:: |</dt><dd><b>))[0-9.]+ m?s") -> str:
        """Digest all files but for computing times, which differ between equal runs."""
        files = sorted(self.target.iterdir()) if self.target.is_dir() else [self.target]
        contents = [file.name.encode() + re.sub(clock.encode(), rb"\1", file.read_bytes()) for file in files]
        return hashlib.sha256(b"".join(hashlib.sha256(one).digest() for one in contents)).hexdigest()


@dataclass
class Writer:
    """Folders of files that repeat a number, one after the other as fast as possible."""

    name: str
    target: Path
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
    moment = ("transfer", str(shipped_recording("freeform")), "--start", "2", "--stop", "2.2", "--overwrite")
    moment += ("--method", "parallel-transport")
    domains = (str(folder / "myoarm.npz"), str(folder / "panda.npz"))
    return {
        "motion": Command("transfer", folder / "motion" / "out", moment),
        "ellipsoids": Command("transfer --no-move", folder / "ellipsoids" / "out", (*moment, "--no-move")),
        "fit": Command("fit", folder / "fit" / "adapter.npz", ("fit", *domains, "--method", "icp")),
        "folder": Writer("folder writer", folder / "folder" / "out"),
    }


@contextmanager
def small() -> Iterator[None]:
    """Sample small domains."""
    with mock.patch.dict(transfer_recording.__kwdefaults__, {"n_teacher": 64, "n_student": 128}):
        yield
