"""A fit in pieces, computed at once."""

from collections.abc import Generator

from markerless_tracker.body import BodyModel, load_body
from markerless_tracker.fitness.shape.pieces import at_once


def test_all_pieces_are_computed_and_the_body_is_returned() -> None:
    body, computed = load_body("person31", 1.70), []

    def fitting() -> Generator[None, None, BodyModel]:
        for piece in range(3):
            computed.append(piece)
            yield
        return body

    assert at_once(fitting()) is body
    assert computed == [0, 1, 2]
