"""Packed batches: the same bytes in one run, in shards, on a cluster, and after kills at any moment."""

import importlib
import json
import os
import pickle
import random
import shutil
import signal
import time
import traceback
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import maniport as mp
from maniport.batch import Clip, PackedDataset, run
from maniport.batch import pair as pair_module
from maniport.batch.executors import completed, executor_for
from maniport.batch.journal import Journal
from maniport.batch.pair import work
from maniport.batch.parquet_tables import GROUP_ROWS, NAMES, file_of, pairs_in
from maniport.cli import app
from maniport.errors import (
    InvalidInputError,
    ManiportError,
    ManiportWarning,
    MissingPackageError,
    OutputError,
)
from maniport.mocap import shipped_recording
from maniport.util.files import load_ellipsoids, load_path
from sizes import little_search

parquet = pytest.importorskip("pyarrow.parquet")

pytestmark = pytest.mark.slow

OPTIONS = {
    "method": "parallel-transport",
    "n_teacher": 32,
    "n_student": 64,
    "move": False,
    "collisions": False,
    "start": 1.0,
    "stop": 1.5,
    "processes": 1,
}
ROBOTS = ("panda", "rhuman")
CLIPS = ("anna/1.c3d", "anna/2.c3d", "ben/1.c3d", "ben/2.c3d", "carl/1.c3d")
EQUAL = ("joints", "targets", "metrics")  # tables without processor times
KILLS = 20


def pack(recordings, folder, shard="1/1", **more):
    dataset = PackedDataset(folder, shard)
    return mp.transfer_batch(recordings, ROBOTS, dataset, **OPTIONS | more)


def contents(folder):
    """Bytes of the tables, and the manifest without processor times."""
    found = {name: file_of(folder, name).read_bytes() for name in EQUAL}
    manifest = parquet.read_table(file_of(folder, "manifest"))
    found["manifest"] = manifest.drop_columns("computing_s").to_pylist()
    return found


def entries(path):
    """Number of results in a journal, which is cut after them."""
    with closing(Journal(path)) as journal:
        return len(journal)


def manifest_of(folder):
    return parquet.read_table(file_of(folder, "manifest")).to_pylist()


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for name in CLIPS:
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(shipped_recording("freeform"), folder / name)
    return folder


@pytest.fixture(scope="module")
def one(recordings, tmp_path_factory):
    """The result of one run."""
    return pack([recordings], tmp_path_factory.mktemp("one") / "dataset")


@pytest.fixture
def copied(one, tmp_path):
    """A copy of that result, to be damaged."""
    return Path(shutil.copytree(one.folder, tmp_path / "dataset"))


@pytest.fixture(scope="module")
def sharded(recordings, tmp_path_factory):
    """The result of three shards, not merged."""
    folder = tmp_path_factory.mktemp("sharded") / "dataset"
    for shard in ("3/3", "1/3", "2/3"):
        pack([recordings], folder, shard)
    return folder


def test_a_packed_batch_has_the_numbers_of_one_with_folders(one, recordings, tmp_path):
    """Table, targets and joints are those of the folders of the pairs, in few files."""
    folders = mp.transfer_batch([recordings], ROBOTS, tmp_path / "folders", **OPTIONS)
    times = {"computing_s": 0.0, "folder": ""}
    assert [row | times for row in one.table] == [row | times for row in folders.table]
    assert len([path for path in one.folder.rglob("*") if path.is_file()]) <= 20
    targets = parquet.read_table(file_of(one.folder, "targets"))
    assert targets.schema.field("time_s").metadata == {b"unit": b"s"}
    for row in folders.table:
        key = row["recording"], row["robot"]
        ((_, own),) = pairs_in(file_of(one.folder, "targets"), {key})
        expected, time = load_ellipsoids(folders.folder / row["folder"] / "target_profile.npz")
        found = np.array(own["ellipsoid"].to_pylist()).reshape(-1, 3, 3)
        np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(own["time_s"].to_numpy(), time)
        assert own["position"].null_count == own["distance"].null_count == len(own)


