"""Many recordings on many robots: each pair once, the same result however it is run and interrupted."""

import csv
import json
import logging
import os
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import Future
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

import maniport as mp
from maniport import batch
from maniport.batch import executors, run
from maniport.batch import pair as pair_module
from maniport.batch.executors import Executor, completed, dask_executor, executor_for
from maniport.batch.inputs import Source, digest, find_recordings, find_robots
from maniport.batch.pair import Outcome, Pair, content_of, work
from maniport.batch.table import failed_row, write_tables
from maniport.cli import app
from maniport.errors import (
    InvalidInputError,
    ManiportError,
    ManiportWarning,
    OutputError,
    UnknownNameError,
)
from maniport.mocap import shipped_recording
from maniport.pipeline.config import BATCH
from maniport.report.describe import results
from maniport.util.process import in_background, settled
from sizes import little_search

pytestmark = pytest.mark.slow

SMALL = {
    "method": "parallel-transport",
    "n_teacher": 32,
    "n_student": 64,
    "move": False,
    "collisions": False,
}
PART = {"start": 1.0, "stop": 1.5}
ROBOTS = ("panda", "rhuman")
NAMES = ("anna/1.c3d", "anna/2.c3d", "ben/1.c3d", "ben/2.c3d")

RUN = f"""
import sys, maniport as mp
if __name__ == "__main__":
    mp.transfer_batch([sys.argv[1]], {ROBOTS!r}, sys.argv[2], processes=2, **{SMALL | PART!r})
"""


def small(recordings, output, **more):
    return mp.transfer_batch(recordings, ROBOTS, output, **{"processes": 1} | PART | SMALL | more)


def wait_until(condition, patience=60.0):
    """Wait until a condition holds, at most so long [s]."""
    begun = time.monotonic()
    while not condition():
        assert time.monotonic() - begun < patience
        time.sleep(0.005)


