"""Printed parts of a mean distance add up to what is printed as their sum."""

import re

import pytest

from maniport.telling import facts_of
from maniport.telling.answer import Answer, Card
from maniport.telling.page.elements import verdict

NUMBER = re.compile(r"-?\d+\.\d+")


def thousandths(text):
    """All numbers of a text, as integers."""
    return [round(1000 * float(number)) for number in NUMBER.findall(text)]


@pytest.mark.parametrize("parts", [(0.0024, 0.3334, 0.0444), (0.0005, 0.0005, 0.0005), (0.2, -0.0104, 0.1206)])
def test_parts_of_a_card_add_up(parts):
    """The page prints a mean that is the sum of the printed parts and the rounded sum of the exact ones."""
    card = Card("ellipsoids", "0.29", parts=tuple(zip("abc", parts, strict=True)))
    page = verdict(Answer("title", cards=(card,)))
    listed = re.search(r'<ul class="parts".*?>(.*?)</ul>', page).group(1)
    mean, *printed = thousandths(listed)
    assert mean == round(1000 * sum(parts)) == sum(printed)


def test_parts_of_the_mean_distance_add_up(small_result):
    """The facts of a run print three decimals that add up."""
    mean, *printed = thousandths(facts_of(small_result).fact("mean_distance").text)
    assert len(printed) == 3
    assert mean == sum(printed)
