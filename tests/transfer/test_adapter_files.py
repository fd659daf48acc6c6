"""Fitted adapters are written and read whole, without pickled objects, and damaged files are named."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from sklearn.base import clone

import maniport as mp
from maniport.errors import FileFormatError, InvalidInputError
from maniport.transfer import GeodesicCorrespondence
from maniport.transfer.adapter_file import FILE_FORMAT
from maniport.util import files

TURN = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
ADAPTERS = [
    mp.ParallelTransport(damping=0.01, base_rotation=TURN),
    mp.ScaledTransport(),
    mp.NearestNeighbor(damping=0.05, n_samples=9),
    mp.RiemannianICP(
        damping=np.float64(0.1), correspondence="geodesic", n_starts=0, most_singular=8
    ),
    mp.LengthField(n_rounds=2),
]


@pytest.fixture
def saved(tmp_path, random_spd):
    """Save a fitted adapter; return its file, the adapter and the teacher's domain."""
    rng = np.random.default_rng(0)
    teacher = random_spd(rng, 10, 3)
    adapter = mp.NearestNeighbor(damping=0.1).fit(teacher, random_spd(rng, 12, 3))
    adapter.save(tmp_path / "adapter.npz")
    return tmp_path / "adapter.npz", adapter, teacher


@pytest.mark.parametrize("adapter", ADAPTERS, ids=lambda a: type(a).__name__)
def test_round_trip_is_exact(adapter, tmp_path, random_spd):
    rng = np.random.default_rng(0)
    teacher = random_spd(rng, 10, 3)
    student = random_spd(rng, 12, 3)
    fitted = clone(adapter).fit(teacher, student)
    image = fitted.transform(teacher)
    fitted.save(str(tmp_path / "any name"))
    loaded = mp.load_adapter(tmp_path / "any name")
    assert type(loaded) is type(fitted)
    for name, value in fitted.get_params().items():
        assert_array_equal(loaded.get_params()[name], value)
    assert_array_equal(loaded.transform(teacher), image)
    assert_array_equal(clone(loaded).fit(teacher, student).transform(teacher), image)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "maniport-adapter-99"}, "maniport-adapter-99"),
        ({"method": "Magic"}, "Magic"),
        ({"method": "RigidAdapter"}, "RigidAdapter"),
        ({"method": None}, "None"),
        ({"parameters": {"color": "red"}}, "color"),
        ({"parameters": [1, 2]}, "damaged"),
        ({"parameters": {"damping": "much"}}, "damping"),
        ({"fitted": {"dispersion_ratio_": "one"}}, "dispersion_ratio_"),
        ({"fitted": {"base_rotation_": 1.0}}, "base_rotation_"),
        ({"fitted": {"stop_reason_": 3}}, "stop_reason_"),
        ({"fitted": None}, "student_damping_"),
        ({"fitted": {"transform": 1}}, "transform"),
        (None, "damaged"),
    ],
)
def test_other_contents_are_refused(saved, change, message):
    path, _, _ = saved
    arrays = files.load_arrays(path, "adapter file")
    plain = json.loads(str(arrays["adapter"]))
    if change and "fitted" in change:
        change = {"fitted": {**plain["fitted"], **change["fitted"]} if change["fitted"] else {}}
    plain = {**plain, **change} if change else "not a mapping"
    files.save_arrays(path, {**arrays, "adapter": np.array(json.dumps(plain))})
    with pytest.raises(FileFormatError, match=rf"adapter\.npz.*{message}"):
        mp.load_adapter(path)


GOLDEN = sorted((Path(__file__).parent / "golden").glob("maniport-adapter-*.npz"))


@pytest.mark.parametrize(
    "path", [path for path in GOLDEN if "images" not in path.name], ids=lambda path: path.stem
)
def test_files_of_this_format_stay_readable(path):
    if FILE_FORMAT not in path.name:
        with pytest.raises(FileFormatError, match=f"'maniport-adapter-3'.*'{FILE_FORMAT}'"):
            mp.load_adapter(path)
        return
    images = files.load_arrays(path.parent / f"{FILE_FORMAT}-images.npz", "images")
    name = path.stem.removeprefix(f"{FILE_FORMAT}-")
    np.testing.assert_allclose(
        mp.load_adapter(path).transform(images["points"]), images[name], rtol=1e-9, atol=1e-12
    )


def test_a_transport_with_dispersion_has_its_own_name(tmp_path):
    """Files of this format from earlier versions have it under the name of parallel transport."""
    loaded = mp.load_adapter(
        Path(__file__).parent / "golden" / "maniport-adapter-4-parallel-transport.npz"
    )
    assert type(loaded) is mp.ScaledTransport
    assert loaded.dispersion_ratio_ != 1.0
    loaded.save(tmp_path / "again.npz")
    again = mp.load_adapter(tmp_path / "again.npz")
    assert type(again) is mp.ScaledTransport
    points = loaded.student_mean_
    assert_array_equal(again.transform(points), loaded.transform(points))


def test_options_that_are_objects_are_not_saved(tmp_path, random_spd):
    points = random_spd(np.random.default_rng(0), 10, 3)
    adapter = mp.RiemannianICP(correspondence=GeodesicCorrespondence(), n_starts=0).fit(
        points, 2.0 * points
    )
    adapter.save(tmp_path / "adapter.npz")
    loaded = mp.load_adapter(tmp_path / "adapter.npz")
    assert_array_equal(loaded.transform(points), adapter.transform(points))
    with pytest.raises(InvalidInputError, match=r"^correspondence"):
        loaded.fit(points, 2.0 * points)


WRONG = {
    "rotation_": [np.diag([1.0, 1.0, -1.0]), 2 * np.eye(3), np.eye(2), np.full((3, 3), np.nan)],
    "student_mean_": [
        -np.eye(3),
        np.zeros((3, 3)),
        np.triu(np.ones((3, 3))),
        np.eye(3).astype("U9"),
    ],
    "history_": [np.array([np.inf]), np.eye(3), np.zeros(0)],
    "keys_": [np.eye(3)[None], -np.eye(3)[None].repeat(12, 0)],
}


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in WRONG.items() for value in values]
)
def test_arrays_that_break_a_law_are_refused(saved, name, value):
    path, _, _ = saved
    arrays = files.load_arrays(path, "adapter file")
    assert f"fitted.{name}" in arrays
    files.save_arrays(path, {**arrays, f"fitted.{name}": value})
    with pytest.raises(FileFormatError, match=rf"adapter\.npz'.*damaged.*({name}|values_)"):
        mp.load_adapter(path)
