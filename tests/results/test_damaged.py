"""Files of runs that are damaged, forged or of something else: one message, never a traceback."""

import os
import time

import h5py
import numpy as np
import pytest

import quietbus as qb
from quietbus.plots import run_figures
from quietbus.results.checks import HEAP, TEXTS
from quietbus.results.files import SEAL
from quietbus.results.schema import VARIABLES
from results.synthetic import synthetic


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "run.nc"
    qb.save_run(synthetic(60), path)
    return path


def load(path):
    """The run or the message; anything but a ValueError of one line is a failure."""
    try:
        return qb.load_run(path), ""
    except ValueError as error:
        return None, str(error)


@pytest.mark.parametrize("sealed", [True, False])
@pytest.mark.parametrize("part", range(4))
def test_damage_anywhere_is_told_or_does_no_harm(good, tmp_path, part, sealed):
    """Bytes changed, lost, added or zeroed, with the seal and, as of other programs, without."""
    data, rng = good.read_bytes(), np.random.default_rng(part)
    inner = len(data) - len(SEAL) - 16
    data = data if sealed else data[:inner]
    refused = 0
    for _ in range(30):
        harmed, place = bytearray(data), int(rng.integers(len(data)))
        length = int(rng.integers(1, 200))
        match int(rng.integers(5)):
            case 0:
                harmed[place] ^= 1 << int(rng.integers(8))
            case 1:
                del harmed[place:]
            case 2:
                del harmed[place : place + length]
            case 3:
                harmed[place:place] = rng.bytes(length)
            case 4:
                harmed[place : place + length] = bytes(len(harmed[place : place + length]))
        path = tmp_path / "harmed.nc"
        path.write_bytes(harmed)
        started = time.perf_counter()
        run, said = load(path)
        assert time.perf_counter() - started < 5.0
        if run is None:
            refused += 1
            assert said.startswith(f"{path}: ")
            assert "\n" not in said
        else:
            assert not sealed or harmed == data or place + length > inner
            qb.summarize(run)
    assert refused > 10


@pytest.mark.parametrize(("place", "length"), [(268, 154), (411, 104)])
def test_damaged_heap_is_not_searched_without_end(good, tmp_path, place, length):
    """Of the files of the test above, these two kept HDF5 2.0 busy for ever."""
    data = bytearray(good.read_bytes()[: -len(SEAL) - 16])
    place += data.index(HEAP)
    data[place : place + length] = bytes(length)
    (tmp_path / "harmed.nc").write_bytes(data)
    with pytest.raises(ValueError, match="a heap of it is damaged"):
        qb.load_run(tmp_path / "harmed.nc")


def change(path, name, values, **attributes):
    with h5py.File(path, "r+") as file:
        if values is not None:
            file[name][...] = values
        file[name].attrs.update(attributes)


def set_attribute(name, value):
    def harm(path):
        with h5py.File(path, "r+") as file:
            file.attrs[name] = value

    return harm


def without_attribute(name):
    def harm(path):
        with h5py.File(path, "r+") as file:
            del file.attrs[name]

    return harm


def instead(name, make):
    """Another thing under a variable's name."""

    def harm(path):
        with h5py.File(path, "r+") as file:
            del file[name]
            make(file, name)

    return harm


def reversed_time(path):
    change(path, "time", np.arange(60)[::-1] / 1000.0)


def two_of_four_cmgs(path):
    qb.save_run(synthetic(60).isel(cmg=slice(2)), path)


def thinned_legs(path):
    qb.save_run(synthetic(60).isel(leg=[0, 1, 2, 3, 4, 4]), path)


def not_finite(value, name="bus_rate"):
    return lambda path: change(path, name, value)


def external_link(file, name):
    with h5py.File("elsewhere.h5", "w") as other:
        other[name] = np.zeros((60, 3))
    file[name] = h5py.ExternalLink("elsewhere.h5", f"/{name}")


def external_values(file, name):
    with open("elsewhere.bin", "wb") as other:
        other.write(bytes(60 * 3 * 8))
    file.create_dataset(name, (60, 3), float, external=[("elsewhere.bin", 0, 60 * 3 * 8)])


def virtual_values(file, name):
    layout = h5py.VirtualLayout((60, 3), float)
    layout[:] = h5py.VirtualSource("elsewhere.h5", name, (60, 3))
    file.create_virtual_dataset(name, layout)


def soft_link(file, name):
    file[name] = h5py.SoftLink("/leg_force")


def vast(file, name):
    file.create_dataset(name, (10**9, 3), float, chunks=(1000, 3), compression="gzip")


def text(file, name):
    file[name] = np.array(["a"] * 60, dtype=h5py.string_dtype())


def whole_numbers(file, name):
    file[name] = np.ones((60, 3), int)


def compound(file, name):
    file[name] = np.zeros(60, dtype=[("a", float), ("b", int)])


def group(file, name):
    file.create_group(name)


