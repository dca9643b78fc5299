"""The page in a real browser: no error, no request; phone and desktop, light and dark, paper."""

import shutil
from pathlib import Path

import pytest

from markerless_tracker.datasets import read_trc
from markerless_tracker.results.read import read_result
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.page.charts import Level
from markerless_tracker.viewing.page.embedded import embedded_film
from markerless_tracker.viewing.page.page import write_page
from markerless_tracker.viewing.page.report import make_report

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
LUMINANCE = """
() => {
  const [r, g, b] = getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number);
  return (r + g + b) / 765;
}
"""
WIDEST = "() => [document.documentElement.scrollWidth, window.innerWidth]"
SMALLEST = """
() => Math.min(...[...document.querySelectorAll('span, td, p')].map(
  e => parseFloat(getComputedStyle(e).fontSize)))
"""
CUT_OFF = """
() => [...document.querySelectorAll('.words')].filter(
  e => e.clientWidth > 0 && e.scrollWidth > e.clientWidth).length
"""
PLAYABLE = """
async () => {
  const film = document.querySelector('video');
  for (let i = 0; i < 600 && film.readyState < 2 && !film.error; i++)
    await new Promise(done => setTimeout(done, 100));
  return [film.readyState >= 2, film.videoWidth, film.error && film.error.message];
}
"""


@pytest.fixture(scope="module")
def browser():
    """Debian's chromium, driven by Playwright."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright: pip install playwright")
    if CHROMIUM is None:
        pytest.skip("no chromium: apt-get install chromium")
    with api.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def page_file(make_result, walk: Path, tmp_path: Path) -> Path:
    """A page of two results, one of them with a film."""
    pytest.importorskip("av", reason="PyAV is not installed: pip install av")
    truth = read_trc(walk / "ground_truth.trc")
    first, second = (read_result(make_result(name, source=walk)) for name in ("one", "two"))
    film = embedded_film(first, ResultImages(first))
    reports = [
        make_report("one", first, reference=truth, film=film),
        make_report("two", second, reference=truth, why_no_film="no images"),
    ]
    levels = [Level("what somebody else printed somewhere: 38 mm", 38.0)]
    write_page(tmp_path / "page.html", reports, levels=levels)
    return tmp_path / "page.html"


def test_phone_and_desktop_light_and_dark_and_paper(browser, page_file: Path) -> None:
    background = {}
    for width, scheme in ((390, "dark"), (1280, "light")):
        context = browser.new_context(
            viewport={"width": width, "height": 800}, color_scheme=scheme, offline=True
        )
        context.set_default_timeout(120_000)
        shown = context.new_page()
        said: list[str] = []
        asked: list[str] = []
        shown.on("console", lambda message, said=said: said.append(message.text))
        shown.on("pageerror", lambda error, said=said: said.append(str(error)))
        shown.on("request", lambda request, asked=asked: asked.append(request.url))
        shown.goto(page_file.as_uri())
        assert shown.evaluate(PLAYABLE) == [True, 392, None]
        widest, window = shown.evaluate(WIDEST)
        assert widest <= window == width, "nothing sticks out at the side"
        assert shown.evaluate(SMALLEST) >= 12.0
        assert shown.locator(".words").count() >= 4 and shown.evaluate(CUT_OFF) == 0
        # Beside the lines there is room on a desktop only.
        assert shown.locator(".lt").first.is_visible() == (width > 640)
        assert shown.locator(".levels").first.is_visible() == (width <= 640)
        background[scheme] = shown.evaluate(LUMINANCE)
        assert not said
        assert all(url.startswith(("file:", "data:")) for url in asked)
        if scheme == "light":
            shown.emulate_media(media="print")
            assert not shown.locator("video").first.is_visible()
            assert shown.locator("img.still").first.is_visible()
            assert shown.pdf()[:4] == b"%PDF"
        context.close()
    assert background["light"] > 0.9 and background["dark"] < 0.2
