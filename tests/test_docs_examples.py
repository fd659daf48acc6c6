"""The examples of the README and the pages run as they are pasted, in an empty folder.

All Python and ``console`` blocks of a page run in their order in one folder. What a page tells the reader to save
("Save it as `NAME`:", then a block) is the only file there. In a block of ``console`` every line that begins with
``maniport`` or ``$ maniport`` is a command; other lines show its output. A command under which such a line begins with
``maniport:`` ends with an error. Examples run in this process, on small domains and with little effort.
"""

import re
import shlex
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest import mock

import pytest
from typer.testing import CliRunner

from maniport.batch.inputs import digest
from maniport.errors import ManiportError
from maniport.pipeline import Transfer
from maniport.pipeline.robots import load_robot
from maniport.pipeline.settings import settings_of
from maniport.util.defaults import AUTO
from real_robots import HERE, MISSING
from sizes import SMALL, little_search

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[1] / "docs"
PAGES = (
    "../README.md",
    "audit.md",
    "batch.md",
    "both_arms.md",
    "capability.md",
    "datasets.md",
    "demonstrations.md",
    "distances.md",
    "end_effector.md",
    "execution.md",
    "live.md",
    "python.md",
    "quick_start.md",
    "recordings.md",
    "result_folder.md",
    "robots.md",
    "tutorial.md",
)
SAVED = re.compile(
    r"[Ss]ave \w+ as `([\w.-]+)`:\n\n```\w+\n(.*?)^```", flags=re.DOTALL | re.MULTILINE
)
BLOCK = re.compile(r"^```(python|console)\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)


@pytest.fixture(params=PAGES)
def page(request, tmp_path, monkeypatch):
    """The text of a page, in an empty folder but for the files that the page tells to save."""
    if request.param in ("robots.md", "both_arms.md") and not HERE:
        pytest.skip(MISSING)
    text = (DOCS / request.param).read_text(encoding="utf-8")
    for name, content in SAVED.findall(text):
        (tmp_path / name).write_text(content)
    monkeypatch.chdir(tmp_path)
    return text


@pytest.fixture(scope="session")
def short_work():
    """Make a context of small domains, and of the quickest method by default; equal transfers run once in a session."""
    results = {}

    run = Transfer.run

    def quick(transfer, recording):
        config = transfer.settings.config
        config = config.changed(**{name: min(SMALL[name], getattr(config, name)) for name in SMALL})
        if config.method == AUTO:
            config = config.changed(method="parallel-transport")
        same = replace(config, recording=(), start=None, stop=None, export=(), verb="")
        key = digest(recording, same, load_robot(config))
        if key not in results:
            results[key] = run(Transfer.of(config, transfer.settings.progress), recording)
        return results[key]

    @contextmanager
    def work():
        with (
            little_search(),
            mock.patch(
                "maniport.batch.inputs.settings_of",
                lambda config: settings_of(config.changed(**SMALL)),
            ),
            mock.patch("maniport.batch.run.cpu_count", return_value=1),
            mock.patch.object(Transfer, "run", quick),
        ):
            yield

    return work


def commands(block):
    """Commands of a block, as (arguments, whether it ends with an error)."""
    for part in re.split(r"^(?:\$ )?(?=maniport )", block.replace("\\\n", " "), flags=re.MULTILINE)[
        1:
    ]:
        line, _, shown = part.partition("\n")
        yield shlex.split(line, comments=True)[1:], shown.startswith("maniport:")


def run_commands(block):
    """Run the commands of a block; each ends as the page says: well, or with an error in one sentence."""
    from maniport.cli import app

    for arguments, fails in commands(block):
        result = CliRunner().invoke(app, arguments)
        assert isinstance(result.exception, ManiportError) if fails else result.exit_code == 0, (
            arguments,
            result,
        )


@pytest.mark.filterwarnings("default::maniport.errors.ManiportWarning")
def test_examples_of_a_page_run(page, short_work):
    names = {"__name__": "__main__"}
    for language, block in BLOCK.findall(page):
        with short_work():
            if language == "python":
                exec(compile(block, "page", "exec"), names)
            else:
                run_commands(block)


def test_no_page_is_left_out():
    pages = {page.relative_to(DOCS).as_posix(): page for page in DOCS.rglob("*.md")}
    pages["../README.md"] = DOCS.parent / "README.md"
    texts = {name: page.read_text(encoding="utf-8") for name, page in pages.items()}
    with_blocks = {name for name, text in texts.items() if BLOCK.search(text)}
    assert with_blocks == set(PAGES)
