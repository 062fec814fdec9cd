"""Pictures of the jitter of a harmonic run, which holds its amplitudes instead of its time."""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from plotly.subplots import make_subplots

from quietbus.plots.signals import AXES
from quietbus.plots.style import COLOURS
from quietbus.report.lines import Drawing, Panel, Picture, finished
from quietbus.results.motion import degrees, last_lines

# variable of a harmonic run: what its line is called
COMBINED = {
    "bus_rate_jitter_envelope": "envelope",
    "bus_rate_jitter_worst_case": "worst case",
    "bus_rate_jitter_rss": "root sum square",
    "bus_rate_jitter_rms": "RMS",
}
_DECADES = 6.0  # what is smaller is rounding


def harmonic_pictures(run: xr.Dataset) -> Iterator[Drawing | Picture]:
    """Combined jitter over time, and the amplitudes of its lines at the end."""
    yield _combined(run)
    yield _bars(run)


def _combined(run: xr.Dataset) -> Drawing:
    names = [name for name in COMBINED if name in run]
    values = np.stack([degrees(run.transpose("time", ...), name) for name in names], axis=1)
    meanings = [f"{COMBINED[name]}: {run[name].attrs.get('long_name', name)}" for name in names]
    return Drawing(
        "envelope",
        "Jitter over time",
        f"Jitter of the bus rate, all rotors and orders together. {'; '.join(meanings)}.",
        run["time"].to_numpy(),
        [
            Panel(
                f"about {axis}",
                "deg/s",
                values[:, :, i],
                [COMBINED[name] for name in names],
                "tozero",
            )
            for i, axis in enumerate(AXES)
        ],
    )


def _bars(run: xr.Dataset) -> Picture:
    """Amplitudes at the end of the run by rotor and order, a panel for each axis."""
    last = run["bus_rate_jitter_amplitude"].isel(time=-1).transpose("cmg", "order", "axis")
    amplitude = np.rad2deg(last.to_numpy())
    frequency = np.abs(last_lines(run).frequency) / (2.0 * np.pi)
    orders = last["order"].to_numpy()
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for row, axis in enumerate(AXES, 1):
        for cmg in range(len(frequency)):
            figure.add_bar(
                x=[f"order {order:g}" for order in orders],
                y=amplitude[cmg, :, row - 1],
                name=f"rotor {cmg}",
                legendgroup=f"rotor {cmg}",
                showlegend=row == 1,
                marker_color=COLOURS[cmg % len(COLOURS)],
                customdata=frequency[cmg],
                hovertemplate=f"rotor {cmg}, about {axis}: %{{y:.4g}} deg/s<br>%{{x}}, "
                "%{customdata:.5g} Hz<extra></extra>",
                row=row,
                col=1,
            )
        figure.update_yaxes(title_text=f"about {axis} [deg/s]", row=row, col=1)
    peak = float(amplitude.max(initial=0.0))
    if peak > 0.0:
        figure.update_yaxes(
            type="log", dtick=1, range=[np.log10(peak) - _DECADES, np.log10(peak) + 0.3]
        )
    figure.update_xaxes(type="category")
    caption = "Amplitude of the bus rate's line of each rotor and order, at the end of the run."
    return Picture("lines", "Lines at the end", caption, finished(figure, rows=3))
