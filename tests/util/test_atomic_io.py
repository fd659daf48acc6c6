"""Files and folders are written whole or not at all, whatever ends the process that writes them."""

import errno
import json
import os
import signal
import sys
from pathlib import Path

import pytest

from maniport import cli
from maniport.errors import OutputError
from maniport.util import atomic_io
from maniport.util.atomic_io import (
    claim,
    folder_written_whole,
    require_room,
    written,
    written_whole,
)

NAMES = ("a.json", "b.json")
CHANGES = (
    "open",
    "os.mkdir",
    "os.rename",
    "os.remove",
    "os.rmdir",
    "shutil.rmtree",
)  # audit events of changes


def write_file(target, number):
    with written_whole(target) as temporary:
        temporary.write_text(json.dumps(number))


def write_folder(target, number):
    with folder_written_whole(target, NAMES, overwrite=True) as staging:
        for name in NAMES:
            write_file(staging / name, number)


both_kinds = pytest.mark.parametrize("write", [write_file, write_folder])


def content(target):
    """Return the number in a file, or in all files of a folder; None when it is not there."""
    if not target.exists():
        return None
    files = [target / name for name in NAMES] if target.is_dir() else [target]
    (number,) = {json.loads(file.read_text()) for file in files}
    return number


def killed_before(change, write, target):
    """Write 2 in a child that is killed before its n-th change; return whether it lived that long."""
    child = os.fork()
    if not child:
        left = iter(range(change))

        def watch(event, _):
            if event in CHANGES and next(left, None) is None:
                os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(watch)
        write(target, 2)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL


@pytest.mark.skipif(sys.platform != "linux", reason="folders cannot be exchanged")
@pytest.mark.parametrize("earlier", [None, 1])
@both_kinds
def test_a_kill_leaves_old_or_new(tmp_path, write, earlier):
    change = 0
    alive = False
    seen = set()
    while not alive:
        target = tmp_path / str(change) / "result.json"
        target.parent.mkdir()
        if earlier is not None:
            write(target, earlier)
        alive = not killed_before(change, write, target)
        seen.add(content(target))
        change += 1
    assert content(target) == 2
    assert list(target.parent.iterdir()) == [target]
    assert seen == {earlier, 2}


def test_a_folder_is_replaced_where_folders_cannot_be_exchanged(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic_io, "_exchange", lambda first, second: False)
    for number in (1, 2):
        write_folder(tmp_path / "out", number)
        assert content(tmp_path / "out") == number
        assert list(tmp_path.iterdir()) == [tmp_path / "out"]
    assert repr(str(tmp_path / "out")) in written()


@both_kinds
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError("disk full")])
def test_an_error_keeps_the_earlier_result(tmp_path, write, error):
    write(tmp_path / "result", 1)
    writer = (
        written_whole
        if write is write_file
        else lambda path: folder_written_whole(path, NAMES, overwrite=True)
    )
    expected = KeyboardInterrupt if error is KeyboardInterrupt else OutputError
    with pytest.raises(expected) as raised, writer(tmp_path / "result"):
        raise error
    assert expected is KeyboardInterrupt or "result" in str(raised.value)
    assert content(tmp_path / "result") == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "result"]


def test_an_earlier_folder_is_replaced_only_when_allowed(tmp_path):
    folder = tmp_path / "out"
    write_folder(folder, 1)
    with pytest.raises(OutputError, match=r"out'.*overwrite="):
        folder_written_whole(folder, NAMES).__enter__()
    with (
        pytest.raises(OutputError, match="other things"),
        folder_written_whole(folder, NAMES, overwrite=True),
    ):
        (folder / "thesis.tex").touch()
    assert {file.name for file in folder.iterdir()} == {*NAMES, "thesis.tex"}
    assert list(tmp_path.iterdir()) == [folder]


def test_a_folder_is_claimed_when_new_empty_or_claimed_before(tmp_path):
    for _ in range(2):
        claim(tmp_path / "new", "about.json", {"seed": 1}, ("seed",))
    assert written().endswith(f"parts of {str(tmp_path / 'new')!r}")
    (tmp_path / "file").touch()
    wrong = {
        "new": "another seed",
        "file": "exists",
        "no/parent": "No such file",
        ".": "other things",
    }
    for name, message in wrong.items():
        with pytest.raises(OutputError, match=message):
            claim(tmp_path / name, "about.json", {"seed": 2}, ("seed",))


@both_kinds
def test_what_cannot_be_written_is_reported_before_the_work(tmp_path, monkeypatch, write):
    folder = write is write_folder
    require_room(tmp_path / "result", folder)
    for place, reason in (
        (tmp_path / "no" / "one", "there is no folder"),
        (tmp_path / ("x" * 300), "name too long"),
    ):
        for attempt in (
            lambda place=place: require_room(place, folder),
            lambda place=place: write(place, 1),
        ):
            with pytest.raises(OutputError, match=reason) as raised:
                attempt()
            assert str(raised.value).count("cannot write") == 1

    def fail(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(Path, "touch", fail)
    for name in ("mkdir", "unlink", "rmdir", "rename", "replace"):
        monkeypatch.setattr(os, name, fail)
    with pytest.raises(OutputError, match=r"result'.*Read-only"):
        write(tmp_path / "result", 1)
    monkeypatch.undo()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("earlier", [False, True])
@both_kinds
def test_links_are_followed_and_stay(tmp_path, write, earlier):
    (tmp_path / "disk").mkdir()
    target = tmp_path / "disk" / "result"
    if earlier:
        write(target, 1)
    (tmp_path / "first").symlink_to("disk/result")
    (tmp_path / "second").symlink_to(tmp_path / "first")
    write(tmp_path / "second", 2)
    assert (tmp_path / "second").is_symlink()
    assert not target.is_symlink()
    assert content(target) == 2
    assert list((tmp_path / "disk").iterdir()) == [target]


@pytest.mark.parametrize("pointed", ["missing/result", "loop", "/", "/dev/null", "other"])
@both_kinds
def test_links_that_lead_nowhere_are_errors(tmp_path, write, pointed):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").touch()
    (tmp_path / "loop").symlink_to(pointed)
    with pytest.raises(OutputError, match="loop"):
        write(tmp_path / "loop", 1)
    assert (tmp_path / "loop").is_symlink()
    assert (tmp_path / "other" / "thesis.tex").exists()


@pytest.mark.parametrize(
    "words", [("demo",), ("transfer", "freeform"), ("learn", "freeform"), ("reproduce",)]
)
def test_the_root_is_no_place_for_results(monkeypatch, capsys, words):
    monkeypatch.setattr(sys, "argv", ["maniport", *words, "-o", os.path.abspath(os.sep)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("maniport: cannot write '")


def test_two_processes_claim_a_new_folder_at_once(tmp_path, monkeypatch):
    """The marker of the other, which comes while this one looks for it, is no other thing."""
    folder = tmp_path / "dataset"
    read = Path.read_text

    def other_comes(path, **options):
        try:
            return read(path, **options)
        except FileNotFoundError:
            folder.mkdir()
            (folder / "batch.json").write_text('{"maniport": "1"}')
            (folder / "shards").mkdir()
            raise

    monkeypatch.setattr(Path, "read_text", other_comes)
    claim(folder, "batch.json", {"maniport": "1"})
    assert (folder / "shards").is_dir()
