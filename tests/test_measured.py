"""Measured maps from files: layouts, units, what is wrong; the commands `import` and `fit`."""

import json
import sys

import numpy as np
import pytest
import xarray as xr

import quietbus as qb
from oracles.spectra import map_of
from oracles.wheels import measured as spectra
from quietbus import cli
from quietbus.analysis.signals.waterfall import FitError, LineShape
from quietbus.measured import MapError, WaterfallFit
from quietbus.scenario.text import read_yaml

RPM = 2 * np.pi / 60
MATRIX = """# component: radial_force
# unit: mN^2/Hz
# speed_unit: rpm
# window: hann
# sample_rate: 200 Hz
speed \\ frequency, 10, 20, 30, 40
600, 1, 2, 3, 4
1200, 5, 6, 7, 8
1800, 9, 10, 11, 12
"""
LONG = """# unit: N*m_peak
# speed_unit: rev/s
component,speed,frequency,value
""" + "\n".join(f"radial_torque,{s},{f},{0.1 * s + f}" for f in (5, 10, 15) for s in (3, 1, 2))
TURNS = np.linspace(8.0, 100.0, 40)
LINES = ((1.0, 7.5e-8, 1), (2.0, 1.2e-8, 1), (3.87, 9e-9, 1))


@pytest.fixture
def put(tmp_path):
    def write(text, name="map.csv"):
        file = tmp_path / name
        file.write_text(text)
        return file

    return write


def netcdf(path, psd, frequency, name="radial_force", turns=TURNS, **attributes):
    about = {"units": "N^2/Hz", "window": "hann"} | attributes
    xr.Dataset(
        {name: (("speed", "frequency"), psd, about)},
        {
            "speed": ("speed", 60 * turns[: len(psd)], {"units": "rpm"}),
            "frequency": ("frequency", frequency, {"units": "Hz"}),
        },
    ).to_netcdf(path, engine="h5netcdf")
    return path


def test_a_matrix_in_csv(put):
    found = qb.read_waterfall(put(MATRIX))["radial_force"]
    assert found.to_numpy() == pytest.approx(1e-6 * np.arange(1.0, 13.0).reshape(3, 4))
    assert found["speed"].to_numpy() == pytest.approx(RPM * np.array([600, 1200, 1800]))
    assert found["frequency"].to_numpy().tolist() == [10, 20, 30, 40]
    assert found.attrs["window"] == "hann"
    assert found.attrs["units"] == "N^2/Hz"


def test_long_rows_of_amplitudes_become_power_spectral_densities(put):
    """A line of amplitude A reads A: its PSD is A^2 / 2 over the noise bandwidth."""
    found = qb.read_waterfall(put(LONG))["radial_torque"]
    s, f = np.array([1.0, 2.0, 3.0]), np.array([5.0, 10.0, 15.0])
    amplitude = 0.1 * s[:, None] + f
    assert found["speed"].to_numpy() == pytest.approx(2 * np.pi * s)
    assert found.to_numpy() == pytest.approx(0.5 * amplitude**2 / (1.5 * 5.0))


@pytest.mark.parametrize(
    ("unit", "psd"),
    [
        ("N^2/Hz", 3.0),
        ("N_rms^2/Hz", 3.0),
        ("mN/Hz^0.5", 9e-6),
        ("N_rms/sqrt(Hz)", 9.0),
        ("N/√Hz", 9.0),
        ("N^2", 3.0 / 15.0),  # over the noise bandwidth of Hann's window, 1.5 bins of 10 Hz
        ("mN_rms", 9e-6 / 15.0),
        ("N_peak", 9.0 / 2 / 15.0),
        ("N pk", 9.0 / 2 / 15.0),
        ("N_pp", 9.0 / 8 / 15.0),
    ],
)
def test_a_value_is_what_its_unit_says(put, unit, psd):
    text = MATRIX.replace("mN^2/Hz", unit).replace("600, 1", "600, 3")
    found = qb.read_waterfall(put(text))["radial_force"]
    assert found.to_numpy()[0, 0] == pytest.approx(psd)