def test_joints_and_placed_targets_of_a_motion(tmp_path):
    part = {"start": 2.0, "stop": 2.3, "move": True}
    with little_search():
        folders = mp.transfer_batch(["freeform"], ["panda"], tmp_path / "a", **OPTIONS | part)
        dataset = PackedDataset(tmp_path / "b")
        packed = mp.transfer_batch(["freeform"], ["panda"], dataset, **OPTIONS | part)
    assert packed.failed == folders.failed == ()
    pair = folders.folder / folders.table[0]["folder"]
    joints = parquet.read_table(file_of(packed.folder, "joints")).to_pydict()
    with np.load(pair / "joints.npz") as expected:
        (row,) = manifest_of(packed.folder)
        assert row["joints"] == list(expected["joint_names"])
        np.testing.assert_array_equal(joints["time_s"], expected["control_time"])
        np.testing.assert_array_equal(joints["position"], expected["control_positions"])
        velocities = expected["control_velocities"].astype(np.float32)
        np.testing.assert_array_equal(np.array(joints["velocity"], dtype=np.float32), velocities)
    targets = parquet.read_table(file_of(packed.folder, "targets")).to_pydict()
    placed, _ = load_ellipsoids(pair / "placed_profile.npz")
    np.testing.assert_array_equal(np.reshape(targets["ellipsoid"], placed.shape), placed)
    path, _ = load_path(pair / "path.npz")
    np.testing.assert_array_equal(targets["position"], path)
    median = packed.table[0]["motion.distance.median"]
    assert np.median(targets["distance"]) == pytest.approx(median, abs=1e-9)


def test_shards_are_one_run(one, sharded):
    """Merged, they have its bytes; each has few files, and all clips of a person."""
    merged = PackedDataset(sharded).merge()
    assert (merged.pairs, merged.failed) == (len(one.table), ())
    assert contents(sharded) == contents(one.folder)
    persons = []
    for folder in sorted((sharded / "shards").iterdir()):
        assert len(list(folder.rglob("*"))) <= 20
        persons += {row["recording"].split("/")[0] for row in manifest_of(folder)}
    assert sorted(persons) == ["anna", "ben", "carl"]


def test_what_is_done_is_not_read_again(one, recordings, copied, monkeypatch):
    """Files of the same size and time are not opened; of touched ones the content counts."""

    def no_reading(source):
        raise AssertionError(source)

    with monkeypatch.context() as patch:
        patch.setattr("maniport.batch.packed.content_of", no_reading)
        patch.setattr("maniport.batch.pair.content_of", no_reading)
        again = pack([recordings], copied)
    assert (again.kept, again.table) == (len(one.table), one.table)
    touched = recordings / CLIPS[0]
    status = touched.stat()
    try:
        os.utime(touched, ns=(status.st_atime_ns, status.st_mtime_ns + 10**9))
        assert pack([recordings], copied).kept == len(one.table)
    finally:
        os.utime(touched, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert contents(copied) == contents(one.folder)


def test_other_results_stay_unless_overwriting_is_allowed(one, recordings, copied, tmp_path):
    """Other settings, changed recordings and a shorter list are refused, and change nothing."""
    before = contents(copied)
    with pytest.raises(OutputError, match=r"damping.*overwrite="):
        pack([recordings], copied, damping=0.02)
    with pytest.raises(OutputError, match=r"4 pairs.*anna/1.c3d.*overwrite="):
        pack([Clip(str(recordings / name)) for name in CLIPS[2:]], copied)
    changed = tmp_path / "recordings"
    shutil.copytree(recordings, changed)
    with open(changed / "ben" / "1.c3d", "ab") as stream:
        stream.write(bytes(512))
    with pytest.raises(OutputError, match="another recording"):
        pack([changed], copied)
    with pytest.raises(OutputError, match="1 shard"):
        pack([recordings], copied, "1/2")
    with pytest.raises(OutputError, match="packed"):
        mp.transfer_batch([recordings], ROBOTS, copied, **OPTIONS)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "batch.json").write_text('{"maniport": "1", "shards": 2}')
    (tmp_path / "taken" / "shards").touch()
    with pytest.raises(OutputError, match="cannot write"):
        pack([recordings], tmp_path / "taken", "1/2")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").touch()
    with pytest.raises(OutputError, match="other things"):
        pack([recordings], tmp_path / "mine")
    assert contents(copied) == before
    assert pack([changed], copied, overwrite=True).kept == len(one.table) - len(ROBOTS)
    fewer = pack([recordings / "anna", recordings / "carl"], copied, overwrite=True)
    assert {row["recording"] for row in manifest_of(copied)} == {
        row["recording"] for row in fewer.table
    }


