"""Outputs of the commands: no input, link, pipe or foreign file is harmed by any of them."""

import os
import signal
import sys

import pytest

import quietbus as qb
from quietbus import cli

TABLE = "unit, kind, order, coefficient\nkg m, radial_force, 1, 2e-7\n"


@pytest.fixture
def command(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["quietbus", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capsys.readouterr()
        return ended.value.code or 0, out, err

    (tmp_path / "my.yaml").write_text(qb.load_scenario("zhang2012").to_yaml())
    (tmp_path / "w.csv").write_text(TABLE)
    (tmp_path / "run.nc").write_bytes(b"\x89HDF\r\n\x1a\nnot really")
    return call


# every command with every option that names a file
WRITERS = {
    "simulate": ("simulate", "my.yaml", "-o"),
    "simulate harmonic": ("simulate", "my.yaml", "--method", "harmonic", "-o"),
    "validate": ("validate", "my.yaml", "--export"),
    "import": ("import", "w.csv", "-o"),
    "init": ("init",),
}


@pytest.mark.parametrize("victim", ["my.yaml", "w.csv"])
@pytest.mark.parametrize("writer", WRITERS.values(), ids=WRITERS)
def test_output_does_not_replace_an_input(command, tmp_path, writer, victim):
    before = (tmp_path / victim).read_bytes()
    status, out, err = command(*writer, victim)
    assert status == 2
    assert f"{victim}: exists" in err
    assert out == ""
    assert (tmp_path / victim).read_bytes() == before


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("w.csv")])
@pytest.mark.parametrize("writer", WRITERS.values(), ids=WRITERS)
def test_output_does_not_replace_a_pipe_or_a_link(command, tmp_path, writer, make):
    make(tmp_path / "node")
    before = (tmp_path / "node").lstat()
    status, _, err = command(*writer, "node")
    assert status == 2
    assert "node: " in err
    assert (tmp_path / "node").lstat() == before
    assert (tmp_path / "w.csv").read_text() == TABLE


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (("analyze", "my.yaml", "-o", "out"), "analysis.json"),
        (("jitter", "my.yaml", "-o", "out"), "jitter.json"),
        (("compare", "my.yaml", "-o", "out"), "summary.json"),
        (("compare", "my.yaml", "-o", "out"), "rigid.nc"),
        (("fit", "w.csv", "-o", "out"), "fit.json"),
        (("fit", "w.csv", "-o", "out"), "disturbance.yaml"),
        (("reproduce", "zhang2012", "-o", "out"), "table.json"),
    ],
)
def test_folder_of_results_is_checked_for_what_is_no_older_result(
    command, tmp_path, arguments, file
):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / file).write_text("mine")
    status, out, err = command(*arguments)
    assert status == 2
    assert f"out/{file}: exists and is no" in err
    assert out == ""
    assert (tmp_path / "out" / file).read_text() == "mine"


def test_slowness_without_compilation_is_told(capsys):
    import jax

    from quietbus.cli.session import import_heavy

    import_heavy()
    assert "JAX_DISABLE_JIT" not in capsys.readouterr().err
    with jax.disable_jit():
        import_heavy()
    assert "note: JAX_DISABLE_JIT is set, so nothing is compiled" in capsys.readouterr().err


def test_bad_output_is_told_before_anything_heavy_is_loaded(tmp_path):
    import subprocess

    code = """
import sys
from quietbus import cli
sys.argv = ["quietbus", "simulate", "zhang2012", "-o", "no/folder/run.nc"]
try:
    cli.main()
finally:
    assert "jax" not in sys.modules
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 2, ended.stderr
    assert ended.stderr == "quietbus: no/folder: no such folder\n"
