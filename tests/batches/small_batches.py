"""Batches that take a moment, and what came of them."""

import csv
import json

import pytest

import maniport as mp

SMALL = {"method": "parallel-transport", "n_teacher": 32, "n_student": 64, "move": False, "collisions": False}
PART = {"start": 1.0, "stop": 1.5}
ROBOTS = ("panda", "rhuman")


def small(recordings, output, **more):
    """A batch that takes a moment."""
    return mp.batch(recordings, ROBOTS, output, **{"processes": 1, "reading": PART} | SMALL | more)


def tree(folder):
    """Every file of a folder with its content but for computing times, without temporary files of killed processes."""
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: without_times(path) for name, path in files.items() if "/." not in f"/{name}"}


def without_times(path):
    """The content of a file of a batch without computing times."""
    if path.name == "pair.json":
        content = json.loads(path.read_text(encoding="utf-8"))
        del content["row"]["computing_s"]
        return content
    if path.name == "table.csv":
        return [{**row, "computing_s": None} for row in read_table(path.parent)]
    if path.name == "table.parquet":
        table = pytest.importorskip("pyarrow.parquet").read_table(path)
        return table.drop_columns("computing_s").to_pydict()
    return b"" if path.name == "index.html" else path.read_bytes()


def read_table(folder):
    """The rows of the table of a batch, by column."""
    with open(folder / "table.csv", newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))
