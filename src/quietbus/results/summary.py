"""The numbers of a run that an engineer asks for first, and what has to be known of them."""

import dataclasses
from dataclasses import dataclass

import numpy as np
import xarray as xr

from quietbus.analysis.signals.residual import residual, shows
from quietbus.results.origin import method_of, scenario_of
from quietbus.results.schema import WORST_PHASES
from quietbus.scenario import Scenario


@dataclass(frozen=True)
class Summary:
    """The numbers of a run that an engineer asks for first."""

    residual_rate: np.ndarray | None  # (3,) [rad/s] peak jitter per axis at the end of the run
    residual_rate_rms: np.ndarray | None  # (3,) [rad/s]
    worst_phases_rate: np.ndarray | None  # (3,) [rad/s] the lines' peak, any rotor phases
    slow_rate: np.ndarray | None  # (3,) [rad/s] peak of the slow motion in the same window
    residual_note: str  # over which time, or why there is none
    pointing_error: float  # [rad] largest norm of the attitude error in the last second
    peak_gimbal_rate: float  # [rad/s]
    peak_stroke: float  # [m]
    peak_strut_force: float  # [N]
    minimum_singularity: float  # [-]
    peak_control_torque: float  # [N m] asked for
    minimum_torque_share: float | None  # [-] of it that was delivered, where units act
    rotor_speeds: np.ndarray | None  # (2,) [rad/s] least and largest, where speeds change
    peak_rotor_torque: float | None  # [N m] likewise

    def to_dict(self) -> dict[str, object]:
        """Numbers and lists, for JSON."""
        fields = dataclasses.asdict(self).items()
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields}


def with_worst_phases(run: xr.Dataset, rate: np.ndarray | None) -> xr.Dataset:
    """A direct run with its jitter for the worst rotor phases, where that is known.

    Args:
        rate: (3,) [rad/s], as of ``quietbus.worst_over_phases``.
    """
    if rate is None or method_of(run).jitter_apart:
        return run
    meaning = "sum of the amplitudes of the bus rate's lines at the end, any rotor phases"
    described = {"units": "rad/s", "long_name": meaning}
    return run.assign({WORST_PHASES: (("axis",), rate, described)})


def summarize(run: xr.Dataset) -> Summary:
    """The numbers of a run (see ``Summary``).

    Raises:
        TypeError, ValueError: not a run.
    """
    scenario = scenario_of(run)
    worst_phases_rate = run[WORST_PHASES].to_numpy() if WORST_PHASES in run else None
    time = run["time"].to_numpy()
    peak = lambda name: float(np.max(np.abs(run[name].to_numpy())))  # noqa: E731
    error = np.linalg.norm(run["attitude_error"].to_numpy(), axis=1)
    jitter = rms = slow = None
    note = "not shown: the output rate is too low for the rotors"
    if method_of(run).jitter_apart:
        last = time >= time[-1] - 1.0
        jitter = run["bus_rate_jitter_envelope"].to_numpy()[last].max(axis=0)
        rms = run["bus_rate_jitter_rms"].to_numpy()[last].max(axis=0)
        slow = np.abs(run["bus_rate"].to_numpy()[last]).max(axis=0)
        worst_phases_rate = run["bus_rate_jitter_worst_case"].to_numpy()[last].max(axis=0)
        note = f"envelope from t = {time[last][0]:.4g} s to {time[-1]:.4g} s"
        if "bus_rate_noise_rms" in run:
            note += "; the rotors' noise is in the RMS alone"
    elif not aliasing(scenario):
        try:
            rest = residual(time, run["bus_rate"].to_numpy())
            jitter, rms, slow = rest.jitter_peak, rest.jitter_rms, rest.slow
            note = f"from t = {rest.window[0]:.4g} s to {rest.window[1]:.4g} s"
        except ValueError as too_short:
            note = str(too_short)
    changing = "rotor_torque" in run
    speed = run["rotor_speed"].to_numpy() if changing else np.zeros(1)
    return Summary(
        residual_rate=jitter,
        residual_rate_rms=rms,
        worst_phases_rate=worst_phases_rate,
        slow_rate=slow,
        residual_note=note,
        pointing_error=float(np.max(error[time >= time[-1] - 1.0])),
        peak_gimbal_rate=peak("gimbal_rate"),
        peak_stroke=peak("leg_stroke"),
        peak_strut_force=peak("leg_force"),
        minimum_singularity=float(run["singularity_measure"].min()),
        peak_control_torque=float(np.max(np.linalg.norm(run["control_torque"].to_numpy(), axis=1))),
        minimum_torque_share=float(run["torque_share"].min()) if "torque_share" in run else None,
        rotor_speeds=np.array([speed.min(), speed.max()]) if changing else None,
        peak_rotor_torque=peak("rotor_torque") if changing else None,
    )


def rotor_notes(run: xr.Dataset) -> list[str]:
    """What the user has to know of rotors whose speed changed, in words.

    Wheels at their limits, and speeds at which the output no longer shows the rotors' lines.
    """
    said: list[str] = []
    if "rotor_torque" not in run:
        return said
    scenario, time = scenario_of(run), run["time"].to_numpy()
    speeds = np.abs(run["rotor_speed"].to_numpy())
    if not method_of(run).jitter_apart and not aliasing(scenario):
        said += filter(None, [aliasing(scenario, float(speeds.max()))])
    units = scenario.units
    for j, wheel in units.wheels:
        limit = wheel.motor and wheel.motor.speed_limit
        reached = time[speeds[:, j] >= (1.0 - 1e-6) * (limit or np.inf)]
        if reached.size and not units.run_up:
            said.append(
                f"wheel {j} reached its speed limit of {limit:.5g} rad/s at t = "
                f"{reached[0]:.4g} s: there it gives no torque that would take it further, and the "
                "satellite does not feel all that the control asks for"
            )
    if "torque_share" in run and not units.gimbals_turn:
        share = run["torque_share"].to_numpy()
        cut = time[share < 1.0 - 1e-6]
        if cut.size:
            said.append(
                f"the wheels' limits cut the torque to {100 * share.min():.3g} % of what was "
                f"asked for at the least, first at t = {cut[0]:.4g} s, in "
                f"{100 * cut.size / time.size:.3g} % of the outputs"
            )
    return said


def aliasing(scenario: Scenario, speed: float = 0.0) -> str:
    """Why the output rate cannot show the rotors' lines, or an empty text if it can.

    Args:
        speed: [rad/s] that a rotor has reached, if that is more than the scenario says.
    """
    fastest = max(speed, *scenario.units.fastest) / (2.0 * np.pi)
    rate = scenario.simulation.output_rate
    if shows(rate, fastest):
        return ""
    return (
        f"the output rate of {rate:g} Hz cannot show the rotors' {fastest:g} Hz: at least "
        f"{2.56 * fastest:g} Hz is needed, {10 * fastest:g} Hz shows it well. The motion is "
        "integrated with every turn resolved, but jitter in the output is aliased"
    )
