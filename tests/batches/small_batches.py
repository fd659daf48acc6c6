"""Batches that take a moment, and what came of them."""

import maniport as mp

SMALL = {"method": "parallel-transport", "n_teacher": 32, "n_student": 64, "move": False, "collisions": False}
PART = {"start": 1.0, "stop": 1.5}
ROBOTS = ("panda", "rhuman")


def small(recordings, output, **more):
    """A batch that takes a moment."""
    return mp.batch(recordings, ROBOTS, output, processes=1, reading=PART, **SMALL | more)


def tree(folder):
    """Every file of a folder with its bytes, but for temporary ones that a killed process left."""
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: path.read_bytes() for name, path in found.items() if "/." not in f"/{name}"}
