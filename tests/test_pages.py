"""Pages that are to be complete: commands, gallery, reference, and the way to each page."""

import re
import shlex
from pathlib import Path

import pytest
import typer

import quietbus as qb
from quietbus import cli

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = {page.relative_to(ROOT).as_posix(): page for page in sorted(DOCS.rglob("*.md"))}
TEXTS = {name: page.read_text(encoding="utf-8") for name, page in PAGES.items()}
README = (ROOT / "README.md").read_text(encoding="utf-8")
APP = typer.main.get_command(cli.app)
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"`([^`]+)`")


def _commands():
    """Command lines in code: within text, in a block of its own, in what a tutorial does."""
    for name, text in (TEXTS | {"README.md": README}).items():
        prose = FENCE.sub("", text)
        lines = [*CODE.findall(prose), *re.findall(r"^ {4}(\S.*)$", prose, re.MULTILINE)]
        blocks = [code for kind, code in FENCE.findall(text) if kind == "sh"]
        lines += [line for code in blocks for line in code.replace("\\\n", " ").splitlines()]
        for line in lines:
            words = shlex.split(line, comments=True) if line.startswith("quietbus ") else []
            if words[1:2] == ["--parts"]:  # before the command
                del words[1:3]
            if len(words) > 2 and words[1] != "COMMAND" and not set(words) & {"|", "--help"}:
                yield pytest.param(words[1:], id=f"{name}: {line}")


@pytest.mark.parametrize("words", list(_commands()))
def test_commands_in_the_documentation_have_arguments_and_options_that_exist(words):
    options = {option for each in APP.commands[words[0]].params for option in each.opts}
    assert {word for word in words if re.match(r"--?[a-z]", word)} <= options


def test_readme_leads_to_every_page():
    linked = set(re.findall(r"\]\((docs/[\w/-]+\.md)", README))
    assert linked == set(PAGES)


def test_reference_has_every_public_name():
    described = set(re.findall(r"^::: quietbus\.(\w+)$", TEXTS["docs/api.md"], re.MULTILINE))
    assert described == set(qb.__all__)


def test_names_of_the_package_in_the_documentation_are_public():
    for page, text in (TEXTS | {"README.md": README}).items():
        for name in re.findall(r"\bqb\.(\w+)", text):
            assert name in qb.__all__, f"{page}: qb.{name}"


def test_commands_page_answers_with_every_command():
    answers = re.findall(r"^\| [^|]* \| `quietbus (\w+)", TEXTS["docs/commands.md"], re.MULTILINE)
    assert set(answers) == set(APP.commands)


def test_gallery_shows_every_picture_once():
    pictures = sorted(file.relative_to(DOCS).as_posix() for file in DOCS.rglob("*.png"))
    assert sorted(re.findall(r"!\[.+?\]\((.+?)\)", TEXTS["docs/gallery.md"])) == pictures


def test_pictures_that_the_gallery_names_are_drawn_by_the_code():
    drawn = "".join(
        file.read_text(encoding="utf-8") for file in (ROOT / "src/quietbus").rglob("*.py")
    )
    text = TEXTS["docs/gallery.md"]
    for name in re.findall(r"`([\w-]+)\.png`", text.partition("## The paper's")[0]):
        prefix = name.partition("-")[0]  # waterfall-COMPONENT, cumulative-NAME
        assert f'"{name}"' in drawn or f'f"{prefix}-{{' in drawn, name
