"""The command line: what it writes, what it prints, how it ends."""

import json
import signal
import subprocess
import sys
import tempfile
import time

import pytest

import quietbus as qb
from quietbus import cli
from quietbus.tables.jitter import critical_table
from quietbus.writing import OutputError


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


def short(tmp_path, **changes):
    text = qb.load_scenario("zhang2012").with_overrides({"simulation.duration": 1.2}).to_yaml()
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "my.yaml"
    path.write_text(text)
    return str(path)


def test_simulate_writes_the_run_and_prints_its_numbers(command, tmp_path):
    status, out, _ = command("simulate", short(tmp_path), "-o", "run.nc", "--mount", "rigid")
    assert status == 0
    run = qb.load_run(tmp_path / "run.nc")
    assert run.attrs["mount"] == "rigid"
    assert run.time[-1] == pytest.approx(1.2)
    for text in ("rate jitter x, peak", "deg/s", "peak gimbal rate", "least singularity measure"):
        assert text in out


def test_compare_puts_both_mounts_side_by_side_with_pictures(command, tmp_path):
    status, out, _ = command("compare", short(tmp_path), "-o", "both")
    assert status == 0
    assert "isolated / rigid" in out
    assert "%" in out
    made = {path.name for path in (tmp_path / "both").iterdir()}
    assert {"isolated.nc", "rigid.nc", "summary.json", "rates.png"} <= made
    summary = json.loads((tmp_path / "both" / "summary.json").read_text())
    for mount in ("isolated", "rigid"):
        run = qb.load_run(tmp_path / "both" / f"{mount}.nc")
        expected = qb.summarize(run).to_dict()
        assert expected["worst_phases_rate"] == qb.worst_over_phases(run).tolist()
        assert summary[mount] == expected


@pytest.mark.parametrize("given", ["30, 30, 30, 30", "30 deg, 30 deg, 30 deg, 30 deg"])
def test_odd_values_are_told_and_all_are_shown_as_read(command, given):
    status, out, err = command("analyze", "zhang2012", "--gimbal-angles", given)
    assert status == 0
    assert "15 N m s at 6000 rpm, rotor 6 kg" in out
    told = "note: cluster.gimbal_angles[0]: read as 30 rad, 1719 deg: more than a whole turn"
    assert (told in err) == ("deg" not in given)
    assert err.count("read as") == ("deg" not in given)
    assert f"gimbals       at {30 if 'deg' in given else 1719} deg" in out


def test_json_has_nothing_beside_it_and_a_slip_is_told_before_what_comes_of_it(command, tmp_path):
    status, out, err = command("analyze", "zhang2012", "--gimbal-angles", "7, 0, 0, 0", "--json")
    assert status == 0
    json.loads(out)
    assert "gimbal_angles[0]: read as 7 rad, 401.1 deg" in err
    path = short(tmp_path, **{"1.3600000000000002e-05": "1.36"})
    status, out, err = command("jitter", path)  # refused, since nothing rests on such a rotor
    assert "note: cluster.rotor.static_imbalance: read as 136000 g cm: a mass centre 227 mm" in err


def test_plot_draws_a_run(command, tmp_path):
    qb.save_run(qb.simulate("zhang2012", duration=0.3), tmp_path / "run.nc")
    status, out, _ = command("plot", "run.nc", "--format", "svg")
    assert status == 0
    assert len(list((tmp_path / "run").glob("*.svg"))) == out.count("wrote") >= 4


