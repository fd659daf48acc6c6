"""Make src/maniport/arms/data/panda_surfaces.npz: the visual meshes with fewer triangles, and the collision meshes.

The fingers are drawn as hulls. Collision meshes are unchanged.

    python scripts/make_panda_surfaces.py [panda.urdf]

The meshes are those of franka_description in franka_ros (Copyright Franka Emika GmbH, Apache License 2.0) as they
come with example-robot-data 6.0.0, whose panda.urdf is used unless another is given. Needs fast-simplification.
"""

import sys
from pathlib import Path

import fast_simplification
import numpy as np
from scipy.spatial import ConvexHull

from maniport.arms.chain import Mesh, Shape
from maniport.arms.loaders.document import read_collision_shapes, read_shapes
from maniport.arms.loaders.urdf import shapes as urdf_shapes
from maniport.arms.meshes import welded
from maniport.util.validation import Array

TARGET = Path(__file__).parents[1] / "src/maniport/arms/data/panda_surfaces.npz"
SOURCE = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
LINKS = [f"panda_link{i}" for i in range(8)]
HAND = "panda_hand"
FINGERS = ["panda_leftfinger", "panda_rightfinger"]
ARM_TRIANGLES = 9000
HAND_TRIANGLES = 900


def main() -> None:
    """Read, reduce and write."""
    places = (
        [Path(sys.argv[1])] if len(sys.argv) > 1 else [Path(entry) / SOURCE for entry in sys.path]
    )
    urdf = next((place for place in places if place.exists()), None)
    if urdf is None:
        sys.exit("panda.urdf is not there: install example-robot-data 6.0.0, or give the file")
    names = [*LINKS, HAND, *FINGERS]
    meshes = {shape.link: welded(shape.mesh) for shape in read_shapes(urdf_shapes, urdf, names)}
    total = sum(len(meshes[link][1]) for link in LINKS)
    shares = {link: ARM_TRIANGLES * len(meshes[link][1]) // total for link in LINKS} | {
        HAND: HAND_TRIANGLES
    }
    shapes = [Shape(link, _reduced(meshes[link], share)) for link, share in shares.items()]
    shapes += [Shape(link, _hull(meshes[link][0])) for link in FINGERS]
    for shape in read_collision_shapes(urdf_shapes, urdf, names).shapes:
        shapes.append(Shape(shape.link, welded(shape.mesh), collision=True))
    _write(TARGET, shapes)
    for shape in shapes:
        points, triangles = shape.mesh
        kind = "collision" if shape.collision else "visual"
        print(f"{shape.link}, {kind}: {len(points)} points, {len(triangles)} triangles")
    print(f"{TARGET}: {TARGET.stat().st_size} bytes")


def _reduced(mesh: Mesh, most: int) -> Mesh:
    """Reduce a mesh to a number of triangles by quadric error (Garland and Heckbert, SIGGRAPH 1997)."""
    points, triangles = fast_simplification.simplify(
        mesh[0].astype(np.float32), mesh[1], target_count=most
    )
    return welded((points.astype(np.float64), triangles.astype(np.int32)))


def _hull(points: Array) -> Mesh:
    """Convex hull of points with its triangles counter-clockwise seen from outside."""
    hull = ConvexHull(points)
    corners = points[hull.vertices]
    triangles = np.searchsorted(hull.vertices, hull.simplices)
    normals = np.cross(*(corners[triangles[:, k]] - corners[triangles[:, 0]] for k in (1, 2)))
    inward = np.sum(normals * hull.equations[:, :3], axis=1) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return corners, triangles.astype(np.int32)


def _write(path: Path, shapes: list[Shape]) -> None:
    """Write shapes with points on a grid of 65 536 steps; the same shapes give the same bytes."""
    arrays: dict[str, np.ndarray] = {
        "links": np.array([shape.link for shape in shapes]),
        "collision": np.array([shape.collision for shape in shapes]),
    }
    for i, shape in enumerate(shapes):
        points, triangles = shape.mesh
        corner = points.min(axis=0)
        step = float(np.ptp(points, axis=0).max()) / 65_535
        arrays[f"grid_{i}"] = np.array([*corner, step])
        arrays[f"points_{i}"] = np.round((points - corner) / step).astype(np.uint16)
        arrays[f"triangles_{i}"] = triangles.astype(np.uint16)
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
