"""The tutorials: what they tell the reader to do works, and what they show is what comes out.

A page is followed block by block in an empty folder. The kinds of blocks:

- ``sh``: commands, run one by one. ``# exit status 2`` after a command says that it is to fail so.
- ``py``: run in one interpreter for the whole page (``python`` blocks, elsewhere in the
  documentation, stand alone).
- ``text``: output of the block before, errors and notes first. Its lines come in this order;
  others may come in between, and ``...`` stands for anything. A number with a point or an exponent
  may differ by one in its last digit.
- ``diff``: lines to be changed in the file that its head names.
"""

import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from oracles.pages import assert_shown
from quietbus import cli

FOLDER = Path(__file__).parents[1] / "docs" / "tutorials"
PAGES = sorted(FOLDER.glob("*.md"))
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


class Reader:
    """Does what a page says."""

    def __init__(self, monkeypatch, capsys):
        self.monkeypatch, self.capsys = monkeypatch, capsys
        self.names, self.output = {"__name__": "__tutorial__"}, ""

    def sh(self, text):
        self.output = "".join(self._run(line) for line in text.replace("\\\n", " ").splitlines())

    def _run(self, line):
        expected = re.search(r"# exit status (\d)$", line)
        words = shlex.split(line, comments=True)
        if words[0] == "quietbus" and not set(words) & {"|", ">", "&&", ";"}:
            status, output = self._quietbus(words)
        else:
            path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
            environment = os.environ | {"PATH": path}
            done = subprocess.run(
                line, shell=True, env=environment, capture_output=True, text=True, check=False
            )
            status, output = done.returncode, done.stderr + done.stdout
        assert status == (int(expected[1]) if expected else 0), f"{line}\n{output}"
        return output

    def _quietbus(self, words):
        """In this process: loading JAX once is enough."""
        self.monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as ended:
            cli.main()
        captured = self.capsys.readouterr()
        return ended.value.code or 0, captured.err + captured.out

    def py(self, code):
        exec(compile(code, "<tutorial>", "exec"), self.names)
        self.output = self.capsys.readouterr().out

    def text(self, shown):
        assert_shown(shown, self.output)

    def diff(self, text):
        old_name, new_name, *changes = text.splitlines()
        file = Path(old_name.removeprefix("--- "))
        assert new_name == f"+++ {file}"
        old = "".join(f"{line[1:]}\n" for line in changes if line.startswith("-"))
        new = "".join(f"{line[1:]}\n" for line in changes if line.startswith("+"))
        content = file.read_text(encoding="utf-8")
        assert content.count(old) == 1, f"{file} has not once\n{old}"
        file.write_text(content.replace(old, new), encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_tutorial_works_as_written(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # pytest's own Ctrl-C stays
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    reader = Reader(monkeypatch, capsys)
    text = page.read_text(encoding="utf-8")
    blocks = list(BLOCK.finditer(text))
    assert len(blocks) == len(re.findall(r"^```\S", text, re.MULTILINE)), "a fence was not read"
    for block in blocks:
        kind, content = block.groups()
        try:
            getattr(reader, kind)(content)
        except AssertionError as error:
            line = text[: block.start()].count("\n") + 1
            raise AssertionError(f"{page.name}, line {line}: {error}") from None


def test_tutorials_are_numbered_as_their_files():
    numbers = [re.match(r"# (\d+) ", page.read_text(encoding="utf-8"))[1] for page in PAGES]
    assert numbers == [page.stem.partition("-")[0] for page in PAGES]
    assert sorted(map(int, numbers)) == list(range(1, len(PAGES) + 1))


@pytest.mark.parametrize("name", sorted(typer.main.get_command(cli.app).commands))
def test_every_command_has_a_tutorial(name):
    commands = [
        line
        for page in PAGES
        for kind, text in BLOCK.findall(page.read_text(encoding="utf-8"))
        for line in text.splitlines()
        if kind == "sh"
    ]
    assert any(line.split()[:2] == ["quietbus", name] for line in commands), (
        f"no tutorial runs `quietbus {name}`: write docs/tutorials/N-{name}.md"
    )


@pytest.mark.parametrize(
    ("shown", "output", "same"),
    [
        ("K  2500\nend", "start\nK 2500\nmore\nend", True),
        ("end\nK 2500", "K 2500\nend", False),
        ("K 2500", "K 2501", False),
        ("0.4606 deg", "0.4607 deg", True),
        ("0.4606 deg", "0.4608 deg", False),
        ("4.281e+04", "4.282e+04", True),
        ("4.281e+04", "4.283e+04", False),
        ("-73.15, 11.24", "-73.15, 11.24", True),
        ("-73.15", "73.15", False),
        ("error ... pass", "error 1.1e-12 1e-09 pass", True),
        ("error ... pass", "error 1.1e-12 1e-09 FAIL", False),
        ("rigid", "rigid mount", False),
    ],
)
def test_shown_output_is_compared_line_by_line_to_the_last_digit(shown, output, same):
    if same:
        assert_shown(shown, output)
    else:
        with pytest.raises(AssertionError, match="not in the output"):
            assert_shown(shown, output)
