"""The two real recordings that come with the package; ``data/SOURCES.md`` says where they are from."""

from pathlib import Path

from maniport.errors import unknown_name

SHIPPED = {"ladder": "ladder.bvh", "freeform": "freeform.c3d"}
"""``"ladder"``: a person climbs a ladder and hangs from it (BVH). ``"freeform"``: free arm motion (C3D)."""


def shipped_recording(name: str) -> Path:
    """Path of a recording that comes with the package.

    Parameters
    ----------
    name : {"ladder", "freeform"}
        Its name.

    Raises
    ------
    UnknownNameError
        When there is none of that name; the message lists those there are.
    """
    if name not in SHIPPED:
        raise unknown_name("shipped recording", name, SHIPPED)
    return Path(__file__).parent / "data" / SHIPPED[name]
