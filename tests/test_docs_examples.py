"""What the README and the pages show is run: every block of Python, every command.

A page's blocks run one after the other in a folder that holds the small files of `FILES` which the page names. In a
block of ``console`` every line that begins with ``maniport`` or ``$ maniport`` is a command; other lines show what it
prints. A command under which such a line begins with ``maniport:`` is one that ends with an error.
"""

import re
import shlex
import shutil
import sys
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from typer.testing import CliRunner

import maniport
import ros_stand_in
from crane import CRANE
from dialect_files import POINTS, mirrored, motion
from format_files import (
    DOWN,
    HIPS,
    SAUL,
    amass,
    landmarks,
    write_csv,
    write_json,
    write_mot,
    write_motive,
    write_mvnx,
    write_trc,
)
from maniport.defaults import AUTO
from maniport.demonstrations import shipped_recording
from maniport.demonstrations.readers.orders import MEDIAPIPE
from maniport.pipeline import transfer_both, transfer_recording
from maniport.pipeline.job import checked
from real_robots import HERE, MISSING
from sizes import SMALL, few_places

DOCS = Path(__file__).parents[1] / "docs"
PAGES = (
    *(f"start/{name}.md" for name in ("your_file", "tip_and_mounting", "distances", "cannot_follow", "sending")),
    "../README.md", "batch.md", "both_arms.md", "learn.md", "live.md", "outputs.md", "python.md", "recordings.md",
    "robots.md",
)  # fmt: skip
RUN_ELSEWHERE = {"add": "test_doors.py", "parallel.md": "test_joblib.py"}
"""Pages, and folders of them, whose blocks are those of other tests."""

PERSON = cache(motion)


def _points(family):
    return PERSON().recording(mirrored(POINTS[family]))


FILES = {
    "crane.urdf": lambda path: path.write_text(CRANE),
    "reach.c3d": lambda path: shutil.copy(shipped_recording("freeform"), path),
    "climb.bvh": lambda path: shutil.copy(shipped_recording("ladder"), path),
    "climb.npy": lambda path: shutil.copy(Path(__file__).parent / "demonstrations" / "data" / "climb.npy", path),
    "reach.csv": lambda path: write_csv(path, _points("COCO")),
    "reach.mot": lambda path: write_mot(path, PERSON().time, PERSON().joint_angles, SAUL),
    "opencap.trc": lambda path: write_trc(path, _points("OpenCap")),
    "mediapipe.json": lambda path: write_json(path, landmarks(_points("MediaPipe"), MEDIAPIPE, DOWN, HIPS)),
    "motive.csv": lambda path: write_motive(path, _points("Plug-in Gait")),
    "suit.mvnx": lambda path: write_mvnx(path, _points("MVNX")),
    "amass.npz": lambda path: np.savez(path, **amass(PERSON())),
    "walk.fbx": lambda path: path.write_bytes(b"Kaydara FBX Binary  "),
}
"""What writes each of the files that pages name."""


@pytest.fixture(params=PAGES)
def page(request, tmp_path, monkeypatch):
    """The text of a page, beside the files that it names."""
    file = DOCS / request.param
    if request.param in ("robots.md", "both_arms.md") and not HERE:
        pytest.skip(MISSING)
    text = file.read_text(encoding="utf-8")
    for name, write in FILES.items():
        if name in text:
            write(tmp_path / name)
    for name, stand_in in ros_stand_in.MODULES.items():
        monkeypatch.setitem(sys.modules, name, stand_in)
    monkeypatch.chdir(tmp_path)
    return text


@contextmanager
def short_work():
    """A time in which the main job is done on small domains, by the quickest method where none is named."""

    def quick(*recording, method=AUTO, **job):
        named = "parallel-transport" if method == AUTO else method
        return transfer_recording(*recording, method=named, **{**SMALL, **job})

    def quick_both(*recording, method=AUTO, **job):
        named = "parallel-transport" if method == AUTO else method
        return transfer_both(*recording, method=named, **{**SMALL, **job})

    with (
        few_places(),
        mock.patch("maniport.pipeline.transfer_both", quick_both),
        mock.patch.object(maniport, "transfer_both", quick_both, create=True),
        mock.patch("maniport.batches.robots.checked", partial(checked, **SMALL)),
        mock.patch("maniport.batches.run.cores", return_value=1),
        mock.patch("maniport.pipeline.transfer_recording", quick),
        mock.patch.object(maniport, "transfer_recording", quick, create=True),
    ):
        yield


def blocks(text, language):
    """Fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def commands(text):
    """Commands of a page, as (arguments, whether it ends with an error)."""
    for block in blocks(text, "console"):
        for part in re.split(r"^(?:\$ )?(?=maniport )", block.replace("\\\n", " "), flags=re.MULTILINE)[1:]:
            line, _, shown = part.partition("\n")
            yield shlex.split(line, comments=True)[1:], shown.startswith("maniport:")


def test_python_of_a_page_runs(page):
    """Every block, in their order and with what those before it made."""
    names = {}
    for block in blocks(page, "python"):
        with short_work():
            exec(compile(block, "page", "exec"), names)


def test_commands_of_a_page_run(page):
    """Every command ends as the page says: well, or with an error in one sentence."""
    from maniport.cli import app
    from maniport.errors import ManiportError

    for arguments, fails in commands(page):
        with short_work():
            result = CliRunner().invoke(app, arguments)
        assert isinstance(result.exception, ManiportError) if fails else result.exit_code == 0, (arguments, result)


def test_no_page_is_left_out():
    """Every page with a block of Python or of commands is among those that are run here, or by another test."""
    pages = {page.relative_to(DOCS).as_posix(): page for page in DOCS.rglob("*.md")}
    pages["../README.md"] = DOCS.parent / "README.md"
    texts = {name: page.read_text(encoding="utf-8") for name, page in pages.items()}
    shown = [name for name, text in texts.items() if blocks(text, "python") or blocks(text, "console")]
    assert {page for page in shown if page.split("/")[0] not in RUN_ELSEWHERE} == set(PAGES)


def test_commands_are_found_in_their_blocks():
    """Lines that go on are joined, prompts are taken off, and what is printed tells errors."""
    text = "```console\n$ maniport info \\\n  a.trc  # look\nPoints 3\n$ maniport info b\nmaniport: no\n```\n"
    assert list(commands(text)) == [(["info", "a.trc"], False), (["info", "b"], True)]
