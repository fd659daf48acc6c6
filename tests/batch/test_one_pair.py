"""A batch of one pair is a single transfer."""

import pytest

import maniport as mp
from maniport.batch.pair import PAIR
from maniport.pipeline import Config
from sizes import little_search

FILES = (
    "adapter.npz",
    "demonstrated_profile.npz",
    "joints.csv",
    "joints.npz",
    "path.npz",
    "person.csv",
    "placed_profile.npz",
    "target_profile.npz",
)


@pytest.mark.slow
def test_a_batch_of_one_pair_is_a_single_transfer(tmp_path):
    """With a selected method the maps are of the person of this recording, as those of a single transfer."""
    options = {"method": "auto", "start": 2.0, "stop": 2.3, "n_teacher": 64, "n_student": 128}
    config = Config(**options, profile_rate=1000.0)
    with little_search():
        batch = mp.transfer_batch(["freeform"], ["panda"], tmp_path / "batch", config, processes=1)
        single = mp.Transfer("panda", config).run("freeform")
    single.save(tmp_path / "single")

    (row,) = batch.table
    folder = tmp_path / "batch" / row["folder"]
    assert (folder / PAIR).exists()
    for name in FILES:
        assert (folder / name).read_bytes() == (tmp_path / "single" / name).read_bytes(), name
