"""Charts as SVG, read back as XML."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from markerless_tracker.viewing.page.charts import (
    MOST_POINTS,
    Curve,
    Level,
    Mark,
    line_chart,
    thinned,
    ticks,
)

X = np.linspace(0.0, 3.0, 31)


def figure(*args, **options) -> ElementTree.Element:
    return ElementTree.fromstring(line_chart(*args, **options))


def paths(element: ElementTree.Element, style: str) -> list[str]:
    return [path.get("d", "") for path in element.iter("path") if path.get("class") == style]


def points(d: str) -> np.ndarray:
    """(n, 2) the points of a path, fractions of the plot's width and height from its top left."""
    return np.array([p.split() for p in d.replace("M", "L").split("L")[1:]], float) / 1000.0


def test_a_curve_lies_where_its_values_are() -> None:
    chart = figure("Knee", "degrees", [Curve("left", "left", X, 10.0 * X)], levels=[Level("a", 15)])
    (line,) = paths(chart, "line left")
    found = points(line)
    np.testing.assert_allclose(found[:, 0], X / 3.0, atol=1e-3)
    np.testing.assert_allclose(found[:, 1], 1.0 - X / 3.0, atol=1e-3)
    assert paths(chart, "level") == ["M0 500.0H1000"]
    texts = {span.get("class"): [] for span in chart.iter("span")}
    for span in chart.iter("span"):
        texts[span.get("class")].append(span.text)
    assert texts["yt"] == ["0", "5", "10", "15", "20", "25", "30"] and texts["lt"] == ["a"]
    assert texts["xt"][0] == "0.0" and texts["xt"][-1] == "3.0"


def test_levels_are_listed_for_narrow_screens() -> None:
    levels = [Level("low: 5 mm", 5.0), Level("high: 9 mm", 9.0)]
    chart = figure("Error", "mm", [Curve("", "s0", X, X)], levels=levels)
    items = [item.find("span").tail for item in chart.find("ul").iter("li")]
    assert chart.find("ul").get("class") == "legend levels"
    assert items == ["high: 9 mm", "low: 5 mm"], "from top to bottom, as the lines"
    assert figure("Error", "mm", [Curve("", "s0", X, X)]).find("ul") is None


def test_gaps_interrupt_the_curve_and_marks_stand() -> None:
    y = np.where((X > 1.0) & (X < 2.0), np.nan, X)
    marks = [Mark("right", 1.5), Mark("right", 9.0)]
    chart = figure("a", "m", [Curve("", "s0", X, y)], marks=marks)
    (line,) = paths(chart, "line s0")
    assert line.count("M") == 2 and len(points(line)) == np.isfinite(y).sum()
    assert paths(chart, "mark right") == ["M500.0 0V1000"], "marks beyond the curve are left out"


def test_marks_of_a_style_are_one_path_and_too_many_are_not_drawn() -> None:
    marks = [Mark(side, x) for x in X for side in ("left", "right")]
    chart = figure("a", "m", [Curve("", "s0", X, X)], marks=marks)
    (left,) = paths(chart, "mark left")
    assert left.startswith("M0.0 0V1000M33.3 0V1000") and left.count("M") == X.size
    assert len(paths(chart, "mark right")) == 1
    crowd = [Mark("left", 1.5)] * (MOST_POINTS + 1)
    assert not paths(figure("a", "m", [Curve("", "s0", X, X)], marks=crowd), "mark left")


def test_texts_are_escaped_and_empty_charts_say_so() -> None:
    chart = figure("<b>&", "m", [Curve("a<b", "s0", X, X)])
    assert chart.find("figcaption").text.startswith("<b>&")
    assert chart.find("./div/svg").get("aria-label").startswith("<b>&. a<b: 0.0 to 3.0 m")
    nothing = figure("a", "m", [Curve("", "s0", X, np.full(31, np.nan))])
    assert nothing.find("p").text == "no values"


def test_a_constant_curve_has_a_scale() -> None:
    chart = figure("a", "m", [Curve("", "s0", X[:1], np.array([7.0]))])
    assert np.isfinite(points(paths(chart, "line s0")[0])).all()


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.0, 3.0, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]),
        (-12.0, 47.0, [-20, -10, 0, 10, 20, 30, 40, 50]),
        (0.81, 0.96, [0.80, 0.85, 0.90, 0.95, 1.0]),
    ],
)
def test_round_ticks(low: float, high: float, expected: list[float]) -> None:
    np.testing.assert_allclose(ticks(low, high), expected, atol=1e-12)


def test_long_curves_keep_their_extremes() -> None:
    x = np.arange(400_000.0)
    y = np.sin(x / 9000.0)
    y[123_456], y[200_000:210_000] = 5.0, np.nan
    short_x, short_y = thinned(x, y)
    assert short_x.size <= 2 * MOST_POINTS and (np.diff(short_x) > 0).all()
    assert np.nanmax(short_y) == 5.0 and np.isnan(short_y).any()
    assert thinned(X, X)[0] is X


def test_long_curves_keep_their_gaps() -> None:
    x = np.concatenate([np.arange(5000.0), 7000.0 + np.arange(5001.0)])
    y = np.where(np.arange(x.size) == 5000, np.nan, 1.0)
    (line,) = paths(figure("a", "m", [Curve("", "s0", x, y)]), "line s0")
    assert line.count("M") == 2
