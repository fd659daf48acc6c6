"""Surfaces of links in a report: written small, placed right, and left out where there is no room."""

import json
import re

import numpy as np
import pytest
from pages import page_of, unpacked
from scipy.spatial.transform import Rotation

from maniport.errors import InvalidInputError
from maniport.telling.page import LARGEST, Body, Motion, Part
from maniport.telling.page.encoding import packed_indices


def read(text):
    """The data of the first motion of a page."""
    return json.loads(re.search(r'id="motion-0">(.*?)</script>', text, re.DOTALL)[1])


def poses_of(turns, positions):
    """Homogeneous transforms (n, 4, 4)."""
    poses = np.broadcast_to(np.eye(4), (len(positions), 4, 4)).copy()
    poses[:, :3, :3], poses[:, :3, 3] = turns.as_matrix(), positions
    return poses


def part(count, triangles=1, seed=0, scale=1.0):
    """A made-up surface of so many triangles that turns more than once."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(np.linspace(0, 9, count)[:, None] * rng.normal(size=3))
    points = scale * rng.normal(size=(triangles // 2 + 3, 3))
    corners = (np.arange(triangles)[:, None] + np.array([0, 1, 2])) % len(points)
    return Part(points, corners, poses_of(turns, rng.normal(size=(count, 3))))


def test_surfaces_are_where_they_were_put():
    """Points, triangles and poses come back; of a quaternion and its negative the one nearer to the one before."""
    given = part(50, 8)
    data = read(page_of(Motion(np.arange(50.0), (Body("a", np.zeros((50, 2, 3)), parts=(given,)),))))
    found = {name: unpacked(entry) for name, entry in data["bodies"][0]["parts"][0].items()}
    corners = found["points"][found["triangles"]]
    np.testing.assert_array_equal(corners, given.points.astype(np.float32)[given.triangles])
    places, turns = found["poses"][:, :3], found["poses"][:, 3:]
    np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 1.0, atol=1e-6)
    assert (np.einsum("ni,ni->n", turns[1:], turns[:-1]) > 0).all()
    np.testing.assert_allclose(poses_of(Rotation.from_quat(turns), places), given.poses, atol=1e-6)


def test_what_stands_still_has_one_pose_and_each_point_once():
    """A base is not written for every time; points that triangles share, or that none has, are not repeated."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [9, 9, 9]], dtype=float)
    base = Part(points, np.array([[0, 1, 2], [3, 4, 5]]), np.broadcast_to(np.eye(4), (30, 4, 4)))
    data = read(page_of(Motion(np.arange(30.0), (Body("a", np.zeros((30, 2, 3)), parts=(base,)),))))
    found = data["bodies"][0]["parts"][0]
    np.testing.assert_array_equal(unpacked(found["poses"]), [[0, 0, 0, 0, 0, 0, 1]])
    assert found["points"]["shape"] == [4, 3]
    assert len(np.intersect1d(*unpacked(found["triangles"]))) == 2


@pytest.mark.parametrize("count", [300, 70_000])
def test_indices_come_back(count):
    """Few fit in two bytes each, many in four."""
    indices = np.arange(0, count, 7)
    entry = packed_indices(indices, count)
    assert ("u16" in entry) == (count < 2**16)
    np.testing.assert_array_equal(unpacked(entry), indices)


def test_robot_with_its_surface_stays_small():
    """Fifteen thousand triangles in nine links add less than 1.5 MB to 1500 frames."""
    skeleton, links = np.zeros((1500, 8, 3)), tuple(part(1500, 15_000 // 9, k) for k in range(9))
    bare, clad = (page_of(Motion(np.arange(1500.0), (Body("a", skeleton, parts=p),))) for p in ((), links))
    assert len(clad) - len(bare) < 1_500_000


@pytest.mark.parametrize(
    ("links", "triangles", "frames", "said"),
    [(120, 150, 750, "750 of 1500"), (2, 150_000, 375, "Drawn as skeletons")],
)
def test_too_much_to_draw_is_left_out_and_told(links, triangles, frames, said):
    """With too many links there are fewer frames, with too many triangles a skeleton; the page is small and says so."""
    parts = tuple(part(1500, triangles, k) for k in range(links))
    text = page_of(Motion(np.arange(1500.0), (Body("a", np.zeros((1500, 2, 3)), parts=parts),)))
    assert len(text.encode()) < LARGEST
    assert said in text
    data = read(text)
    assert data["time"]["shape"] == [frames]
    assert len(data["bodies"][0]["parts"]) == (0 if "skeletons" in said else links)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Body("a", np.zeros((3, 2, 3)), parts=(part(2),)), r"poses of parts\[0\] of 'a' must have 3 entries"),
        (lambda: Part(np.zeros((2, 2)), np.zeros((1, 3), int), np.eye(4)[None]), r"points must have shape \(m, 3\)"),
        (lambda: Part(np.zeros((2, 3)), np.zeros((1, 3)), np.eye(4)[None]), "triangles must be whole numbers"),
        (lambda: Part(np.zeros((2, 3)), np.zeros((0, 3), int), np.eye(4)[None]), "k ≥ 1"),
        (lambda: Part(np.zeros((2, 3)), np.array([[0, 1, 2]]), np.eye(4)[None]), "points from 0 to 1; found 0 to 2"),
        (lambda: Part(np.zeros((2, 3)), np.array([[0, 1, 1]]), np.eye(4)), r"poses must have shape \(n, 4, 4\)"),
        (lambda: Part(np.zeros((2, 3)), np.array([[0, 1, 1]]), 2 * np.eye(4)[None]), "one that is not at index 0"),
        (lambda: Part(np.zeros((2, 3)), np.array([[0, 1, 1]]), np.diag([1.0, 1, -1, 1])[None]), "det R = 1"),
    ],
)
def test_bad_surfaces_are_refused(make, message):
    """Wrong shapes, triangles of points that are not there, and poses that are none are told at once."""
    with pytest.raises(InvalidInputError, match=message):
        make()
