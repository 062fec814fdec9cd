"""The rule by which published numbers are judged."""

import pytest

from quietbus.reproduce.claims import RULES, Claim
from quietbus.reproduce.pages import counts


def claim(printed="0.036", **more):
    return Claim(
        "ours", "eq. 1", "a coefficient", printed, "", "since {ours:.3g}", "derived", **more
    )


@pytest.mark.parametrize(
    ("printed", "ours", "verdict"),
    [
        ("0.036", 0.03623, "within rounding"),
        ("0.036", 0.0366, "not reproduced"),
        ("70.3", 70.4, "reproduced"),
        ("70.3", 71.5, "not reproduced"),
        ("3.4e-4", 3.44e-4, "within rounding"),
        ("3.4e-4", 3.46e-4, "not reproduced"),
        ("9130", 9122.0, "reproduced"),
        ("9130", 9130.4, "within rounding"),
        ("0", 0.4, "within rounding"),
        ("-60", -59.8, "within rounding"),
        ("20", -20.0, "not reproduced"),
    ],
)
def test_verdict_follows_the_printed_digits(printed, ours, verdict):
    assert claim(printed).row({"ours": ours})["verdict"] == verdict


@pytest.mark.parametrize(
    ("ours", "verdict"), [(8.9, "order of magnitude"), (9.1, "not reproduced")]
)
def test_order_of_magnitude_is_a_factor_of_three_and_only_for_assumed_parameters(ours, verdict):
    assert claim("3", assumed=True).row({"ours": ours})["verdict"] == verdict
    assert claim("3", assumed=True).row({"ours": 9.0 / ours})["verdict"] == verdict
    assert claim("3").row({"ours": ours})["verdict"] == "not reproduced"


def test_an_error_of_the_paper_needs_its_own_finding():
    shown = claim(error="refused")
    assert shown.row({"ours": 0.036, "refused": 1.0})["verdict"] == "paper in error"
    assert shown.row({"ours": 0.036, "refused": 0.0})["verdict"] == "within rounding"
    with pytest.raises(KeyError):
        shown.row({"ours": 0.036})


def test_a_row_tells_difference_and_reason_or_that_nothing_was_computed():
    row = claim("2").row({"ours": 3.0})
    assert row["relative_difference"] == pytest.approx(0.5)
    assert row["why"] == "since 3"
    assert claim("0").row({"ours": 3.0})["relative_difference"] is None
    empty = claim().row({})
    assert (empty["ours"], empty["verdict"]) == (None, "not computed")
    assert {"reproduced", "not computed", row["verdict"]} <= set(RULES)


def test_an_equation_is_judged_by_what_it_gives_not_by_a_printed_number():
    of = claim("", given="theirs", error="broken")
    row = of.row({"ours": 1e-17, "theirs": 0.021, "broken": 1.0})
    assert (row["published"], row["ours"]) == (0.021, 1e-17)
    assert row["printed"] == "0.021"
    assert row["verdict"] == "paper in error"
    same = of.row({"ours": 0.021, "theirs": 0.021, "broken": 0.0})
    assert same["verdict"] == "within rounding"
    assert of.row({"ours": 1.0})["verdict"] == "not computed"


def test_inputs_and_repeated_numbers_are_counted_apart():
    claims = (
        Claim("mass", "eq. 1", "mass", "82.8", "kg", "", "input"),
        Claim("a", "eq. 1", "a", "1", "", "", "derived"),
        Claim("b", "eq. 1", "b", "2", "", "", "derived", "a"),
        Claim("c", "eq. 1", "c", "5", "", "", "simulated"),
    )
    rows = [each.row({"mass": 82.8, "a": 1.0, "b": 2.0, "c": 7.0}) for each in claims]
    text = counts(rows)
    assert "4 rows. 1 of them" in text
    assert "| input | 1 | 0 | 1 |" in text
    assert "| derived | 1 | 0 | 1 |" in text
    assert "| simulated | 0 | 1 | 1 |" in text
