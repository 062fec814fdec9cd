"""Tables of what was fitted to a measured map."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from quietbus.tables.parts import titled

if TYPE_CHECKING:
    from collections.abc import Iterator

    from quietbus.analysis.signals.waterfall import FittedMode
    from quietbus.measured import WaterfallFit


def fit_tables(fitted: WaterfallFit) -> Iterator[Table]:
    """Fitted numbers of each component of a measured map, with their standard deviations."""
    for name, each in fitted.components.items():
        unit = "kg m" if name.endswith("force") else "kg m^2"
        table = titled(f"Orders of the {name.replace('_', ' ')}")
        columns = ("order", "+-", f"coefficient\n{unit}", "+- %", "whirl", "speeds", "explained\n%")
        for column in columns:
            table.add_column(column, justify="left" if column == "whirl" else "right")
        splits = any(mode.split for mode in each.modes)
        for line, speeds, share in zip(
            each.orders, each.line_speed, each.explained.by_order[:-1], strict=True
        ):
            relative = line.coefficient.relative
            table.add_row(
                f"{line.order.value:.4f}" + ("?" if line.doubt else ""),
                f"{line.order.deviation:.1e}",
                f"{line.coefficient.value:.3e}",
                "unknown" if relative is None else f"{100.0 * relative:.2g}",
                line.whirl if splits else "",
                str(len(speeds)),
                f"{100.0 * share:.3g}",
            )
        said = [_mode_text(mode) for mode in each.modes]
        said.append(f"lines: measured over fitted, RMS error {100.0 * each.line_error:.2g} %")
        said.append(f"misfit {each.misfit:.2g} of the spectra's scatter")
        said.append(f"{100.0 * each.explained.total:.3g} % of the power explained")
        table.caption = "; ".join(said)
        yield table


def _mode_text(mode: FittedMode) -> str:
    def near(deviation: float | None) -> str:
        return "+- unknown" if deviation is None else f"+- {deviation:.1g}"

    said = (
        f"mode: {mode.frequency.value:.5g} Hz ({near(mode.frequency.deviation)}), "
        f"damping {mode.damping.value:.4g} ({near(mode.damping.deviation)})"
    )
    if mode.split is None:
        return said
    split = mode.split
    return f"{said}, spin over transverse inertia {split.value:.4g} ({near(split.deviation)})"
