"""Finding config/ in a source tree, a pip prefix, a colcon prefix, an overlay."""

import sys
from pathlib import Path

import pytest

from markerless_tracker import resources
from markerless_tracker.errors import ConfigError


def install(prefix: Path, *, package: str) -> Path:
    """Lay out a prefix with config/ in share/; returns the module's path in there."""
    module = prefix / package / "markerless_tracker" / "resources.py"
    module.parent.mkdir(parents=True)
    module.touch()
    share = prefix / "share" / "markerless_tracker" / "config"
    share.mkdir(parents=True)
    (share / "thing.yaml").write_text("a: 1\n")
    return module


def test_source_tree(project_root: Path) -> None:
    assert resources.config_dir() == project_root / "config"


@pytest.mark.parametrize(
    "package", ["lib/python3.12/site-packages", "local/lib/python3.12/dist-packages", ""]
)
def test_prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    module = install(tmp_path / "prefix", package=package)
    monkeypatch.setattr(resources, "__file__", str(module))
    assert resources.config_dir() == tmp_path / "prefix/share/markerless_tracker/config"


def test_the_package_s_own_prefix_goes_before_an_overlay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = install(tmp_path / "own", package="lib/python3.12/site-packages")
    install(tmp_path / "other", package="lib/python3.12/site-packages")
    monkeypatch.setattr(resources, "__file__", str(module))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "other"))
    assert resources.config_dir() == tmp_path / "own/share/markerless_tracker/config"


def test_overlay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path / "overlay", package="lib/python3.12/site-packages")
    elsewhere = tmp_path / "a/b/c/d/e/f/markerless_tracker/resources.py"
    elsewhere.parent.mkdir(parents=True)
    elsewhere.touch()
    monkeypatch.setattr(resources, "__file__", str(elsewhere))
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "none"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'none'}:{tmp_path / 'overlay'}")
    assert resources.config_dir() == tmp_path / "overlay/share/markerless_tracker/config"


def test_nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resources, "_candidates", lambda module: iter([tmp_path / "none"]))
    with pytest.raises(ConfigError, match="config/ of markerless_tracker is not installed"):
        resources.config_dir()


def test_a_missing_file_names_those_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "start.yaml").touch()
    monkeypatch.setattr(resources, "config_dir", lambda: tmp_path)
    assert resources.config_file("demo/start.yaml") == tmp_path / "demo" / "start.yaml"
    with pytest.raises(ConfigError, match=r"'demo/strat.yaml'.*start\.yaml"):
        resources.config_file("demo/strat.yaml")
