"""Middleware settings that prevent the loss of camera images between processes."""

import os
from collections.abc import MutableMapping
from pathlib import Path

from markerless_tracker.resources import config_dir

VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Environment variable that names the profile for rmw_fastrtps in Jazzy."""

USERS_OWN = (VARIABLE, "FASTDDS_DEFAULT_PROFILES_FILE")
"""Environment variables by which users name their own profile."""


def profile_file() -> Path:
    """The shipped Fast DDS profile for images."""
    return config_dir() / "fastdds" / "images.xml"


def apply_profile(environment: MutableMapping[str, str] | None = None) -> bool:
    """Make Fast DDS use the shipped profile unless the user chose another.

    Must run before ``rclpy.init``. Fast DDS' own default file in the working directory
    (``DEFAULT_FASTRTPS_PROFILES.xml``) counts as a choice.

    Args:
        environment: environment to change; None = that of this process.

    Returns:
        Whether the shipped profile is in use.
    """
    env = os.environ if environment is None else environment
    chosen = any(env.get(name) for name in USERS_OWN)
    if chosen or Path("DEFAULT_FASTRTPS_PROFILES.xml").is_file():
        return env.get(VARIABLE) == str(profile_file())
    env[VARIABLE] = str(profile_file())
    return True
