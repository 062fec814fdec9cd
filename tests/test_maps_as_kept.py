"""Measured maps as rigs write them: decimal commas, tabs, speeds that fall or are negative."""

import time

import numpy as np
import pytest
import xarray as xr

import quietbus as qb
from quietbus.measured import MapError

ABOUT = """# component: radial_force
# unit: N^2/Hz
# speed_unit: rpm
# window: hann
"""
SPEED, FREQUENCY = np.array([600.0, 1200.5, 1800.0]), np.array([10.5, 20.5, 30.5, 40.5])
POWER = np.arange(1.0, 13.0).reshape(3, 4) / 8.0


@pytest.fixture
def put(tmp_path):
    def write(text, name="map.csv"):
        file = tmp_path / name
        file.write_text(text)
        return file

    return write


def matrix(speed=SPEED, power=POWER, separator=", ", corner="speed \\ frequency"):
    rows = [[corner, *FREQUENCY], *([s, *p] for s, p in zip(speed, power, strict=True))]
    return ABOUT + "\n".join(separator.join(map(str, cells)) for cells in rows)


def same(found):
    found = found["radial_force"]
    np.testing.assert_allclose(found["speed"], SPEED * 2 * np.pi / 60)
    np.testing.assert_allclose(found["frequency"], FREQUENCY)
    np.testing.assert_allclose(found, POWER)


@pytest.mark.parametrize("separator", [", ", ",", ";", "\t", ",\t"])
def test_separators(put, separator):
    same(qb.read_waterfall(put(matrix(separator=separator))))


@pytest.mark.parametrize("separator", [";", "\t", "; "])
def test_decimal_commas(put, separator):
    text = matrix(separator=separator, corner="rpm").replace(".", ",")
    same(qb.read_waterfall(put(text)))
    assert ",5" in text
    with pytest.raises(MapError, match="which is the decimal sign"):
        qb.read_waterfall(put(text.replace("1200,5", "1200.5")))


@pytest.mark.parametrize("turn", [slice(None), slice(None, None, -1)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_speeds_that_fall_or_are_negative(put, tmp_path, turn, sign):
    """The rows of each speed stay with it."""
    speed, power = sign * SPEED[turn], POWER[turn]
    same(qb.read_waterfall(put(matrix(speed, power))))
    long = ABOUT + "speed,frequency,value\n"
    for s, row in zip(speed, power, strict=True):
        long += "".join(f"{s},{f},{p}\n" for f, p in zip(FREQUENCY, row, strict=True))
    same(qb.read_waterfall(put(long)))
    maps = xr.Dataset(
        {"radial_force": (("speed", "frequency"), power, {"units": "N^2/Hz", "window": "hann"})},
        {
            "speed": ("speed", speed, {"units": "rpm"}),
            "frequency": ("frequency", FREQUENCY, {"units": "Hz"}),
        },
    )
    maps.to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    same(qb.read_waterfall(tmp_path / "map.nc"))


@pytest.mark.parametrize(
    ("speed", "message"),
    [
        ([-600, 1200, 1800], "speeds of one sense of rotation, got -600 and 1200"),
        ([600, 1200, 1000], "expected ascending values, got 1000 after 1200"),
        ([-1800, -600, -1200], "expected ascending values, got 600 after 1800"),
        ([0, 600, 1200], "expected numbers above 0, got 0"),
        ([0, -600, -1200], "expected numbers above 0, got 0"),
        (["-inf", 600, 1200], r"column 1 \(line 6\): expected a number, got '-inf'"),
    ],
)
def test_speeds_that_cannot_be_sorted(put, speed, message):
    with pytest.raises(MapError, match=message):
        qb.read_waterfall(put(matrix(speed)))


def test_reading_takes_a_time_linear_in_the_rows(put):
    def taken(speeds):
        text = ABOUT + "speed,frequency,value\n"
        text += "".join(f"{s},{f},1\n" for s in range(1, speeds + 1) for f in range(20))
        file = put(text)
        start = time.process_time()
        qb.read_waterfall(file)
        return time.process_time() - start

    taken(3)
    assert taken(2000) < 40 * taken(100) + 0.2
