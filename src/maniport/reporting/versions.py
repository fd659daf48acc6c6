"""Which software made a result."""

import platform
from importlib import metadata

from maniport import __version__
from maniport.viewing.report import Fact

SHOWN = {"numpy": "NumPy", "scipy": "SciPy", "pin": "Pinocchio", "pin-pink": "Pink"}


def versions() -> tuple[Fact, ...]:
    """Name the versions of what computed."""
    found = [f"maniport {__version__}", f"Python {platform.python_version()}"]
    for package, name in SHOWN.items():
        try:
            found.append(f"{name} {metadata.version(package)}")
        except metadata.PackageNotFoundError:  # installed by other means than a package
            found.append(f"{name} of unknown version")
    return (Fact("Versions", ", ".join(found)),)
