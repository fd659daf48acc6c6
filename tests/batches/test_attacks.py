"""What people and file systems do to a batch: names, pipes, other people's files, changes by hand."""

import os
import shutil
import socket
import subprocess
import sys
import threading

import pytest
from small_batches import PART, ROBOTS, small, tree

import maniport as mp
from maniport.batches import workers
from maniport.batches.pair import Order, Task, work
from maniport.batches.robots import robots_of
from maniport.batches.sources import Source, sources
from maniport.batches.table import failed_row, write_tables
from maniport.errors import InvalidInputError, ManiportError, ManiportWarning, OutputError


def names(given, without):
    """What recordings are called."""
    return [one.name for one in sources(given, without)]


def test_names_stay_below_the_folder(tmp_path, monkeypatch):
    """No name is empty, leads upwards, or is the folder of another's; what is no letter in it can be written."""
    frames, inside = tmp_path / "frames" / "1.c3d", tmp_path / "more" / "1.c3d"
    for folder in (frames, inside):
        folder.mkdir(parents=True)
    (frames / "0.json").write_text("{}")
    for name in (b"2.c3d", b"3\xff.c3d"):
        (inside / os.fsdecode(name)).touch()
    found = names([f"{tmp_path}/frames/*", tmp_path / "more"], tmp_path / "dataset")
    assert found == ["frames/1.c3d", "more/1.c3d/2.c3d", "more/1.c3d/3\\udcff.c3d"]
    monkeypatch.chdir(frames)
    for given in (["."], ["../../more/*/../../frames/1.c3d"], [frames, "*.json"]):
        assert names(given, tmp_path / "dataset") == ["1.c3d"]
    with pytest.raises(InvalidInputError, match="empty"):
        sources([""], tmp_path / "dataset")


def test_results_and_settings_are_no_recordings(recordings, whole, tmp_path):
    """An earlier dataset below a pattern, and a JSON file beside recordings, are not taken for keypoints."""
    shutil.copytree(whole.folder, tmp_path / "earlier")
    (tmp_path / "mine").mkdir()
    shutil.copy(recordings / "anna" / "1.c3d", tmp_path / "mine")
    (tmp_path / "mine" / "markers.json").write_text("{}")
    assert names([f"{tmp_path}/**/*.c3d"], tmp_path / "new") == ["mine/1.c3d"]
    assert names([tmp_path / "mine"], tmp_path / "new") == ["1.c3d"]
    with pytest.raises(InvalidInputError, match="no file ends with"):
        sources([tmp_path / "earlier"], tmp_path / "new")


def test_each_robot_has_a_folder_of_its_own():
    """Equal robots are one; others have names of their own that are no files of the batch."""
    panda, arms = mp.load_arm("panda"), []
    for k, name in enumerate(("a:b", "a?b", "A-b", "..", "adapters")):
        arms.append(panda.narrowed(panda.lower + 1e-3 * k, panda.upper))
        arms[-1].name = name
    found = robots_of([*arms, arms[1]], "raw-copy", {"collisions": False}, ["adapters"])
    assert [one.name for one in found] == ["a-b", "a-b-2", "A-b-3", "robot", "adapters-2"]


def test_what_was_changed_is_noticed(recordings, tmp_path):
    """What is missing is made again; what was changed or added, and a row that is none, stay unless asked."""
    folder, given = tmp_path / "dataset", [recordings / "anna"]
    small(given, folder)
    before, pair = tree(folder), folder / "panda" / "1.c3d"
    (pair / "summary.md").unlink()
    next((folder / "adapters").glob("panda-*.json")).unlink()
    again = small(given, folder)
    assert again.kept == len(again.table) - 1
    assert tree(folder) == before
    for name, text in (("summary.md", "mine"), ("pair.json", '{"key": 1, "row": {}}')):
        (pair / name).write_text(text)
        with pytest.raises(OutputError, match="changed since"):
            small(given, folder)
        assert (pair / name).read_text() == text
        small(given, folder, overwrite=True)
        assert tree(folder) == before


