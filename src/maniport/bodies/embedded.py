"""Arms that come with the package: chains as JSON, and what their links look like as small files."""

import json
import zipfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from maniport.bodies.chain import REVOLUTE, Body, Chain, Frame, Joint, Shape, pose
from maniport.errors import FileFormatError

DATA = Path(__file__).parent / "data"
_STEPS = 65_535
"""Coordinates are whole multiples of this fraction of the longest side of the box around a shape."""


def read_embedded(name: str) -> Chain:
    """Read a chain that ships with the package, ``bodies/data/<name>.json``."""
    chain = chain_from_json(json.loads((DATA / f"{name}.json").read_text(encoding="utf-8")))
    shapes = DATA / f"{name}_surfaces.npz"
    return replace(chain, shapes=partial(read_shapes, shapes)) if shapes.exists() else chain


def chain_from_json(data: Mapping[str, Any]) -> Chain:
    """Build a chain from the content of an embedded file (lengths in metres, angles in radians)."""
    coordinates = [entry["name"] for entry in data["coordinates"]]
    coupling = np.zeros((len(data["joints"]), len(coordinates)))
    joints: list[Joint] = []
    for row, entry in enumerate(data["joints"]):
        for coordinate, factor in entry.get("follows", {entry["name"]: 1.0}).items():
            coupling[row, coordinates.index(coordinate)] = factor
        axis = np.array(entry["axis"], dtype=np.float64)
        placement = pose(entry["xyz"], entry.get("rpy", (0, 0, 0)))
        if not joints:
            placement = pose(**data["base"]) @ placement
        joints.append(Joint(entry["name"], entry.get("kind", REVOLUTE), axis / np.linalg.norm(axis), placement))
    speeds = [entry.get("velocity", np.inf) for entry in data["coordinates"]]
    return Chain(
        name=data["name"],
        joints=tuple(joints),
        frames={
            f["name"]: Frame(f["joint"], pose(f["xyz"], f.get("rpy", (0, 0, 0))), f.get("parent"))
            for f in data["frames"]
        },
        frame=data["tip"],
        coordinates=tuple(coordinates),
        lower=np.array([entry["lower"] for entry in data["coordinates"]], dtype=np.float64),
        upper=np.array([entry["upper"] for entry in data["coordinates"]], dtype=np.float64),
        coupling=coupling,
        offset=np.zeros(len(joints)),
        velocity_limits=np.array(speeds) if np.any(np.isfinite(speeds)) else None,
        others=None if "others" not in data else {
            body["name"]: Body(body["joint"], np.array([pose(**place) for place in body["placements"]]), body["name"])
            for body in data["others"]
        },
    )  # fmt: skip


def write_shapes(path: Path, shapes: Sequence[Shape]) -> None:
    """Write shapes with up to 65 536 points each; the same shapes give the same bytes."""
    arrays: dict[str, np.ndarray] = {"links": np.array([shape.link for shape in shapes])}
    for i, shape in enumerate(shapes):
        points, triangles = shape.mesh
        corner, step = points.min(axis=0), float(np.ptp(points, axis=0).max()) / _STEPS
        arrays[f"grid_{i}"] = np.array([*corner, step])
        arrays[f"points_{i}"] = np.round((points - corner) / step).astype(np.uint16)
        arrays[f"triangles_{i}"] = triangles.astype(np.uint16)
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]


def read_shapes(path: Path, links: Collection[str]) -> list[Shape]:
    """Read what `write_shapes` wrote of some links."""
    try:
        with np.load(path, allow_pickle=False) as data:
            shapes = []
            for i, link in enumerate(data["links"].tolist()):
                if link in links:
                    *corner, step = data[f"grid_{i}"]
                    points = np.array(corner) + step * data[f"points_{i}"]
                    shapes.append(Shape(link, (points, data[f"triangles_{i}"].astype(np.int32))))
            return shapes
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"{path}: holds no shapes of links: {error}") from None
