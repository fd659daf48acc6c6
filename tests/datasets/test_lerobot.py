"""LeRobot datasets: what is written has the layout of version 3.0, and versions 3.0 and 2.1 are read."""

import json
import shutil

import numpy as np
import pytest

pyarrow = pytest.importorskip("pyarrow")

import pyarrow.parquet as pq  # noqa: E402

from maniport.datasets.lerobot import (  # noqa: E402
    STATE,
    Episode,
    Feature,
    LeRobotDataset,
    write_lerobot,
)
from maniport.errors import FileFormatError, InvalidInputError, OutputError, UnknownNameError  # noqa: E402

NAMES = ("a.pos", "b.pos", "c.pos")
FEATURES = (
    Feature(STATE, NAMES, ("rad", "rad", "m")),
    Feature("action", NAMES, ("rad", "rad", "m")),
    Feature("quality", ("distance",)),
)


def episodes(count=3):
    generator = np.random.default_rng(1)
    for number in range(count):
        length = 10 + 5 * number
        state = generator.normal(size=(length, 3))
        values = {
            STATE: state,
            "action": state[1:][[*range(length - 1), -1]],
            "quality": state[:, :1],
        }
        yield Episode(f"clip {number}", "reach" if number else "wave", values, {"status": "green"})


@pytest.fixture
def dataset(tmp_path):
    write_lerobot(tmp_path / "set", episodes(), FEATURES, 25, "panda")
    return tmp_path / "set"


