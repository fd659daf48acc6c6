"""Base of what is fitted: scikit-learn's protocol of estimators, without loading scikit-learn.

`sklearn.base` imports `scipy.stats`, which takes 0.4 s of each fresh process, half as long as a first fit. What is
here is what scikit-learn requires of other estimators: parameters are the arguments of the constructor,
stored as they are, and what was learned ends in an underscore.
"""

import copy
import inspect
from typing import Any, Self, TypeVar

from maniport.errors import InvalidInputError

E = TypeVar("E")


class Estimator:
    """What has parameters, and is fitted; works in scikit-learn's `clone`, `Pipeline` and `GridSearchCV`."""

    @classmethod
    def _parameters(cls) -> dict[str, Any]:
        """Names of the parameters, sorted, and their defaults."""
        parameters = inspect.signature(cls).parameters
        return {name: parameters[name].default for name in sorted(parameters)}

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the parameters by name; scikit-learn passes `deep`."""
        return {name: getattr(self, name) for name in self._parameters()}

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters by name; they are checked when it is fitted."""
        own = self._parameters()
        for name, value in parameters.items():
            if name not in own:
                raise InvalidInputError(
                    f"{type(self).__name__} has no parameter {name!r}; it has {', '.join(own) or 'none'}"
                )
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        values = (
            (name, repr(getattr(self, name)), repr(default))
            for name, default in self._parameters().items()
        )
        changed = (
            f"{name}={' '.join(value.split())}"
            for name, value, default in values
            if value != default
        )
        return f"{type(self).__name__}({', '.join(changed)})"

    def __sklearn_tags__(self) -> Any:
        """Return the tags of scikit-learn of an estimator that needs no labels."""
        from sklearn.utils import Tags, TargetTags, TransformerTags

        transforms = TransformerTags() if hasattr(self, "transform") else None
        return Tags(
            estimator_type=None, target_tags=TargetTags(required=False), transformer_tags=transforms
        )


def clone(estimator: E) -> E:
    """Return another estimator with the same parameters that has learned nothing, as `sklearn.base.clone` does."""
    parameters = estimator.get_params()  # type: ignore[attr-defined]
    return type(estimator)(**copy.deepcopy(parameters))
