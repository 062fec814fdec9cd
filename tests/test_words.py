"""Names from outside in messages, tables, pictures and the names of files: they mean themselves."""

import io

import pytest
from rich.console import Console
from rich.table import Table

from quietbus.cli import session
from quietbus.plots.style import literal, new_figure, save_figures, style
from quietbus.words import file_name, shown, visible, visible_lines

ODD = [r"$\frac{1$", "$x$ and $", r"\$", "[/red]", "[bold]b", ":smile:", "<b>&amp;", "a/../b", "_x"]


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("a\x1b[31mb", r"a\x1b[31mb"),
        ("a\u202eb\u2066", r"a\u202eb\u2066"),
        ("a\nb\r", r"a\nb\r"),
        ("\x9b\x00\ud800", r"\x9b\x00\ud800"),
        ("卫星 é µ", "卫星 é µ"),
    ],
)
def test_letters_without_a_glyph_are_seen(text, seen):
    assert visible(text) == seen


def test_line_ends_of_our_own_stay():
    assert visible_lines("a\nb\x1b") == "a\nb\\x1b"


def test_a_value_is_shown_without_being_looked_through():
    nested = ["x"]
    for _ in range(100):
        nested = [nested] * 10
    assert shown(nested) in ("a list of 10", shown(nested)[:60])
    assert len(shown("y" * 10**7)) == 60
    assert shown(10**5000) == "a whole number of some 5,000 digits"
    assert shown(object()) == "an object of type object"


@pytest.mark.parametrize("name", ODD)
def test_names_in_pictures_are_drawn_as_they_are(name, tmp_path):
    with style():
        figure = new_figure(2.0, f"Title ({name})")
        axes = figure.subplots()
        axes.set_title(literal(name))
        (saved,) = save_figures({f"of-{name}": figure}, tmp_path, ".svg")
    assert saved.parent == tmp_path
    assert saved.stat().st_size > 0


def test_pictures_whose_names_become_alike_stay_apart(tmp_path):
    with style():
        figures = {name: new_figure(1.0, "x") for name in ("a b", "a/b", "a-b")}
    names = [path.name for path in save_figures(figures, tmp_path)]
    assert names == ["a-b.png", "a-b~2.png", "a-b~3.png"]
    assert file_name("../../x y") == "..-..-x-y"


@pytest.mark.parametrize("name", ODD)
def test_names_in_tables_are_printed_as_they_are(name, monkeypatch, capsys):
    table = Table(title=name)
    table.add_column(name)
    table.add_row(name)
    session.print_table(table)
    assert capsys.readouterr().out.count(name) == 3


def test_a_console_that_reads_markup_would_fail():
    """The test above can fail: rich itself takes a name in brackets for markup."""
    table = Table(title="[bold]b")
    console = Console(file=io.StringIO())
    console.print(table)
    assert "[bold]" not in console.file.getvalue()
