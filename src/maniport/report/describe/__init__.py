"""Descriptions of results, robots, recordings and other objects of maniport as a `Report`."""

from dataclasses import replace

from maniport.report.values import Report


def report_of(thing: object) -> Report:
    """Return the `Report` of a result, an arm, a recording, an adapter or another object of maniport.

    Parameters
    ----------
    thing : any object
        Of an unknown object only the prompt is reported.

    Returns
    -------
    Report
    """
    from maniport.report.describe.registry import describe  # slow to load

    described = describe(thing)
    if isinstance(described, Report):
        return described
    section = replace(described, title="", folded=False)
    return Report(described.title, "", (section,))
