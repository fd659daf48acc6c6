"""Options that several verbs share, written once: each group becomes one argument of the verb."""

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

from maniport.errors import InvalidInputError

Verb = Callable[..., None]


def group(parameter: str, options: Verb, make: Callable[..., Any], **defaults: Any) -> Callable[[Verb], Verb]:
    """Give verbs the options of a group.

    Parameters
    ----------
    parameter : str
        Of the verb: it gets what the options were set to.
    options : callable
        Its parameters are the options.
    make : callable
        Makes the verb's argument from their values, by name.
    **defaults
        Of some of the options, where these verbs have others.
    """
    own_defaults = {name: {"default": value} for name, value in defaults.items()}
    written = inspect.signature(options, eval_str=True).parameters
    shared = {name: one.replace(**own_defaults.get(name, {})) for name, one in written.items()}

    def decorate(verb: Verb) -> Verb:
        own = inspect.signature(verb, eval_str=True).parameters.values()

        @wraps(verb)
        def with_options(**given: Any) -> None:
            made = make(**{name: given.pop(name) for name in shared})
            verb(**given, **{parameter: made})

        every = [*(one for one in own if one.name != parameter), *shared.values()]
        every.sort(key=lambda one: one.default is not inspect.Parameter.empty)
        with_options.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
        with_options.__annotations__ = {one.name: one.annotation for one in every}
        return with_options

    return decorate


def require_none(options: Mapping[str, Any], what: str, why: str) -> None:
    """Raise when one of some options was given; the message says what it does, and why not here."""
    for name, value in options.items():
        if value is not None:
            raise InvalidInputError(f"--{name} {what}; {why}")