SCENARIO = qb.load_scenario("zhang2012").to_yaml()
HARMS = {
    "time reversed": (reversed_time, "time: expected values that grow"),
    "time twice": (lambda p: change(p, "time", np.repeat(np.arange(30), 2)), "index 1 does not"),
    "time nan": (not_finite(np.nan, "time"), "time: expected finite values"),
    "time before zero": (lambda p: change(p, "time", np.arange(60) - 5.0), "from 0 s on"),
    "time past the end": (lambda p: change(p, "time", np.arange(60) * 1.0), "the duration of its"),
    "time in days": (lambda p: change(p, "time", None, units="days since 2000-01-01"), "time: "),
    "two of four CMGs": (two_of_four_cmgs, "cmg: expected 4 of its scenario, got 2"),
    "a leg twice": (thinned_legs, "leg: expected the labels 0, 1, 2, 3, 4, 5"),
    "all nan": (not_finite(np.nan), "bus_rate: expected finite values"),
    "one infinite": (not_finite(np.inf, "leg_stroke"), "leg_stroke: expected finite values"),
    "no unit quaternion": (not_finite(0.3, "bus_attitude"), "bus_attitude: expected unit quat"),
    "other unit": (lambda p: change(p, "bus_rate", None, units="deg/s"), "the unit rad/s, got 'de"),
    "no unit": (lambda p: change(p, "leg_force", None, units=3.0), "leg_force: expected the unit"),
    "scaled": (
        lambda p: change(p, "bus_rate", None, scale_factor=np.inf),
        "bus_rate: expected fin",
    ),
    "unknown method": (set_attribute("method", "magic"), "method: expected direct or harmonic"),
    "harmonic without lines": (set_attribute("method", "harmonic"), "no labels order"),
    "unknown status": (set_attribute("status", "fine"), "status: expected complete or stopped"),
    "unknown mount": (set_attribute("mount", "soft"), "mount: expected isolated or rigid"),
    "other mount": (set_attribute("mount", "rigid"), "that of its scenario isolated"),
    "number for text": (set_attribute("scenario", 5.0), "its attribute scenario is no text"),
    "list for text": (set_attribute("status", [1.0, 2.0]), "its attribute status is no text"),
    "no status": (without_attribute("status"), "not a run of quietbus: it has no status"),
    "no scenario": (without_attribute("scenario"), "not a run of quietbus: it has no scenario"),
    "empty scenario": (set_attribute("scenario", "x"), "the run's scenario"),
    "scenario no YAML": (set_attribute("scenario", "a: [b"), "the run's scenario"),
    "scenario wrong": (
        set_attribute("scenario", SCENARIO.replace("mass:", "mess:")),
        "the run's scenario",
    ),
    "external link": (instead("bus_rate", external_link), "'bus_rate' is a link to elsewhere"),
    "values elsewhere": (instead("bus_rate", external_values), "its values in other files"),
    "virtual values": (instead("bus_rate", virtual_values), "its values in other files"),
    "soft link": (instead("bus_rate", soft_link), "'bus_rate' is a link to elsewhere"),
    "vast": (instead("bus_rate", vast), "it declares 2.4e+10 bytes"),
    "text": (instead("bus_rate", text), "harmed.nc: "),
    "whole numbers": (instead("bus_rate", whole_numbers), "harmed.nc: "),
    "compound": (instead("bus_rate", compound), "harmed.nc: "),
    "a group": (instead("bus_rate", group), "harmed.nc: "),
    "a folder": (lambda p: (p.unlink(), p.mkdir()), "is a folder; expected the file of a run"),
    "a pipe": (lambda p: (p.unlink(), os.mkfifo(p)), "is a pipe, socket or device"),
    "empty": (lambda p: p.write_bytes(b""), "not a NetCDF-4 file (expected a run"),
} | {
    f"no {name}": (instead(name, lambda *_: None), f"run of quietbus: it has no {name}")
    for name in VARIABLES
}


@pytest.mark.parametrize("harm", HARMS, ids=str)
def test_forged_or_incomplete_file_is_refused_by_name(good, tmp_path, monkeypatch, harm):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "harmed.nc"
    path.write_bytes(good.read_bytes())
    do, expected = HARMS[harm]
    do(path)
    run, said = load(path)
    assert run is None
    assert expected in said
    assert said.startswith(f"{path}: ")
    assert "\n" not in said
    assert len(said) < 600


def test_what_users_do_to_runs_stays_a_run(good, tmp_path):
    """A stretch, every third instant, further variables, compression, single precision."""
    run = qb.load_run(good)
    for kept in (
        run.isel(time=slice(20, 40)),
        run.isel(time=slice(None, None, 3)),
        run.assign(mine=("time", np.zeros(60))).assign_attrs(remark="mine"),
        run.astype(np.float32),
        run.drop_attrs(deep=False).assign_attrs({name: run.attrs[name] for name in TEXTS}),
    ):
        qb.save_run(kept, tmp_path / "kept.nc")
        assert qb.load_run(tmp_path / "kept.nc").equals(kept)
        assert run_figures(kept)
    run.to_netcdf(
        tmp_path / "packed.nc",
        engine="h5netcdf",
        encoding={name: {"zlib": True, "complevel": 9} for name in run.data_vars},
    )
    assert qb.load_run(tmp_path / "packed.nc").equals(run)
