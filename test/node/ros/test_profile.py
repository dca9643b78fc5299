import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from markerless_tracker.node.ros.profile import USERS_OWN, VARIABLE, apply_profile, profile_file

LARGEST_IMAGE = 1920 * 1080 * 3
SMALL_SHARED_MEMORY = 64 * 2**20


def test_the_shipped_profile_is_applied_unless_the_user_chose_one(run_folder: Path) -> None:
    environment: dict[str, str] = {}
    assert apply_profile(environment)
    assert environment == {VARIABLE: str(profile_file())}
    assert apply_profile(environment)


@pytest.mark.parametrize("name", USERS_OWN)
def test_a_users_own_profile_stays(name: str, run_folder: Path) -> None:
    environment = {name: "/mine.xml"}
    assert not apply_profile(environment)
    assert environment == {name: "/mine.xml"}


def test_a_profile_in_the_working_directory_stays(run_folder: Path) -> None:
    (run_folder / "DEFAULT_FASTRTPS_PROFILES.xml").write_text("<dds/>")
    environment: dict[str, str] = {}
    assert not apply_profile(environment) and not environment


def test_the_profile_holds_large_images_and_fits_a_containers_shared_memory() -> None:
    root = ElementTree.parse(profile_file()).getroot()
    names = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"
    segment = int(root.findtext(f".//{names}segment_size", "0"))
    message = int(root.findtext(f".//{names}maxMessageSize", "0"))
    assert LARGEST_IMAGE < message <= segment
    # Player, tracker and a viewer take one segment each.
    assert 3 * segment < SMALL_SHARED_MEMORY
