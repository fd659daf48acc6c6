"""Recordings of left arms, made of right ones: seen in a mirror, with the names exchanged."""

from dataclasses import replace

import numpy as np

from maniport.mocap.marker_sets import other_side


def in_a_mirror(recording):
    """What a recording would be had the person moved the other arm so."""
    names = tuple(other_side(name) for name in recording.names)
    return replace(recording, names=names, positions=recording.positions * np.array([1.0, 1.0, -1.0]))
