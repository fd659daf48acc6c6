import zipfile

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import maniport as mp
from maniport.errors import FileFormatError, InvalidInputError, NotSPDError
from maniport.util.files import (
    load_ellipsoids,
    load_path,
    read_settings,
    require_mapping,
    save_arrays,
    save_ellipsoids,
    save_path,
)
from maniport.util.input_limits import SETTINGS_BYTES

POINTS = np.stack([np.diag([1.0, 2.0, 3.0]), np.diag([0.0, 1.0, 4.0]), np.eye(3)])
TIMES = np.array([0.0, 0.5, 1.0])


@pytest.mark.parametrize("time", [None, TIMES])
def test_ellipsoids_and_paths_come_back_bit_for_bit(tmp_path, time):
    for save, load, values in (
        (save_ellipsoids, load_ellipsoids, POINTS),
        (save_path, load_path, POINTS[0]),
    ):
        save(tmp_path / "profile", values, time)
        again, times = load(str(tmp_path / "profile"))
        assert_array_equal(again, values)
        assert (times is None) if time is None else np.array_equal(times, time)
        assert [file.name for file in tmp_path.iterdir()] == ["profile"]


@pytest.mark.parametrize(
    ("save", "values", "time", "word"),
    [
        (save_ellipsoids, POINTS[0], None, r"manipulability must have shape \(n, d, d\)"),
        (save_ellipsoids, -POINTS, None, r"manipulability\[0\] is indefinite"),
        (save_ellipsoids, POINTS * np.nan, None, "manipulability must be finite"),
        (save_ellipsoids, POINTS, TIMES + np.inf, "time must be finite"),
        (save_path, np.zeros(3), None, "path must have shape"),
    ],
)
def test_values_that_could_not_be_read_again_are_not_written(tmp_path, save, values, time, word):
    with pytest.raises(InvalidInputError, match=word):
        save(tmp_path / "profile.npz", values, time)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("load", "arrays", "error", "word"),
    [
        (
            load_ellipsoids,
            {"other": POINTS},
            FileFormatError,
            r"no array 'manipulability'; it holds other",
        ),
        (load_ellipsoids, {"manipulability": POINTS[0]}, InvalidInputError, "shape"),
        (
            load_ellipsoids,
            {"manipulability": np.full((1, 2, 2), "a")},
            InvalidInputError,
            "array of numbers",
        ),
        (
            load_ellipsoids,
            {"manipulability": np.where(POINTS == 4, np.inf, POINTS)},
            InvalidInputError,
            "finite",
        ),
        (
            load_ellipsoids,
            {"manipulability": POINTS + np.eye(3, k=1)},
            NotSPDError,
            r"\[0\] is not symmetric",
        ),
        (
            load_ellipsoids,
            {"manipulability": POINTS * [[[1]], [[1]], [[-1]]]},
            NotSPDError,
            r"\[2\] is indefinite",
        ),
        (
            load_ellipsoids,
            {"manipulability": POINTS, "time": TIMES[:2]},
            InvalidInputError,
            "shape",
        ),
        (
            load_ellipsoids,
            {"manipulability": POINTS, "time": TIMES[::-1]},
            InvalidInputError,
            "increase strictly",
        ),
        (load_path, {"path": np.zeros(3)}, InvalidInputError, "must have shape"),
    ],
)
def test_wrong_arrays_are_refused(tmp_path, load, arrays, error, word):
    save_arrays(tmp_path / "profile.npz", arrays)
    with pytest.raises(error, match=word) as caught:
        load(tmp_path / "profile.npz")
    assert "profile.npz" in str(caught.value)


def test_unreadable_files_are_refused(tmp_path):
    path = tmp_path / "profile.npz"
    with pytest.raises(FileFormatError, match=r"profile\.npz.*no such"):
        load_ellipsoids(path)
    save_ellipsoids(path, POINTS)
    whole = path.read_bytes()
    for length in (-1, len(whole) // 2, 14, 0):
        path.write_bytes(whole[:length])
        with pytest.raises(FileFormatError, match=r"profile\.npz.*(readable|empty)"):
            load_ellipsoids(path)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("a: 1\n b: 2\n", "line 2, column 3"),
        ("a: 1\na: 2\n", "the key 'a' occurs twice"),
        ("a: &x [1]\nb: *x\n", "aliases"),
        ("a: !!python/object/apply:os.system [true]\n", "could not determine a constructor"),
        ("- 1\n", "keys a, b; found list"),
        ("# nothing\n", "found nothing"),
        ("c: 1\n", "unknown key 'c'; allowed are, nearest first: a, b"),
        ("a: " + "[" * 1500, "not readable as YAML"),
        ("a: \x00", "not readable as YAML"),
        (b"a: \xff\xfe", "not readable as YAML"),
        (" " * (SETTINGS_BYTES + 1), "at most 0.25 MB"),
    ],
)
def test_faulty_settings_are_refused(tmp_path, text, word):
    path = tmp_path / "s.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(FileFormatError, match=word):
        read_settings(path, ("a", "b"))


def test_a_nested_mapping_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=r"l\.yaml: joints.*'velocty'.*velocity"):
        require_mapping({"velocty": 1}, ("jerk", "velocity"), "l.yaml: joints")
    with pytest.raises(FileFormatError, match=r"other\.yaml"):
        read_settings(tmp_path / "other.yaml", ("a",))
    with pytest.raises(FileFormatError, match=r"\.yaml.*\.yml.*\.json"):
        read_settings(__file__, ("a",))


def test_an_archive_of_many_arrays_is_described_by_a_few(tmp_path):
    """Each reader of .npz files names a few arrays and how many there are."""
    path = tmp_path / "many.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for number in range(1_000):
            archive.writestr(f"an_array_of_many_{number}{'x' * (number == 0) * 500}.npy", b"")
    for read in (load_ellipsoids, load_path, mp.load_adapter, mp.read_recording):
        with pytest.raises(FileFormatError, match="and 99") as error:
            read(path)
        assert len(str(error.value)) < 800
