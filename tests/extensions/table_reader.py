"""Recording format: a row per frame with its time [s] and three columns per point."""

import numpy as np

from maniport.mocap import READERS


def read(file, options):
    """Read ``time elbow.x elbow.y elbow.z wrist.x …``; `options` are the user's unit and rate."""
    with open(file, encoding="utf-8") as stream:
        columns = stream.readline().split()
        table = np.loadtxt(stream, ndmin=2)
    names = [column.removesuffix(".x") for column in columns[1::3]]
    return options.recording(
        file, names, table[:, 1:].reshape(len(table), -1, 3), table[:, 0], unit="m"
    )


READERS[".pts"] = read