def read_table(folder):
    with open(folder / "table.csv", newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def without_place(path, folder):
    """Return the content of a file without the folder, which suggested commands name."""
    return path.read_bytes().replace(os.fsencode(folder), b"FOLDER")


def tree(folder):
    """Every file of a folder with its content but for computing times, without temporary files of killed processes."""

    def content(path):
        if path.name == "pair.json":
            pair = json.loads(path.read_text(encoding="utf-8"))
            del pair["row"]["computing_s"]
            return pair
        if path.name == "table.csv":
            return [row | {"computing_s": None} for row in read_table(folder)]
        if path.name in ("index.html", "table.parquet"):
            return b""
        return without_place(path, folder)

    names = {
        path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()
    }
    return {name: content(path) for name, path in names.items() if "/." not in f"/{name}"}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for name in NAMES:
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(shipped_recording("freeform"), folder / name)
    return folder


@pytest.fixture(scope="module")
def whole(recordings, tmp_path_factory):
    return small([recordings], tmp_path_factory.mktemp("whole") / "dataset")


def test_each_pair_has_a_row_and_a_folder(whole):
    """The table has every pair once, with the numbers of its summary, also as CSV and Parquet; adapters are shared."""
    assert [(row["recording"], row["robot"]) for row in whole.table] == [
        (a, b) for a in NAMES for b in ROBOTS
    ]
    for row in whole.table:
        summary = json.loads(
            (whole.folder / row["folder"] / "summary.json").read_text(encoding="utf-8")
        )
        assert row["state"] == "done"
        assert row["computing_s"] > 0.0
        assert row["adapter.cost"] == summary["adapter"]["cost"]
        assert row["warning_keys"].split() == list(
            dict.fromkeys(one["key"] for one in summary["warnings"])
        )
        assert row["status"] == (summary["status"] or "")
    lines = read_table(whole.folder)
    table = (
        pytest.importorskip("pyarrow.parquet")
        .read_table(whole.folder / "table.parquet")
        .to_pydict()
    )
    for name in ("recording", "status", "warning_keys", "adapter.cost", "computing_s"):
        assert table[name] == [row[name] for row in whole.table]
        assert [line[name] for line in lines] == [str(row[name]) for row in whole.table]
    for robot in ROBOTS:
        (file,) = (whole.folder / "adapters").glob(f"{robot}-*.npz")
        mine = mp.load_adapter(whole.folder / robot / "anna" / "1.c3d" / "adapter.npz")
        np.testing.assert_array_equal(mp.load_adapter(file).rotation_, mine.rotation_)


def test_finished_pairs_are_not_repeated(whole, recordings, tmp_path):
    """Other settings are named; what is missing is made again; changed files stay unless overwriting is allowed."""
    folder = tmp_path / "dataset"
    shutil.copytree(whole.folder, folder)
    shutil.rmtree(folder / "rhuman" / "ben")
    assert small([recordings], folder).kept == len(whole.table) - 2
    assert tree(folder) == tree(whole.folder)
    with pytest.raises(OutputError, match=r"damping.*overwrite="):
        small([recordings], folder, damping=0.02)
    with pytest.raises(OutputError, match="stop, profile_rate"):
        small([recordings], folder, stop=1.75, profile_rate=5)
    assert tree(folder) == tree(whole.folder)
    (folder / "panda" / "anna" / "1.c3d" / "pair.json").write_text('{"key": 1, "row": {}}')
    with pytest.raises(OutputError, match=r"pair\.json"):
        small([recordings], folder)
    changed = tmp_path / "recordings"
    shutil.copytree(recordings, changed)
    with open(changed / "ben" / "1.c3d", "ab") as stream:
        stream.write(bytes(512))
    assert small([changed], folder, overwrite=True).kept == len(whole.table) - len(ROBOTS) - 1


def test_one_failure_does_not_stop_the_rest(whole, recordings, tmp_path):
    """It is a warning, a row with the columns of any other, and a line of the page; the command ends with 1."""
    (tmp_path / "bad.bvh").write_text("rubbish")
    os.mkfifo(tmp_path / "pipe.bvh")
    given = [tmp_path / "bad.bvh", tmp_path / "pipe.bvh", recordings / "anna" / "1.c3d"]
    with pytest.warns(ManiportWarning, match="BVH|pipe") as warned:
        found = small(given, tmp_path / "dataset")
    assert len(warned) == 2
    assert [row["state"] for row in found.table] == ["done"] * 2 + ["failed"] * 4
    assert all("no BVH file" in row["reason"] for row in found.failed[:2])
    assert all(list(row) == list(whole.table[0]) for row in found.table)
    page = (tmp_path / "dataset" / "index.html").read_text(encoding="utf-8")
    assert page.count("no BVH file") == 1  # one line for both robots
    assert 'href="panda/1.c3d/summary.md"' in page
    words = [
        "batch",
        str(tmp_path / "bad.bvh"),
        "-o",
        str(tmp_path / "other"),
        "--processes",
        "1",
        "--json",
    ]
    ended = CliRunner().invoke(
        app, [*words, "--no-collisions", "--method", "identity", "--no-move"]
    )
    assert ended.exit_code == 1
    assert [(one["recording"], one["robots"]) for one in json.loads(ended.stdout)["failed"]] == [
        ("bad.bvh", ["panda"])
    ]


def test_columns_are_metrics_of_a_summary(whole, tmp_path, small_result):
    mp.write_results(small_result, tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))

    def known(name):
        numbers = summary
        for key in name.split("."):
            if not isinstance(numbers, dict) or key not in numbers:
                return False
            numbers = numbers[key]
        return True

    missing = {name for name in list(whole.table[0])[10:] if not known(name)}
    assert missing == {
        f"motion.orientation_error_deg.{value}" for value in ("median", "p95", "max")
    }


def test_a_killed_batch_continues(whole, recordings, tmp_path):
    """Two processes that are killed in the middle, and one that continues, give the bytes of one alone."""

    def done():  # in any number of folders, of which temporary ones vanish meanwhile
        found = []
        for parent, folders, names in os.walk(folder):
            folders[:] = [name for name in folders if not name.startswith(".")]
            if "pair.json" in names:
                found.append(parent)
        return found

    def members():
        for status in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):
                state, _, group = status.read_text().rpartition(")")[2].split()[:3]
                if int(group) == process.pid and state != "Z":
                    yield status

    folder = tmp_path / "dataset"
    script = tmp_path / "script.py"
    script.write_text(RUN)
    environment = {**os.environ, "PYTHONWARNINGS": "ignore"}
    process = subprocess.Popen(
        [sys.executable, script, recordings, folder], env=environment, start_new_session=True
    )
    while process.poll() is None and len(done()) < 2:
        time.sleep(0.005)
    process.kill()
    process.wait()
    while any(members()):  # workers end by themselves
        time.sleep(0.05)
    kept = len(done())
    assert small([recordings], folder).kept == kept
    assert tree(folder) == tree(whole.folder)


