"""The page of a run as text: what it says, whole and escaped."""

import html
import importlib.metadata
import math
import re
import signal
import sys

import numpy as np
import pytest

import quietbus as qb
from quietbus import cli
from quietbus.report import report_page, write_report
from quietbus.report.harmonic import harmonic_pictures
from quietbus.results import summarize
from quietbus.validate import Check
from report.runs import harmonic, synthetic

HOSTILE = "</code></pre></title><script>alert(1)</script>{{ 7 * 7 }}&amp;"


def rows(page, heading):
    """Cells of the rows of the table with that caption."""
    table = re.search(rf"<caption>{re.escape(heading)}.*?</table>", page, re.DOTALL)[0]
    found = re.findall(r"<tr><th scope=\"row\">(.*?)</tr>", table)
    return [[html.unescape(cell) for cell in re.split(r"<[^>]+>+", row)] for row in found]


def cells(page, heading):
    """First cell: the other cells, blanks left out."""
    return {row[0]: [cell for cell in row[1:] if cell] for row in rows(page, heading)}


def scenario_shown(page):
    return html.unescape(re.search(r'<code id="yaml">(.*?)</code>', page, re.DOTALL)[1])


@pytest.mark.parametrize("name", ["plain", HOSTILE])
def test_scenario_is_the_run_s_to_the_letter(name):
    run = synthetic(count=100, name=name)
    page = report_page(run)
    assert scenario_shown(page) == run.attrs["scenario"]
    assert qb.Scenario.from_yaml(scenario_shown(page)).name == name


def test_nothing_of_a_run_becomes_markup():
    run = synthetic(count=100, name=HOSTILE, status=HOSTILE, reason=HOSTILE)
    for name in ("solver", "created", "quietbus_version"):
        run.attrs[name] = HOSTILE
    run.attrs[HOSTILE] = HOSTILE
    page = report_page(run)
    assert "alert(1)" in page
    assert "<script>alert" not in page
    assert "{{ 7 * 7 }}" in page
    assert page.partition("<script>/**")[0].count("</title>") == 1
    shown = harmonic()
    shown["bus_rate_jitter_rms"].attrs["long_name"] = HOSTILE
    assert "<script>alert" not in report_page(shown)


def test_a_run_of_an_unknown_method_is_refused_by_name():
    run = synthetic(count=100)
    run.attrs["method"] = "\x1b[2Jmagic"
    with pytest.raises(
        ValueError, match=r"run: expected the method direct or harmonic, got '"
    ) as no:
        report_page(run)
    assert "\x1b" not in str(no.value)


def test_numbers_are_those_of_the_summary():
    run = synthetic()
    summary = summarize(run)
    shown = cells(report_page(run), "Residual motion from t = ")
    assert len(shown) == 15
    for i, axis in enumerate("xyz"):
        assert shown[f"rate jitter {axis}, peak"] == [
            "deg/s",
            f"{math.degrees(summary.residual_rate[i]):.4g}",
        ]
    assert shown["largest strut stroke"] == ["mm", f"{1e3 * summary.peak_stroke:.4g}"]


def test_status_mount_and_method_come_first():
    head = report_page(synthetic(count=2001)).partition("<main>")[0]
    for words in (">complete</span>", "<dd>isolated</dd>", "<dd>direct</dd>", "2 s", "1000 Hz"):
        assert words in head
    assert "not complete" not in head
    assert "<dt>CMGs</dt>" in head


def test_frequencies_of_lines_are_those_of_the_speeds_at_the_end():
    run = harmonic()
    speed = np.outer(np.linspace(1.0, 2.0, run.sizes["time"]), [100.0, 200.0, -300.0, 400.0])
    run["rotor_speed"] = (("time", "cmg"), speed)
    run["rotor_angle"] = (("time", "cmg"), 0.0 * speed)
    bars = next(p for p in harmonic_pictures(run) if p.name == "lines").content.data[:4]
    for bar, last in zip(bars, np.abs(speed[-1]) / (2 * np.pi), strict=True):
        assert np.array(bar.customdata) == pytest.approx(last * np.array([1, 2]))


