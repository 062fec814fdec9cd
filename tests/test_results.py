"""Runs as labelled data: names, units, provenance, files, summary numbers."""

import json

import numpy as np
import pytest
import xarray as xr

import quietbus as qb
from quietbus.analysis.signals.residual import residual

CONTRACT = {  # variable: (dimensions, unit), design/interface.md
    "bus_position": (("time", "axis"), "m"),
    "bus_velocity": (("time", "axis"), "m/s"),
    "bus_attitude": (("time", "quaternion"), "1"),
    "bus_rate": (("time", "axis"), "rad/s"),
    "platform_position": (("time", "axis"), "m"),
    "platform_attitude": (("time", "quaternion"), "1"),
    "platform_rate": (("time", "axis"), "rad/s"),
    "gimbal_angle": (("time", "cmg"), "rad"),
    "gimbal_rate": (("time", "cmg"), "rad/s"),
    "rotor_angle": (("time", "cmg"), "rad"),
    "rotor_speed": (("time", "cmg"), "rad/s"),
    "leg_stroke": (("time", "leg"), "m"),
    "leg_force": (("time", "leg"), "N"),
    "control_torque": (("time", "axis"), "N m"),
    "attitude_error": (("time", "axis"), "rad"),
    "singularity_measure": (("time",), "1"),
}


@pytest.fixture(scope="module")
def run():
    return qb.simulate("zhang2012", duration=1.0)


def test_variables_have_the_names_dimensions_and_units_of_the_contract(run):
    for name, (dimensions, unit) in CONTRACT.items():
        assert run[name].dims == dimensions, name
        assert run[name].attrs["units"] == unit, name
        assert run[name].attrs["long_name"], name
    assert list(run.axis.values) == ["x", "y", "z"]
    assert list(run.quaternion.values) == ["w", "x", "y", "z"]
    assert (run.sizes["cmg"], run.sizes["leg"]) == (4, 6)
    np.testing.assert_allclose(run.time, np.arange(1001) / 1000.0)


def test_attitude_starts_where_the_scenario_says(run):
    """3-2-1 sequence, angles given as [roll, pitch, yaw]; scalar-first quaternion."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = run.bus_attitude[0].values
    yaw, pitch, roll = Rotation.from_quat([x, y, z, w]).as_euler("ZYX", degrees=True)
    np.testing.assert_allclose([roll, pitch, yaw], 1.5, rtol=1e-12)


def test_control_torque_follows_the_contract_s_law(run):
    """-(Kp e + Ki int e + Kd w), e twice the vector part of the shortest error quaternion."""
    quaternion = run.bus_attitude.values
    e = 2.0 * np.sign(quaternion[:, :1]) * quaternion[:, 1:]
    integral = np.concatenate([np.zeros((1, 3)), np.cumsum((e[1:] + e[:-1]) / 2000.0, axis=0)])
    torque = -(200.0 * e + 0.1 * integral + 2500.0 * run.bus_rate.values)
    np.testing.assert_allclose(run.attitude_error, e, atol=1e-14)
    np.testing.assert_allclose(run.control_torque, torque, atol=1e-7)


def test_provenance_is_in_the_run(run):
    assert qb.scenario_of(run).simulation.duration == 1.0
    assert run.attrs["status"] == "complete"
    assert run.attrs["method"] == "direct"
    assert "Dopri8" in run.attrs["solver"]
    assert run.attrs["relative_tolerance"] == 1e-8
    assert run.attrs["quietbus_version"]


def test_run_comes_back_from_its_file_as_it_was(run, tmp_path):
    qb.save_run(run, tmp_path / "run.nc")
    assert qb.load_run(tmp_path / "run.nc").identical(run)
    assert [path.name for path in tmp_path.iterdir()] == ["run.nc"]


def test_file_that_is_no_run_is_refused_by_name(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.nc: no such file"):
        qb.load_run(tmp_path / "nothing.nc")
    (tmp_path / "text.nc").write_text("not NetCDF")
    with pytest.raises(ValueError, match=r"text\.nc: not a NetCDF-4 file"):
        qb.load_run(tmp_path / "text.nc")
    xr.Dataset({"a": 1.0}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(ValueError, match="not a run of quietbus"):
        qb.load_run(tmp_path / "other.nc")


def test_summary_holds_the_largest_values_and_goes_into_json(run):
    summary = qb.summarize(run)
    assert summary.peak_strut_force == np.abs(run.leg_force).max()
    assert summary.minimum_singularity == run.singularity_measure.min()
    assert summary.pointing_error == pytest.approx(np.linalg.norm(run.attitude_error, axis=1).max())
    assert json.loads(json.dumps(summary.to_dict()))["peak_stroke"] == summary.peak_stroke


def test_residual_separates_a_line_from_slow_motion():
    """A 100 Hz line of known size on a decaying exponential as the loop leaves it."""
    t = np.arange(0.0, 10.0, 1e-3)
    slow = 1e-3 * np.exp(-0.08 * t)
    line = 2e-6 * np.sin(2.0 * np.pi * 100.0 * t + 0.25 * np.pi)
    rest = residual(t, np.column_stack([slow + line, slow]))
    assert rest.jitter_peak[0] == pytest.approx(2e-6, rel=3e-3)  # no sample falls on the peak
    assert rest.jitter_rms[0] == pytest.approx(2e-6 / np.sqrt(2.0), rel=1e-3)
    assert rest.jitter_peak[1] < 1e-10  # nothing but slow motion
    assert rest.slow[1] == pytest.approx(1e-3 * np.exp(-0.08 * 9.25), rel=1e-3)


def test_residual_of_too_few_samples_is_refused():
    with pytest.raises(ValueError, match="the last 1 s hold 6 samples, a residual needs 8"):
        residual(np.arange(20) / 5.0, np.zeros((20, 1)))


def test_residual_of_a_run_shorter_than_its_window_is_refused():
    """A cubic over a few turns would eat the line and show too little jitter."""
    with pytest.raises(ValueError, match=r"the run lasts 0\.02 s, a residual is of the last 1 s"):
        residual(np.arange(21) / 1000.0, np.zeros((21, 1)))


def test_joint_forces_are_given_when_asked_for():
    forces = qb.simulate("zhang2012", duration=0.02, joint_forces=True)
    assert forces.spherical_force.dims == ("time", "leg", "axis")
    assert forces.universal_moment.attrs["units"] == "N m"
    with pytest.raises(ValueError, match="joint_forces needs mount 'isolated'"):
        qb.simulate("zhang2012", mount="rigid", joint_forces=True)


def test_unknown_method_and_mount_are_refused_by_name():
    with pytest.raises(ValueError, match=r"'direct', 'harmonic', .* got 'magic'"):
        qb.simulate("zhang2012", method="magic")
    with pytest.raises(ValueError, match="'isolated', 'rigid', got 'soft'"):
        qb.simulate("zhang2012", mount="soft")
