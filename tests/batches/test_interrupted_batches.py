"""Interrupted batches, and tables with the same columns whatever succeeds."""

import json
import os
import signal
from collections.abc import Mapping

import pytest
from small_batches import read_table, small, tree
from typer.testing import CliRunner

import maniport as mp
from maniport import batches
from maniport.batches.table import TEXTS
from maniport.cli import app
from maniport.errors import ManiportWarning


class Interrupting:
    """A progress callback that acts when so many pairs are done."""

    def __init__(self, count, act):
        self.count, self.act = count, act

    def __call__(self, step, fraction, found=""):
        """Count a pair that ends."""
        self.count -= "→" in step
        if self.count == 0:
            self.act()


def interrupt():
    """Interrupt as Ctrl-C does."""
    raise KeyboardInterrupt


def test_an_interrupted_batch_has_a_table_and_continues(whole, recordings, tmp_path):
    """The exception has the numbers of pairs; table and overview have those that are done; the rest follows."""
    folder = tmp_path / "dataset"
    with pytest.raises(KeyboardInterrupt, match="4 of 12 pairs"):
        small([recordings], folder, progress=Interrupting(3, interrupt))
    rows = read_table(folder)
    assert len(rows) == 4
    assert {row["state"] for row in rows} == {"done"}
    assert "4 of 12 pairs" in (folder / "index.html").read_text(encoding="utf-8")
    again = small([recordings], folder)
    assert again.kept == 4
    assert tree(folder) == tree(whole.folder)


def test_ctrl_c_ends_the_command_with_what_is_done(recordings, tmp_path, monkeypatch):
    """Exit code 130, nothing on standard output, and how many pairs are done; the same command continues."""
    whole = batches.batch

    def interrupted(*given, progress, **more):
        return whole(*given, progress=Interrupting(1, lambda: os.kill(os.getpid(), signal.SIGINT)), **more)

    words = ["batch", str(recordings / "anna"), "-o", str(tmp_path / "dataset"), "--processes", "1", "--no-move"]
    words += ["--start", "1", "--stop", "1.5", "--method", "raw-copy", "--no-collisions", "--json"]
    with monkeypatch.context() as patch:
        patch.setattr(batches, "batch", interrupted)
        ended = CliRunner().invoke(app, words)
    assert (ended.exit_code, ended.stdout) == (130, "")
    assert "1 of 3 pairs" in ended.stderr
    assert len(read_table(tmp_path / "dataset")) == 1
    again = CliRunner().invoke(app, words)
    assert again.exit_code == 0
    assert json.loads(again.stdout)["done_before"] == 1


def test_columns_are_the_same_whatever_succeeds(whole, tmp_path, small_result):
    """A table of failures has the columns of any other; each metric is one of a summary of a run."""
    (tmp_path / "bad.bvh").write_text("rubbish")
    with pytest.warns(ManiportWarning, match="no BVH file"):
        failed = small([tmp_path / "bad.bvh"], tmp_path / "dataset")
    names = list(whole.table[0])
    assert list(read_table(tmp_path / "dataset")[0]) == list(read_table(whole.folder)[0]) == names
    assert all(list(row) == names for row in (*whole.table, *failed.table))
    mp.write_results(small_result, tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    missing = {name for name in names if not has(summary, name)}
    assert missing - set(TEXTS) - {"computing_s"} == {
        f"motion.orientation_error_deg.{one}" for one in ("median", "p95", "max")
    }


def has(numbers, name):
    """Whether a summary has a number of this path."""
    for key in name.split("."):
        if not isinstance(numbers, Mapping) or key not in numbers:
            return False
        numbers = numbers[key]
    return True


def test_computing_time_is_in_table_and_overview(whole, recordings, tmp_path):
    """Of each pair, also of one that failed, and the same when it is not done again."""
    assert all(row["computing_s"] > 0.0 for row in whole.table)
    assert [float(row["computing_s"]) for row in read_table(whole.folder)] == [r["computing_s"] for r in whole.table]
    assert "computing time [s]" in (whole.folder / "index.html").read_text(encoding="utf-8")
    (tmp_path / "bad.bvh").write_text("rubbish")
    with pytest.warns(ManiportWarning, match="no BVH file"):
        found = small([tmp_path / "bad.bvh"], tmp_path / "dataset")
    assert all(row["computing_s"] >= 0.0 for row in found.table)