def test_run_yaml_of_a_pair_repeats_it(whole, tmp_path):
    pair = whole.folder / "panda" / "anna" / "1.c3d"
    words = [
        "batch",
        "--config",
        str(pair / "run.yaml"),
        "-o",
        str(tmp_path / "again"),
        "--processes",
        "1",
    ]
    ended = CliRunner().invoke(app, words)
    assert ended.exit_code == 0, ended.stderr
    again = tmp_path / "again" / "panda" / "1.c3d"
    for name in ("joints.csv", "target_profile.npz", "adapter.npz", "summary.json", "run.yaml"):
        assert (again / name).exists() == (pair / name).exists()
        if (pair / name).exists():
            assert without_place(again / name, again) == without_place(pair / name, pair)


def test_pairs_suggest_commands_with_their_own_folder(tmp_path, monkeypatch):
    """A program and a reader find the command, whose run.yaml is that of the pair."""
    command = "maniport transfer --config {folder}/run.yaml -o {folder}-again"
    monkeypatch.setattr(results, "_advice", lambda *_: ("Repeat it.", command))
    options = {**SMALL, "move": True, "start": 2.0, "stop": 2.3, "processes": 1}
    with little_search():
        batch = mp.transfer_batch(["freeform"], ["panda"], tmp_path / "a b", **options)
    assert batch.failed == ()
    pair = batch.folder / batch.table[0]["folder"]
    command = json.loads((pair / "summary.json").read_text())["summary"]["command"]
    words = shlex.split(command)
    assert words[0] == "maniport"
    assert words[words.index("--config") + 1] == str(pair / "run.yaml")
    assert (pair / "run.yaml").is_file()
    assert command in (pair / "summary.md").read_text()


def test_two_arms_of_a_person_go_to_two_of_a_robot(tmp_path):
    robot = mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])
    part = {"start": 5.1, "stop": 5.4, "collisions": False, "processes": 1}
    options = {**SMALL, **part, "move": True}
    table = mp.transfer_batch(["both-arms"], [robot, "rhuman"], tmp_path, **options).table
    assert [row["state"] for row in table] == ["done", "done"]
    folder = tmp_path / table[0]["folder"]
    assert {"left", "right", "joints.csv", "run.yaml"} <= {file.name for file in folder.iterdir()}
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    medians = [summary[f"{side}_motion"]["distance"]["median"] for side in ("left", "right")]
    assert table[0]["motion.distance.median"] == max(medians)
    assert mp.transfer_batch(["both-arms"], [robot, "rhuman"], tmp_path, **options).kept == 2


def test_ctrl_c_ends_the_command_with_what_is_done(recordings, tmp_path, monkeypatch):
    run = batch.transfer_batch

    def interrupted(*given, progress, **more):
        def kill(step, *_):
            if "→" in step:
                os.kill(os.getpid(), signal.SIGINT)

        return run(*given, progress=kill, **more)

    words = [
        "batch",
        str(recordings / "anna"),
        "-o",
        str(tmp_path / "dataset"),
        "--processes",
        "1",
        "--no-move",
    ]
    words += ["--start", "1", "--stop", "1.5", "--method", "identity", "--no-collisions", "--json"]
    with monkeypatch.context() as patch:
        patch.setattr(batch, "transfer_batch", interrupted)
        ended = CliRunner().invoke(app, words)
    assert (ended.exit_code, ended.stdout) == (130, "")
    assert "1 of 2 pairs" in ended.stderr
    assert len(read_table(tmp_path / "dataset")) == 1
    assert "1 of 2 pairs" in (tmp_path / "dataset" / "index.html").read_text(encoding="utf-8")
    again = CliRunner().invoke(app, words)
    assert (again.exit_code, json.loads(again.stdout)["done_before"]) == (0, 1)


