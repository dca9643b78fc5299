"""Differences between configurations, as text for a column."""

from collections.abc import Sequence

from markerless_tracker.tracking import TrackerConfig

SHOWN = ("preset", "optimizer", "body", "refinement", "evaluations", "seed", "threads")
"""Settings that have columns of their own or are replaced by the table."""


def variants(configs: Sequence[TrackerConfig]) -> list[str]:
    """For each configuration the settings that differ from its preset: 'partition=hard'.

    Differences common to all configurations are left out.
    """
    changed = [_changes(config) for config in configs]
    common = set.intersection(*map(set, changed)) if len(changed) > 1 else set()
    return [", ".join(item for item in own if item not in common) for own in changed]


def _changes(config: TrackerConfig) -> list[str]:
    preset = TrackerConfig.from_mapping(
        {"preset": config.preset, "optimizer": config.optimizer}
    ).by_name()
    return [
        f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
        for name, value in config.by_name().items()
        if name not in SHOWN and value != preset[name]
    ]
