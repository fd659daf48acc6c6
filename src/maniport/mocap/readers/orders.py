"""Arrays of joints without names: the skeleton in whose order they are, by its arms and by its sides."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from maniport.arms.chain import RIGHT
from maniport.mocap.body_sides import MOST_FRAMES, BodySides, body_sides
from maniport.mocap.readers import Coordinates, arm_error
from maniport.mocap.recording import MAX_POSITION, Recording
from maniport.mocap.roles import find_roles, other_side


class Order(NamedTuple):
    """The order of joints in an array."""

    names: tuple[str, ...]  # of the joints in this order; empty where none is recognized
    text: str  # how it was recognized, or why not
    is_assumed: bool = False  # whether the text is a warning


def recognized_order(skeletons: Mapping[str, Sequence[str]], positions: Coordinates) -> Order:
    """Recognize the order of joints (n, k, 3) among those of skeletons, in any unit of length.

    The arms must have constant lengths. Orders that are the same but for the sides are told apart by the body; where it
    shows nothing, the first is assumed. A body that contradicts the only order has its sides exchanged.
    """
    fits = _fitting_orders(skeletons, positions)
    if not fits:
        listed = ", ".join(f"{len(joints)} ({name})" for name, joints in skeletons.items())
        return Order((), f"recognized by their number are {listed}")

    first, *others = fits
    order = fits[first]
    exchanged = tuple(map(other_side, order))
    mirrored = [name for name in others if fits[name] == exchanged]
    if len(others) > len(mirrored):
        return Order((), f"{' and '.join(fits)} both fit")

    count = len(order)
    taken = f"{count} joints without names: taken as {first}"
    sides = _sides(order, positions)
    if sides.agree or not (sides.contradict or mirrored):
        return Order(order, f"{taken}, in which their arms have constant lengths")
    if not sides.contradict:
        text = f"{taken}, not as {mirrored[0]}; the body does not show which side is left: check it"
        return Order(order, text, is_assumed=True)
    if mirrored:
        cause = "of the two orders of this skeleton the body shows this one"
        return Order(exchanged, f"{count} joints without names: taken as {mirrored[0]}; {cause}")
    cause = "left and right are exchanged in it, or one axis is mirrored (left-handed axes)"
    return Order(exchanged, f"{taken} with left and right exchanged, since {cause}", True)


def _fitting_orders(
    skeletons: Mapping[str, Sequence[str]], positions: Coordinates
) -> dict[str, tuple[str, ...]]:
    """Return the orders in which joints (n, k, 3) have arms of constant lengths, by the names of skeletons."""
    fits = {}
    for name, joints in skeletons.items():
        if len(joints) == positions.shape[1] and arm_error(joints, positions) < 1.0:
            fits[name] = tuple(joints)
    return fits


def _sides(names: Sequence[str], positions: Coordinates) -> BodySides:
    """Compare the sides of an order of joints with the body."""
    every = -(-len(positions) // MOST_FRAMES)
    with np.errstate(over="ignore"):  # of wider floating-point types
        points = positions[::every].astype(np.float64)
    points[~(np.abs(points) <= MAX_POSITION).all(axis=-1)] = np.nan
    recording = Recording(tuple(names), points, np.arange(len(points), dtype=np.float64))
    roles = find_roles(recording.observed, RIGHT)[1]
    return body_sides(recording, roles, RIGHT)
