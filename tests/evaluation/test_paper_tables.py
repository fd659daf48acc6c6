"""The numbers that the paper prints, against a second copy in its own layout."""

import pytest

from maniport.errors import InvalidInputError
from maniport.studies.paper.tables import IDENTITY, RANDOM, TRAJECTORIES, TRANSPORT, paper_table

TABLES = {
    "I": """
        12 most singular of 100 & 28 & 0.095
        100 & 22 & 0.042
    """,
    "II": """
        400 & PT only & 0.874 & 0.783 & 0.782
        200 & ICP & 1.058 & 0.827 & 0.829
        100 & ICP + w & 0.913 & 0.725 & 0.726
        100 & ICP + w² & 0.933 & 0.733 & 0.733
        100 & ICP + w³ & 0.710 & 0.606 & 0.605
        100 & PT + ICP + w³ & 0.362 & 0.410 & 0.419
        50 & ICP only + w³ & 0.714 & 0.618 & 0.606
        50 & PT + ICP + w³ & 0.703 & 0.594 & 0.912
        25 & ICP only + w³ & 0.548 & 0.547 & 0.453
        25 & PT + ICP + w³ & 0.440 & 0.497 & 0.408
        500 & PT only & 0.875 & 0.774 & 0.790
        100 & ICP only + w³ & 0.864 & 0.715 & 0.708
        100 & PT + ICP + w³ & 0.864 & 0.736 & 0.726
        50 & ICP only + w³ & 0.648 & 0.550 & 0.547
        50 & PT + ICP + w³ & 0.649 & 0.540 & 0.538
        25 & ICP only + w³ & 0.677 & 0.545 & 0.554
        25 & PT + ICP + w³ & 0.586 & 0.492 & 0.496
    """,
    "III": """
        400 & PT + ICP & 0.539 & 0.834 & 0.340 & 0.297
        100 & ICP & 0.548 & 0.854 & 0.346 & 0.300
        100 & PT + ICP & 0.549 & 0.848 & 0.348 & 0.300
        25 & ICP & 0.578 & 0.884 & 0.376 & 0.297
        25 & PT + ICP & 0.576 & 0.888 & 0.375 & 0.290
        100 & PT + ICP & 0.602 & 0.827 & 0.340 & 0.377
        100 & ICP & 0.437 & 0.699 & 0.317 & 0.363
        25 & PT + ICP & 0.501 & 0.698 & 0.344 & 0.370
        25 & ICP & 0.619 & 0.818 & 0.339 & 0.382
    """,
}


def printed(number):
    """Lines of a table of the paper, as lists of cells."""
    return [[cell.strip() for cell in line.split("&")] for line in TABLES[number].strip().splitlines()]


@pytest.mark.parametrize("number", ["II", "III"])
def test_every_printed_number_is_there(number):
    """Samples, method and all errors of each row agree with the paper."""
    rows = paper_table(number)
    assert [[row.label, row.method, *map("{:.3f}".format, row.rmse.values())] for row in rows] == printed(number)
    assert [row.row for row in rows] == list(range(1, len(rows) + 1))


def test_toy_table_has_iterations():
    """Table I prints iterations beside the error."""
    assert [[r.label, str(r.iterations), *map(str, r.rmse.values())] for r in paper_table("I")] == printed("I")


def test_methods_become_settings():
    """Start and weights of a row are what its method's name says."""
    meant = {(row.method, row.start, row.exponent) for row in paper_table("II")}
    assert meant == {
        ("PT only", TRANSPORT, None),
        ("ICP", IDENTITY, 0.0),
        ("ICP + w", IDENTITY, 1.0),
        ("ICP + w²", IDENTITY, 2.0),
        ("ICP + w³", IDENTITY, 3.0),
        ("ICP only + w³", IDENTITY, 3.0),
        ("PT + ICP + w³", TRANSPORT, 3.0),
    }
    assert {(row.method, row.start, row.exponent) for row in paper_table("III")} == {
        ("ICP", IDENTITY, 3.0),
        ("PT + ICP", TRANSPORT, 3.0),
    }


def test_halves_are_trajectories_and_random_data():
    """The upper halves of Tables II and III are fitted to trajectories, the lower ones to random samples."""
    for number, upper in (("II", 10), ("III", 5)):
        data = [row.data for row in paper_table(number)]
        assert data == [TRAJECTORIES] * upper + [RANDOM] * (len(data) - upper)


def test_there_are_three_tables():
    """An unknown table is refused, with the names of those there are."""
    with pytest.raises(InvalidInputError, match=r"unknown table 'IV'; there are.*'I', 'II', 'III'"):
        paper_table("IV")
