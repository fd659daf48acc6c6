"""The functions that describe objects; the type of the first argument says which."""

from collections.abc import Callable
from functools import singledispatch

from maniport.report.describe.motions import motion_report
from maniport.report.describe.placements import placement_section
from maniport.report.describe.recordings import (
    fit_report,
    learned_report,
    person_section,
    recording_report,
)
from maniport.report.describe.results import result_report
from maniport.report.describe.robots import arm_report
from maniport.report.describe.transfers import adapter_section, evaluation_report
from maniport.report.values import Report, Section

DESCRIPTIONS: tuple[Callable[..., Report | Section], ...] = (
    arm_report,
    placement_section,
    motion_report,
    recording_report,
    fit_report,
    person_section,
    learned_report,
    adapter_section,
    evaluation_report,
    result_report,
)


@singledispatch
def describe(thing: object) -> Report | Section:
    """Describe an object; of an unknown one, its prompt."""
    return Report(type(thing).__name__, repr(thing))


for description in DESCRIPTIONS:
    describe.register(description)
