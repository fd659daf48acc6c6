"""Does a change keep every result to the last bit? Record the results of commands, and compare two such records.

    python scripts/golden_results.py record FOLDER [--only NAME ...]
    python scripts/golden_results.py compare BEFORE AFTER

A record takes about three minutes on one core. Planning is a discrete search, so one changed bit may lead to another
motion: a refactoring keeps all files equal. Record both folders on one machine.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import maniport as mp

SHORT = "--start 2 --stop 2.5"

COMMANDS = {
    "transfer": f"transfer freeform --robot panda {SHORT}",
    "identity": f"transfer freeform --robot panda {SHORT} --method identity --seed 3",
    "icp": f"transfer freeform --robot panda {SHORT} --method icp",
    "scale": f"transfer freeform --robot panda {SHORT} --method identity --scale 0.5",
    "place": (
        "place FOLDER/identity/placed_profile.npz --path FOLDER/identity/path.npz "
        "--robot panda --tilt free --rank 2"
    ),
    "track": "track FOLDER/identity/placed_profile.npz --path FOLDER/identity/path.npz --robot panda",
    "orientation": f"transfer freeform --robot panda {SHORT} --method identity --orientation demonstrated",
    "force": f"transfer freeform --robot panda {SHORT} --ellipsoids force --payload 1.5",
    "table": f"transfer freeform --robot panda {SHORT} --method identity --table -0.1",
    "both": (
        "transfer both-arms --side both --robot panda --robot panda --pose 0,0.3,0,0 "
        "--pose 0,-0.3,0,0 --start 5.1 --stop 5.6 --method identity"
    ),
    "learn": "learn freeform --segments 1.4:2.1,2.5:3.2 --components 4 --robot panda",
    "batch": f"batch freeform --robot panda {SHORT}",
    "reproduce": "reproduce toy",
}
"""Arguments of `maniport`, by the name of the subfolder; FOLDER is that of the record."""

UNSTABLE = {
    "report.html",
    "index.html",
    "pair.json",
    "table.csv",
    "table.parquet",
    "paper.json",
    "paper.md",
}
"""Files with computing times or dates."""


def run_command(arguments: list[str]) -> bytes:
    """Run `maniport` on one thread; return its standard output."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "maniport", *arguments]
    result = subprocess.run(command, env=environment, capture_output=True, check=False)
    if result.returncode != 0:
        raise SystemExit(f"{' '.join(command)} failed:\n{result.stderr.decode()}")
    return result.stdout


def follow_live(file: Path) -> None:
    """Write the joint positions of live control over two seconds of simulated time."""
    recording = mp.read_recording("freeform").crop(2.0, 4.0)
    result = mp.transfer_recording(recording, robot="panda", method="identity")
    live = mp.Live.of(result, clock=None)
    joints = []
    for i, time in enumerate(recording.time):
        points = {name: recording.point(name)[i] for name in live.points}
        state = live.step(points, time)
        joints.append(state.joint_positions.tolist())
    file.write_text(json.dumps(joints))


def record(folder: Path, only: list[str]) -> None:
    """Run all commands, each into a subfolder of its name."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in COMMANDS.items():
        if only and name not in only:
            continue
        arguments = text.replace("FOLDER", str(folder)).split()
        output = run_command([*arguments, "-o", str(folder / name), "--overwrite", "--quiet"])
        (folder / f"{name}.txt").write_bytes(output.replace(str(folder).encode(), b"FOLDER"))
        print(name, flush=True)
    if not only or "live" in only:
        follow_live(folder / "live.json")
        print("live", flush=True)


def digests(folder: Path) -> dict[str, str]:
    """Return the digest of each file; the path of the folder counts as nothing."""
    result = {}
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.name not in UNSTABLE:
            content = file.read_bytes().replace(str(folder).encode(), b"FOLDER")
            result[str(file.relative_to(folder))] = hashlib.sha256(content).hexdigest()
    return result


def compare(before: Path, after: Path) -> int:
    """Print the files that differ; return 1 where there are any."""
    old = digests(before)
    new = digests(after)
    changed = [name for name in sorted({*old, *new}) if old.get(name) != new.get(name)]
    for name in changed:
        print(f"differs: {name}")
    print(f"{len(changed)} of {len({*old, *new})} files differ")
    return int(bool(changed))


def main() -> int:
    """Parse the command line and run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
    recorder = verbs.add_parser("record")
    recorder.add_argument("folder", type=Path)
    recorder.add_argument("--only", nargs="+", choices=[*COMMANDS, "live"], default=[])
    comparer = verbs.add_parser("compare")
    comparer.add_argument("before", type=Path)
    comparer.add_argument("after", type=Path)
    options = parser.parse_args()
    if options.verb == "compare":
        return compare(options.before, options.after)
    record(options.folder.resolve(), options.only)
    return 0


if __name__ == "__main__":
    sys.exit(main())