def test_init_writes_a_scenario_that_works_and_keeps_what_is_there(command, tmp_path):
    assert command("init", "new.yaml")[0] == 0
    assert qb.load_scenario(tmp_path / "new.yaml").name == "my-satellite"
    (tmp_path / "new.yaml").write_text("mine")
    status, _, err = command("init", "new.yaml")
    assert status == 2
    assert "new.yaml: exists already" in err
    assert (tmp_path / "new.yaml").read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulate", "zhang2013"], "did you mean zhang2012"),
        (["simulate", "zhang2012", "--duration", "ten"], "simulation.duration"),
        (["simulate", "zhang2012", "--duration", "-3"], "simulation.duration"),
        (["simulate", "zhang2012", "--duration", "5 m"], "simulation.duration"),
        (["simulate", "zhang2012", "-o", "no/folder/run.nc"], "no/folder: no such folder"),
        (["simulate", "zhang2012", "--mount", "soft"], "soft"),
        (["simulate", "zhang2012", "--mount", "rigid", "--joint-forces"], "--joint-forces"),
        (["simulate", "zhang2012", "-o", "."], ".: is a folder"),
        (["simulate", "zhang2012", "-o", "/proc/run.nc"], "/proc/run.nc: cannot be written"),
        (["simulate", "zhang2012", "--duration", "5 m"], "zhang2012 with --duration: simulation."),
        (["jitter", "zhang2012", "--gimbal-angles", "1"], "zhang2012 with --gimbal-angles: clus"),
        (["analyze", "zhang2012", "-o", __file__], "is a file; expected the name of a folder"),
        (["compare", "zhang2012", "-o", "/proc/none"], "/proc/none: cannot be made"),
        (["compare", "zhang2012", "-o", "/proc"], "/proc: cannot be written"),
        (["plot", "nothing.nc"], "nothing.nc: no such file"),
        (["plot", "."], ".: is a folder"),
        (["plot", "zhang2013"], "did you mean zhang2012"),
        (["plot", "nothing.nc", "--format", "bmp"], "expected png, svg or pdf, got 'bmp'"),
        (["validate", "zhang2012", "--export", "no/folder/m.xml"], "no/folder: no such folder"),
    ],
)
def test_bad_input_ends_with_status_2_and_one_message(command, arguments, message):
    status, out, err = command(*arguments)
    assert status == 2
    assert message in err
    assert out == ""
    assert "Traceback" not in err


def test_what_is_found_wrong_before_a_run_names_file_and_line(command, tmp_path):
    """The scenario itself is fine; what it declares needs another output rate."""
    path = short(
        tmp_path,
        **{
            "name: zhang2012": "name: other",
            "    static_imbalance:": "    disturbance: {orders: [{order: 8, radial_force: 1e-6}]}\n"
            "    static_imbalance:",
        },
    )
    status, out, err = command("simulate", path)
    lines = (tmp_path / "my.yaml").read_text().splitlines()
    line = next(i for i, text in enumerate(lines, 1) if "output_rate" in text)
    assert status == 2
    assert f"{path}: simulation.output_rate (line {line}): expected at least 2048 Hz" in err
    assert out == ""
    _, _, err = command("simulate", path, "--output-rate", "400 Hz")
    assert f"{path} with --output-rate: simulation.output_rate: expected at least 2048 Hz" in err


def test_bad_scenario_names_file_line_field_and_what_was_expected(command, tmp_path):
    path = short(tmp_path, **{"damping: 500.0": "damping: 500 N/m"})
    status, _, err = command("simulate", path)
    lines = (tmp_path / "my.yaml").read_text().splitlines()
    line = next(i for i, text in enumerate(lines, 1) if "500 N/m" in text)
    assert status == 2
    assert "my.yaml" in err
    assert str(line) in err
    assert "isolator.legs.damping" in err
    assert "N*s/m" in err


def test_run_that_diverges_keeps_what_it_has_and_ends_with_status_1(command, tmp_path):
    path = short(tmp_path, **{"kp: 200.0": "kp: 2.0e+7", "kd: 2500.0": "kd: 2.5e+8"})
    status, _, err = command("simulate", path, "--duration", "5 s", "-o", "run.nc")
    assert status == 1
    assert "at t = " in err
    assert qb.load_run(tmp_path / "run.nc").attrs["status"] == "stopped"


def _until(ready, process, seconds=180.0):
    """Wait until something is there, while the program runs."""
    ending = time.monotonic() + seconds
    while not ready():
        assert process.poll() is None, process.returncode
        assert time.monotonic() < ending
        time.sleep(0.2)


