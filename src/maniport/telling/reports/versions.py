"""What it takes to make a result again: the seed and the software."""

import platform
from importlib import metadata

from maniport import __version__
from maniport.telling.page import Fact

SHOWN = {"numpy": "NumPy", "scipy": "SciPy", "pin": "Pinocchio", "pin-pink": "Pink"}


def seed(random_state: int) -> Fact:
    """Name the seed of a run."""
    return Fact("Seed", str(random_state), "The same seed and versions give the same numbers.")


def versions() -> tuple[Fact, ...]:
    """Name the versions of what computed."""
    found = [f"maniport {__version__}", f"Python {platform.python_version()}"]
    for package, name in SHOWN.items():
        try:
            found.append(f"{name} {metadata.version(package)}")
        except metadata.PackageNotFoundError:  # installed by other means than a package
            found.append(f"{name} of unknown version")
    return (Fact("Versions", ", ".join(found)),)