def test_files_and_numbers(dataset):
    info = json.loads((dataset / "meta" / "info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, 45, 2)
    assert (info["fps"], info["robot_type"], info["splits"]) == (25, "panda", {"train": "0:3"})
    assert info["video_path"] is None
    assert info["features"][STATE] == {"dtype": "float32", "shape": [3], "names": list(NAMES)}

    data = pq.read_table(dataset / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(data.column_names) == set(info["features"])
    assert data["index"].to_pylist() == list(range(45))
    assert data["episode_index"].to_pylist() == [0] * 10 + [1] * 15 + [2] * 20
    assert data["task_index"].to_pylist() == [0] * 10 + [1] * 35
    np.testing.assert_allclose(data["timestamp"].to_numpy()[:10], np.arange(10) / 25, atol=1e-6)
    assert data.schema.field("timestamp").type == pyarrow.float32()
    assert data.schema.field("quality").type == pyarrow.float32()  # vectors of one are numbers
    assert data.schema.field(STATE).type.value_type == pyarrow.float32()

    rows = pq.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["length"] for row in rows] == [10, 15, 20]
    assert [row["dataset_from_index"] for row in rows] == [0, 10, 25]
    assert [row["dataset_to_index"] for row in rows] == [10, 25, 45]
    assert rows[0]["tasks"] == ["wave"]
    assert {row["data/file_index"] for row in rows} == {0}
    state = np.array(data[STATE].to_pylist())
    for row, part in zip(rows, (state[:10], state[10:25], state[25:]), strict=True):
        np.testing.assert_allclose(row[f"stats/{STATE}/mean"], part.mean(axis=0), atol=1e-6)
        np.testing.assert_allclose(
            row[f"stats/{STATE}/q90"], np.quantile(part, 0.9, axis=0), atol=1e-6
        )


def test_statistics_of_all_episodes(dataset):
    stats = json.loads((dataset / "meta" / "stats.json").read_text())
    state = np.array(pq.read_table(dataset / "data/chunk-000/file-000.parquet")[STATE].to_pylist())
    assert set(stats[STATE]) == {
        "min",
        "max",
        "mean",
        "std",
        "count",
        "q01",
        "q10",
        "q50",
        "q90",
        "q99",
    }
    for name in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(stats[STATE][name], getattr(np, name)(state, axis=0), atol=1e-6)
    assert stats[STATE]["count"] == [45]
    assert len(stats["timestamp"]["mean"]) == 1


def test_the_index_of_the_tasks_is_described_for_pandas(dataset):
    schema = pq.read_schema(dataset / "meta" / "tasks.parquet")
    assert json.loads(schema.metadata[b"pandas"])["index_columns"] == ["task"]
    assert schema.names == ["task_index", "task"]


def test_what_was_written_is_read(dataset):
    found = LeRobotDataset(dataset)
    motions = dict(found.motions())
    assert list(motions) == [0, 1, 2]
    for motion, episode in zip(motions.values(), episodes(), strict=True):
        np.testing.assert_allclose(motion.positions, episode.values[STATE], atol=1e-6)
        assert motion.columns == NAMES
        assert motion.units == ("rad", "rad", "m")
        assert motion.rate == pytest.approx(25.0)
    assert [number for number, _ in found.motions(episodes=[2])] == [2]


def test_a_file_of_data_ends_at_its_size(tmp_path, monkeypatch):
    monkeypatch.setattr("maniport.datasets.lerobot.writer.DATA_MEGABYTES", 1e-4)
    write_lerobot(tmp_path / "set", episodes(5), FEATURES, 25, "panda")
    files = sorted((tmp_path / "set" / "data").rglob("*.parquet"))
    assert len(files) > 1
    rows = pq.read_table(tmp_path / "set/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["data/file_index"] for row in rows][-1] == len(files) - 1
    assert len(dict(LeRobotDataset(tmp_path / "set").motions())) == 5


def as_version_2(dataset, folder, names=None, fps=25):
    """Write a dataset as version 2.1: a file for each episode."""
    info = json.loads((dataset / "meta" / "info.json").read_text())
    info["codebase_version"] = "v2.1"
    info["fps"] = fps
    info["data_path"] = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    if names is not None:
        info["features"][STATE]["names"] = names
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    data = pq.read_table(dataset / "data/chunk-000/file-000.parquet")
    lines = []
    for number in range(info["total_episodes"]):
        rows = pyarrow.compute.equal(data["episode_index"], number)
        part = data.filter(rows)
        lists = pyarrow.array(part[STATE].to_pylist(), pyarrow.list_(pyarrow.float32()))
        part = part.set_column(part.column_names.index(STATE), STATE, lists)
        pq.write_table(part, folder / f"data/chunk-000/episode_{number:06d}.parquet")
        lines.append(json.dumps({"episode_index": number, "tasks": ["a"], "length": part.num_rows}))
    (folder / "meta" / "episodes.jsonl").write_text("\n".join(lines))
    return folder


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["a.pos", "b.pos", "c.pos"], NAMES),
        ([["kLeftA", "kLeftB", "kLeftC"]], ("kLeftA", "kLeftB", "kLeftC")),
        ({"motors": ["a", "b", "c"]}, ("a", "b", "c")),
        ({"left": ["a"], "right": ["b", "c"]}, ("a", "b", "c")),
        ({"b": 1, "a": 0, "c": 2}, ("a", "b", "c")),
        (None, ()),
        (["state"], ()),
    ],
)
def test_version_2_and_names_in_the_wild(dataset, tmp_path, names, expected):
    import pyarrow.compute  # noqa: F401

    folder = as_version_2(dataset, tmp_path / "old", names if names is not None else 0, 25.0)
    found = LeRobotDataset(folder)
    assert found.columns() == expected
    motions = dict(found.motions())
    for motion, episode in zip(motions.values(), episodes(), strict=True):
        np.testing.assert_allclose(motion.positions, episode.values[STATE], atol=1e-6)
        assert motion.units == ("", "", "")


def test_a_state_in_parts(tmp_path):
    features = (
        Feature(f"{STATE}.left_arm", ("one", "two")),
        Feature(f"{STATE}.right_arm", ("one", "two")),
        Feature("action", ("x",)),
    )
    values = {
        f"{STATE}.left_arm": np.ones((4, 2)),
        f"{STATE}.right_arm": np.zeros((4, 2)),
        "action": np.ones((4, 1)),
    }
    write_lerobot(tmp_path / "set", [Episode("a", "b", values)], features, 10, "two")
    found = LeRobotDataset(tmp_path / "set")
    assert found.columns() == ("left_arm.one", "left_arm.two", "right_arm.one", "right_arm.two")
    assert dict(found.motions())[0].positions[0].tolist() == [1.0, 1.0, 0.0, 0.0]
    with pytest.raises(UnknownNameError, match="state"):
        list(found.motions("observation.stat"))


def edit(path, change):
    table = pq.read_table(path)
    pq.write_table(change(table), path)


