"""The file that holds ellipsoids, and writing whole or not at all."""

import errno
import os

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from maniport.atomic_io import folder_written_whole, require_room, written_whole
from maniport.errors import FileFormatError, InvalidInputError, NotSPDError, OutputError
from maniport.files import load_ellipsoids, save_arrays, save_ellipsoids

POINTS = np.stack([np.diag([1.0, 2.0, 3.0]), np.diag([0.0, 1.0, 4.0]), np.eye(3)])
TIMES = np.array([0.0, 0.5, 1.0])


@pytest.fixture
def path(tmp_path):
    """Name a file in an empty folder."""
    return tmp_path / "profile.npz"


@pytest.mark.parametrize("time", [None, TIMES])
def test_round_trip(path, time):
    """Ellipsoids, singular ones too, and their times come back bit for bit."""
    save_ellipsoids(path, POINTS, time)
    points, found = load_ellipsoids(str(path))
    assert_array_equal(points, POINTS)
    assert (found is None) if time is None else np.array_equal(found, time)
    assert list(path.parent.iterdir()) == [path]


def test_suffix_is_not_invented(tmp_path):
    """The file has exactly the name that was asked for."""
    save_ellipsoids(tmp_path / "profile", POINTS)
    assert [p.name for p in tmp_path.iterdir()] == ["profile"]


@pytest.mark.parametrize(
    ("points", "time", "message"),
    [
        (POINTS[0], None, r"manipulability must have shape \(n, d, d\)"),
        (POINTS[:0], None, "n ≥ 1"),
        (POINTS[:, :2], None, "manipulability must hold square"),
        (-POINTS, None, r"manipulability\[0\] is indefinite"),
        (POINTS * np.nan, None, "manipulability must be finite"),
        (POINTS, TIMES[:2], r"time must have shape \(3,\); found shape \(2,\)"),
        (POINTS, TIMES + np.inf, "time must be finite"),
    ],
)
def test_unfit_ellipsoids_are_not_written(path, points, time, message):
    """What could not be read again is refused before anything is written."""
    with pytest.raises(InvalidInputError, match=message):
        save_ellipsoids(path, points, time)
    assert not list(path.parent.iterdir())


@pytest.mark.parametrize(
    ("arrays", "error", "message"),
    [
        ({"other": POINTS}, FileFormatError, r"no array 'manipulability'; it holds \['other'\]"),
        ({}, FileFormatError, "it holds nothing"),
        ({"manipulability": POINTS[0]}, FileFormatError, r"shape \(n, d, d\).*found \(3, 3\)"),
        ({"manipulability": POINTS[:0]}, FileFormatError, r"n ≥ 1; found \(0, 3, 3\)"),
        ({"manipulability": POINTS[:, :2]}, InvalidInputError, "square"),
        ({"manipulability": np.full((1, 2, 2), "a")}, InvalidInputError, "array of numbers"),
        ({"manipulability": np.where(POINTS == 4.0, np.inf, POINTS)}, InvalidInputError, r"finite; found inf at index"),
        ({"manipulability": POINTS + np.triu(POINTS, 1) + np.eye(3, k=1)}, NotSPDError, r"\[0\] is not symmetric"),
        ({"manipulability": POINTS * [[[1]], [[1]], [[-1]]]}, NotSPDError, r"\[2\] is indefinite"),
        ({"manipulability": POINTS, "time": TIMES[:2]}, FileFormatError, r"3 ellipsoids, but 'time' has shape \(2,\)"),
        ({"manipulability": POINTS, "time": TIMES * np.nan}, InvalidInputError, "time .*finite"),
        ({"manipulability": POINTS, "time": TIMES[::-1]}, InvalidInputError, "time .*must increase strictly"),
    ],
)
def test_unfit_contents_are_refused(path, arrays, error, message):
    """Missing arrays, wrong shapes and values are refused, and the message names the file."""
    save_arrays(path, arrays)
    with pytest.raises(error, match=message) as caught:
        load_ellipsoids(path)
    assert "profile.npz" in str(caught.value)


def test_unreadable_files_are_refused(path):
    """A missing, truncated, foreign or pickled file is refused, and the message names it."""
    with pytest.raises(FileFormatError, match=r"profile\.npz.*no such file"):
        load_ellipsoids(path)
    save_ellipsoids(path, POINTS)
    whole = path.read_bytes()
    for content in (whole[:-1], whole[: len(whole) // 2], b"", b"manipulability"):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match=r"profile\.npz.*(not a readable|the file is empty)"):
            load_ellipsoids(path)
    np.savez(path, manipulability=np.array([None]))
    with pytest.raises(FileFormatError, match=r"profile\.npz.*(not a readable|the file is empty)"):
        load_ellipsoids(path)


def test_interrupted_writing_leaves_nothing(path):
    """When the block fails, for whatever reason, the old file stays and the temporary one goes."""
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), written_whole(path) as temporary:  # noqa: PT012
        temporary.write_text("half")
        raise KeyboardInterrupt
    with pytest.raises(OutputError, match=r"profile\.npz.*disk full"), written_whole(path) as temporary:  # noqa: PT012
        temporary.write_text("half")
        raise OSError("disk full")
    assert path.read_text() == "old"
    assert list(path.parent.iterdir()) == [path]


def test_writing_replaces_the_old_file(path):
    """When the block ends well the new file takes the place of the old one, which was there until then."""
    path.write_text("old")
    with written_whole(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
        assert temporary.parent == path.parent
    assert path.read_text() == "new"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("place", ["", "/", "missing/profile.npz"])
def test_impossible_places_are_refused(place, tmp_path, monkeypatch):
    """A folder, or a file in a folder that does not exist, cannot be written."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match="cannot write"):
        save_ellipsoids(place, POINTS)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("folder", [False, True])
def test_what_cannot_be_written_is_told_before_the_work(folder, tmp_path, monkeypatch):
    """A folder that is not there, a name too long and a file system that refuses; what is tried leaves nothing."""
    require_room(tmp_path / "one", folder)
    for place, told in ((tmp_path / "no" / "one", "there is no folder"), (tmp_path / ("x" * 300), "name too long")):
        with pytest.raises(OutputError, match=told) as raised:
            require_room(place, folder)
        assert str(raised.value).count("cannot write") == 1
        with pytest.raises(OutputError, match=told) as raised:
            (folder_written_whole(place, ()) if folder else written_whole(place)).__enter__()
        assert str(raised.value).count("cannot write") == 1

    def fail(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    for name in ("open", "mkdir"):
        monkeypatch.setattr(os, name, fail)
    with pytest.raises(OutputError, match="Read-only file system"):
        require_room(tmp_path / "one", folder)
    monkeypatch.undo()
    assert not list(tmp_path.iterdir())


def test_an_earlier_folder_stays_unless_it_may_be_overwritten(tmp_path):
    """Without a word it is refused before the block; with it, it is there until the block has ended well."""
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "data").write_text("earlier")
    with pytest.raises(OutputError, match=r"holds an earlier result \('data'\); give overwrite= to replace it"):
        folder_written_whole(folder, ("data", "more")).__enter__()
    with pytest.raises(KeyboardInterrupt), folder_written_whole(folder, ("data",), overwrite=True) as staging:  # noqa: PT012
        (staging / "data").write_text("half")
        raise KeyboardInterrupt
    assert (folder / "data").read_text() == "earlier"
    with folder_written_whole(folder, ("data", "more"), overwrite=True) as staging:
        (staging / "more").write_text("new")
    assert [entry.name for entry in folder.iterdir()] == ["more"]
    assert list(tmp_path.iterdir()) == [folder]
