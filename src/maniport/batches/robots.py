"""Which robots are meant: each once, with a name of its own, and all that it shall do."""

import inspect
import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from maniport.batches.content import as_setting, digest
from maniport.batches.pair import Robot
from maniport.bodies import Arm, load_arm
from maniport.defaults import AUTO, BATCH_EFFORT, BATCH_RATE, KEEP, PERSON
from maniport.errors import InvalidInputError
from maniport.pipeline.job import checked
from maniport.pipeline.work import Job
from maniport.steps import untold
from maniport.transfer import DomainAdapter
from maniport.version import __version__

WHOSE: dict[str, Any] = {
    "person": PERSON, "markers": None, "side": AUTO, "height": None, "smooth": AUTO, "leaps": KEEP,
}  # fmt: skip
"""What `maniport.fit_arm` is told of all persons."""

ASKED = {one.name for one in inspect.signature(checked).parameters.values() if one.kind is one.KEYWORD_ONLY}
"""Of the settings those that are not about the person, nor how the motion is planned."""

BATCH_CONTROL: dict[str, Any] = {"effort": BATCH_EFFORT, "rate": BATCH_RATE}
"""How motions are planned where nothing else is said."""

Asked = Arm | str | Path | tuple[Arm, Mapping[str, Any]]


def robots_of(
    asked: Sequence[Asked], method: str | DomainAdapter, settings: Mapping[str, Any], taken: Collection[str]
) -> list[Robot]:
    """The robots, each once, with names of their own, none of those taken, and all that they shall do, checked."""
    if isinstance(asked, str | Path | Arm) or not len(asked):
        raise InvalidInputError("robots must be a sequence of at least one robot")
    whose = {name: settings.get(name, value) for name, value in WHOSE.items()}
    same = {name: value for name, value in settings.items() if name in ASKED}
    control = BATCH_CONTROL | {
        name: value for name, value in settings.items() if name not in ASKED and name not in WHOSE
    }
    found, names = dict[str, Robot](), {one.casefold() for one in taken}
    for one in asked:
        robot, own = one if isinstance(one, tuple) else (one, {})
        arm = robot if isinstance(robot, Arm) else load_arm(robot)
        job = checked(whose, arm, method, {**control, **own}, **same)
        key = digest(__version__, replace(job, tell=untold))
        if key not in found:  # one that is given twice is one
            found[key] = Robot(_as_folder(arm.name, names), job, key, _settings(job))
    return list(found.values())


def _settings(job: Job) -> dict[str, str]:
    """Return all settings of a robot's pairs by their names as arguments, as text."""
    found: dict[str, Any] = {"maniport": __version__}
    for name in (one.name for one in fields(job) if one.name not in ("tell", "once_adapted")):
        value = getattr(job, name)
        if name == "sizes":
            found |= dict(zip(("n_teacher", "n_student"), value, strict=True))
        elif isinstance(value, DomainAdapter):
            found |= {"method": type(value).__name__, **value.get_params(deep=False)}
        elif isinstance(value, Mapping):  # of the person, the motion, or a method that is to be chosen
            found |= value
        elif name == "spec" and is_dataclass(value):
            found |= {one.name: getattr(value, one.name) for one in fields(value)}
        else:
            found[{"seed": "random_state"}.get(name, name)] = value
    return {name: as_setting(value) for name, value in found.items()}


def _as_folder(name: str, taken: set[str]) -> str:
    """A robot's name where no sign of it divides a path, and a number after it where it is taken; it is taken then."""
    whole = "".join("-" if letter in '/\\:*?"<>|' or not letter.isprintable() else letter for letter in name)
    first = whole.strip(". ") or "robot"
    names = itertools.chain([first], (f"{first}-{k}" for k in itertools.count(2)))
    chosen = next(one for one in names if one.casefold() not in taken)
    taken.add(chosen.casefold())
    return chosen