def replaced(name, function):
    def change(table):
        values = pyarrow.array(function(table[name].to_pylist()))
        return table.set_column(table.column_names.index(name), name, values)

    return change


def with_nan(rows):
    rows[3][1] = float("nan")
    return rows


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda table: table.drop_columns([STATE]), "observation.state"),
        (replaced(STATE, with_nan), "finite"),
        (replaced(STATE, lambda rows: [row[:2] for row in rows]), "3 numbers"),
        (replaced(STATE, lambda rows: [*rows[:-1], rows[-1][:2]]), "3 numbers"),
        (replaced(STATE, lambda rows: [*rows[:-1], None]), "3 numbers"),
        (replaced(STATE, lambda rows: [[str(v) for v in row] for row in rows]), "numbers"),
        (replaced("timestamp", lambda rows: [1.2 * value for value in rows]), "25 Hz"),
        (lambda table: table.slice(0, 25), "1 of 3"),
        (replaced("frame_index", lambda rows: [0 for _ in rows]), "25 Hz"),
    ],
    ids=[
        "no column",
        "nan",
        "other count",
        "one short",
        "null",
        "text",
        "other rate",
        "cut",
        "frames",
    ],
)
def test_faulty_data(dataset, change, word):
    edit(dataset / "data/chunk-000/file-000.parquet", change)
    with pytest.raises(FileFormatError, match=word):
        list(LeRobotDataset(dataset).motions())


@pytest.mark.parametrize("share", [0.0, 0.3, 0.95])
def test_truncated_data(dataset, share):
    path = dataset / "data/chunk-000/file-000.parquet"
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(FileFormatError):
        list(LeRobotDataset(dataset).motions())


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"codebase_version": "v1.6"}, "v3.0"),
        ({"fps": 0}, "fps"),
        ({"fps": "fast"}, "fps"),
        ({"features": None}, "features"),
        ({"total_episodes": 4}, "1 of 4"),
        ({"codebase_version": "v2.1", "data_path": "../../{episode_index}.parquet"}, "out of"),
        (
            {"codebase_version": "v2.1", "data_path": "{episode_index.__class__}.parquet"},
            "no such file",
        ),
        ({"codebase_version": "v2.1", "data_path": "{nothing}.parquet"}, "nothing"),
    ],
)
def test_faulty_info(dataset, change, word):
    path = dataset / "meta" / "info.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(FileFormatError, match=word):
        list(LeRobotDataset(dataset).motions())


def test_a_folder_that_is_no_dataset(tmp_path):
    with pytest.raises(FileFormatError):
        LeRobotDataset(tmp_path)


@pytest.mark.parametrize(
    "values",
    [
        {STATE: np.zeros((4, 3)), "action": np.zeros((4, 3))},
        {STATE: np.zeros((4, 3)), "action": np.zeros((5, 3)), "quality": np.zeros((4, 1))},
        {STATE: np.full((4, 3), np.nan), "action": np.zeros((4, 3)), "quality": np.zeros((4, 1))},
        {STATE: np.zeros((4, 2)), "action": np.zeros((4, 3)), "quality": np.zeros((4, 1))},
    ],
    ids=["missing", "lengths", "nan", "size"],
)
def test_a_faulty_episode_leaves_nothing(tmp_path, values):
    made = [*episodes(1), Episode("wrong", "task", values)]
    with pytest.raises(InvalidInputError, match="wrong"):
        write_lerobot(tmp_path / "set", made, FEATURES, 25, "panda")
    assert list(tmp_path.iterdir()) == []


def test_a_dataset_without_episodes_is_not_written(tmp_path):
    with pytest.raises(InvalidInputError):
        write_lerobot(tmp_path / "set", [], FEATURES, 25, "panda")
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_dataset_is_replaced_on_request(dataset):
    with pytest.raises(OutputError):
        write_lerobot(dataset, episodes(1), FEATURES, 25, "panda")
    write_lerobot(dataset, episodes(1), FEATURES, 25, "panda", overwrite=True)
    assert LeRobotDataset(dataset).count == 1
    (dataset / "notes.txt").write_text("mine")
    with pytest.raises(OutputError):
        write_lerobot(dataset, episodes(1), FEATURES, 25, "panda", overwrite=True)
    assert (dataset / "notes.txt").exists()
    shutil.rmtree(dataset)
