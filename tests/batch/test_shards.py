"""Lists of recordings, and the part of them that a shard has."""

from pathlib import Path

import pytest

from maniport.batch import Clip, Shard, read_list
from maniport.batch.inputs import Source, find_recordings
from maniport.errors import FileFormatError, InvalidInputError, ManiportWarning


@pytest.fixture
def clips(tmp_path, monkeypatch):
    """Four files in the working folder."""
    monkeypatch.chdir(tmp_path)
    names = ["anna/1.c3d", "anna/2.c3d", "ben/1.c3d", "ben/2 b.c3d"]
    for name in names:
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).touch()
    return names


def written(text):
    Path("list.txt").write_bytes(text.encode())
    return "list.txt"


def test_a_list_has_a_recording_in_each_line(clips):
    """Empty lines, line ends of Windows, a byte order mark, persons after a tab, and bundled names."""
    text = "\ufeffanna/1.c3d\tanna\r\n\r\n  \nben/2 b.c3d\nfreeform\tcarl"
    expected = [Clip("anna/1.c3d", "anna"), Clip("ben/2 b.c3d"), Clip("freeform", "carl")]
    assert read_list(written(text)) == expected
    names = [source.name for source in find_recordings(expected, Path("out"))]
    assert names == ["1.c3d", "2 b.c3d", "freeform.c3d"]


def test_missing_files_of_a_list_are_named_with_their_lines(clips):
    with pytest.raises(InvalidInputError) as error:
        read_list(written("anna/1.c3d\nanna/9.c3d\n\nben/\0.c3d\nben/8.c3d\n"))
    for part in ("3 recordings", "line 2 'anna/9.c3d'", "line 4", "line 5 'ben/8.c3d'"):
        assert part in str(error.value)
    assert "anna/1.c3d" not in str(error.value)


@pytest.mark.parametrize("content", [b"", b"\n \n\t\n", b"\xff\xfe\x00binary"])
def test_what_is_no_list_is_refused(clips, content):
    Path("list.txt").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"list\.txt"):
        read_list("list.txt")
    for other in ("none.txt", "anna"):
        with pytest.raises(FileFormatError, match=other):
            read_list(other)


def test_repeated_lines_count_once(clips):
    """Also by another path or link; two persons of one recording are a contradiction."""
    Path("link.c3d").symlink_to("anna/1.c3d")
    text = "anna/1.c3d\nben/1.c3d\n./anna/1.c3d\nlink.c3d\n"
    with pytest.warns(ManiportWarning, match="2 lines"):
        assert read_list(written(text)) == [Clip("anna/1.c3d"), Clip("ben/1.c3d")]
    with pytest.raises(InvalidInputError, match=r"line 2.*'ben'.*'anna'"):
        read_list(written("anna/1.c3d\tanna\nanna/1.c3d\tben\n"))


@pytest.mark.parametrize(
    "text",
    ["", "1", "0/2", "3/2", "-1/2", "1/0", "1/2/3", "1.0/2", "one/two", "1/", "²/3", "1/9999999"],
)
def test_a_shard_is_one_of_n(text):
    with pytest.raises(InvalidInputError, match="shard"):
        Shard.parse(text)
    assert Shard.parse(" 3/10 ") == Shard(3, 10)
    assert str(Shard.parse("03/10")) == "3/10"


def slurm(**values):
    return {f"SLURM_ARRAY_TASK_{name}": str(value) for name, value in values.items()}


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({}, Shard(1, 1)),
        ({"SLURM_ARRAY_TASK_ID": "3"}, Shard(1, 1)),
        (slurm(ID=3, COUNT=10), Shard(3, 10)),
        (slurm(ID=3, COUNT=10, MIN=1, MAX=10, STEP=1), Shard(3, 10)),
        (slurm(ID=0, COUNT=10, MIN=0, MAX=9), Shard(1, 10)),
        (slurm(ID=9, COUNT=10, MIN=0, MAX=9), Shard(10, 10)),
    ],
)
def test_a_task_of_a_slurm_array_is_a_shard(environment, expected):
    assert Shard.of_slurm(environment) == expected


@pytest.mark.parametrize(
    "environment",
    [
        slurm(ID=7, COUNT=3, MIN=1, MAX=7),  # --array=1,3,7: which of them is a third?
        slurm(ID=1, COUNT=3, MIN=1, MAX=7),
        slurm(ID=0, COUNT=3),
        slurm(ID=4, COUNT=3),
        slurm(ID="x", COUNT=3),
    ],
)
def test_an_array_with_gaps_is_refused(environment):
    with pytest.raises(InvalidInputError, match="shard"):
        Shard.of_slurm(environment)


def parts(sources, count):
    return [Shard(i, count).select(sources) for i in range(1, count + 1)]


def sources_of(persons, *, named):
    """Sources of persons with numbers of clips, each in a folder, or named by the list."""
    sources = []
    for person, clips in persons.items():
        for k in range(clips):
            path = Path("all" if named else person, f"{person}-{k}.bvh")
            sources.append(Source(path.name, path, person if named else ""))
    return sources


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("count", [1, 2, 3, 7, 40])
def test_each_person_is_in_one_shard(named, count):
    """Each recording is in one shard, and shards differ by about the recordings of one person."""
    persons = {f"person {k:02}": 1 + k % 5 for k in range(30)}
    sources = sources_of(persons, named=named)
    found = parts(sources, count)
    assert sorted(source.name for part in found for source in part) == sorted(
        source.name for source in sources
    )
    for person in persons:
        holders = [part for part in found if any(one.name.startswith(person) for one in part)]
        assert len(holders) == 1
    assert max(map(len, found)) <= len(sources) / count + 5


def test_clips_in_one_folder_are_spread_evenly():
    """Where nothing says who they are of; a person whom the list names stays together."""
    sources = sources_of({"only": 10}, named=False)
    assert [len(part) for part in parts(sources, 4)] == [2, 3, 2, 3]
    named = sources_of({"only": 10}, named=True)
    assert [len(part) for part in parts(named, 4)] == [0, 0, 10, 0]