def test_dask_gives_the_same_bytes(whole, recordings, tmp_path):
    distributed = pytest.importorskip("distributed")
    options = {
        "n_workers": 1,
        "threads_per_worker": 2,
        "processes": False,
        "dashboard_address": None,
    }
    with distributed.LocalCluster(**options) as cluster:
        small([recordings], tmp_path / "dataset", dask=cluster.scheduler_address)
    assert tree(tmp_path / "dataset") == tree(whole.folder)
    with pytest.raises(ManiportError, match="Dask scheduler"):
        small([recordings], tmp_path / "other", dask="127.0.0.1:1")


def test_a_result_that_is_not_here_is_a_failure(recordings, tmp_path, monkeypatch):
    """A worker that writes to a disk of its own is named with its host, and so are wrong bytes; the rest is done."""
    distributed = pytest.importorskip("distributed")
    elsewhere = tmp_path / "disk of the worker"
    folder = tmp_path / "dataset"

    def work_elsewhere(pairs):
        if pairs[0].names == ("1.c3d", "panda"):  # another disk at the same path
            elsewhere.mkdir()
            shutil.copy(folder / "batch.json", elsewhere)
            pairs = [replace(pair, output=elsewhere) for pair in pairs]
        outcomes = work(pairs)
        if pairs[0].names == ("2.c3d", "panda"):  # cut off
            os.truncate(pairs[0].folder / "target_profile.npz", 100)
        return outcomes

    monkeypatch.setattr(run, "work", work_elsewhere)
    monkeypatch.setattr(executors, "SHOWN_AFTER", 0.1)
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False}
    with (
        distributed.LocalCluster(**options, dashboard_address=None) as cluster,
        pytest.warns(ManiportWarning, match="failed"),
    ):
        found = small([recordings / "anna"], folder, dask=cluster.scheduler_address)
    assert (elsewhere / "panda" / "1.c3d" / "pair.json").exists()
    states = {(row["recording"], row["robot"]): row["state"] for row in found.table}
    assert states.pop(("1.c3d", "panda")) == "failed"
    assert states.pop(("2.c3d", "panda")) == "failed"
    assert set(states.values()) == {"done"}
    assert all(repr(socket.gethostname()) in row["reason"] for row in found.failed)
    assert [row["state"] for row in read_table(folder)].count("failed") == 2
    monkeypatch.undo()
    again = small([recordings / "anna"], folder)
    assert (again.kept, again.failed) == (2, ())


def test_a_result_may_be_visible_late(recordings, tmp_path, monkeypatch):
    """Network file systems show files of other computers after some time."""
    hidden = tmp_path / "hidden"
    looks = []

    def work_and_hide(pairs):
        outcomes = work(pairs)
        os.rename(pairs[0].folder, hidden)
        return outcomes

    def is_visible(outcome, pair):
        looks.append(pair)
        if len(looks) == 2:
            os.rename(hidden, pair.folder)
        return original(outcome, pair)

    original = Outcome.is_visible
    monkeypatch.setattr(run, "work", work_and_hide)
    monkeypatch.setattr(Outcome, "is_visible", is_visible)
    executor = Executor(
        lambda work, task: settled(Future(), work, task), lambda: 1, shown_after=60.0
    )
    monkeypatch.setattr(run, "executor_for", lambda *_: nullcontext(executor))
    options = {"processes": 1, **PART, **SMALL}
    found = mp.transfer_batch(
        [recordings / "anna" / "1.c3d"], ["panda"], tmp_path / "dataset", **options
    )
    assert [row["state"] for row in found.table] == ["done"]
    assert len(looks) == 2


@pytest.mark.parametrize("missing", ["folder", "recording", "version"])
def test_a_worker_checks_that_it_is_like_the_others(recordings, tmp_path, monkeypatch, missing):
    """Before the long work it reports a folder or recording that it does not see, and another version."""
    file = tmp_path / "1.c3d"
    shutil.copy(recordings / "anna" / "1.c3d", file)
    source = Source("1.c3d", file)
    config = BATCH.changed(method="identity", collisions=False, **PART)
    (robot,) = find_robots(["panda"], config, ())
    pair = Pair(tmp_path / "dataset", source, content_of(source), robot)
    pair.output.mkdir()
    expected = "version"
    if missing == "version":
        (pair.output / "batch.json").touch()
        monkeypatch.setattr(pair_module, "__version__", "0.0.1")
    elif missing == "folder":
        expected = "batch.json"
    else:
        (pair.output / "batch.json").touch()
        file.unlink()
        expected = "1.c3d"
    (outcome,) = work([pair])
    assert outcome.row["state"] == "failed"
    assert expected in outcome.row["reason"]
    assert outcome.host == socket.gethostname()
    assert not (pair.output / "panda").exists()


