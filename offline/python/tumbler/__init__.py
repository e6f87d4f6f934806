"""Motions of robots with contact, found, looked at and played in simulation."""

import functools

from tumbler import _native
from tumbler._html import add_html
from tumbler._native import (
    Contacts,
    Derivatives,
    Evaluation,
    FileError,
    Joint,
    Kinematics,
    Model,
    Outcome,
    Primitive,
    Progress,
    RecordError,
    Refused,
    RobustnessMap,
    Run,
    Sequence,
    SpaceKinematics,
    SpaceModel,
    Spline,
    Task,
    __version__,
)
from tumbler._record import Record


def _function_of(native):
    """A function of this package, which other processes find by its name, in place of a compiled one."""

    @functools.wraps(native)
    def function(*arguments, **options):
        return native(*arguments, **options)

    function.__module__, function.__qualname__ = __name__, native.__name__
    return function


check = _function_of(_native.check)
optimise = _function_of(_native.optimise)
robustness = _function_of(_native.robustness)
simulate = _function_of(_native.simulate)

__all__ = [
    "Contacts",
    "Derivatives",
    "Evaluation",
    "FileError",
    "Joint",
    "Kinematics",
    "Model",
    "Outcome",
    "Primitive",
    "Progress",
    "Record",
    "RecordError",
    "Refused",
    "RobustnessMap",
    "Run",
    "Sequence",
    "SpaceKinematics",
    "SpaceModel",
    "Spline",
    "Task",
    "__version__",
    "check",
    "optimise",
    "robustness",
    "simulate",
]

for _class in (Joint, Model, Outcome, Primitive, Record, RobustnessMap, Run, Sequence, SpaceModel, Spline, Task):
    _class.__module__ = __name__  # Where they are found, also by what was pickled.
    add_html(_class)
del _class