def test_an_amplitude_is_asked_about_as_hertz_squared_is(put):
    for unit, text in (("N", MATRIX.replace("mN^2/Hz", "N")), ("N*m", LONG.replace("_peak", ""))):
        with pytest.raises(MapError) as told:
            qb.read_waterfall(put(text))
        assert f"write {unit}_peak or {unit}_rms; got '{unit}'" in str(told.value)


def test_amplitudes_without_a_window_are_read_by_the_one_that_is_found(put):
    """Tukey's window has a noise bandwidth of 1.10 bins, Hann's, which stands in, of 1.5."""
    rpm = np.arange(600, 3001, 200)
    frequency, psd = map_of(((1.0, 1e-6),), ("tukey", 0.25), 1e-4, rpm)
    width = LineShape("tukey 0.25", 1024).noise_bandwidth
    rows = [
        ",".join(f"{v:.6e}" for v in (speed, *np.sqrt(row * width)))
        for speed, row in zip(rpm, psd, strict=True)
    ]
    head = "# component: radial_force\n# unit: N_rms\n# speed_unit: rpm\n"
    text = head + ",".join(map(str, ["speed", *frequency])) + "\n" + "\n".join(rows)
    fitted = qb.fit_waterfall(put(text))
    found = fitted.components["radial_force"]
    assert found.window.name == "tukey 0.25"
    assert found.orders[0].coefficient.value == pytest.approx(1e-6, rel=1e-3)
    assert "radial_force: window: none is declared; lines have the shape" in fitted.notes[0]
    with pytest.raises(FitError, match="radial_force: window: 'hann' is declared"):
        qb.fit_waterfall(put(text.replace("# speed_unit", "# window: hann\n# speed_unit")))


def test_netcdf_is_read_with_its_units(tmp_path):
    psd = np.arange(12.0).reshape(3, 4) + 1
    file = netcdf(tmp_path / "map.nc", psd, [0.0, 1.0, 2.0, 3.0], sample_rate="10 Hz")
    found = qb.read_waterfall(file)["radial_force"]
    assert found.to_numpy() == pytest.approx(psd)
    assert found["speed"].to_numpy() == pytest.approx(2 * np.pi * TURNS[:3])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("# component: radial_force", "", "component: expected one of radial_force"),
        ("mN^2/Hz", "kg", r"unit: .*in N\^2/Hz .* amplitude in N_rms or N_peak, got 'kg'"),
        ("mN^2/Hz", "mN", "unit: .* peak or its root mean square. write mN_peak or mN_rms; got"),
        ("mN^2/Hz", "N^2*s/rad", "unit: expected a power spectral density"),
        ("# speed_unit: rpm", "", "speed_unit: expected a unit, such as rad/s, got none"),
        ("speed_unit: rpm", "speed_unit: Hz", "turns or radians"),
        ("window: hann", "window: hen", "window: expected 'none' or a window .*, got 'hen'"),
        ("window: hann", "window: tukey x", r"window: expected .* tukey 0.25, got 'tukey x'"),
        ("sample_rate: 200", "sample_rate: 60", "at most 30 Hz, the Nyquist .*, got 40"),
        ("1200, 5", "400, 5", "speed: expected ascending values, got 400 after 600"),
        ("600, 1", "0, 1", "speed: expected numbers above 0, got 0"),
        ("10, 20, 30", "10, 30, 20", "frequency: expected ascending values, got 20 after 30"),
        ("30, 40", "30, 50", "evenly spaced"),
        ("5, 6, 7", "5, -6, 7", r"column 3 \(line 8\): expected a number of at least 0, got '-6'"),
        ("5, 6, 7", "5, nan, 7", r"column 3 \(line 8\): .* at least 0, got 'nan'"),
        ("5, 6, 7", "5, 7", r"line 8: expected 5 cells, got 4"),
        ("5, 6, 7", "5, x, 7", r"column 3 \(line 8\): expected a number of at least 0, got 'x'"),
        ("window: hann", "windw: hann", r"line 4: unknown key 'windw'; did you mean 'window'"),
        ("window: hann", "unit: N", r"unit \(line 4\): this key appears twice"),
        ("1800, 9, 10, 11, 12\n", "", "speed: expected at least three, got 2"),
    ],
)
def test_a_wrong_matrix_is_told(put, old, new, message):
    assert MATRIX.count(old) == 1
    with pytest.raises(MapError, match=message):
        qb.read_waterfall(put(MATRIX.replace(old, new)))


