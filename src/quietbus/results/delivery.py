"""What the units make of the torque that the control asks for, in words."""

import numpy as np
import xarray as xr

from quietbus.results.origin import scenario_of

ENOUGH = 0.9  # of the torque asked for, less is told
LONG = 1.0  # [s] if it lasts longer than this
AT_LIMIT = 0.99  # of the gimbals' rate limit
NEAR = 0.1  # singularity measure of a cluster that is surely near a singular set


def delivery_notes(run: xr.Dataset) -> list[str]:
    """The longest time in which the units gave less than ENOUGH of what was asked for, if LONG."""
    if "torque_share" not in run:
        return []
    time, share = run["time"].to_numpy(), run["torque_share"].to_numpy()
    short = share < ENOUGH
    edges = np.flatnonzero(np.diff(np.concatenate([[0], short, [0]])))
    stretches = [(first, end - 1) for first, end in edges.reshape(-1, 2)]
    if not stretches:
        return []
    first, last = max(stretches, key=lambda ends: time[ends[1]] - time[ends[0]])
    lasting = time[last] - time[first]
    if lasting <= LONG * (1.0 + 1e-9):
        return []
    here = slice(first, last + 1)
    asked = np.linalg.norm(run["control_torque"].to_numpy()[here], axis=1)
    delivered = float(np.mean(asked * share[here]))
    return [
        f"from t = {time[first]:.4g} s to {time[last]:.4g} s the satellite felt less than "
        f"{100 * ENOUGH:g} % of the torque asked for: {np.mean(asked):.3g} N m were asked for, "
        f"{delivered:.2g} N m delivered along them (means; torque_share at the least "
        f"{100 * share[here].min():.3g} %). {_cause(run.isel(time=here))}"
    ]


def _cause(stretch: xr.Dataset) -> str:
    units = scenario_of(stretch).units
    if not units.gimbals_turn:
        return "The wheels are at their torque or speed limits"
    fastest = np.max(np.abs(stretch["gimbal_rate"].to_numpy()), axis=0)
    measure = float(stretch["singularity_measure"].min())
    said = []
    if np.any(fastest > AT_LIMIT * units.gimbal_rate_limits):
        said.append("The gimbals are at their rate limit")
    if units.wheels:
        said.append("Wheels may be at their torque or speed limits")
    if not said or measure < NEAR:
        said.append(
            f"The gimbals are near a singular set (singularity_measure down to {measure:.2g}), "
            "where the steering law gives little along one direction, and may stay there: start "
            "from other gimbal angles, or turn another way"
        )
    return ". ".join(said)
