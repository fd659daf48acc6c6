"""Small files of settings: what is read, and what a faulty one gets."""

import pytest

from maniport.errors import FileFormatError
from maniport.files import read_settings, require_mapping
from maniport.input_limits import SETTINGS_BYTES


def test_yaml_and_json_give_the_same(tmp_path):
    """The same content in either notation is the same mapping."""
    yaml, json = tmp_path / "a.yaml", tmp_path / "a.json"
    yaml.write_text("default: {velocity: 1.5}\njoints:\n  elbow: {jerk: 3}\n")
    json.write_text('{"default": {"velocity": 1.5}, "joints": {"elbow": {"jerk": 3}}}')
    keys = ("default", "joints")
    assert read_settings(yaml, keys) == read_settings(str(json), keys)
    assert read_settings(yaml, keys) == {"default": {"velocity": 1.5}, "joints": {"elbow": {"jerk": 3}}}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\n b: 2\n", r"not readable as YAML in line 2, column 3"),
        ("a: 1\na: 2\n", r"in line 2, column 1: the key 'a' stands twice"),
        ("a: &x [1]\nb: *x\n", r"in line 2, column 4: aliases \(\*x\) are not read"),
        ("a: !!python/object/apply:os.system [true]\n", r"in line 1, column 4: could not determine a constructor"),
        ("- 1\n", "must be a mapping with the keys a, b; found list"),
        ("# nothing\n", "must be a mapping with the keys a, b; found nothing"),
        ("c: 1\n", "unknown key 'c'; allowed are, nearest first: a, b"),
        ("[a]: 1\n", "in line 1, column 1: found unhashable key"),
        ("a: " + "[" * 1500, "not readable as YAML"),
        ("a: 9" + "9" * 5000, "not readable as YAML: Exceeds the limit"),
        ("a: 2020-99-99", "not readable as YAML: month must be"),
        ("a: \x00", "not readable as YAML"),
        (" " * (SETTINGS_BYTES + 1), r"has 0\.25 MB; at most 0\.25 MB are read"),
    ],
)
def test_faulty_files(tmp_path, text, message):
    """Each fault is named, with its line where it has one."""
    path = tmp_path / "s.yaml"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=message):
        read_settings(path, ("a", "b"))


def test_what_is_no_text_or_not_there(tmp_path):
    """Other files are named as what they are not."""
    (tmp_path / "s.yml").write_bytes(b"a: \xff\xfe")
    with pytest.raises(FileFormatError, match="not a text file: invalid start byte at byte 3"):
        read_settings(tmp_path / "s.yml", ("a",))
    with pytest.raises(FileFormatError, match="no such file"):
        read_settings(tmp_path / "other.yaml", ("a",))
    with pytest.raises(FileFormatError, match=r"allowed are \.yaml, \.yml, \.json"):
        read_settings(__file__, ("a",))


def test_a_nested_mapping_is_checked_by_its_place():
    """The message says which mapping holds the unknown key."""
    with pytest.raises(FileFormatError, match=r"l\.yaml: joints: unknown key 'velocty'; .*: velocity, jerk"):
        require_mapping({"velocty": 1}, ("jerk", "velocity"), "l.yaml: joints")