def test_a_result_goes_with_its_recording_to_another_name(recordings, tmp_path):
    """A pair that was given another name, recording and folder alike, stands in the table by the new one."""
    shutil.copytree(recordings / "anna", tmp_path / "anna")
    small([tmp_path / "anna"], tmp_path / "dataset")
    for folder in ("anna", *(f"dataset/{robot}" for robot in ROBOTS)):
        (tmp_path / folder / "1.c3d").rename(tmp_path / folder / "9.c3d")
    again = small([tmp_path / "anna"], tmp_path / "dataset")
    assert again.kept == len(again.table)
    assert (again.table[-1]["recording"], again.table[-1]["folder"]) == ("9.c3d", f"{ROBOTS[-1]}/9.c3d")


def test_a_recording_that_changes_meanwhile_is_told(recordings, tmp_path):
    """What was read is what stands in the key, or nothing is written."""
    source = Source("1.c3d", recordings / "anna" / "1.c3d")
    order = Order(tmp_path, PART, 10.0, {}, False, False)
    robots = tuple(robots_of(["panda"], "raw-copy", {"collisions": False}, ()))
    row = work(Task(order, source, "another", robots, ("key",)))[0]
    assert "changed meanwhile" in row["reason"]
    assert not list(tmp_path.iterdir())


def test_pipes_and_other_folders_do_no_harm(recordings, tmp_path):
    """A pipe, which has no end, is told to be none; a folder with somebody else's batch.json is not taken."""
    os.mkfifo(tmp_path / "pipe.bvh")
    with pytest.warns(ManiportWarning, match="pipe"):
        found = small([tmp_path / "pipe.bvh"], tmp_path / "dataset")
    assert len(found.failed) == len(ROBOTS)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "batch.json").write_text('{"mine": 1}')
    with pytest.raises(OutputError, match="other things"):
        small([recordings], tmp_path / "other")


def test_spreadsheets_compute_no_names(tmp_path):
    """A text that begins like a formula has an apostrophe before it in CSV, and is as it was in Parquet."""
    write_tables(tmp_path, [failed_row("=1+1.c3d", "panda", "bad \udcff")])
    line = (tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()[1]
    assert line.startswith("'=1+1.c3d,panda,failed,bad \\udcff")
    parquet = pytest.importorskip("pyarrow.parquet")
    assert parquet.read_table(tmp_path / "table.parquet")["recording"].to_pylist() == ["=1+1.c3d"]


def test_who_says_nothing_is_not_waited_for(recordings, tmp_path, monkeypatch):
    """An address that takes connections and is silent, and a cluster without workers, end in an error."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(workers, "CONNECTING", 0.2)
    monkeypatch.setattr(workers, "PATIENCE", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent, pytest.raises(ManiportError, match="no Dask scheduler"):
        small([recordings], tmp_path / "dataset", dask=f"127.0.0.1:{silent.getsockname()[1]}")
    monkeypatch.setattr(workers, "CONNECTING", 10)
    options = {"n_workers": 0, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, pytest.raises(ManiportError, match="no worker"):
        small([recordings], tmp_path / "dataset", dask=cluster.scheduler_address)


def test_a_process_ends_whose_parent_ended_first():
    """A worker whose sender had ended before it could ask for it ends, too."""
    script = "import sys, time; from maniport.signals import end_with_parent; end_with_parent(0); time.sleep(600)"
    assert subprocess.run([sys.executable, "-c", script], timeout=300, check=False).returncode == 1


BEGUN, GATE = threading.Event(), threading.Event()


def held():
    """Work until the gate is open."""
    BEGUN.set()
    GATE.wait(60.0)


def test_a_scheduler_that_is_lost_ends_the_batch():
    """When the scheduler of a cluster ends, so does the batch, with an error that says how to go on."""
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        crew = workers.OnDask(client)
        running = [client.submit(held, pure=False)]
        assert BEGUN.wait(60.0)
        client.cancel(running, reason="scheduler-connection-lost")
        with pytest.raises(ManiportError, match="start again"):
            crew.some(running)
        GATE.set()