CLUSTER = """
import sys, time
from distributed import LocalCluster
if __name__ == "__main__":
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False}
    with LocalCluster(**options, protocol="tcp", dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_a_lost_scheduler_ends_the_batch_with_what_is_done(recordings, tmp_path, capfd, end):
    """One sentence says how many pairs are done; table and overview are those of these pairs."""
    pytest.importorskip("distributed")
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    folder = tmp_path / "dataset"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, script], text=True, **pipes) as process:
        address = process.stdout.readline().strip()

        def lose(step, *_):
            if "→" in step:
                process.send_signal(end)
                process.wait()

        with pytest.raises(ManiportError, match="lost") as error:
            small([recordings], folder, dask=address, progress=lose)
    assert error.value.__suppress_context__
    table = read_table(folder)
    assert 1 <= len(table) < 8
    assert all(row["state"] == "done" for row in table)
    assert f"{len(table)} of 8 pairs" in str(error.value)
    assert f"{len(table)} of 8 pairs" in (folder / "index.html").read_text(encoding="utf-8")
    assert "Traceback" not in "".join(capfd.readouterr())
    assert logging.getLogger("distributed.client").isEnabledFor(logging.ERROR)
    assert small([recordings], folder).kept >= len(table)


def test_the_width_follows_the_cluster():
    """With one thread, two tasks are submitted; with three, when workers have joined, six."""
    threads = {"first": 1}
    futures = []

    def submit(work, task):
        futures.append(Future())
        return futures[-1]

    client = SimpleNamespace(
        nthreads=lambda: dict(threads), get_executor=lambda pure: SimpleNamespace(submit=submit)
    )
    executor = dask_executor(client, 60.0)
    found = completed(executor, eval, map(str, range(10)), period=0.01)
    collected = in_background(list, found)
    wait_until(lambda: len(futures) == 2)
    threads["second"] = 2
    wait_until(lambda: len(futures) == 6)
    del threads["second"]
    wait_until(lambda: executor.width() == 2)
    for future in futures[:3]:
        future.set_result(0)
    with pytest.raises(TimeoutError):
        collected.result(0.2)
    assert len(futures) == 6
    while not collected.done():
        for future in futures:
            if not future.done():
                future.set_result(0)
    assert len(collected.result()) == len(futures) == 10


def test_ray_gives_the_same_bytes(recordings, tmp_path, monkeypatch):
    """A stand-in for Ray: the width follows its processors, and results are verified."""
    processors = {"CPU": 1.0}

    class Task:
        def __init__(self, function):
            self.function = function

        def remote(self, *given):
            return SimpleNamespace(future=lambda: settled(Future(), self.function, *given))

    stand_in = SimpleNamespace(
        is_initialized=lambda: True,
        remote=lambda **options: Task,
        cluster_resources=lambda: dict(processors),
    )
    monkeypatch.setattr(executors, "ray", lambda: stand_in)
    monkeypatch.setattr(executors, "SHOWN_AFTER", 0.1)
    with executor_for(1, None, True) as executor:
        assert executor.width() == 2
        processors["CPU"] = 16.0
        wait_until(lambda: executor.width() == 32)
        assert executor.is_cluster
    given = recordings / "anna" / "1.c3d"
    whole = small([given], tmp_path / "whole")
    assert not whole.failed
    small([given], tmp_path / "dataset", ray=True)
    assert tree(tmp_path / "dataset") == tree(whole.folder)

    def work_elsewhere(pairs):
        outcomes = work(pairs)
        shutil.rmtree(pairs[0].folder)
        return outcomes

    monkeypatch.setattr(run, "work", work_elsewhere)
    with pytest.warns(ManiportWarning, match="failed"):
        lost = small([given], tmp_path / "lost", ray=True)
    assert all(repr(socket.gethostname()) in row["reason"] for row in lost.failed)
    assert len(lost.failed) == len(ROBOTS)


def test_a_silent_scheduler_ends_the_batch():
    """A scheduler that takes no part any more, but keeps its connection, is lost after some time."""
    answers = [{"first": 1}]

    def nthreads():
        if answers:
            return answers.pop()
        raise OSError("closed")

    client = SimpleNamespace(
        nthreads=nthreads,
        get_executor=lambda pure: SimpleNamespace(submit=lambda *_: Future()),
    )
    with pytest.raises(ManiportError, match="not answered"):
        list(completed(dask_executor(client, 0.05), eval, ["1"], period=0.01))


def test_a_killed_process_takes_one_task_with_it():
    tasks = ["1 + 1", "__import__('os')._exit(1)", "2 + 2", "1 / 0"]
    with executor_for(2, None, False) as executor:
        found = dict(completed(executor, eval, tasks))
    assert "killed" in str(found.pop(tasks[1]))
    assert isinstance(found.pop("1 / 0"), ZeroDivisionError)
    assert found == {"1 + 1": 2, "2 + 2": 4}


def test_a_killed_dask_worker_takes_no_task_with_it(tmp_path):
    """Of two workers one is killed by a task; the scheduler gives its tasks to others, and starts it anew."""
    distributed = pytest.importorskip("distributed")
    mark = tmp_path / "killed"
    killing = f"open({str(mark)!r}, 'x') and __import__('os')._exit(1)"
    once = f"4 if __import__('os').path.exists({str(mark)!r}) else {killing}"
    tasks = ["1 + 1", once, "2 + 1", "1 / 0"]
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(**options) as cluster,
        executor_for(1, cluster.scheduler_address, False) as executor,
    ):
        found = dict(completed(executor, eval, tasks))
    assert mark.exists()
    assert isinstance(found.pop("1 / 0"), ZeroDivisionError)
    assert found == {"1 + 1": 2, once: 4, "2 + 1": 3}


def test_a_lost_cluster_ends_the_batch():
    future = Future()
    client = SimpleNamespace(
        nthreads=dict, get_executor=lambda pure: SimpleNamespace(submit=lambda *_: future)
    )
    with pytest.raises(ManiportError, match="no workers"):
        list(completed(dask_executor(client, 0.0), eval, ["1"], period=0.01))
    future.cancel()
    future.set_running_or_notify_cancel()
    with pytest.raises(ManiportError, match="lost"):
        list(completed(dask_executor(client, 60.0), eval, ["1"]))


def test_names_of_recordings(tmp_path, monkeypatch, whole):
    """Folders and patterns name recordings below themselves; no name is a folder of another, leads up, or is taken."""

    def names(*given, without=tmp_path / "dataset"):
        return [source.name for source in find_recordings(given, without)]

    for name in (
        "a/walk.bvh",
        "b/walk.bvh",
        "b/table.csv",
        "c/1.c3d/2.c3d",
        "c/1.c3d/x.txt",
        "d/1.c3d/0.json",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "c" / os.fsdecode(b"3\xff.c3d")).touch()
    a, b, c, d = (tmp_path / name for name in "abcd")
    assert names(a, b) == names(f"{tmp_path}/**/*.bvh") == ["a/walk.bvh", "b/walk.bvh"]
    assert names(a, tmp_path / "b" / "table.csv") == ["table.csv", "walk.bvh"]
    assert names(a, b, d / "1.c3d") == ["a/walk.bvh", "b/walk.bvh", "d/1.c3d"]
    assert names(f"{tmp_path}/[ab]/*", without=a) == ["b/table.csv", "b/walk.bvh"]
    assert names(f"{d}/*", c) == ["c/1.c3d/2.c3d", "c/3\\udcff.c3d", "d/1.c3d"]
    monkeypatch.chdir(d / "1.c3d")
    for given in (["."], ["../../c/*/../../d/1.c3d"], [d / "1.c3d", "*.json"]):
        assert names(*given) == ["1.c3d"]
    for wrong in ("", f"{tmp_path}/*.c3d", "missing.bvh", whole.folder):
        with pytest.raises(InvalidInputError, match="recordings"):
            names(wrong, without=tmp_path / "new")


def test_folders_that_vanish_are_no_recordings(tmp_path, monkeypatch):
    """A batch that writes below the folder of recordings removes temporary folders while they are listed."""
    for name in ("a/walk.bvh", ".temporary/b/1.c3d", "c/walk.bvh"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).touch()
    scan = os.scandir

    def vanishing(path="."):
        if str(path).endswith(".temporary"):
            shutil.rmtree(path)
        return scan(path)

    monkeypatch.setattr(os, "scandir", vanishing)
    names = [source.name for source in find_recordings([tmp_path], tmp_path / "dataset")]
    assert names == ["a/walk.bvh", "c/walk.bvh"]


def test_each_robot_has_a_folder_of_its_own():
    panda = mp.load_arm("panda")
    arms = []
    for k, name in enumerate(("a:b", "a?b", "A-b", "..", "adapters")):
        arms.append(panda.narrowed(panda.lower + 1e-3 * k, panda.upper))
        arms[-1].name = name
    found = find_robots(
        [*arms, arms[1]], BATCH.changed(method="identity", collisions=False), ["adapters"]
    )
    assert [robot.name for robot in found] == ["a-b", "a-b-2", "A-b-3", "robot", "adapters-2"]


def test_a_recording_that_changes_meanwhile_is_reported(recordings, tmp_path):
    source = Source("1.c3d", recordings / "anna" / "1.c3d")
    config = BATCH.changed(method="identity", collisions=False, **PART)
    (robot,) = find_robots(["panda"], config, ())
    (tmp_path / "batch.json").touch()
    (outcome,) = work([Pair(tmp_path, source, "another", robot)])
    assert "changed" in outcome.row["reason"]
    assert [path.name for path in tmp_path.iterdir()] == ["batch.json"]


def test_tables_hold_no_formulas(tmp_path):
    write_tables(tmp_path, [failed_row("=1+1.c3d", "panda", "bad \udcff")])
    line = (tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()[1]
    assert line.startswith("'=1+1.c3d,panda,failed,bad \\udcff")


def test_each_pair_is_one_line_of_the_table(tmp_path):
    """Texts with line breaks, such as several warnings, are one line in CSV; in Parquet they stay as they are."""
    breaks = ["\n", "\r\n", "\r", "\x0b", "\x0c", "\x1c", "\x85", "\u2028", "\u2029"]
    rows = []
    for character in breaks:
        row = failed_row("1.c3d", "panda", "")
        rows.append(row | {"warnings": f"first, one{character}second", "verdict": character})
    write_tables(tmp_path, rows)
    text = (tmp_path / "table.csv").read_bytes().decode()
    assert len(text.splitlines()) == 1 + len(rows)
    table = read_table(tmp_path)
    assert [line["warnings"] for line in table] == ["first, one | second"] * len(rows)
    assert [line["verdict"] for line in table] == [""] * len(rows)
    parquet = pytest.importorskip("pyarrow.parquet").read_table(tmp_path / "table.parquet")
    assert parquet.to_pydict()["warnings"] == [row["warnings"] for row in rows]


def test_digests_tell_contents_apart(tmp_path):
    arm = mp.load_arm("panda")
    assert (
        digest(arm)
        == digest(mp.load_arm("panda"))
        != digest(arm.narrowed(arm.lower + 0.1, arm.upper))
    )
    for name in ("1", "2"):
        (tmp_path / name).write_text("same")
    assert digest(tmp_path / "1") == digest(tmp_path / "2") != digest(tmp_path)
    assert digest({"a": 1, "b": {2, 3}}) == digest({"b": {3, 2}, "a": 1})
    first, second = (
        np.array([float(text) for text in ("1.5", "2.5")], dtype=object) for _ in range(2)
    )
    assert digest(first) == digest(second)  # their bytes are addresses
    things = [
        1,
        1.0,
        "1",
        True,
        [1],
        {"1": 1},
        {1},
        np.array([1]),
        np.array([1.0]),
        [[1]],
        b"1",
        None,
    ]
    assert len({digest(thing) for thing in things}) == len(things)


@pytest.mark.parametrize(
    ("error", "more"),
    [
        (OutputError, {}),
        (InvalidInputError, {"move": True, "export": "vhs"}),
        (InvalidInputError, {"dask": "x:1", "ray": True}),
        (InvalidInputError, {"side": "both"}),
        (InvalidInputError, {"processes": 0}),
        (UnknownNameError, {"speed": 3}),
    ],
)
def test_wrong_arguments_are_refused_before_work(recordings, tmp_path, error, more):
    (tmp_path / "batch.json").write_text('{"mine": 1}')
    with pytest.raises(error):
        small([recordings], **{"output": tmp_path / "new" if more else tmp_path, **more})
    assert [path.name for path in tmp_path.iterdir()] == ["batch.json"]
