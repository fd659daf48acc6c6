"""Methods, readers of recordings and costs of installed packages, by their entry points."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from maniport.errors import InvalidInputError, unknown_name
from maniport.pipeline.options import OPTIONS

if TYPE_CHECKING:  # the command line loads this module at each start
    from maniport.arms import Arm, ArmGroup
    from maniport.motion import Cost

METHODS_GROUP = "maniport.methods"
READERS_GROUP = "maniport.readers"
COSTS_GROUP = "maniport.costs"
GROUPS = (METHODS_GROUP, READERS_GROUP, COSTS_GROUP)
"""Groups of entry points: a class of `DomainAdapter` by its name; the ending of a file and a reader as in
`maniport.mocap.READERS`; and a function that makes a cost for a robot."""

CostMaker = Callable[["Arm | ArmGroup"], "Cost"]
COSTS: dict[str, CostMaker] = {}
"""Costs by the names that ``--costs`` takes: functions of a robot, an `Arm` or an `ArmGroup`."""

_loaded: set[tuple[str, str, str]] = set()  # group, name and value of entry points


def load_extensions() -> tuple[str, ...]:
    """Register what installed packages add, once; return what is wrong with those that cannot be used."""
    faults = []
    for point in _entry_points():
        key = (point.group, point.name, point.value)
        if key in _loaded:
            continue
        _loaded.add(key)
        fault = _register(point)
        if fault:
            package = "" if point.dist is None else f" of the package {point.dist.name}"
            faults.append(f"{point.group}: {point.name!r}{package} is not used: {fault}")
    return tuple(faults)


def costs_of(costs: "Sequence[str | Cost]", robot: "Arm | ArmGroup") -> "tuple[Cost, ...]":
    """Return costs for a robot: those of names in `COSTS`, and others as they are."""
    from maniport.motion import Cost

    made: list[Cost] = []
    for cost in costs:
        if not isinstance(cost, str):
            made.append(cost)
            continue
        if cost not in COSTS:
            raise unknown_name(
                "cost", cost, COSTS, f"(installed ones have the group {COSTS_GROUP})"
            )
        term = COSTS[cost](robot)
        if not isinstance(term, Cost):
            raise InvalidInputError(
                f"costs: {cost!r} must make an object with the methods residual and jacobian; "
                f"found {type(term).__name__}"
            )
        made.append(term)
    return tuple(made)


def _entry_points() -> Iterable[EntryPoint]:
    """Return the entry points of all groups, in the order of their names."""
    installed = entry_points()
    found = []
    for group in GROUPS:
        found += sorted(installed.select(group=group), key=lambda point: (point.name, point.value))
    return found


def _register(point: EntryPoint) -> str:
    """Add what an entry point names to its registry; return the fault, empty if there is none."""
    try:
        value = point.load()
    except Exception as error:  # noqa: BLE001 - code of others may raise anything
        return f"{type(error).__name__}: {error}"
    if point.group == METHODS_GROUP:
        return _add_method(point.name, value)
    if point.group == READERS_GROUP:
        return _add_reader(point.name, value)
    if not callable(value):
        return f"a cost must be a function of a robot; found {type(value).__name__}"
    if point.name in COSTS:
        return "the name is taken"
    COSTS[point.name] = value
    return ""


def _add_method(name: str, method: object) -> str:
    from maniport.transfer import METHODS, DomainAdapter

    if not isinstance(method, type) or not issubclass(method, DomainAdapter):
        return f"a method must be a class of maniport.transfer.DomainAdapter; found {method!r}"
    option = OPTIONS["method"]
    if name in option.choices:
        return "the name is taken"
    METHODS[name] = method
    OPTIONS["method"] = replace(option, choices=(*option.choices, name))
    return ""


def _add_reader(ending: str, reader: object) -> str:
    from maniport.mocap import READERS

    if not ending.startswith(".") or ending != ending.lower():
        return "the name must be the ending of a file in lower case, such as '.pts'"
    if not callable(reader):
        return f"a reader must be a function of a path and options; found {type(reader).__name__}"
    if ending in READERS:
        return "files with this ending have a reader"
    READERS[ending] = reader
    return ""
