"""Flight records."""

import os
import types

import numpy as np

from tumbler import _native


def _read_only(columns):
    for column in columns.values():
        column.setflags(write=False)
    return columns


def _same_columns(first, second):
    """Bit for bit: what is not a number equals itself."""
    return list(first) == list(second) and all(
        a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
        for a, b in zip(dict.values(first), dict.values(second))
    )


class Record(dict):
    """A flight record: every tick of a run, as columns with units in their names.

    It is a read-only dictionary of read-only arrays, which pandas.DataFrame(record) takes. The columns are those of the
    CSV that tumbler record writes. Records are equal when all numbers of their columns and truth are.
    """

    def __init__(self, columns, truth, about):
        super().__init__(_read_only(columns))
        self._truth = _read_only(truth)
        self._about = types.MappingProxyType(about)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> "Record":
        """Reads a whole record. Throws RecordError."""
        return _native._load_record(path)

    @property
    def name(self):
        """The file's."""
        return self._about["name"]

    @property
    def joints(self):
        """Their names, with which their columns begin."""
        return self._about["joints"]

    @property
    def period_s(self):
        """Of the control loop."""
        return self._about["period_s"]

    @property
    def remarks(self):
        """How the record ends, and what is lost or damaged."""
        return list(self._about["remarks"])

    @property
    def complete(self):
        """Whether it ended in order, and nothing is lost or damaged."""
        return self._about["complete"]

    @property
    def summary(self):
        """Several lines for people."""
        return self._about["summary"]

    @property
    def columns(self):
        """All columns by name, in a dictionary of the caller's own."""
        return dict(self)

    @property
    def truth(self):
        """True states of a simulated robot, by the names of the messages truth_t and space_truth_t;
        else empty."""
        return dict(self._truth)

    def __eq__(self, other):
        if not isinstance(other, Record):
            return NotImplemented
        return _same_columns(self, other) and _same_columns(self._truth, other._truth)

    def __ne__(self, other):
        equal = self.__eq__(other)
        return equal if equal is NotImplemented else not equal

    __hash__ = None

    def __reduce__(self):
        return type(self), (dict(self), self._truth, dict(self._about))

    def __copy__(self):
        return type(self)(dict(self), self._truth, dict(self._about))

    def copy(self):
        """Another record with the same columns."""
        return self.__copy__()

    def __repr__(self):
        return f"<tumbler.Record {self.name}>"

    def _refuse(self, *_, **__):
        raise TypeError("a record is read-only; its columns can be copied: dict(record)")

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refuse