def test_failures_are_rows_and_are_tried_again(recordings, tmp_path):
    given = tmp_path / "given"
    given.mkdir()
    (given / "bad.bvh").write_text("rubbish")
    shutil.copy(recordings / CLIPS[0], given / "good.c3d")
    folder = tmp_path / "dataset"
    with pytest.warns(ManiportWarning, match=r"bad\.bvh"):
        found = pack([given], folder)
    assert [row["state"] for row in found.table] == ["failed"] * 2 + ["done"] * 2
    assert all("no BVH file" in row["reason"] for row in found.failed)
    assert all(list(row) == list(found.table[-1]) for row in found.table)
    assert {row["recording"]: row["state"] for row in manifest_of(folder)} == {
        "bad.bvh": "failed",
        "good.c3d": "done",
    }
    shutil.copy(shipped_recording("ladder"), given / "bad.bvh")
    again = pack([given], folder)
    assert (again.kept, again.failed) == (2, ())


def run_killed(moment, *given):
    """Run in a child that has everything loaded; kill it after some time [s]."""
    child = os.fork()
    if not child:
        try:
            pack(*given)
            os._exit(0)
        except BaseException:  # noqa: BLE001 - a child must never return into the parent's work
            traceback.print_exc()
        finally:
            os._exit(1)
    end = time.monotonic() + moment
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.001)
    os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_killed_twenty_times_it_is_the_same(one, recordings, tmp_path):
    """At random moments, in random shards; what was done is never lost."""
    chance = random.Random(0)
    folder = tmp_path / "dataset"
    begun = time.monotonic()
    pack([recordings], tmp_path / "timed")
    longest = time.monotonic() - begun
    killed = 0
    runs = 0
    done = dict.fromkeys(range(1, 3), 0)
    while killed < KILLS:
        index = chance.randint(1, 2)
        code = run_killed(chance.uniform(0.0, 0.4 * longest), [recordings], folder, f"{index}/2")
        assert code in (0, -signal.SIGKILL)
        killed += code != 0
        runs += 1
        assert runs < 10 * KILLS
        part = folder / "shards" / f"{index}-of-2"
        if (part / "journal").exists():
            shutil.copy(part / "journal", tmp_path / "journal")
            count = entries(tmp_path / "journal")
            assert count == 0 or count >= done[index]
            done[index] = count
        if code == 0 or runs % 7 == 0:  # complete shards are begun anew
            shutil.rmtree(part, ignore_errors=True)
            done[index] = 0
    for index in (1, 2):
        pack([recordings], folder, f"{index}/2")
    PackedDataset(folder).merge()
    assert contents(folder) == contents(one.folder)


