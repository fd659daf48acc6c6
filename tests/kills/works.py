"""What is killed: commands that write a folder or a file, and the writer of folders alone."""

import hashlib
import re
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

from maniport import __main__ as entry_point
from maniport import cli, load_arm, sample_domain
from maniport.atomic_io import folder_written_whole
from maniport.demonstrations import shipped_recording
from maniport.files import save_ellipsoids
from maniport.pipeline import transfer_recording
from sizes import few_places, few_postures

HALF, MISSING = "half", "missing"
NAMES = ("motion", "ellipsoids", "fit", "folder", "cold")
"""Of all that is killed; the last is started cold."""
CLOCK = re.compile(rb"(Time to fit(?:: |</dt><dd><b>))[0-9.]+ m?s")
"""The one thing that two runs of the same job write differently."""
DAMPING = ("0.01", "0.02")
"""Of two runs whose results are told from each other by it."""
FILES = {f"{name}.npz": size for name, size in (("a", 20_000), ("b", 300), ("c", 20_000), ("d", 5_000))}
"""What the writer of folders writes, and in how many bytes."""


@dataclass
class Command:
    """A verb that writes one result: which of two runs it is of, is known by all its bytes."""

    name: str
    target: Path
    words: tuple[str, ...]
    known: dict[str, int] = field(default_factory=dict)

    def arguments(self, which: int) -> list[str]:
        """What the user types for one of the two runs."""
        return [*self.words, "--damping", DAMPING[which], "-o", str(self.target), "--quiet"]

    def warm(self) -> None:
        """Run both in this process, which loads and compiles what its children shall find ready, and know them."""
        for which in range(len(DAMPING)):
            with mock.patch.object(sys, "argv", ["maniport", *self.arguments(which)]), suppress(SystemExit):
                cli.main()
            self.learn(which)

    def learn(self, which: int) -> None:
        """What is in place now is of this run."""
        self.known[self._sum()] = which

    def run(self, which: int) -> None:
        """Run one of them as the user does."""
        sys.argv = ["maniport", *self.arguments(which)]
        entry_point.main()

    def next(self, state: int | str) -> int:
        """Of the two runs the one whose result is not in place."""
        return 1 - state if isinstance(state, int) else 0

    def state(self) -> int | str:
        """Which run's result is in place, whole."""
        return self.known.get(self._sum(), HALF) if self.target.exists() else MISSING

    def _sum(self) -> str:
        files = sorted(self.target.iterdir()) if self.target.is_dir() else [self.target]
        contents = [file.name.encode() + CLOCK.sub(rb"\1", file.read_bytes()) for file in files]
        return hashlib.sha256(b"".join(hashlib.sha256(one).digest() for one in contents)).hexdigest()


@dataclass
class Writer:
    """Folders of files that say a number, one after the other as fast as it goes."""

    name: str
    target: Path

    def warm(self) -> None:
        """Write the first."""
        self.write(0)

    def write(self, number: int) -> None:
        """Write one."""
        with folder_written_whole(self.target, FILES, overwrite=True) as staging:
            for name, size in FILES.items():
                (staging / name).write_bytes(f"{number:9}\n".encode() * (size // 10))

    def run(self, first: int) -> None:
        """Write until something ends it."""
        while True:
            self.write(first)
            first += 1

    def next(self, state: int | str) -> int:
        """Numbers go on."""
        return state + 1 if isinstance(state, int) else 0

    def state(self) -> int | str:
        """The number that all files say, each in its whole length."""
        if not self.target.exists():
            return MISSING
        contents = {file.name: file.read_bytes() for file in self.target.iterdir()}
        whole = {name: len(content) for name, content in contents.items()} == {
            name: 10 * (size // 10) for name, size in FILES.items()
        }
        numbers = {line for content in contents.values() for line in content.splitlines()}
        return int(numbers.pop()) if whole and len(numbers) == 1 else HALF


def works(folder: Path) -> dict[str, Command | Writer]:
    """Everything that is killed, each with a folder of its own below `folder`."""
    places = {name: folder / name for name in NAMES}
    for place in places.values():
        place.mkdir()
    for arm in ("myoarm", "panda"):
        save_ellipsoids(folder / f"{arm}.npz", sample_domain(load_arm(arm), 256, 0))
    moment = ("transfer", str(shipped_recording("freeform")), "--start", "2", "--stop", "2.2", "--overwrite")
    moment += ("--method", "parallel-transport")
    domains = (str(folder / "myoarm.npz"), str(folder / "panda.npz"))
    return {
        "motion": Command("transfer", places["motion"] / "out", moment),
        "ellipsoids": Command("transfer --no-move", places["ellipsoids"] / "out", (*moment, "--no-move")),
        "fit": Command("fit", places["fit"] / "adapter.npz", ("fit", *domains, "--method", "icp")),
        "folder": Writer("folder writer", places["folder"] / "out"),
        "cold": Command("transfer --no-move", places["cold"] / "out", (*moment, "--no-move")),
    }


@contextmanager
def small() -> Iterator[None]:
    """Few samples, places and postures: the way is the same, and shorter."""
    with ExitStack() as stack:
        stack.enter_context(few_places())
        stack.enter_context(few_postures())
        sizes = {"n_teacher": 64, "n_student": 128}
        stack.enter_context(mock.patch.dict(transfer_recording.__kwdefaults__, sizes))
        yield
