"""Datasets of maniport in LeRobot's own library: ``python -m pytest tests/others/check_lerobot.py``.

Needs the package lerobot, which is too large for every run of the tests.
"""

import os

os.environ["HF_HUB_OFFLINE"] = "1"  # before LeRobot is imported

import numpy as np
import pytest
import torch
from lerobot.datasets.aggregate import aggregate_datasets
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from maniport.datasets.lerobot import STATE, Episode, Feature, write_lerobot

FPS = 50
ENVIRONMENT = "observation.environment_state"
FEATURES = (
    Feature(STATE, ("a.pos", "b.pos", "gripper.pos"), ("rad", "rad", "")),
    Feature("action", ("a.pos", "b.pos", "gripper.pos"), ("rad", "rad", "")),
    Feature(ENVIRONMENT, tuple(f"target.{i}" for i in range(9))),
    Feature("quality", ("distance",)),
)


def written(folder, lengths, task):
    """Write a dataset; return its values by feature, all episodes in one array."""
    generator = np.random.default_rng(len(lengths))
    episodes = []
    for number, length in enumerate(lengths):
        values = {}
        for feature in FEATURES:
            values[feature.key] = generator.normal(size=(length, feature.size)).astype(np.float32)
        episodes.append(Episode(f"clip {number}", f"{task} {number % 2}", values))
    write_lerobot(folder, episodes, FEATURES, FPS, "panda")
    joined = {}
    for feature in FEATURES:
        joined[feature.key] = np.concatenate([one.values[feature.key] for one in episodes])
    return joined


@pytest.fixture
def dataset(tmp_path):
    values = written(tmp_path / "one", (40, 47, 54), "reach")
    return tmp_path / "one", values


def test_frames_and_index(dataset):
    folder, values = dataset
    loaded = LeRobotDataset("maniport/one", root=folder)
    assert (len(loaded), loaded.num_episodes, loaded.fps) == (141, 3, FPS)
    assert loaded.meta.robot_type == "panda"
    frame = loaded[41]
    np.testing.assert_array_equal(frame[STATE].numpy(), values[STATE][41])
    np.testing.assert_allclose(float(frame["quality"]), values["quality"][41, 0])
    assert (int(frame["episode_index"]), int(frame["frame_index"])) == (1, 1)
    assert frame["task"] == "reach 1"
    assert loaded.meta.names[STATE] == ["a.pos", "b.pos", "gripper.pos"]
    mean = np.asarray(loaded.meta.stats[STATE]["mean"])
    np.testing.assert_allclose(mean, values[STATE].mean(axis=0), atol=1e-5)


def test_delta_timestamps(dataset):
    folder, values = dataset
    deltas = {STATE: [-1 / FPS, 0.0], "action": [0.0, 1 / FPS, 2 / FPS]}
    loaded = LeRobotDataset("maniport/one", root=folder, delta_timestamps=deltas)
    frame = loaded[50]
    np.testing.assert_array_equal(frame[STATE].numpy(), values[STATE][49:51])
    np.testing.assert_array_equal(frame["action"].numpy(), values["action"][50:53])
    assert loaded[40][f"{STATE}_is_pad"].tolist() == [True, False]  # begin of an episode


def test_data_loader(dataset):
    folder, _ = dataset
    loaded = LeRobotDataset("maniport/one", root=folder)
    batches = list(torch.utils.data.DataLoader(loaded, batch_size=32, shuffle=True))
    assert sum(len(batch[STATE]) for batch in batches) == 141
    assert batches[0][ENVIRONMENT].shape == (32, 9)


def test_selected_episodes(dataset):
    folder, values = dataset
    loaded = LeRobotDataset("maniport/one", root=folder, episodes=[1])
    assert len(loaded) == 47
    np.testing.assert_array_equal(loaded[0][STATE].numpy(), values[STATE][40])


def test_aggregate(dataset, tmp_path):
    folder, values = dataset
    others = written(tmp_path / "two", (30, 31), "wave")
    aggregate_datasets(
        ["maniport/one", "maniport/two"],
        "maniport/all",
        roots=[folder, tmp_path / "two"],
        aggr_root=tmp_path / "all",
    )
    loaded = LeRobotDataset("maniport/all", root=tmp_path / "all")
    assert (len(loaded), loaded.num_episodes, loaded.meta.total_tasks) == (202, 5, 4)
    np.testing.assert_array_equal(loaded[141][STATE].numpy(), others[STATE][0])
    np.testing.assert_array_equal(loaded[140][STATE].numpy(), values[STATE][140])
