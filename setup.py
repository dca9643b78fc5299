"""Build recipe, for colcon (ament_python) and for plain pip alike."""

import re
from pathlib import Path

from setuptools import find_packages, setup

NAME = "markerless_tracker"
HERE = Path(__file__).resolve().parent


def version() -> str:
    """The version that the package states, read without importing it."""
    text = (HERE / NAME / "__init__.py").read_text(encoding="utf-8")
    match = re.search(r'^__version__ = "([^"]+)"$', text, re.MULTILINE)
    if match is None:
        raise SystemExit(f"{NAME}/__init__.py states no __version__")
    return match[1]


def shared_files(folder: str) -> list[tuple[str, list[str]]]:
    """(target folder, files) of everything below a folder, for share/NAME."""
    found: dict[str, list[str]] = {}
    for path in sorted((HERE / folder).rglob("*")):
        if path.is_file() and not path.name.startswith("."):
            relative = path.relative_to(HERE)
            found.setdefault(f"share/{NAME}/{relative.parent.as_posix()}", []).append(
                relative.as_posix()
            )
    return sorted(found.items())


EXTRAS = {
    "cluster": ["distributed>=2024.1"],
    "formats": ["cdflib>=1", "ezc3d>=1.5"],
    "plots": ["matplotlib>=3.8"],
    "view": ["av>=14", "rerun-sdk>=0.24"],
}

setup(
    name=NAME,
    version=version(),
    description="Full-body pose tracking from several calibrated cameras, with particle swarms.",
    license="Apache-2.0",
    author="markerless_tracker maintainers",
    maintainer="markerless_tracker maintainers",
    maintainer_email="maintainers@markerless-tracker.example",
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        *shared_files("config"),
        *shared_files("launch"),
    ],
    install_requires=[
        "PyYAML>=6",
        "mcap>=1.5",
        "numba>=0.58",
        "numpy>=1.26",
        "opencv-python-headless>=4.6",
        "rich>=13",
        "rosbags>=0.10",
        "scipy>=1.11",
    ],
    extras_require={
        **EXTRAS,
        "all": sorted(sum(EXTRAS.values(), [])),
        "ros": ["ros-jazzy-common-interfaces", "ros-jazzy-rclpy[fastrtps]"],
        "test": [
            "hypothesis",
            "mcap-ros2-support>=0.5",
            "mypy",
            'opensim>=4.5; python_version < "3.14"',
            "pandas>=2",
            "pytest>=7",
            "pytest-xdist",
            "ruff",
            "scipy-stubs",
            "types-PyYAML",
            "yourdfpy",
        ],
    },
    entry_points={
        "console_scripts": [
            f"markerless_tracker = {NAME}.cli.main:main",
            f"player = {NAME}.node.player.executable:main",
            f"segmenter = {NAME}.node.segmenter.executable:main",
            f"tracker = {NAME}.node.tracker.executable:main",
        ],
    },
    zip_safe=False,
)
