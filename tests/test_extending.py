"""Parts of a user's own: docs/extending.md, done as it says."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from oracles.pages import assert_shown

PAGE = Path(__file__).parents[1] / "docs" / "extending.md"
BLOCK = re.compile(r'^```(\w+)(?: title="([\w.]+)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The page's files, and a scenario with its lines."""
    folder = tmp_path_factory.mktemp("extending")
    files: dict[str, str] = {}
    for _, name, code in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        if name:
            files[name] = files.get(name, "") + code
    for name, code in files.items():
        (folder / name).write_text(code, encoding="utf-8")
    _run(folder, "-c", _WRITE)
    return folder


_WRITE = f"""
import quietbus as qb, own_parts
from ruamel.yaml import YAML
data = qb.load_scenario("zhang2012").to_dict()
page = YAML(typ="safe").load(open({str(PAGE)!r}).read().split("```yaml\\n")[1].split("```")[0])
legs = data["isolator"]["legs"]
del legs["stiffness"], legs["damping"]
legs["strut"] = page["isolator"]["legs"]["strut"]
data["actuators"] = page["actuators"]
open("my.yaml", "w").write(qb.Scenario.from_dict(data).to_yaml())
"""


def _run(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert not done.returncode, done.stderr
    return done.stdout


def test_python_example_gives_what_is_shown(folder):
    shown = PAGE.read_text(encoding="utf-8").split("```text\n")[1].split("```")[0]
    output = _run(folder, "check.py")
    assert_shown(shown.replace("apart by\n", ""), output)
    assert float(output.split("apart by")[1]) < 1e-9


def test_command_of_the_page_runs_with_both_parts(folder):
    command = re.search(r"^quietbus (--parts .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    arguments = [part.strip('"') for part in re.findall(r'"[^"]*"|\S+', command[1])]
    output = _run(folder, "-m", "quietbus", *arguments)
    assert "6 of type d_strut" in output
    assert "rods (torque_rods)" in output
    without = subprocess.run(
        [sys.executable, "-m", "quietbus", *arguments[2:]],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert without.returncode == 2
    assert "isolator.legs.strut.type (line" in without.stderr
    assert "actuators.rods.type" in without.stderr


def test_a_run_is_not_continued_with_another_law(folder):
    """The scenario is the same to the letter; the file of its strut is not."""
    law = folder / "law.py"
    law.write_text((folder / "own_parts.py").read_text())
    ask = ("-c", _ASK.format(law="law.py"))
    assert _run(folder, *ask, "first").strip() == "new"
    assert _run(folder, *ask, "again").strip() == "goes on"
    law.write_text(law.read_text().replace("self.k_A * e +", "3.0 * self.k_A * e +"))
    assert "differs in parts_file" in _run(folder, *ask, "again")


_ASK = """
import pathlib, sys
from quietbus.cli.own_parts import load_parts
load_parts(pathlib.Path("{law}"))
import quietbus as qb
from quietbus.asked import task_asked
from quietbus.results.checkpoint import Checkpoint, CheckpointError
task = task_asked(qb.load_scenario("my.yaml"), qb.Direct())
try:
    if sys.argv[1] == "first":
        Checkpoint.create("run.checkpoint", task).close()
        print("new")
    else:
        Checkpoint.resume("run.checkpoint", task)[0].close()
        print("goes on")
except CheckpointError as error:
    print(error)
"""


def test_a_file_of_parts_may_be_called_as_a_library_is(folder):
    """And an analysis has what the struts remember: real poles beside those of the modes."""
    (folder / "elsewhere").mkdir()
    file = folder / "elsewhere" / "json.py"
    file.write_text((folder / "own_parts.py").read_text())
    told = _run(folder, "-m", "quietbus", "--parts", str(file), "analyze", "my.yaml", "--json")
    poles = json.loads(told)["channels"]["z"]["poles"]
    assert [pole["damped_frequency_hz"] > 0.0 for pole in poles].count(False) == 1


@pytest.mark.parametrize("command", ["simulate", "jitter", "analyze"])
def test_a_law_that_is_wrong_is_told_in_one_line(folder, command):
    """With the line of the scenario, whichever command builds the model."""
    law = folder / "wrong_law.py"
    law.write_text((folder / "own_parts.py").read_text().replace("def stored(", "def store("))
    done = subprocess.run(
        [sys.executable, "-m", "quietbus", "--parts", law.name, command, "my.yaml"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    said = "DStrutLaw.stored: expected the law to have this method, got none"
    told = [line for line in done.stderr.splitlines() if line.startswith("quietbus: ")]
    assert len(told) == 1
    assert re.fullmatch(rf"quietbus: my\.yaml: isolator\.legs\.strut \(line \d+\): {said}", told[0])
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "expected a Python file"),
        ("import nothing_of_this_name\n", "line 1: ModuleNotFoundError"),
        ("\nx = (\n", "line 2: SyntaxError"),
        ("raise SystemExit(3)\n", "line 1: SystemExit: 3"),
    ],
)
def test_a_file_of_parts_that_cannot_be_used_is_told(folder, text, said):
    file = folder / "bad_parts.py"
    file.unlink(missing_ok=True)
    if text is not None:
        file.write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "quietbus", "--parts", file.name, "init", "x.yaml"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
