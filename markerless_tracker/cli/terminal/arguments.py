"""Argument types common to several verbs."""

import argparse
import math
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def list_of(kind: Callable[[str], T]) -> Callable[[str], tuple[T, ...]]:
    """Parser of a comma-separated list; repeated values count once."""

    def parse(text: str) -> tuple[T, ...]:
        words = [word.strip() for word in text.split(",")]
        if not all(words):
            raise argparse.ArgumentTypeError(f"{text!r} expected values with commas between them")
        return tuple(dict.fromkeys(kind(word) for word in words))

    return parse


def count(text: str) -> int:
    """A whole number from 1."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text!r}, expected a whole number from 1")
    return value


def positive(text: str) -> float:
    """A finite number above 0."""
    value = not_negative(text)
    if value == 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}, expected a number above 0")
    return value


def not_negative(text: str) -> float:
    """A finite number from 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0.0):
        raise argparse.ArgumentTypeError(f"{text!r}, expected a number from 0")
    return value
