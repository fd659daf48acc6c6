"""Settings files are YAML 1.2: what YAML 1.1 alone reads as numbers, truth values or dates is text."""

import pytest
import yaml

from maniport.arms.collisions.obstacles import read_boxes
from maniport.errors import FileFormatError, InvalidInputError, ManiportError
from maniport.motion import MotionLimits
from maniport.pipeline.config import Config
from maniport.pipeline.options import OPTIONS
from maniport.pipeline.settings import marker_roles, settings_of
from maniport.util.files import read_settings, settings_text
from maniport.util.validation import as_count, as_flag, as_number

TEXTS = [
    *("1:59:59", "1:30.5", "yes", "No", "on", "OFF", "y", "1_000", "0b11", "0O17", "2026-01-01"),
    *("<<", "=", "-.nan", "+.nan", "0o8", "-0x1f", "12e", "truE", "nUll"),
]
NUMBERS = {
    "010": 10,
    "+12": 12,
    "-0": 0,
    "0o17": 15,
    "0x1F": 31,
    "1e5": 1e5,
    "-1.5E-3": -1.5e-3,
    ".5": 0.5,
    "5.": 5.0,
    ".inf": float("inf"),
    "-.INF": -float("inf"),
    "true": True,
    "False": False,
    "~": None,
    "": None,
    "Null": None,
    str(2**63 - 1): 2**63 - 1,
}
HUGE = ["1" * 5000, "-" + "9" * 20, "0x" + "f" * 5000, "0o" + "7" * 9000, str(2**63)]


@pytest.fixture
def written(tmp_path):
    """Write a settings file; return its path."""

    def write(text):
        path = tmp_path / "settings.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("text", TEXTS)
def test_what_only_yaml_1_1_interprets_is_text(written, text):
    assert read_settings(written(f"a: {text}"), ["a"]) == {"a": text}
    assert read_settings(written(f"a: [{text}]"), ["a"]) == {"a": [text]}


@pytest.mark.parametrize("text", NUMBERS)
def test_scalars_of_the_core_schema_have_their_types(written, text):
    value = read_settings(written(f"a: {text}"), ["a"])["a"]
    assert (type(value), value) == (type(NUMBERS[text]), NUMBERS[text])


@pytest.mark.parametrize(
    "text",
    [*HUGE, "!!int 1:59", "!!bool yes", "!!timestamp 2026-01-01", "!!binary aa", "!!set {a}"],
    ids=lambda text: text[:12],
)
def test_huge_integers_and_other_types_are_refused_with_their_line(written, text):
    with pytest.raises(FileFormatError, match="line 2") as error:
        read_settings(written(f"b: 1\na: {text}"), ["a", "b"])
    assert len(str(error.value)) < 400


@pytest.mark.parametrize("value", [*TEXTS, *filter(None, NUMBERS), 1e-5, 1e22, 10, True, None])
def test_what_is_written_is_read_alike_by_both_versions(written, value):
    text = settings_text({"a": value})
    assert read_settings(written(text), ["a"]) == {"a": value}
    assert yaml.safe_load(text) == {"a": value}


@pytest.mark.parametrize(
    "seed",
    [*TEXTS[:6], "-1", "4294967296", "1.0", ".inf", "true", "[1]", "{}", "0x100000000", *HUGE],
    ids=lambda seed: seed[:12],
)
def test_other_seeds_are_refused_in_files(written, seed):
    with pytest.raises(FileFormatError) as error:
        Config.load(written(f"seed: {seed}"))
    assert len(str(error.value)) < 500


def test_other_seeds_are_refused_in_python():
    for seed in (-1, 2**32, 10**5000, 1.0, True, "7", float("inf")):
        with pytest.raises(InvalidInputError, match="seed"):
            Config(seed=seed)


@pytest.mark.parametrize(
    "seed", ["-1", "4294967296", "1e3", "1:59:59", "9" * 5000], ids=lambda seed: seed[:10]
)
def test_other_seeds_are_refused_on_the_command_line_before_the_recording_is_read(
    run, seed, tmp_path
):
    code, out, err = run("transfer", "missing.bvh", f"--seed={seed}", "-o", tmp_path / "out")
    assert (code, out) == (2, "")
    assert "--seed" in err
    assert "missing.bvh" not in err
    assert len(err) < 500


def test_the_largest_seed_is_used(written):
    assert Config.load(written(f"seed: {2**32 - 1}")).seed == 2**32 - 1
    assert OPTIONS["seed"].parse("4294967295") == 2**32 - 1


@pytest.mark.parametrize("name", [name for name, own in OPTIONS.items() if own.typed])
@pytest.mark.parametrize(
    "value", ["1:59:59", "off", ".nan", "[.inf, .nan]", "{a: b}", "[1, [2]]", "[null]", "[true, 1]"]
)
def test_no_value_of_any_option_ends_in_another_error(written, name, value):
    section = OPTIONS[name].section
    text = f"{section}:\n  {name}: {value}" if section else f"{name}: {value}"
    try:
        config = Config.load(written(text))
    except FileFormatError:
        return
    for check in (marker_roles, lambda own: own.spec, lambda own: own.rotation):
        try:
            check(config)
        except ManiportError:
            return


@pytest.mark.parametrize("value", ["1:30", "yes", "true", ".inf", "[1]", "'2'"])
def test_limits_and_boxes_need_numbers(written, value, panda):
    for text in (
        f"default: {{velocity: {value}}}",
        f"joints: {{panda_joint1: {{upper: {value}}}}}",
    ):
        with pytest.raises(FileFormatError):
            MotionLimits.of(panda, written(text))
    for text in (
        f"obstacles: {{a: {{center: [{value}, 0, 0], size: [1, 1, 1]}}}}",
        f"obstacles: {{a: {{center: [0, 0, 0], size: [1, 1, 1], yaw: {value}}}}}",
    ):
        with pytest.raises(FileFormatError):
            read_boxes(written(text))


def test_names_that_yaml_1_1_takes_for_other_types_name_joints_and_boxes(written):
    assert [
        box.name
        for box in read_boxes(written("obstacles: {on: {center: [0, 0, 0], size: [1, 1, 1]}}"))
    ] == ["on"]
    config = Config.load(written("human: {smooth: off}\nrobot: {lock: {y: 0.5}}"))
    assert (config.smooth, config.lock) == ("off", {"y": 0.5})


def test_markers_of_huge_numbers_or_no_roles_are_refused(tmp_path):
    file = tmp_path / "markers.json"
    file.write_text('{"elbow": ' + "1" * 5000 + "}")
    with pytest.raises(FileFormatError, match="markers"):
        marker_roles(Config(markers=str(file)))
    with pytest.raises(InvalidInputError, match="markers"):
        marker_roles(Config(markers=3))


def test_option_values_that_cannot_be_used_are_found_with_the_robot():
    for options in ({"home": ("x",) * 7}, {"lock": {"panda_joint1": "on"}}, {"collisions": "off"}):
        with pytest.raises(ManiportError):
            settings_of(Config(**options))


def test_truth_values_and_huge_integers_are_no_numbers():
    for check in (as_count, as_number):
        for value in (True, 10**5000):
            with pytest.raises(InvalidInputError, match="n must"):
                check(value, "n", maximum=5)
    for value in ([1, [2]], {}, "on", 10**5000):
        with pytest.raises(InvalidInputError, match="n must"):
            as_flag(value, "n")
