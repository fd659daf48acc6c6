"""The robot executes a profile: placement, time, what is written."""

import csv
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import maniport as mp
from maniport.errors import FileFormatError, InvalidInputError, OutputError
from maniport.files import load_ellipsoids, load_path, save_path
from maniport.pipeline.follow import _Asked, follow
from maniport.telling import as_numbers, facts_of
from maniport.telling.renderings import files_of
from maniport.telling.write import EXECUTION_FILES, EXPORTS
from sizes import few_places


@pytest.fixture(scope="module")
def panda():
    """The robot."""
    return mp.load_arm("panda")


@pytest.fixture(scope="module")
def wanted(panda):
    """A motion of the Panda: times, its own ellipsoids and hand path, and the joint positions."""
    time = np.linspace(0.0, 2.0, 21)
    phase = np.sin(np.linspace(0.0, np.pi, 21))[:, None]
    joints = np.array([0.1, -0.5, 0.2, -2.0, 0.3, 1.8, 0.0]) + 0.3 * phase * np.array([1, 0.5, -1, 0.7, 0.5, -0.5, 0])
    return time, panda.manipulability(joints), panda.forward(joints)[:, :3, 3], joints


@pytest.fixture(scope="module")
def execution(panda, wanted):
    """The Panda follows its own motion where it was made."""
    time, profile, path, _ = wanted
    return follow(panda, profile, time, path, place=False)


def test_own_motion_is_followed(execution):
    """Ellipsoids that the robot made itself are followed to a distance of 0.05, its path to what the tip may leave it.

    They begin and end in full motion, and the robot at rest: it is farther from them there.
    """
    assert np.median(execution.motion.distance) < 0.05
    assert np.percentile(execution.motion.distance, 95) < 0.1
    assert np.percentile(execution.motion.position_error, 95) < execution.plan.tip_tolerance
    assert execution.placement is None


def test_tempo_stretches_time(panda, wanted):
    """At half the tempo the same motion takes twice as long, but for the moments in which it starts and ends."""
    time, profile, path, _ = wanted
    slow = follow(panda, profile, time, path, place=False, tempo=0.5)
    assert 2.0 * np.ptp(time) <= slow.motion.control_time[-1] < 2.05 * np.ptp(time)
    np.testing.assert_allclose(np.diff(slow.motion.time), 2.0 * np.diff(time), rtol=0.2)
    np.testing.assert_array_equal(slow.plan.demonstrated_time, time)
    assert np.median(slow.motion.distance) < 0.05


def test_placement_turns_path_and_profile(panda, wanted):
    """With `place` the robot is asked for the placed path and the turned profile."""
    time, profile, path, _ = wanted
    with few_places():
        placed = follow(panda, profile, time, path + 2.0)
    np.testing.assert_allclose(placed.motion.path, placed.placement.path, atol=1e-12)
    np.testing.assert_allclose(placed.motion.target, placed.placement.profile, atol=1e-12)
    assert placed.placed_time.shape == placed.placement.distance.shape
    assert np.median(placed.motion.position_error) < 1e-3
    assert as_numbers(facts_of(placed))["placement"]["scale"] == placed.placement.scale


def ran(share, distance=1.0, lasts=1.0, placement=None, tip=0.0):
    """What a motion is compared with others by; its tip may be 1 mm beside its path."""
    motion = SimpleNamespace(distance=np.full(3, distance), control_time=np.array([0.0, lasts]))
    motion.position_error, plan = np.array([0.0, 0.0, tip]), SimpleNamespace(tip_tolerance=1e-3)
    return SimpleNamespace(room=SimpleNamespace(share=share), motion=motion, placement=placement, plan=plan)


@pytest.mark.parametrize(
    ("shares", "moved", "kept"),
    [((0.0, None), True, 0), ((0.2, 0.0), True, 1), ((0.2, 0.3), True, 0), ((0.2, None), False, 0)],
)
def test_where_the_motion_collides_another_place_is_tried(panda, wanted, monkeypatch, shares, moved, kept):
    """It is one with all points in reach, planned for only where it is another, and kept where less collides."""
    time, profile, path, _ = wanted
    planned = []

    def placed(asked, *, reaching):
        return SimpleNamespace(path=path + (0.1 if reaching and moved else 0.0)), None

    def motion(asked, placement, floor, seed):
        planned.append(ran(shares[len(planned)], placement=placement))
        return planned[-1]

    monkeypatch.setattr(_Asked, "placed", placed)
    monkeypatch.setattr(_Asked, "moved", motion)
    found = follow(panda, profile, time, path, effort="quick")
    assert found is planned[kept]
    assert len(planned) == sum(share is not None for share in shares)


