"""Motions of robots with contact, found, looked at and played in simulation."""

from tumbler._native import (
    Evaluation,
    FileError,
    Joint,
    Primitive,
    Refused,
    Sequence,
    Spline,
    check,
)

__all__ = [
    "Evaluation",
    "FileError",
    "Joint",
    "Primitive",
    "Refused",
    "Sequence",
    "Spline",
    "check",
]
