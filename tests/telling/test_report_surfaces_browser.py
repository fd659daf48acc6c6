"""Surfaces of links in a real browser."""

import numpy as np
import pytest
from pages import written

from maniport.telling.page import Body, Motion, Part


@pytest.fixture(scope="module")
def clad(motion, tmp_path_factory):
    """Two arms, one of them a box that stands and one that turns by a right angle about the vertical."""
    corners = np.stack(np.meshgrid(*[[-0.1, 0.1]] * 3, indexing="ij"), -1).reshape(8, 3)
    # in no order: some are seen clockwise from outside
    triangles = [[0, 1, 3], [0, 2, 3], [4, 5, 7], [4, 6, 7], [0, 1, 5], [0, 4, 5], [2, 3, 7], [2, 6, 7], [0, 2, 6]]
    triangles = np.array([*triangles, [0, 4, 6], [1, 3, 7], [1, 5, 7]])
    poses = np.broadcast_to(np.eye(4), (60, 4, 4)).copy()
    angle = np.linspace(0, np.pi / 2, 60)
    poses[:, 0, 0] = poses[:, 1, 1] = np.cos(angle)
    poses[:, 1, 0], poses[:, 0, 1] = np.sin(angle), -np.sin(angle)
    poses[:, 2, 3] = 0.4
    parts = (Part(corners, triangles, np.broadcast_to(np.eye(4), (60, 4, 4))), Part(corners, triangles, poses))
    time, shells = motion(3, 60)
    skeleton = np.broadcast_to([[0.0, 0, 0], [0, 0, 0.4], [0.3, 0, 0.5]], (60, 3, 3))
    person = Body("person", skeleton, {"person": shells})
    robot = Body("robot", skeleton, {"target": 1.5 * shells, "achieved": shells}, parts=parts)
    moving = Motion(time, (person, robot), legend={"target": "target", "achieved": "the robot's"})
    path = tmp_path_factory.mktemp("clad") / "report.html"
    return written(path, moving)


def pixels(browser, stage=1):
    """Colours of a stage as it is drawn now."""
    return np.array(
        browser.run(
            "new Promise(done => requestAnimationFrame(() => { const player = maniport.players[0]; player.show();"
            f" const {{gl, canvas}} = player.stages[{stage}].stage;"
            " const all = new Uint8Array(4 * canvas.width * canvas.height);"
            " gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, all);"
            " done(Array.from(new Uint32Array(all.buffer))); }))"
        )
    )


def test_surfaces_are_drawn_and_can_be_taken_off(browser, clad):
    """With its check mark the robot shows its surface, without it its skeleton; the person has none and stays."""
    browser.dress()
    browser.open(clad)
    surface, person = pixels(browser), pixels(browser, 0)
    browser.run("[...document.querySelectorAll('.key.wide label')].at(-1).click()")
    skeleton = pixels(browser)
    assert (surface != skeleton).mean() > 0.01
    assert (surface != 0).sum() > (skeleton != 0).sum()
    np.testing.assert_array_equal(pixels(browser, 0), person)
    browser.run("[...document.querySelectorAll('.key.wide label')].at(-1).click()")
    np.testing.assert_array_equal(pixels(browser), surface)
    assert browser.complaints == []
    assert browser.run("maniport.players[0].stages[1].stage.gl.getError()") == 0


def test_surfaces_move_with_the_clock(browser, clad):
    """Half way between two stored times a surface is half turned; the one that stands still stays."""
    browser.dress()
    browser.open(clad)
    turned = browser.run("maniport.poseAt(maniport.players[0].motion.bodies[1].parts[1].poses, 29, 0.5).columns")
    angle = 29.5 / 59 * np.pi / 2
    expected = [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    np.testing.assert_allclose(turned, expected, atol=1e-6)
    still = browser.run("maniport.poseAt(maniport.players[0].motion.bodies[1].parts[0].poses, 29, 0.5).columns")
    np.testing.assert_allclose(still, np.eye(3), atol=1e-6)
    before = pixels(browser)
    browser.press("End")
    browser.wait("document.querySelector('.motion').dataset.time > 5.4")
    assert (pixels(browser) != before).any()


def test_edges_stay_sharp_and_bends_are_smooth(browser, clad):
    """A right-angled edge gives each side its own normal, whatever the order of its corners; a flat bend shares one."""
    browser.dress()
    browser.open(clad)
    script = "Array.from(maniport.smoothed(new Float32Array({}), new Uint16Array({})).numbers)"
    for height, count in ((1.0, 6), (0.1, 4)):
        points = [0, 0, 0, 0, 1, 0, 1, 0, 0, 0 if height == 1 else -1, 0, height]
        for order in ([0, 1, 2, 0, 1, 3], [0, 1, 2, 1, 0, 3]):
            places, normals = np.split(np.array(browser.run(script.format(points, order))).reshape(-1, 6), 2, axis=1)
            np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
            normals *= np.sign(normals.sum(axis=1, keepdims=True))  # either sign is lit alike
            assert len(np.unique(np.round([*zip(places, normals, strict=True)], 5), axis=0)) == count