@pytest.mark.parametrize("status", ["interrupted", "stopped"])
def test_a_run_cut_short_says_so_and_why(status):
    reason = "interrupted by the user at t = 2 s" if status == "interrupted" else "leg 3 is short"
    page = report_page(synthetic(count=2001, status=status, reason=reason))
    assert f'<span class="badge ">{status}</span>' in page
    assert f"It reached 2 s of 100 s: {reason}." in page


def test_provenance_is_that_of_the_run_and_of_the_page():
    page = report_page(synthetic(count=100))
    run = cells(page, "The run, as its file says")
    assert run["solver"] == ["by hand"]
    assert run["relative tolerance"] == ["1e-07"]
    assert run["quietbus"] == ["0.0.1"]
    assert run["wall time, compilation included [s]"] == ["12.35"]
    assert run["created (UTC)"] == ["2012-03-04T05:06:07+00:00"]
    here = cells(page, "What made this page")
    for name in ("quietbus", "jax", "diffrax", "numpy"):
        assert here[name] == [importlib.metadata.version(name)]
    assert here["python"] == [sys.version.split()[0]]


def test_without_checks_the_page_says_how_to_get_them():
    page = report_page(synthetic(count=100))
    text = re.sub(r"<[^>]+>", "", page.partition('<section id="validation">')[2])
    assert "Not checked; run quietbus report --validate" in text


def test_checks_are_shown_with_value_bound_and_verdict():
    checks = [
        Check("energy", "sum over <b>all</b>", 3e-12, 1e-9),
        Check("momentum", "sum", math.nan, 1e-9),
    ]
    page = report_page(synthetic(count=100), checks)
    shown = cells(page, "zhang2012, isolated: quietbus against MuJoCo")
    assert shown == {
        "energy: sum over <b>all</b>": ["3.0e-12", "1e-09", "pass"],
        "momentum: sum": ["nan", "1e-09", "FAIL"],
    }
    assert "1 of 2 checks failed" in page.partition("<main>")[0]
    assert "all 1 checks passed" in report_page(synthetic(count=100), checks[:1])


@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_a_long_run_s_page_stays_small_and_says_what_is_left_out(rate):
    page = report_page(synthetic(count=int(100 * rate) + 1, rate=rate))
    assert len(page.encode()) < 10e6
    assert f"of the run's {int(100 * rate) + 1} instants, each line is drawn by" in page
    assert "are reduced" not in report_page(synthetic(count=1000))


def test_an_output_too_coarse_is_told_but_not_of_a_harmonic_run():
    assert "Jitter is not shown:" in report_page(synthetic(rate=200.0))
    assert "Jitter is not shown:" not in report_page(harmonic())
    assert "Jitter is not shown:" not in report_page(synthetic(count=100))


def test_a_run_of_one_instant_has_a_page_without_a_table():
    page = report_page(synthetic(count=1))
    assert "One instant only" in page
    assert "1 instant<" in page


def test_plotly_is_embedded_once_and_nothing_is_linked():
    page = report_page(synthetic(count=100))
    assert page.count("plotly.js v") == 1
    own = page.partition("<script>/**")[0] + page.rpartition('"use strict";')[2]
    assert not re.findall(r"(?:src|href)=\"(?!#)|https?://|@import|url\(", own)


def test_a_page_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    (tmp_path / "run.html").write_text("<!DOCTYPE html> old")
    write_report(synthetic(count=10), tmp_path / "run.html")
    assert [path.name for path in tmp_path.iterdir()] == ["run.html"]
    assert "CMGs" in (tmp_path / "run.html").read_text(encoding="utf-8")
    with pytest.raises(OSError, match="folder"):
        write_report(synthetic(count=10), tmp_path / "folder" / "run.html")


