"""One mutated file is read: what came of it."""

import random
import traceback
from collections.abc import Iterator
from pathlib import Path

from fuzz.mutations import mutated
from fuzz.targets import Target
from maniport.errors import ManiportError

READ, REFUSED = "read", "refused"
"""Both are right; whatever else `outcome` says is not."""


def files(target: Target, name: str, start: int, stop: int) -> Iterator[tuple[int, bytes]]:
    """Mutations by their numbers: each is the same whenever it is made."""
    seeds = target.seeds()
    for number in range(start, stop):
        random_ = random.Random(f"{name} {number}")
        yield number, mutated(random_.choice(seeds), seeds, random_)


def outcome(target: Target, path: Path, content: bytes) -> str:
    """Write a file, read it, and say in a word or a line what happened."""
    path.write_bytes(content)
    try:
        target.read(path)
    except ManiportError:
        return REFUSED
    except Exception as error:  # noqa: BLE001 - that it may be any is what is looked for
        place = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} at {Path(place.filename).name}:{place.lineno}: {str(error)[:120]}"
    return READ
