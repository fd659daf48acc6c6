"""What the main job compiles when it first runs on a machine; `maniport.second` compiles it while the first works.

Both keep what they compile in one cache, and none compiles what the other one is at: who needs that waits for it, and
compiles meanwhile what the other one would come to last.
"""

import importlib
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from numba import types
from numba.core.errors import NumbaError

from maniport import compiling

FIRST = """
spd.kernels.loops.eigh_loop f3 f2 f3 i i f2
spd.kernels.loops.compose_loop f2 f3 f3 i i f2
spd.kernels.loops.moments_loop f3 f3 f1 f1 f1 b i i f2
spd.kernels.loops.congruence_loop f3 i f3 i f3 i i f2
spd.kernels.loops.distance_loop f3 i f3 i f1 i i f2
spd.kernels.loops.eigh_loop f3 f2 f3 i i f1
spd.kernels.loops.compose_loop f2 f3 f3 i i f1
spd.kernels.loops.congruence_loop f3 i f3 i f3 i i f1
spd_check.vouch f3 f3 f f f f b
bodies.manipulability_jacobian._derivatives f3 f3 f2 f2 b f4
tracking.kernels.step_within_limits f2 f2 f3 f1 r1 r1 f2 f1
tracking.kernels.add_log_residual f2 f3 f4 f2 f3
tracking.kernels.log_slopes f2
transfer.so3.minimize f3 f3 f3 f1 f2 f i f2
""".strip().split("\n")
"""What the second process compiles before it takes on work, in the order in which it is needed. Functions and the
types of their arguments: `f`, `i`, `b` numbers, whole ones, truth values; with a digit contiguous arrays of so many
dimensions, `r` read-only ones."""

REST = """
bodies.collisions.kernels.poses_of f2 f3 f2 b1 f4 f3
bodies.collisions.kernels.fill_room f4 f3 f2 i1 i1 f2 f2 i2 f1 f b2 f2
tracking.plan.shortest_path._values f2 f1 i1 f1 f1 f2 f f
tracking.kernels.add_residual f2 f3 f2 f3
transfer.icp.correspondence.match_tree._most_promising f2 f2 f3 f3 f3 f3 i1
transfer.icp.correspondence.match_tree._search f2 f2 i1 i2 f4 f4 b1 f2 f3 f3 f3 f3 i1 f1
transfer.cloud_kernels.nearest_distances f2 f3 f1
transfer.cloud_kernels.sum_distances f2 f3 f2 f1 f2
spd.kernels.loops.power_loop f3 f3 f f3 f f f3 i i f2
transfer.lengths.kernels.field_loop f3 f1 f2 f2 f2 f2 f2 f1 f3 i i f2
""".strip().split("\n")
"""What it compiles when no work waits for it; the first process begins with the last one, while it waits."""

KINDS: dict[str, Any] = {"f": types.float64, "r": types.float64, "i": types.int64, "b": types.boolean}


def _kernel(line: str) -> tuple[Any, tuple[Any, ...]]:
    """Import a function of a list; return it and the types of its arguments."""
    place, *words = line.split()
    module, _, name = place.rpartition(".")
    arguments = [
        KINDS[word[0]] if len(word) == 1 else types.Array(KINDS[word[0]], int(word[1]), "C", readonly=word[0] == "r")
        for word in words
    ]
    return getattr(importlib.import_module(f"maniport.{module}"), name), tuple(arguments)


def compile_missing(claim: Callable[[str], bool], lines: Iterable[str]) -> Iterator[str]:
    """Compile what is needed and missing, one at a time; give the name of each when it is compiled.

    `claim` is called with the name of each before, and says whether nobody else is at it.
    """
    for line in lines:
        try:
            kernel, arguments = _kernel(line)
            name = compiling.name_of(kernel.py_func, arguments)
            if compiling.is_missing(kernel, arguments) and claim(name):
                kernel.compile(arguments)
                yield name
        except (AttributeError, TypeError, NumbaError) as error:  # of a function that changed: the others are left
            print(f"{line}: {error}", file=sys.stderr)