def test_a_journal_that_is_cut_anywhere_has_all_entries_before(one, recordings, tmp_path):
    """Also with wrong bytes; the manifest that was written meanwhile does not count for more."""
    folder = tmp_path / "dataset"

    def stop(step, *_):
        if "carl" in step:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="10 pairs"):
        pack([recordings], folder, progress=stop)
    whole = (folder / "journal").read_bytes()
    assert len(manifest_of(folder)) >= 9
    for length in (0, 5, len(whole) // 2, len(whole) - 1):
        (folder / "journal").write_bytes(whole[:length])
        kept = entries(folder / "journal")
        damaged = bytearray(whole)
        damaged[length] ^= 1
        (folder / "journal").write_bytes(damaged)
        assert entries(folder / "journal") == kept
        assert kept < 10
    file_of(folder, "manifest").write_bytes(b"PAR1")
    assert pack([recordings], folder).kept == kept
    assert contents(folder) == contents(one.folder)
    assert not (folder / "journal").exists()


@pytest.mark.parametrize("name", NAMES)
def test_a_damaged_table_is_named_before_the_work(one, recordings, copied, name):
    file = file_of(copied, name)
    os.truncate(file, file.stat().st_size // 2)
    with pytest.raises(OutputError, match=rf"{name}\.parquet.*overwrite="):
        pack([recordings], copied)
    assert pack([recordings], copied, overwrite=True).kept == 0
    assert contents(copied) == contents(one.folder)


def test_a_shard_is_written_by_one_process(recordings, sharded, tmp_path):
    """A second one ends at once, and others write theirs meanwhile; a list without a clip of theirs is no fault."""
    folder = shutil.copytree(sharded, tmp_path / "dataset")
    errors = []

    def second(step, *_):
        if not errors and "Check" in step:
            with pytest.raises(OutputError, match="another process") as error:
                pack([recordings], folder, "1/3")
            errors.append(error)
            assert pack([recordings], folder, "2/3").kept > 0

    assert pack([recordings], folder, "1/3", progress=second).kept > 0
    assert errors
    assert pack([recordings / CLIPS[0]], tmp_path / "few", "1/3").pairs == 0
    assert pack([recordings / CLIPS[0]], tmp_path / "few", "2/3").pairs == len(ROBOTS)


def test_a_merge_names_the_shard_that_is_missing(one, recordings, sharded, tmp_path):
    folder = shutil.copytree(sharded, tmp_path / "dataset")
    second = folder / "shards" / "2-of-3"
    merged = PackedDataset(folder).merge

    (second / "journal").touch()
    with pytest.raises(OutputError, match=r"interrupted: 2/3;.*shard="):
        merged()
    shutil.rmtree(second)
    with pytest.raises(OutputError, match=r"missing: 2/3;"):
        merged()
    assert pack([recordings], folder, "2/3").kept == 0
    assert merged().pairs == len(one.table)

    file = file_of(second, "targets")
    content = file.read_bytes()
    file.write_bytes(content[:-9])
    before = contents(folder)
    with pytest.raises(OutputError, match=r"2-of-3.*targets\.parquet"):
        merged()
    assert contents(folder) == before
    assert pack([recordings], folder, "2/3", overwrite=True).kept == 0
    assert merged().pairs == len(one.table)
    assert file.read_bytes() == content

    (second / "shard.json").write_text("{}")
    with pytest.raises(OutputError, match=r"shard\.json"):
        merged()
    pack([recordings], folder, "2/3", seed=3, overwrite=True)
    with pytest.raises(OutputError, match=r"2/3.*another seed"):
        merged()
    pack([recordings / "anna", recordings / "ben"], folder, "2/3", overwrite=True)
    with pytest.raises(OutputError, match=r"2/3.*another list"):
        merged()
    pack([recordings], folder, "2/3", overwrite=True)
    assert merged().pairs == len(one.table)
    for wrong in (one.folder, tmp_path):
        with pytest.raises(OutputError, match=r"shards|packed"):
            PackedDataset(wrong).merge()


def test_groups_of_rows_depend_on_pairs_alone(one, sharded, tmp_path, monkeypatch):
    """Also where a table has several row groups, whose pairs are never divided."""
    monkeypatch.setattr("maniport.batch.parquet_tables.GROUP_ROWS", 7)
    assert GROUP_ROWS > 7
    folder = shutil.copytree(sharded, tmp_path / "dataset")
    PackedDataset(folder).merge()
    file = file_of(folder, "targets")
    assert parquet.ParquetFile(file).num_row_groups > 2
    keys = [key for key, _ in pairs_in(file)]
    assert keys == [(row["recording"], row["robot"]) for row in one.table]
    assert parquet.read_table(file).equals(parquet.read_table(file_of(one.folder, "targets")))


def test_two_dask_workers_give_the_same_bytes(one, recordings, tmp_path, monkeypatch):
    """On another computer they have no folder for maps: each process has its own."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(pair_module, "_maps", {})
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "processes": False,
        "dashboard_address": None,
    }

    def work_elsewhere(pairs):
        pairs = [replace(pair, adapters=tmp_path / "elsewhere") for pair in pairs]
        return pickle.loads(pickle.dumps(work(pickle.loads(pickle.dumps(pairs)))))

    monkeypatch.setattr(run, "work", work_elsewhere)
    with distributed.LocalCluster(**options) as cluster:
        address = cluster.scheduler_address
        found = pack([recordings], tmp_path / "dataset", dask=address)
    assert found.failed == ()
    assert contents(tmp_path / "dataset") == contents(one.folder)
    assert not (tmp_path / "elsewhere").exists()


def test_without_pyarrow_the_extra_is_named(recordings, tmp_path, monkeypatch):
    load = importlib.import_module

    def missing(name, *given):
        if name.startswith("pyarrow"):
            raise ImportError(f"No module named {name!r}")
        return load(name, *given)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(MissingPackageError, match=r"\[datasets\]"):
        pack([recordings], tmp_path / "dataset")
    with pytest.raises(MissingPackageError, match=r"\[datasets\]"):
        PackedDataset(tmp_path).merge()
    assert not (tmp_path / "dataset").exists()


@pytest.mark.parametrize("more", [{"pages": True}, {"move": True, "export": "mujoco"}])
def test_pages_and_formats_need_folders(recordings, tmp_path, more):
    with pytest.raises(InvalidInputError, match="packed"):
        pack([recordings], tmp_path / "dataset", **more)
    for wrong in ("0/2", "x"):
        with pytest.raises(InvalidInputError, match="shard"):
            PackedDataset(tmp_path, wrong)
    assert not (tmp_path / "dataset").exists()


def test_the_command_processes_a_list_in_shards(recordings, tmp_path, monkeypatch):
    """A Slurm array gives the shards; the merge takes the folder alone."""
    lines = [f"{recordings / name}\t{name.split('/')[0]}" for name in CLIPS[1:]]
    (tmp_path / "list.txt").write_text("\n".join(lines))
    folder = tmp_path / "dataset"
    few = ["--method", "identity", "--no-move", "--no-collisions", "--start", "1", "--stop", "1.5"]
    words = ["batch", "-o", str(folder), "--files", str(tmp_path / "list.txt"), "--json"]
    words += ["--processes", "1", *few]

    def run(*given):
        ended = CliRunner().invoke(app, given)
        assert ended.exit_code == 0, ended.stderr
        return json.loads(ended.stdout)

    for name, value in {"COUNT": 2, "MIN": 0, "MAX": 1}.items():
        monkeypatch.setenv(f"SLURM_ARRAY_TASK_{name}", str(value))
    counts = []
    for task in "01":
        monkeypatch.setenv("SLURM_ARRAY_TASK_ID", task)
        counts.append(run(*words, "--packed")["pairs"])
    assert sum(counts) == len(lines)
    again = run(*words, "--shard", "1/2")  # stated, it is not that of the task
    assert (again["pairs"], again["done_before"]) == (counts[0], counts[0])
    assert run("batch", "--merge", "-o", str(folder), "--json")["pairs"] == len(lines)
    assert [row["recording"] for row in manifest_of(folder)] == list(CLIPS[1:])
    assert (folder / "shards" / "1-of-2" / "run.yaml").exists()


@pytest.mark.parametrize(
    "given",
    [
        ("--merge", "freeform"),
        ("--merge", "--shard", "1/2"),
        ("freeform", "--shard", "3/2"),
        ("freeform", "--shard", "half"),
        ("--files", "none.txt"),
        ("--files", os.devnull),
        ("--merge",),
    ],
)
def test_wrong_options_are_refused(tmp_path, monkeypatch, given):
    monkeypatch.chdir(tmp_path)
    ended = CliRunner().invoke(app, ["batch", *given, "-o", "dataset"])
    assert isinstance(ended.exception, ManiportError)
    assert list(tmp_path.iterdir()) == []


def test_two_ray_workers_give_the_same_bytes(one, recordings, tmp_path):
    """A worker that dies takes no task with it: Ray gives it to another."""
    ray = pytest.importorskip("ray")
    mark = tmp_path / "killed"
    killing = f"open({str(mark)!r}, 'x') and __import__('os')._exit(1)"
    once = f"4 if __import__('os').path.exists({str(mark)!r}) else {killing}"
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        with executor_for(1, None, True) as executor:
            found = dict(completed(executor, eval, ["1 + 1", once, "2 + 1"]))
        assert found == {"1 + 1": 2, once: 4, "2 + 1": 3}
        assert pack([recordings], tmp_path / "dataset", ray=True).failed == ()
    finally:
        ray.shutdown()
    assert contents(tmp_path / "dataset") == contents(one.folder)