def test_other_wrong_files_are_told(put, tmp_path):
    with pytest.raises(MapError, match="no such file"):
        qb.read_waterfall(tmp_path / "nowhere.csv")
    with pytest.raises(MapError, match="got no map"):
        qb.read_waterfall(put(""))
    with pytest.raises(MapError, match="every speed with every frequency; 1 are missing"):
        qb.read_waterfall(put(LONG.rpartition("\n")[0]))
    with pytest.raises(MapError, match="stand here twice"):
        qb.read_waterfall(put(LONG + "\nradial_torque,1,5,3"))
    with pytest.raises(MapError, match="unknown column 'amount'"):
        qb.read_waterfall(put(LONG.replace("value", "amount")))
    with pytest.raises(MapError, match=r"value \(line \d+\): expected a number of at least 0"):
        qb.read_waterfall(put(LONG + "\nradial_torque,1,20,inf"))
    with pytest.raises(MapError, match="is a folder; expected the file of a map"):
        qb.read_waterfall(tmp_path)
    wrong = netcdf(tmp_path / "a.nc", np.ones((3, 4)), np.arange(4.0), name="thrust")
    with pytest.raises(MapError, match=r"expected variables among radial_force.*got thrust"):
        qb.read_waterfall(wrong)
    wrong = netcdf(tmp_path / "b.nc", np.ones((3, 4)), np.arange(4.0), units="N*m")
    with pytest.raises(MapError, match="or an amplitude in N_rms or N_peak, got"):
        qb.read_waterfall(wrong)


def test_a_long_file_of_something_else_is_told_in_a_few_lines(put):
    with pytest.raises(MapError, match="and 994 problems more") as told:
        qb.read_waterfall(put("what\n" + "ever\n" * 999))
    assert len(str(told.value).splitlines()) == 6


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    frequency, psd = spectra(LINES, (230.0, 0.02, 0.0), TURNS, 1e-9, seconds=16.0)
    return netcdf(tmp_path_factory.mktemp("maps") / "wheel.nc", psd, frequency)


@pytest.fixture(scope="module")
def fitted(file):
    return qb.fit_waterfall(file)


def test_a_fit_is_a_disturbance_that_a_scenario_takes(fitted):
    block, _ = read_yaml(fitted.to_yaml(), "fit")
    zhang = qb.load_scenario("zhang2012").to_dict()
    zhang["cluster"]["rotor"] |= block
    found = qb.Scenario.from_dict(zhang).cluster.rotor.disturbance
    assert [line.order for line in found.orders] == pytest.approx([1.0, 2.0, 3.87], rel=1e-4)
    assert found.orders[0].order == 1.0  # whole to the last digit: it adds to the imbalance's
    for line, (_, coefficient, _) in zip(found.orders, LINES, strict=True):
        assert line.radial_force == pytest.approx(coefficient, rel=0.01)
    assert found.resonances.radial.frequency == pytest.approx(230.0, rel=0.01)
    assert set(found.broadband.given()) == {"radial_force"}


def test_a_floor_that_the_mode_does_not_shape_comes_back_at_the_mount(fitted):
    """The scenario's noise arises at the rotor; through the mode its mean level is the map's."""
    each = fitted.components["radial_force"]
    assert not each.floor_at_rotor
    f = each.floor_frequency
    d = 2j * 0.02 * f / 230.0
    passed = np.abs((1 + d) / (1 + d - (f / 230.0) ** 2)) ** 2
    assert each.rotor_floor(each.modes) * passed == pytest.approx(each.floor, rel=0.05)


def test_orders_of_components_are_one_where_they_agree(fitted):
    force = fitted.components["radial_force"]
    both = WaterfallFit({"radial_force": force, "axial_force": force}).disturbance()
    assert len(both["orders"]) == 3
    assert all(o["radial_force"] == o["axial_force"] for o in both["orders"])


