"""The algorithms by name, and their replacement."""

import pytest

from markerless_tracker.optim import ALGORITHMS, Pso, is_replaced


def test_a_replaced_algorithm_is_known_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not any(is_replaced(name) for name in ALGORITHMS)

    class Own(Pso):
        """Another algorithm."""

    monkeypatch.setitem(ALGORITHMS, "pso", Own)
    assert is_replaced("pso") and not is_replaced("sppso")
