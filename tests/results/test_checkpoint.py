"""Runs that are interrupted or killed, and go on as if they had not been."""

import itertools
import json
import pathlib
import shutil
import struct

import numpy as np
import pytest

import quietbus as qb
from quietbus.results import checkpoint as checkpoints
from quietbus.results.checkpoint import CheckpointError, read
from quietbus.results.size import expected_size
from quietbus.results.task import Task, differences
from quietbus.writing import OutputError

LENGTH = 4.0  # [s], four pieces


@pytest.fixture
def every_piece(monkeypatch):
    monkeypatch.setattr(checkpoints, "EVERY", 0.0)


def stopping_at(instant):
    """As Ctrl-C does."""

    def tell(t):
        if t >= instant:
            raise KeyboardInterrupt

    return tell


@pytest.fixture(scope="module")
def whole():
    return qb.simulate("zhang2012", duration=LENGTH)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """A checkpoint of the run that was interrupted at 2 s."""
    path = tmp_path_factory.mktemp("interrupted") / "run.nc.checkpoint"
    with pytest.warns(qb.QuietbusWarning, match="interrupted by the user at t = 2 s"):
        run = qb.simulate("zhang2012", duration=LENGTH, progress=stopping_at(2.0), checkpoint=path)
    assert run.attrs["status"] == "interrupted"
    return path


@pytest.fixture
def copy(interrupted, tmp_path):
    return pathlib.Path(shutil.copy(interrupted, tmp_path / "run.nc.checkpoint"))


def test_resumed_run_is_the_uninterrupted_one_bit_for_bit(copy, whole):
    run = qb.simulate("zhang2012", duration=LENGTH, checkpoint=copy, resume=True)
    assert run.attrs["status"] == "complete"
    assert run.attrs["steps"] == whole.attrs["steps"]
    assert run.equals(whole)
    assert qb.load_run(copy).equals(whole)


def test_resumed_run_does_not_compute_again_what_is_there(copy):
    reached = []
    qb.simulate("zhang2012", duration=LENGTH, checkpoint=copy, resume=True, progress=reached.append)
    assert reached == [3.0, 4.0]


def test_checkpoint_is_a_run_of_status_interrupted(interrupted, whole):
    run = qb.load_run(interrupted)
    assert run.attrs["status"] == "interrupted"
    assert run.attrs["stop_reason"] == "a checkpoint: the run had come to t = 2 s"
    assert run.sizes["time"] == 2000
    assert run.equals(whole.isel(time=slice(2000)))
    assert set(run.attrs) == set(whole.attrs)
    assert qb.summarize(run).peak_stroke > 0.0


@pytest.mark.parametrize("lost", [1, 5, 1000, 20_000])
def test_checkpoint_cut_short_holds_what_was_written_before(every_piece, whole, tmp_path, lost):
    """As a killed program or a full disk leaves it, and it can be continued."""
    path = tmp_path / "run.nc.checkpoint"
    with pytest.warns(qb.QuietbusWarning):
        qb.simulate("zhang2012", duration=LENGTH, progress=stopping_at(3.0), checkpoint=path)
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size - lost)
    assert qb.load_run(path).sizes["time"] == 2000
    run = qb.simulate("zhang2012", duration=LENGTH, checkpoint=path, resume=True)
    assert run.equals(whole)


def test_other_run_is_not_continued(copy):
    for other, named in (
        ({"duration": 5.0}, "simulation.duration"),
        ({"mount": "rigid"}, "isolator.mount"),
        ({"output_rate": 500.0}, "simulation.output_rate"),
        ({"joint_forces": True}, "joint_forces"),
        ({"method": "harmonic"}, "method"),
    ):
        asked = {"duration": LENGTH} | other
        with pytest.raises(CheckpointError, match=f"is of another run, which differs in.*{named}"):
            qb.simulate("zhang2012", checkpoint=copy, resume=True, **asked)
    assert read(copy).reached is not None


def test_checkpoint_of_this_very_run_is_not_lost_by_accident(copy):
    with pytest.raises(CheckpointError, match="holds this very run up to t = 2 s: resume it, or"):
        qb.simulate("zhang2012", duration=LENGTH, checkpoint=copy)


def test_file_that_is_no_checkpoint_is_neither_read_nor_replaced(tmp_path):
    path = tmp_path / "mine"
    path.write_text("precious")
    for resume in (False, True):
        with pytest.raises(OutputError, match="exists and is no checkpoint"):
            qb.simulate("zhang2012", duration=LENGTH, checkpoint=path, resume=resume)
    assert path.read_text() == "precious"


