"""The page as a browser shows it: drawn, quiet, alone with its file, and useful by keyboard."""

import pytest

import quietbus as qb
from quietbus.report import write_report
from quietbus.validate import Check
from report.browser import open_browser
from report.runs import harmonic, synthetic

HOSTILE = "</code></pre><script>alert(1)</script><img src=x onerror=alert(2)>"
# for each plot: its name, how many traces it has and how many of them are drawn
DRAWN = """[...document.querySelectorAll(".plot")].map(plot => [
  plot.id,
  JSON.parse(document.querySelector(`script[data-plot="${plot.id}"]`).textContent).data.length,
  [...plot.querySelectorAll(".scatterlayer .trace, .barlayer .trace")].filter(trace =>
    [...trace.querySelectorAll("path")].some(path => (path.getAttribute("d") ?? "").length > 8)
  ).length,
])"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with open_browser(tmp_path_factory.mktemp("profile")) as page:
        yield page


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The page of a run of two seconds, with joint forces and checks."""
    file = tmp_path_factory.mktemp("page") / "run.html"
    run = qb.simulate("zhang2012", duration=2.0, joint_forces=True)
    write_report(run, file, [Check("energy", "sum", 1e-12, 1e-9)])
    return file, run


def drawn_and_quiet(browser, file):
    """What the browser shows is complete, and it asked for the file alone and said nothing."""
    browser.open(file)
    plots = browser.run(DRAWN)
    assert browser.complaints == []
    assert browser.requests
    assert all(url == file.as_uri() or url.startswith("data:") for url in browser.requests)
    for plot, wanted, drawn in plots:
        assert drawn == wanted > 0, plot
    return {plot for plot, _, _ in plots}


def test_the_page_of_a_true_run_is_drawn_without_network_or_complaint(browser, example):
    plots = drawn_and_quiet(browser, example[0])
    names = ("attitude", "control", "rates", "jitter", "turns", "spectrum", "gimbals", "struts")
    assert plots == {f"plot-{name}" for name in (*names, "joints")}
    assert (
        browser.run("document.getElementById('yaml').textContent") == example[1].attrs["scenario"]
    )
    assert "all 1 checks passed" in browser.run("document.querySelector('header').innerText")


@pytest.mark.parametrize(
    ("run", "count"),
    [
        (lambda: synthetic("rigid", count=20_001), 7),
        (lambda: synthetic(count=1), 5),
        (lambda: synthetic(count=2, status="interrupted", reason="interrupted by the user"), 5),
        (lambda: synthetic(rate=200.0, control="none"), 6),
        (harmonic, 7),
        (lambda: synthetic(legs=30, cmgs=16, count=2001), 8),
    ],
    ids=["rigid", "one-instant", "interrupted", "coarse", "harmonic", "many"],
)
def test_pages_of_all_kinds_are_drawn_without_network_or_complaint(browser, tmp_path, run, count):
    write_report(run(), tmp_path / "run.html")
    assert len(drawn_and_quiet(browser, tmp_path / "run.html")) == count


def test_a_hostile_name_is_text(browser, tmp_path):
    run = synthetic(name=HOSTILE, status="stopped", reason=HOSTILE)
    write_report(run, tmp_path / "run.html")
    drawn_and_quiet(browser, tmp_path / "run.html")
    assert browser.run("document.querySelector('h1').firstChild.textContent.trim()") == HOSTILE
    assert browser.run("document.getElementById('yaml').textContent") == run.attrs["scenario"]
    assert browser.run("document.querySelectorAll('img').length") == 0


def test_the_network_is_closed_to_the_page(browser, example):
    """Whatever a script in it might try."""
    browser.open(example[0])
    tried = browser.run("fetch('http://127.0.0.1:9/').then(() => 'gone', () => 'refused')")
    assert tried == "refused"
    assert any("Content Security Policy" in complaint for complaint in browser.complaints)


@pytest.mark.parametrize("width", [320, 600, 1600])
def test_the_page_fits_its_window(browser, example, width):
    browser.open(example[0], width=width)
    assert browser.run("document.documentElement.scrollWidth") <= width
    plots = browser.run(
        "[...document.querySelectorAll('.plot svg.main-svg')].map(svg => svg.clientWidth)"
    )
    assert all(0.5 * min(width, 1100) < plot <= width for plot in plots)


def test_keys_move_and_zoom_a_picture(browser, example):
    browser.open(example[0])
    browser.run("document.getElementById('plot-struts').focus()")

    def shown():
        browser.wait()
        return browser.run("document.getElementById('plot-struts').layout.xaxis2.range")

    whole = shown()
    browser.press("+")
    low, high = shown()
    assert high - low == pytest.approx(0.6 * (whole[1] - whole[0]))
    browser.press("ArrowRight")
    assert shown() == pytest.approx([low + 0.2 * (high - low), high + 0.2 * (high - low)])
    browser.press("ArrowLeft")
    browser.press("-")
    assert shown() == pytest.approx(whole)
    browser.press("+")
    browser.press("0")
    assert shown() == whole
    assert browser.complaints == []


def test_everything_to_act_on_is_reached_by_tab_and_has_a_name(browser, example):
    browser.open(example[0])
    named = browser.run(
        "[...document.querySelectorAll('a, button, summary, [tabindex=\"0\"]')].map("
        "e => (e.getAttribute('aria-label') ?? e.dataset.title ?? e.textContent).trim())"
    )
    assert len(named) > 25
    assert all(named)


def test_the_button_copies_the_scenario(browser, example):
    browser.open(example[0])
    allowed = ["clipboardReadWrite", "clipboardSanitizedWrite"]
    browser.call("Browser.grantPermissions", permissions=allowed)
    browser.run("document.getElementById('copy').click()")
    browser.wait()
    assert browser.run("document.getElementById('copied').textContent") == "copied"
    assert browser.run("navigator.clipboard.readText()") == example[1].attrs["scenario"]


def test_the_page_stays_legible_where_dark_is_preferred(browser, example):
    feature = {"name": "prefers-color-scheme", "value": "dark"}
    browser.call("Emulation.setEmulatedMedia", features=[feature])
    browser.open(example[0])
    colours = browser.run("(s => [s.color, s.backgroundColor])(getComputedStyle(document.body))")
    browser.call("Emulation.setEmulatedMedia", features=[])
    assert colours == ["rgb(29, 36, 43)", "rgb(255, 255, 255)"]


def test_on_paper_the_scenario_is_unfolded_and_the_pictures_fit(browser, example):
    browser.open(example[0], width=1600)
    browser.run("dispatchEvent(new Event('beforeprint'))")
    browser.call("Emulation.setEmulatedMedia", media="print")
    browser.wait()
    assert browser.run("document.querySelector('details').open") is True
    widths = browser.run("[...document.querySelectorAll('.plot')].map(p => p._fullLayout.width)")
    assert set(widths) == {670}
    browser.call("Emulation.setEmulatedMedia", media="")
    browser.run("dispatchEvent(new Event('afterprint'))")
    assert browser.run("document.querySelector('details').open") is False