def test_maps_of_a_fit_are_labelled(fitted):
    maps = fitted.to_dataset()
    ratio = maps["radial_force_measured"] / maps["radial_force_fitted"]
    assert maps["radial_force_residual"].to_numpy() == pytest.approx(
        10 * np.log10(ratio.to_numpy())
    )
    assert maps["radial_force_measured"].attrs["units"] == "N^2/Hz"


def run(*arguments, capsys):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["quietbus", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
    captured = capsys.readouterr()
    return stopped.value.code or 0, captured.out, captured.err


def test_command_fit_writes_numbers_pictures_and_the_block(file, fitted, tmp_path, capsys):
    code, out, _ = run("fit", file, "-o", tmp_path, capsys=capsys)
    assert code == 0
    assert "Orders of the radial force" in out
    assert "230 Hz" in out
    assert (tmp_path / "disturbance.yaml").read_text() == fitted.to_yaml()
    for name in ("waterfall", "lines"):
        assert (tmp_path / f"{name}-radial_force.png").stat().st_size > 10_000
    code, out, err = run("fit", file, "--json", capsys=capsys)
    assert (code, err) == (0, "")
    assert json.loads(out) == json.loads((tmp_path / "fit.json").read_text())
    order = json.loads(out)["components"]["radial_force"]["orders"][0]["order"]
    assert order["value"] == pytest.approx(1.0, abs=5 * order["deviation"])


def test_command_import_prints_or_writes_the_block(put, tmp_path, capsys):
    table = put("1.0,9e-8\n2.5,1e-9\n", "radial_force.csv")
    code, out, err = run("import", table, capsys=capsys)
    assert code == 0
    assert err.startswith("note: S2E turns its lines against the rotor")
    block, _ = read_yaml(out, "import")
    assert block == {"disturbance": qb.read_wheel_table(table).to_dict()}
    code, out, _ = run("import", table, "-o", tmp_path / "d.yaml", capsys=capsys)
    assert code == 0
    assert read_yaml((tmp_path / "d.yaml").read_text(), "import")[0] == block


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("import", "nowhere.csv"), "nowhere.csv: no such file"),
        (("import", "nowhere.csv", "--kind", "radial"), "--kind: expected one of radial_force"),
        (("fit", "nowhere.nc"), "nowhere.nc: no such file"),
    ],
)
def test_wrong_input_is_one_message(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*arguments, capsys=capsys)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


def test_a_map_without_lines_is_bad_input(tmp_path, capsys):
    frequency, psd = spectra((), None, TURNS[:12], 1e-9, seconds=8.0)
    file = netcdf(tmp_path / "noise.nc", psd, frequency)
    code, _, err = run("fit", file, "-o", tmp_path / "out", capsys=capsys)
    assert code == 2
    assert "radial_force: no order stands out" in err
    assert not (tmp_path / "out").exists()  # not even an empty folder


def test_a_second_mode_is_told_and_left_out_of_the_block(tmp_path, capsys):
    rpm = np.linspace(600, 6000, 40)
    lines, modes = ((1.0, 1e-6), (2.0, 3e-7), (4.42, 1.5e-7)), ((110.0, 0.02), (190.0, 0.03))
    frequency, psd = map_of(lines, "hann", 1e-3, rpm, modes, seconds=8)
    map_ = netcdf(tmp_path / "two.nc", psd, frequency, turns=rpm / 60)
    code, out, err = run("fit", map_, "--json", capsys=capsys)
    found = json.loads(out)
    assert code == 0
    both = found["components"]["radial_force"]["modes"]
    assert [mode["frequency_hz"]["value"] for mode in both] == pytest.approx([110, 190], rel=1e-3)
    kept = found["disturbance"]["resonances"]["radial"]
    assert kept["frequency"] == pytest.approx(110, rel=1e-3)
    # at its peak the other passes on 1 / (2 damping), and a little
    assert "the mode at 190 Hz is left out, which changes lines by up to a factor of 1" in err
    assert found["notes"][0] in err
