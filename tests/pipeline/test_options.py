"""Options by topic: each class checks its own, a transfer has them all, and one table describes them."""

from dataclasses import fields

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, UnknownNameError
from maniport.mocap import read_recording
from maniport.pipeline.config import Config
from maniport.pipeline.options import (
    OPTIONS,
    HumanOptions,
    MapOptions,
    MotionOptions,
    RobotOptions,
    TransferOptions,
)
from maniport.pipeline.settings import fit_options, marker_roles, read_part

TOPICS = (HumanOptions, RobotOptions, MapOptions, MotionOptions)


def names(kind):
    return [item.name for item in fields(kind)]


def test_each_option_of_a_class_is_in_the_table_and_the_reverse():
    assert sorted([*OPTIONS, "verb"]) == sorted(names(Config))


def test_each_option_of_a_transfer_belongs_to_one_topic():
    of_topics = [name for kind in TOPICS for name in names(kind)]
    assert sorted([*of_topics, "seed"]) == sorted(names(TransferOptions))


@pytest.mark.parametrize(
    ("kind", "section"),
    list(zip(TOPICS, ("human", "robot", "transfer", "motion"), strict=True)),
)
def test_options_of_a_topic_are_one_section_of_files(kind, section):
    assert {OPTIONS[name].section for name in names(kind)} == {section}


@pytest.mark.parametrize("name", [name for name in OPTIONS if name != "costs"])
def test_defaults_pass_their_own_checks_and_none_is_the_default(name):
    default = getattr(Config, name)
    assert getattr(Config(), name) == default
    assert getattr(Config(**{name: None}), name) == default


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        (HumanOptions, {"unit": "ft"}),
        (HumanOptions, {"height": 3.0}),
        (RobotOptions, {"payload": -1.0}),
        (MapOptions, {"damping": -1.0}),
        (MapOptions, {"ellipsoids": "heat"}),
        (MotionOptions, {"rate": 3.0}),
        (MotionOptions, {"table": 0.0, "collisions": False}),
        (MotionOptions, {"export": ["ros2"], "move": False}),
        (MotionOptions, {"orientation": (0.0, 0.0, 0.0)}),
    ],
)
def test_a_topic_checks_its_own_options_as_the_whole_does(kind, options):
    for made in (kind, TransferOptions, Config):
        with pytest.raises(InvalidInputError):
            made(**options)


def test_an_option_of_another_topic_cannot_be_changed():
    with pytest.raises(UnknownNameError, match="scale"):
        HumanOptions().changed(scale=1.0)
    assert MotionOptions().changed(scale=0.5).scale == 0.5


def test_a_configuration_of_options_has_their_values():
    options = TransferOptions(robot="ur5", scale=0.8, seed=3, base_rotation=np.eye(3))
    config = Config.of(options)
    assert (config.robot, config.scale, config.seed) == (("ur5",), 0.8, 3)
    assert config.rank == Config().rank
    assert Config.of(config) is config
    assert Config.of(None) == Config()


def test_functions_take_the_options_that_they_need():
    options = HumanOptions(start=1.0, stop=1.5, side="right", markers={"elbow": ["E"]})
    assert marker_roles(options) == {"elbow": ["E"]}
    assert fit_options(options)["side"] == "right"
    part = read_part(read_recording("freeform"), options)
    assert part.time[-1] - part.time[0] <= 0.5


def test_a_transfer_takes_options_as_an_object_or_by_name():
    part = {"start": 2.0, "stop": 2.3, "method": "identity", "move": False}
    small = {**part, "n_teacher": 32, "n_student": 32}
    result = mp.transfer_recording("freeform", TransferOptions(**small))
    again = mp.transfer_recording("freeform", **small)
    assert result.config == again.config
    np.testing.assert_array_equal(result.arms[0].target_profile, again.arms[0].target_profile)
