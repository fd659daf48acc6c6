"""Small C3D files of every kind."""

import struct

import numpy as np

from maniport.mocap.readers.c3d import DEC, MIPS

LABELS = ("RSHO", "RELB", "C7", "T10")


class Writer:
    """Writes small C3D files as processors of each kind do; the points are those of a slowly moving arm [mm]."""

    def __init__(self, processor=84, integer=False, analog=0, frames=7, labels=LABELS):
        self.order = ">" if processor == MIPS else "<"
        self.processor = processor
        self.integer = integer
        self.analog = analog
        self.frames = frames
        self.labels = labels
        grid = np.arange(frames * 12).reshape(frames, 4, 3)
        base = np.array([[0, -200, 1400], [0, -200, 1100], [0, 0, 1450], [0, 0, 1200]])
        parts = 1 if integer else 3  # of a millimetre
        self.points = np.round(parts * (base + 40 * np.sin(grid))) / parts
        self.lost = np.zeros((frames, 4), dtype=bool)
        self.lost[2, 1] = True

    def real(self, *values):
        if self.processor != DEC:
            return np.array(values, dtype=f"{self.order}f4").tobytes()
        bits = (4 * np.array(values, dtype=np.float32)).view(np.uint32)
        bits[np.array(values) == 0] = 0
        return np.stack([bits >> 16, bits & 0xFFFF], axis=1).astype("<u2").tobytes()

    def short(self, *values):
        return np.array(values, dtype=f"{self.order}u2").tobytes()

    def parameter(self, group, name, kind, extents, data):
        body = struct.pack("bB", kind, len(extents)) + bytes(extents) + data + b"\0"
        return (
            struct.pack("bb", len(name), group) + name.encode() + self.short(len(body) + 2) + body
        )

    def group(self, number, name):
        return struct.pack("bb", len(name), -number) + name.encode() + self.short(3) + b"\0"

    def content(self, empty_scale=False, frames=None, more=b""):
        scale = 0.5 if self.integer else -0.5
        section = self.group(1, "POINT") + b"".join(
            [
                self.parameter(1, "USED", 2, (), self.short(4)),
                self.parameter(1, "SCALE", 4, (), self.real(scale)),
                self.parameter(1, "RATE", 4, (), self.real(50.0)),
                self.parameter(1, "DATA_START", 2, (), self.short(4)),
                self.parameter(1, "FRAMES", 2, (), self.short(self.frames)),
                self.parameter(1, "UNITS", -1, (2,), b"mm"),
                self.parameter(
                    1,
                    "LABELS",
                    -1,
                    (16, 4),
                    b"".join(label.encode().ljust(16) for label in self.labels),
                ),
            ]
        )
        if self.analog:
            values = () if empty_scale else (1.0,) * self.analog
            section += self.group(2, "ANALOG") + b"".join(
                [
                    self.parameter(2, "USED", 2, (), self.short(self.analog)),
                    self.parameter(2, "GEN_SCALE", 4, (), self.real(1.0)),
                    self.parameter(2, "RATE", 4, (), self.real(100.0)),
                    self.parameter(
                        2, "SCALE", 4, (len(values),), self.real(*values) if values else b""
                    ),
                    self.parameter(2, "OFFSET", 2, (self.analog,), self.short(*(0,) * self.analog)),
                    self.parameter(2, "LABELS", -1, (2, self.analog), b"F1" * self.analog),
                ]
            )
        section = (bytes([1, 0x50, 2, self.processor]) + section + more + b"\0\0").ljust(
            1024, b"\0"
        )
        last = self.frames if frames is None else frames
        head = bytes([2, 0x50]) + self.short(4, 2 * self.analog, 1, last, 10) + self.real(scale)
        head += self.short(4, 2 if self.analog else 0) + self.real(50.0)
        rows = []
        for points, lost in zip(self.points, self.lost, strict=True):
            words = np.concatenate(
                [points / (scale if self.integer else 1), np.where(lost, -1, 0)[:, None]], axis=1
            )
            numbers = np.concatenate([words.ravel(), np.full(2 * self.analog, 7.0)])
            rows.append(
                np.round(numbers).astype(f"{self.order}i2").tobytes()
                if self.integer
                else self.real(*numbers)
            )
        data = b"".join(rows)
        return head.ljust(512, b"\0") + section + data.ljust(-(-len(data) // 512) * 512, b"\0")
