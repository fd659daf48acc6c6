"""Writing whole when processes are killed: old or new is there at any moment, and what they left goes."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from maniport import atomic_io
from maniport.atomic_io import folder_written_whole, written_whole
from maniport.errors import OutputError

NAMES = ("a.json", "b.json", "c.json")
CHANGES = ("open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "shutil.rmtree")
"""What Python tells its auditors of before files and folders change."""


def write_file(target, number):
    """Write a file that says its number."""
    with written_whole(target) as temporary:
        temporary.write_text(json.dumps(number))


def write_folder(target, number):
    """Write a folder of files that say its number."""
    with folder_written_whole(target, NAMES, overwrite=True) as staging:
        for name in NAMES:
            write_file(staging / name, number)


def found(target):
    """The number that a file, or all files of a folder, say; None when it is not there."""
    if not target.exists():
        return None
    (number,) = {json.loads(one.read_text()) for one in ([target / x for x in NAMES] if target.is_dir() else [target])}
    return number


def temporary_names(target):
    """Names of the temporary files and folders next to a target, without those of the earlier result."""
    return {one.name.removesuffix(atomic_io.EARLIER) for one in target.parent.iterdir() if one != target}


def killed_before(change, write, target):
    """Write 2 in a child that is killed before so many changes are made; whether it lived that long."""
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


@pytest.mark.parametrize("earlier", [None, 1])
@pytest.mark.parametrize("at_once", [True, False] if sys.platform == "linux" else [False])
@pytest.mark.parametrize("write", [write_file, write_folder])
def test_a_kill_leaves_old_or_new_and_the_next_run_cleans(tmp_path, monkeypatch, write, at_once, earlier):
    """Killed between any two changes; where folders do not change places at once, the next run brings the old back."""
    if not at_once:
        monkeypatch.setattr(atomic_io, "_exchange", lambda first, second: False)
    target, change, seen = tmp_path / "result.json", 0, set()
    while True:
        if earlier is not None:
            write(target, earlier)
        if not killed_before(change, write, target):
            break
        assert len(temporary_names(target)) <= 1, change
        after = found(target)
        if not at_once and earlier and after is None:
            atomic_io.clean(target)
            after = found(target)
        assert after in (earlier, 2), change
        seen.add(after)
        write(target, 3)
        assert found(target) == 3
        assert list(tmp_path.iterdir()) == [target], change
        if earlier is None:
            (atomic_io.shutil.rmtree if target.is_dir() else Path.unlink)(target)
        change += 1
    assert found(target) == 2
    assert seen == {earlier, 2} or write is write_file  # nothing changes after a file is in place


def test_what_lives_is_not_removed(tmp_path):
    """While another process writes a target, who writes the same leaves its temporary folder alone."""
    target = tmp_path / "result"
    code = (
        "import sys; from pathlib import Path; from maniport.atomic_io import temporary_beside, place\n"
        "with temporary_beside(Path(sys.argv[1]), folder=True) as folder:\n"
        "    (folder / 'a.json').write_text('1'); print(flush=True); sys.stdin.readline()\n"
        "    place(folder, Path(sys.argv[1]))"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code, str(target)], **pipes, text=True) as other:
        other.stdout.readline()
        write_folder(target, 2)
        assert found(target) == 2
        assert len(list(tmp_path.iterdir())) == 2
        other.communicate("\n")
    assert [one.name for one in target.iterdir()] == ["a.json"]
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("error", [BlockingIOError, FileNotFoundError])
@pytest.mark.parametrize("write", [write_file, write_folder])
def test_what_another_one_takes_for_left_is_made_again(tmp_path, monkeypatch, write, error):
    """A temporary file that somebody who cleans locks or removes before its maker has locked it is given up."""
    locked, lost = atomic_io._lock, []

    def too_late(path):
        if not lost:
            lost.append(path)
            raise error
        return locked(path)

    monkeypatch.setattr(atomic_io, "_lock", too_late)
    write(tmp_path / "result", 1)
    assert found(tmp_path / "result") == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "result"]
    assert lost


@pytest.mark.parametrize("reason", ["another computer", "no locks"])
def test_in_doubt_nothing_is_removed(tmp_path, monkeypatch, reason):
    """What another computer left is its own to remove; where nothing can be locked nobody knows what lives."""
    with monkeypatch.context() as elsewhere:
        if reason == "another computer":
            elsewhere.setattr(atomic_io.platform, "node", lambda: "elsewhere")
        assert killed_before(5, write_folder, tmp_path / "result")
    if reason == "no locks":
        monkeypatch.setattr(atomic_io, "fcntl", None)
    write_folder(tmp_path / "result", 3)
    assert len(list(tmp_path.iterdir())) == 2
    monkeypatch.undo()
    if reason == "no locks":
        write_folder(tmp_path / "result", 4)
        assert len(list(tmp_path.iterdir())) == 1


def test_names_that_are_nearly_ours_stay(tmp_path):
    """Only what has a temporary name of this target is removed."""
    with atomic_io.temporary_beside(tmp_path / "result.json") as other:
        pass
    others = [other.with_name(other.name + "x"), other.with_name("x" + other.name), tmp_path / ".result.json"]
    for one in others:
        one.touch()
    write_file(tmp_path / "result.json", 1)
    assert sorted(tmp_path.iterdir()) == sorted([*others, tmp_path / "result.json"])


def test_what_comes_meanwhile_stays(tmp_path):
    """A folder that others filled while the result was made is not replaced."""
    with pytest.raises(OutputError, match="holds other things"), folder_written_whole(tmp_path / "out", NAMES):  # noqa: PT012
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / "thesis.tex").touch()
    assert [one.name for one in (tmp_path / "out").iterdir()] == ["thesis.tex"]
    assert [one.name for one in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("write", [write_file, write_folder])
def test_a_read_only_file_system_does_not_hide_its_message(tmp_path, monkeypatch, write):
    """Where nothing can be made and nothing be removed, the reason is told, and not that removing failed."""

    def fail(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    for name in ("open", "mkdir", "unlink", "rmdir", "rename", "replace"):
        monkeypatch.setattr(os, name, fail)
    with pytest.raises(OutputError, match=r"cannot write '.*result': Read-only file system"):
        write(tmp_path / "result", 1)


@pytest.mark.parametrize("moment", ["writing", "written"])
def test_ctrl_c_says_whether_anything_was_written(tmp_path, moment):
    """Exit code 130, nothing left, and one sentence: nothing was written, or what was."""
    code = (
        "import os, signal, sys, time; from pathlib import Path; from maniport import __main__ as start\n"
        "from maniport import atomic_io, files\n"
        "signal.signal(signal.SIGINT, start._end)\n"
        "if sys.argv[2] == 'written': files.save_path(sys.argv[1], [[0, 0, 0]])\n"
        "with atomic_io.written_whole(sys.argv[1]) as temporary:\n"
        "    temporary.write_text('half'); os.kill(os.getpid(), signal.SIGINT); time.sleep(10)"
    )
    target = tmp_path / "path.npz"
    ended = subprocess.run([sys.executable, "-c", code, target, moment], capture_output=True, text=True, check=False)
    written = moment == "written"
    assert ended.returncode == 130
    assert ("path.npz' was written before" if written else "nothing was written") in ended.stderr
    assert list(tmp_path.iterdir()) == [target] * written
