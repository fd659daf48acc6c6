"""How long work tells how far it is."""

import pytest

from maniport.steps import ALMOST, Step, counted, pieces


def test_a_step_begins_goes_on_and_ends_once():
    """It is told with 0 at once, stays below 1 until its end, and ends with what was found."""
    told = []
    step = Step(lambda *call: told.append(call), "walk")
    step(0.5)
    step(1.0)
    step.end("3 km")
    assert told == [("walk", 0.0), ("walk", 0.5), ("walk", ALMOST), ("walk", 1.0, "3 km")]


def test_nobody_need_listen():
    """Without anybody to tell, a step may be gone through all the same."""
    step = Step(None, "walk")
    step(0.5)
    step.end("3 km")


def test_pieces_follow_one_another_and_make_the_whole():
    """Each piece ends where the next begins, in proportion to its effort; those without effort take nothing."""
    told = []
    for tell in pieces(told.append, 1.0, 0.0, 3.0):
        tell(0.0)
        tell(1.0)
    assert told == pytest.approx([0.0, 0.25, 0.25, 0.25, 0.25, 1.0])


def test_counted_items_are_told_when_they_are_done():
    """An item counts once the next is asked for, and the last one makes the whole."""
    told = []
    for i, item in enumerate(counted("abcd", 4, told.append)):
        assert item == "abcd"[i]
        assert len(told) == i
    assert told == [0.25, 0.5, 0.75, 1.0]
