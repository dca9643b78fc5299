"""What tells configurations apart."""

from markerless_tracker.benchmarks.tables.variants import variants
from markerless_tracker.tracking import TrackerConfig


def config(**values):
    return TrackerConfig.from_mapping(values)


def test_what_leaves_the_preset_is_told() -> None:
    a = config(preset="paper", optimizer="hmcpso", **{"hmcpso.sub_swarms": 4})
    b = config(preset="paper", optimizer="hmcpso", evaluations=7200, body="person34", seed=3)
    c = config(preset="paper", optimizer="apf", cost="overlap", **{"apf.layer_shrink": 0.25})
    assert variants([a, b, c]) == ["hmcpso.sub_swarms=4", "", "cost=overlap, apf.layer_shrink=0.25"]


def test_what_all_share_is_left_out() -> None:
    a, b = (config(collision="none", partition=kind) for kind in ("soft", "hard"))
    assert variants([a, b]) == ["", "partition=hard"]
    assert variants([b]) == ["partition=hard, collision=none"] or variants([b]) == [
        "collision=none, partition=hard"
    ]
    assert variants([]) == []