def test_run_goes_on_where_the_checkpoint_s_disk_is_full(every_piece, whole, tmp_path, monkeypatch):
    append, records = checkpoints._append, itertools.count()

    def full(file, record):
        if next(records) > 2:
            file.write(bytes(record[:100]))
            raise OSError(28, "No space left on device")
        append(file, record)

    monkeypatch.setattr(checkpoints, "_append", full)
    path = tmp_path / "run.nc.checkpoint"
    with pytest.warns(qb.QuietbusWarning, match="holds only a part of the run: No space left"):
        run = qb.simulate("zhang2012", duration=LENGTH, checkpoint=path)
    assert run.equals(whole)
    assert qb.load_run(path).sizes["time"] == 2000


def test_nothing_is_left_of_a_run_that_could_not_begin(tmp_path):
    path = tmp_path / "run.nc.checkpoint"
    with pytest.raises(ValueError, match="joint_forces needs mount 'isolated'"):
        qb.simulate("zhang2012", mount="rigid", joint_forces=True, checkpoint=path)
    assert not list(tmp_path.iterdir())


def test_size_is_known_before(whole):
    task = Task(qb.scenario_of(whole), qb.Direct())
    assert expected_size(task) == pytest.approx(whole.nbytes, rel=0.01)


def test_disk_without_room_is_told_before_the_flight(tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=1_000_000))
    path, reached = tmp_path / "run.nc.checkpoint", []
    with pytest.raises(
        OutputError, match=r"too little room: .* need about 4\.\d+ MB, 1 MB are free"
    ):
        qb.simulate("zhang2012", duration=LENGTH, checkpoint=path, progress=reached.append)
    assert not reached
    assert not list(tmp_path.iterdir())


def test_task_comes_back_as_it_was():
    lines = {"camera": np.arange(36.0).reshape(3, 12) / 7.0}
    task = Task(
        qb.load_scenario("zhang2012"), qb.Harmonic(1e-6), False, {"p": np.array([0.1, 0, 3])}, lines
    )
    again = Task.from_dict(json.loads(json.dumps(task.to_dict())))
    assert not differences(again, task)
    assert again.tolerances == task.tolerances
    assert np.array_equal(again.view().line_of_sight, task.view().line_of_sight)


def test_harmonic_run_goes_on_from_its_slow_motion(every_piece, tmp_path):
    asked = {"method": "harmonic", "duration": 60.0, "output_rate": 2.0}
    path = tmp_path / "run.nc.checkpoint"
    whole = qb.simulate("zhang2012", **asked)
    assert expected_size(Task(qb.scenario_of(whole), qb.Harmonic())) == pytest.approx(
        whole.nbytes, rel=0.02
    )
    with pytest.warns(qb.QuietbusWarning, match="interrupted"):
        qb.simulate("zhang2012", **asked, progress=stopping_at(20.0), checkpoint=path)
    partial = qb.load_run(path)  # the slow motion of 50 s is there, its jitter computed on reading
    assert partial.attrs["status"] == "interrupted"
    assert partial.sizes["time"] == 100
    early = whole.isel(time=slice(100))
    assert partial["bus_rate"].equals(early["bus_rate"])
    size = early["bus_rate_jitter_amplitude"]
    np.testing.assert_allclose(
        partial["bus_rate_jitter_amplitude"], size, atol=1e-5 * float(size.max()), rtol=0.0
    )
    run = qb.simulate("zhang2012", **asked, checkpoint=path, resume=True)
    assert run.equals(whole)


def test_changed_byte_anywhere_is_noticed(copy, whole, tmp_path):
    """By the checksums; what comes before it counts."""
    data, rng = copy.read_bytes(), np.random.default_rng(1)
    for place in rng.integers(0, len(data), 40).tolist() + list(range(40)):
        harmed = bytearray(data)
        harmed[place] ^= 1 << int(rng.integers(8))
        (tmp_path / "harmed").write_bytes(harmed)
        said, run = _read(tmp_path / "harmed")
        assert said.count("\n") == 0
        assert ("harmed: " in said) != (run is not None)
        if run is not None:
            assert run.sizes["time"] < 2000
            assert run.equals(whole.isel(time=slice(run.sizes["time"])))


def _read(path):
    try:
        return "", qb.load_run(path)
    except ValueError as told:
        return str(told), None


def test_record_of_absurd_length_takes_no_memory(tmp_path):
    (tmp_path / "harmed").write_bytes(checkpoints.MAGIC + struct.pack("<QI", 2**60, 0))
    with pytest.raises(CheckpointError, match="without a sound beginning"):
        qb.load_run(tmp_path / "harmed")
