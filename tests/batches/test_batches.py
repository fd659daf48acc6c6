"""Many recordings on many robots: each pair once, the same result however it is worked on and interrupted."""

import itertools
import json
import os
import shutil
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from small_batches import PART, ROBOTS, SMALL, read_table, small, tree
from typer.testing import CliRunner

import maniport as mp
from maniport.batches import workers
from maniport.batches.content import digest
from maniport.batches.page import PAGE
from maniport.batches.sources import sources
from maniport.batches.workers import LOST, Processes, completed
from maniport.cli import app
from maniport.errors import InvalidInputError, ManiportError, ManiportWarning, OutputError

RUN = """
import sys, maniport as mp
if __name__ == "__main__":
    mp.batch([sys.argv[1]], {robots!r}, sys.argv[2], processes=2, reading={part!r}, **{small!r})
"""


def members(group):
    """Processes of a group that are there."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, mine = status.read_text().rpartition(")")[2].split()[:3]
            found += [status.parent.name] if int(mine) == group and state != "Z" else []
    return found


def pairs(folder):
    """How many pairs are done: what is still written stands in temporary folders."""
    written = (Path(place).relative_to(folder) for place, _, files in os.walk(folder) if "pair.json" in files)
    return sum("/." not in f"/{place.as_posix()}" for place in written)


def test_each_pair_has_a_row_and_a_folder(whole, recordings):
    """The table has every pair once, with the numbers of its summary; all stand in CSV and Parquet, too."""
    parquet = pytest.importorskip("pyarrow.parquet")
    assert [(row["recording"], row["robot"]) for row in whole.table] == [
        (f"{who}/{k}.c3d", robot) for who in ("anna", "ben") for k in (1, 2, 3) for robot in ROBOTS
    ]
    for row in whole.table:
        told = json.loads((whole.folder / row["folder"] / "summary.json").read_text(encoding="utf-8"))
        assert row["state"] == "done"
        assert row["adapter.cost"] == told["adapter"]["cost"]
        assert row["warning_keys"].split() == list(dict.fromkeys(one["key"] for one in told["warnings"]))
        assert row["warnings"].split("\n") == [one["text"] for one in told["warnings"]]
        assert row["status"] == (told["status"] or "")
    lines = read_table(whole.folder)
    table = parquet.read_table(whole.folder / "table.parquet").to_pydict()
    for name in ("recording", "status", "warning_keys", "adapter.cost"):
        values = [row[name] for row in whole.table]
        assert table[name] == values
        assert [line[name] for line in lines] == [str(value) for value in values]


def test_one_person_has_one_adapter(whole):
    """All recordings of equal arms share an adapter, one for each robot, which is the one of each pair."""
    adapters = list((whole.folder / "adapters").glob("*.npz"))
    assert len(adapters) == len(ROBOTS)
    for file in adapters:
        shared = mp.load_adapter(file)
        mine = mp.load_adapter(whole.folder / file.name.partition("-")[0] / "anna" / "1.c3d" / "adapter.npz")
        np.testing.assert_array_equal(shared.rotation_, mine.rotation_)


def test_what_is_done_is_not_done_again(whole, recordings, tmp_path):
    """Only what has other content is done again, where it may be; the result is that of a fresh start."""
    folder = tmp_path / "dataset"
    shutil.copytree(whole.folder, folder)
    before = {path: path.stat().st_ino for path in folder.rglob("pair.json")}
    again = small([recordings], folder)
    assert again.kept == len(again.table)
    assert {path: path.stat().st_ino for path in before} == before
    assert tree(folder) == tree(whole.folder)
    with pytest.raises(OutputError, match=r"damping 0\.01, now 0\.02.*overwrite="):
        small([recordings], folder, damping=0.02)
    with pytest.raises(OutputError, match=r"reading\.stop 1\.5, now 1\.75; profile_rate 10\.0, now 5\.0;"):
        small([recordings], folder, reading={"start": 1.0, "stop": 1.75}, profile_rate=5)
    assert tree(folder) == tree(whole.folder)
    changed = tmp_path / "recordings"
    shutil.copytree(recordings, changed)
    with open(changed / "ben" / "1.c3d", "ab") as stream:
        stream.write(bytes(512))
    again = small([changed], folder, overwrite=True)
    assert again.kept == len(again.table) - len(ROBOTS)


def test_one_failure_does_not_stop_the_rest(recordings, tmp_path):
    """What fails stands in table and overview with its reason, is warned of, and the command ends with 1."""
    (tmp_path / "bad.bvh").write_text("rubbish")
    given = [tmp_path / "bad.bvh", recordings / "anna" / "1.c3d"]
    with pytest.warns(ManiportWarning, match="no BVH file") as warned:
        found = small(given, tmp_path / "dataset")
    assert len(warned) == 1
    assert all(name in str(warned[0].message) for name in ("bad.bvh", *ROBOTS))
    assert [row["state"] for row in found.table] == ["done", "done", "failed", "failed"]
    assert all("no BVH file" in row["reason"] for row in found.failed)
    page = (tmp_path / "dataset" / PAGE).read_text(encoding="utf-8")
    assert page.count("no BVH file") == 1  # one line for both robots
    assert 'href="panda/1.c3d/summary.md"' in page
    words = ["batch", str(tmp_path / "bad.bvh"), "-o", str(tmp_path / "other"), "--processes", "1", "--json"]
    ended = CliRunner().invoke(app, [*words, "--no-collisions", "--method", "raw-copy", "--no-move"])
    assert ended.exit_code == 1
    assert [(one["recording"], one["robots"]) for one in json.loads(ended.stdout)["failed"]] == [("bad.bvh", ["panda"])]


def test_killed_in_the_middle_it_goes_on(whole, recordings, tmp_path):
    """Two processes that are killed in the middle, and one that goes on, give the bytes of one alone."""
    folder, script = tmp_path / "dataset", tmp_path / "script.py"
    script.write_text(RUN.format(robots=ROBOTS, part=PART, small=SMALL))
    process = subprocess.Popen(
        [sys.executable, script, recordings, folder], env={**os.environ, "PYTHONWARNINGS": "ignore"},
        start_new_session=True,
    )  # fmt: skip
    while process.poll() is None and pairs(folder) < 3:
        time.sleep(0.005)
    process.kill()
    process.wait()  # its workers end by themselves
    while members(process.pid):
        time.sleep(0.05)
    done = pairs(folder)
    again = small([recordings], folder)
    assert again.kept == done
    assert tree(folder) == tree(whole.folder)


def test_dask_gives_the_same_bytes(whole, recordings, tmp_path):
    """Workers of a Dask cluster, of several threads, give what one process does."""
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster:
        small([recordings], tmp_path / "dataset", dask=cluster.scheduler_address)
    assert tree(tmp_path / "dataset") == tree(whole.folder)


def test_a_process_that_is_ended_takes_one_task_with_it():
    """Where a worker is ended from outside, its task is told to be lost and all others are done."""
    tasks = ["1 + 1", "__import__('os')._exit(1)", "2 + 2", "3 + 3"]
    with Processes(2) as crew:
        found = dict(completed(crew, eval, tasks))
    assert str(found.pop(tasks[1])) == LOST
    assert found == {"1 + 1": 2, "2 + 2": 4, "3 + 3": 6}


def test_a_cluster_that_lost_all_workers_is_not_waited_for(monkeypatch):
    """While there are workers they are waited for; when none is left, an error says so after a while."""
    asked, times = [], itertools.count(0.0, 0.004)  # the clock goes on by 4 ms each time that it is read

    class Client:
        def nthreads(self):
            asked.append(1)
            return {"one": 1} if len(asked) < 3 else {}

    def wait(*_, **__):
        raise TimeoutError

    monkeypatch.setattr(workers, "PATIENCE", 0.01)
    monkeypatch.setattr(workers, "monotonic", lambda: next(times))
    monkeypatch.setattr(workers, "distributed", lambda: SimpleNamespace(wait=wait))
    with pytest.raises(ManiportError, match="no workers for"):
        workers.OnDask(Client()).some(["a task"])
    assert len(asked) > 3


@pytest.mark.skipif(sys.platform != "linux", reason="file systems elsewhere take letters only")
def test_names_that_are_no_letters_are_written(recordings, tmp_path):
    """A name with bytes that are not UTF-8 stands in table, summary and overview as it can be written."""
    file = tmp_path / os.fsdecode(b"caf\xe9.c3d")
    shutil.copy(recordings / "anna" / "1.c3d", file)
    found = small([file], tmp_path / "dataset")
    assert [(row["recording"], row["state"]) for row in found.table] == [("caf\\udce9.c3d", "done")] * len(ROBOTS)


def test_recordings_are_named_apart(tmp_path):
    """Folders and patterns name recordings below themselves, single files by as much as tells them apart."""
    for name in ("a/walk.bvh", "b/walk.bvh", "b/table.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    every = ["a/walk.bvh", "b/walk.bvh"]
    for given in ([tmp_path], [f"{tmp_path}/**/*.bvh"], [tmp_path / one for one in every]):
        assert [one.name for one in sources(given, tmp_path / "dataset")] == every
    assert [one.name for one in sources([tmp_path / "a", tmp_path], tmp_path / "dataset")] == ["b/walk.bvh", "walk.bvh"]
    assert [one.name for one in sources([f"{tmp_path}/**/*"], tmp_path / "a")] == ["b/table.csv", "b/walk.bvh"]
    with pytest.raises(InvalidInputError, match="no file matches"):
        sources([f"{tmp_path}/*.c3d"], tmp_path)


def test_digests_tell_contents_apart():
    """Equal robots have one digest wherever they were read; other limits, numbers and kinds have others."""
    arm = mp.load_arm("panda")
    assert digest(arm) == digest(mp.load_arm("panda")) != digest(arm.narrowed(arm.lower + 0.1, arm.upper))
    things = [1, 1.0, "1", True, [1], {"1": 1}, np.array([1]), np.array([1.0]), [[1]], b"1", None]
    assert len({digest(one) for one in things}) == len(things)


def test_what_cannot_be_is_said_before_work(recordings, tmp_path):
    """A folder of other things, unknown formats and settings, and two clusters are refused."""
    (tmp_path / "mine.txt").touch()
    for error, more in (
        (OutputError, {}),
        (InvalidInputError, {"exports": "vhs", "output": tmp_path / "new"}),
        (InvalidInputError, {"dask": "x:1", "ray": True, "output": tmp_path / "new"}),
        (TypeError, {"speed": 3, "output": tmp_path / "new"}),
    ):
        with pytest.raises(error):
            small([recordings], **{"output": tmp_path, **more})
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
