"""A recording format of one's own: a table with a row for each frame, its time [s] and three columns for each point."""

import numpy as np

from maniport.demonstrations import READERS, Recording


def read(file, scale=None, up=None):
    """Read ``time,elbow.x,elbow.y,elbow.z,wrist.x,…``; `scale` is the file's unit in metres, `up` its upward axis."""
    with open(file, encoding="utf-8") as stream:
        columns = stream.readline().strip().split(",")
        table = np.genfromtxt(stream, delimiter=",", ndmin=2)  # an empty field is nan: not seen
    positions = (scale or 1.0) * table[:, 1:].reshape(len(table), -1, 3)
    names = [column.removesuffix(".x") for column in columns[1::3]]
    return Recording(names, positions, table[:, 0], up=up or "z", source=str(file))


READERS[".csv"] = read
