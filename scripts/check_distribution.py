"""Build wheel and sdist, check their content, and use each outside of the checkout.

    python scripts/check_distribution.py [FOLDER]

Each is installed into an empty environment of its own, with what it declares and nothing else, and run in an empty
folder: the main job from the wheel, a room of the tests, those of the sdist, from the sdist. The files are left in the
folder, by default ``dist``.
"""

import os
import subprocess
import sys
import tarfile
import tempfile
import venv
from pathlib import Path

HOME = Path(__file__).parents[1]
TESTED = (
    "tests/spd/test_ellipsoid.py",
    "tests/transfer/test_adapter_files.py",
    "tests/cli/test_start.py",
    "tests/test_project.py",
)
"""Quick tests that run from the sdist."""


def run(*command: str | Path, folder: Path = HOME) -> None:
    """Print and run a command without this environment's packages; raise if it fails."""
    print("$", *command, flush=True)
    lent = ("PYTHONPATH", "VIRTUAL_ENV", "PYTHONHOME")
    subprocess.run(
        command, cwd=folder, check=True, env={k: v for k, v in os.environ.items() if k not in lent}
    )


def environment(folder: Path, *what: str | Path) -> Path:
    """Create an environment with distributions; return the folder of its commands."""
    venv.create(folder, with_pip=True)
    commands = folder / ("Scripts" if os.name == "nt" else "bin")
    run(commands / "python", "-m", "pip", "install", "--quiet", *what)
    return commands


def only(folder: Path, pattern: str) -> Path:
    """Return the only file that matches a pattern."""
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        raise SystemExit(
            f"{folder}: {len(found)} files fit {pattern}, not one; empty the folder first"
        )
    return found[0]


def main(dist: Path) -> None:
    """Build, check, install, run."""
    run(sys.executable, "-m", "build", "--outdir", dist)
    wheel = only(dist, "*.whl")
    sdist = only(dist, "*.tar.gz")
    run(sys.executable, "-m", "twine", "check", "--strict", wheel, sdist)
    run(sys.executable, "-m", "check_wheel_contents", wheel)
    with tempfile.TemporaryDirectory(prefix="maniport-") as name:
        away = Path(name)
        run(
            environment(away / "of-wheel", wheel) / "maniport", "demo", "-o", "results", folder=away
        )
        with tarfile.open(sdist) as archive:
            archive.extractall(away, filter="data")
        source = only(away, "maniport-*")
        commands = environment(away / "of-sdist", f"{sdist}[test]")
        run(commands / "python", "-m", "pytest", "-q", "-n", "0", *TESTED, folder=source)
    print(f"{wheel} and {sdist} may be published")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else HOME / "dist").resolve())
