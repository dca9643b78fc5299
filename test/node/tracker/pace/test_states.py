from markerless_tracker.node.tracker.pace.states import LEAST_S, StatePace


def test_each_set_has_its_state_while_none_is_newer() -> None:
    pace = StatePace()
    for now_s in (1.0, 1.001, 1.002):
        assert pace.due(now_s, now_s - 0.01, now_s - 0.01)
        pace.published(now_s)
    assert pace.due(1.003, 0.99, None)


def test_while_newer_sets_wait_states_are_apart() -> None:
    pace = StatePace()
    assert pace.due(1.0, 0.9, 0.95)
    pace.published(1.0)
    assert not pace.due(1.0 + 0.5 * LEAST_S, 0.95, 0.96)
    # Any state counts, also one that was not published after a set.
    assert pace.due(1.0 + 1.01 * LEAST_S, 0.95, 0.96)
    # The last set of a stream has its state.
    assert pace.due(1.0 + 0.5 * LEAST_S, 0.96, 0.96)