def test_long_paths_are_placed_by_part_of_their_points(panda, wanted, monkeypatch):
    """A path of more points than the limit is placed by every n-th of them, and followed at all."""
    monkeypatch.setattr("maniport.pipeline.execution.placed_rows.__defaults__", (8,))
    time, profile, path, _ = wanted
    with few_places():
        placed = follow(panda, profile, time, path)
    assert len(placed.placement.path) == 7
    np.testing.assert_allclose(placed.motion.path[::3], placed.placement.path, atol=1e-12)
    np.testing.assert_allclose(placed.motion.target[::3], placed.placement.profile, atol=1e-12)
    assert placed.plan.node_floor.shape == time.shape
    np.testing.assert_array_equal(placed.placed_time, placed.motion.time[::3])


def test_run_knows_its_gap_seed_and_files(panda, wanted, tmp_path):
    """The summary has the feasibility gap and the seed, and the command's report the files it was given."""
    time, profile, _, _ = wanted
    run = replace(follow(panda, 4.0 * profile, time, random_state=5), sources=("wanted.npz",))
    numbers = as_numbers(facts_of(run))
    assert numbers["run"]["random_state"] == 5
    assert numbers["run"]["sources"] == ["wanted.npz"]
    assert numbers["motion"]["feasibility_gap"]["median"] == pytest.approx(np.median(run.gap))
    assert np.median(run.gap) > 0.1  # no Panda is twice as fast
    assert (run.gap <= run.motion.distance + 1e-6).all()
    mp.write_results(run, tmp_path / "run")
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "wanted.npz" in page
    assert "<dt>Seed</dt><dd><b>5</b>" in page


def test_ellipsoids_alone_are_followed(panda, wanted):
    """Without a path there is no position error and no placement."""
    time, profile, _, _ = wanted
    alone = follow(panda, profile, time)
    assert alone.motion.position_error is None
    assert np.median(alone.motion.distance) < 0.05
    assert "tip_error_mm" not in as_numbers(facts_of(alone))["motion"]


def test_folder_holds_all_that_was_promised(execution, tmp_path):
    """The joint trajectory can be read back from text and arrays, and the numbers from JSON."""
    mp.write_results(execution, tmp_path / "out")
    assert {entry.name for entry in (tmp_path / "out").iterdir()} == set(EXECUTION_FILES) - {
        *EXPORTS,
        *files_of("motion"),
    }
    rows = list(csv.reader((tmp_path / "out" / "joints.csv").open()))
    assert rows[0][:2] == ["time_s", "panda_joint1_rad"]
    np.testing.assert_allclose(np.array(rows[1:], float)[:, 1:8], execution.motion.control_positions, atol=1e-8)
    achieved, time = load_ellipsoids(tmp_path / "out" / "joints.npz")
    np.testing.assert_array_equal(achieved, execution.motion.achieved)
    np.testing.assert_array_equal(time, execution.motion.time)
    numbers = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert numbers == json.loads(json.dumps(as_numbers(facts_of(execution))))
    positions, times = load_path(tmp_path / "out" / "path.npz")
    np.testing.assert_array_equal(positions, execution.motion.path)
    np.testing.assert_array_equal(times, execution.motion.time)


def test_foreign_folder_is_refused(execution, tmp_path):
    """A folder that holds other things is left as it is."""
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"notes\.txt"):
        mp.write_results(execution, tmp_path)


def test_bad_input_is_refused(panda, wanted):
    """Missing times, a tempo of zero, and unequal lengths are said."""
    time, profile, path, _ = wanted
    with pytest.raises(InvalidInputError, match="no times"):
        follow(panda, profile, None, path)
    with pytest.raises(InvalidInputError, match="tempo"):
        follow(panda, profile, time, path, tempo=0.0)
    with pytest.raises(InvalidInputError, match="must have shape"):
        follow(panda, profile, time, path[:-1])
    with pytest.raises(InvalidInputError, match="one row for each"):
        follow(panda, profile, time[:-1], path, place=False)


def test_path_files_are_checked(tmp_path):
    """A path file must hold positions of shape (n, 3)."""
    save_path(tmp_path / "p.npz", np.zeros((4, 3)))
    positions, time = load_path(tmp_path / "p.npz")
    assert positions.shape == (4, 3)
    assert time is None
    with pytest.raises(InvalidInputError, match="path must have shape"):
        save_path(tmp_path / "q.npz", np.zeros(3))
    np.savez(tmp_path / "other.npz", x=1)
    with pytest.raises(FileFormatError, match="no array 'path'"):
        load_path(tmp_path / "other.npz")
    np.savez(tmp_path / "flat.npz", path=np.zeros(3))
    with pytest.raises(FileFormatError, match="must have shape"):
        load_path(tmp_path / "flat.npz")