@pytest.mark.slow
def test_killed_and_interrupted_runs_keep_what_they_have_and_go_on(tmp_path, command):
    """Killed, resumed, stopped by SIGTERM (as by Ctrl-C), then resumed to the end."""
    output, checkpoint = tmp_path / "run.nc", tmp_path / "run.nc.checkpoint"
    arguments = ["simulate", "zhang2012", "--duration", "400 s", "-o", str(output)]
    arguments += ["--output-rate", "260 Hz"]
    start = lambda *more: subprocess.Popen(  # noqa: E731
        [sys.executable, "-m", "quietbus", *arguments, *more], stderr=subprocess.PIPE, text=True
    )
    process = start()
    _until(lambda: checkpoint.exists() and checkpoint.stat().st_size > 50_000, process)
    process.kill()
    process.communicate()
    assert not output.exists()
    killed = qb.load_run(checkpoint)
    assert killed.attrs["status"] == "interrupted"
    assert killed.time[-1] > 0.5
    status, _, err = command(*arguments)
    assert status == 2
    assert "holds this very run up to t = " in err
    process, size = start("--resume"), checkpoint.stat().st_size
    _until(lambda: checkpoint.stat().st_size > size, process)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=120.0)
    assert process.returncode == 1
    assert "the same command with --resume goes on from there" in err
    stopped = qb.load_run(output)
    assert stopped.attrs["status"] == "interrupted"
    assert killed.time[-1] < stopped.time[-1] < 399.0
    assert killed.equals(stopped.isel(time=slice(killed.sizes["time"])))
    assert qb.load_run(checkpoint).equals(stopped)


def test_what_cannot_be_resumed_is_told_at_once(command, tmp_path):
    status, _, err = command("simulate", "zhang2012", "-o", "run.nc", "--resume")
    assert status == 2
    assert "run.nc.checkpoint: no such file, so there is nothing to resume" in err
    status, _, err = command("compare", "zhang2012", "-o", "out", "--resume")
    assert status == 2
    assert "nothing to resume" in err


def test_run_that_cannot_be_written_is_kept_elsewhere(command, tmp_path, monkeypatch):
    from quietbus import results

    write, refused = results.save_run, []

    def full_disk(run, path):
        if not refused:
            refused.append(path)
            raise OutputError(f"{path}: cannot be written: No space left on device")
        write(run, path)

    monkeypatch.setattr(results, "save_run", full_disk)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    status, _, err = command("simulate", short(tmp_path), "-o", "run.nc", "--mount", "rigid")
    assert status == 1
    assert "run.nc: cannot be written: No space left on device; the run is in" in err
    refuge = err.split("the run is in ")[1].strip()
    assert qb.load_run(refuge).attrs["status"] == "complete"
    refused.clear()
    status, _, err = command("compare", short(tmp_path), "-o", "both")
    assert status == 1
    refuge = err.split("isolated.nc: cannot be written: No space left on device; the run is in ")[1]
    assert qb.load_run(refuge.strip()).attrs["mount"] == "isolated"
    assert qb.load_run(tmp_path / "both" / "rigid.nc").attrs["mount"] == "rigid"


def test_coarse_output_is_told(command, tmp_path):
    path = short(tmp_path, **{"output_rate: 1000.0": "output_rate: 50"})
    status, out, err = command("simulate", path)
    assert status == 0
    assert "note: the output rate of 50 Hz cannot show" in err
    assert "n/a" in out


def test_version_is_the_packages(command):
    assert command("--version") == (0, f"quietbus {qb.__version__}\n", "")


def test_a_mode_has_one_name_in_all_tables():
    """That of `analyze`, which JSON has too, in the table of critical speeds of `jitter`."""
    found = {
        "factor": 0.5, "speed_rpm": 3000.0, "order": 1.0, "frequency_hz": 50.0, "damping": 0.1,
        "amplification": 5.0, "bus_rate_amplitude_deg_s": [1e-5, 0.0, 0.0], "excited": True,
        "mode": "translation x + rotation y",
    }  # fmt: skip
    sweep = {
        "speed_rpm": [0.0, 6000.0],
        "isolated": {"critical_speeds": [found], "bearing_critical_speeds": []},
    }
    assert list(critical_table(sweep, "").columns[-1].cells) == ["translation x + rotation y"]


def test_help_and_import_do_not_load_heavy_modules():
    """What makes `quietbus --help` answer at once."""
    code = """
import sys, quietbus, quietbus.cli
sys.argv = ["quietbus", "--help"]
try:
    quietbus.cli.main()
finally:
    print(*sys.modules)
"""
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"jax", "xarray", "matplotlib", "scipy", "pydantic", "numpy"} & set(loaded)
