"""Reading of the YAML files of bodies, subjects and poses."""

import re
import sys
from pathlib import Path
from typing import Any

import yaml

from markerless_tracker.errors import BodyModelError


class _Loader(yaml.SafeLoader):
    """Takes 9e-1 for a number, as YAML 1.2 does, and YAML 1.1 does not."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$"),
    list("-+0123456789"),
)  # fmt: skip


def read_yaml(path: Path, what: str) -> Any:
    """Content of a YAML file.

    Args:
        path: the file.
        what: kind of the file, for the message.

    Raises:
        BodyModelError: the file cannot be read or is no YAML.
    """
    try:
        return yaml.load(path.read_text(encoding="utf-8-sig"), _Loader)
    except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
        first = str(error).splitlines()[0]
        raise BodyModelError(f"{path}: cannot read the {what}: {first}") from error


def is_number(value: Any) -> bool:
    """Whether a value of a file is a finite number; YAML's integers may be too large for a float.

    The comparison takes integers of any size, which numpy and `math.isfinite` do not.
    """
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and abs(value) <= sys.float_info.max