@pytest.fixture
def command(monkeypatch, tmp_path, capsys):
    """Run a command in an empty folder; gives exit status, standard output and error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # pytest's own Ctrl-C stays

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["quietbus", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capsys.readouterr()
        return ended.value.code or 0, out, err

    return call


def test_report_s_table_is_that_of_simulate(command, tmp_path):
    status, printed, _ = command("simulate", "zhang2012", "--duration", "1.2", "-o", "run.nc")
    assert status == 0
    status, out, _ = command("report", "run.nc")
    assert (status, out) == (0, "wrote run.html\n")
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    shown = cells(page, "Residual motion from t = 0.45 s to 0.95 s")
    lines = [re.split(r"\s{2,}", line.strip()) for line in printed.splitlines()]
    assert shown == {line[0]: line[1:] for line in lines if len(line) == 3}
    assert len(shown) == 19


def test_report_with_failed_checks_is_written_and_ends_with_status_1(
    command, tmp_path, monkeypatch
):
    qb.save_run(synthetic(count=100), tmp_path / "run.nc")
    good, bad = Check("energy", "sum", 1e-12, 1e-9), Check("momentum", "sum", 1e-3, 1e-9)
    monkeypatch.setattr("quietbus.validate.validate", lambda *_, **__: [good, bad])
    status, out, err = command("report", "run.nc", "--validate", "-o", "page.html")
    assert (status, out) == (1, "wrote page.html\n")
    assert "1 of 2 checks failed: momentum" in err
    assert "1.0e-03" in (tmp_path / "page.html").read_text(encoding="utf-8")
    monkeypatch.setattr("quietbus.validate.validate", lambda *_, **__: [good])
    assert command("report", "run.nc", "--validate", "-o", "page.html")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.nc"], "nothing.nc: no such file"),
        (["."], ".: is a folder"),
        (["text.nc"], "text.nc: not a NetCDF-4 file"),
        (["other.nc"], "other.nc: a NetCDF file, but not a run of quietbus"),
        (["broken.nc"], "the run's scenario"),
        (["run.nc", "-o", "no/page.html"], "no: no such folder"),
        (["run.nc", "-o", "."], ".: is a folder"),
        (["run.nc", "-o", "/proc/page.html"], "/proc/page.html: cannot be written"),
        (["run.nc", "-o", "run.nc"], "run.nc: is the run itself"),
    ],
)
def test_bad_input_ends_with_status_2_and_one_message(command, tmp_path, arguments, message):
    run = synthetic(count=10)
    qb.save_run(run, tmp_path / "run.nc")
    qb.save_run(run.drop_vars("leg_force"), tmp_path / "other.nc")
    run.attrs["scenario"] = "name: []"
    qb.save_run(run, tmp_path / "broken.nc")
    (tmp_path / "text.nc").write_text("no run")
    before = (tmp_path / "run.nc").read_bytes()
    status, out, err = command("report", *arguments)
    assert (status, out) == (2, "")
    assert message in err
    assert "Traceback" not in err
    assert (tmp_path / "run.nc").read_bytes() == before
    assert not list(tmp_path.glob("*.html"))


@pytest.mark.parametrize("missing", ["plotly", "jinja2"])
def test_a_missing_extra_is_named(command, tmp_path, monkeypatch, missing):
    qb.save_run(synthetic(count=10), tmp_path / "run.nc")
    for name in list(sys.modules):
        if name.startswith("quietbus.report") or name.partition(".")[0] == missing:
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    status, _, err = command("report", "run.nc")
    assert status == 1
    assert "quietbus report needs the extra: pip install 'quietbus[report]'" in err


def test_values_that_are_no_numbers_are_gaps():
    run = synthetic(count=3000)
    run["bus_rate"][1500:1510] = np.nan
    run["leg_force"][10] = np.inf
    page = report_page(run)
    assert "No jitter to show: the bus rate has values that are not finite." in page
    assert "Infinity" not in page.partition("<script>/**")[0]
