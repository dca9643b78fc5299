"""What tells configurations apart, in words for a column."""

from collections.abc import Sequence

from markerless_tracker.tracking import TrackerConfig

SHOWN = ("preset", "optimizer", "body", "refinement", "evaluations", "seed", "threads")
"""Settings with columns of their own, or overruled."""


def variants(configs: Sequence[TrackerConfig]) -> list[str]:
    """For each configuration the settings in which it leaves its preset: 'partition=hard'.

    What all of them share is left out.
    """
    changed = [_changes(config) for config in configs]
    common = set.intersection(*map(set, changed)) if len(changed) > 1 else set()
    return [", ".join(item for item in own if item not in common) for own in changed]


def _changes(config: TrackerConfig) -> list[str]:
    usual = TrackerConfig.from_mapping(
        {"preset": config.preset, "optimizer": config.optimizer}
    ).by_name()
    return [
        f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
        for name, value in config.by_name().items()
        if name not in SHOWN and value != usual[name]
    ]
