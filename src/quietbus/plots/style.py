"""How the pictures look: colours, line styles, axes, and lines that hide no peak."""

import contextlib
import pathlib
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quietbus.words import file_name
from quietbus.writing import replacing

# Okabe and Ito's colours, told apart by colour-blind readers too, without the pale yellow
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (1.5, 1)))  # told apart in black and white
WIDTH = 7.5  # [in] of a figure, two columns of a journal
LINE = 88  # [letters] of a title
MARKERS = ("o", "s", "^")
BINS = 1200  # of a long line, one for each dot of its width
_RC: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.xmargin": 0.01,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "grid.color": "0.88",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
}


@contextlib.contextmanager
def style() -> Iterator[None]:
    """The settings under which figures are made."""
    with mpl.rc_context(_RC):
        yield


def literal(text: str) -> str:
    """Text in which a user's dollar signs are dollar signs, not the bounds of a formula."""
    return text.replace("$", r"\$")


def new_figure(height: float, title: str) -> Figure:
    """An empty figure of the usual width, ``height`` [in]; the title's letters mean themselves."""
    figure = Figure(figsize=(WIDTH, height), dpi=150)
    figure.set_layout_engine("constrained", w_pad=0.08, h_pad=0.05)
    title = textwrap.fill(title, LINE, break_on_hyphens=False)
    figure.suptitle(literal(title), fontsize=10.5, fontweight="bold", x=0.01, ha="left")
    return figure


def save_figures(
    figures: dict[str, Figure], directory: str | pathlib.Path, suffix: str = ".png"
) -> list[pathlib.Path]:
    """Write figures as ``directory/name.suffix``: PNG at 150 dpi, or SVG or PDF.

    Letters of a name that a file's name should not have become dashes.

    Raises:
        ValueError: another suffix.
        OutputError: (an OSError) a picture cannot be written.
    """
    if suffix not in (".png", ".svg", ".pdf"):
        raise ValueError(f"suffix must be .png, .svg or .pdf; got {suffix!r}")
    folder = pathlib.Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    names: dict[str, None] = {}  # of the files, no two alike
    for name in map(file_name, figures):
        alike = sum(other.rpartition("~")[0] == name or other == name for other in names)
        names[f"{name}~{alike + 1}" if alike else name] = None
    paths = [folder / f"{name}{suffix}" for name in names]
    for path, figure in zip(paths, figures.values(), strict=True):
        with replacing(path, f"{suffix} picture") as file, _laid_out(figure):
            figure.savefig(file, format=suffix[1:])
    return paths


@contextlib.contextmanager
def _laid_out(figure: Figure) -> Iterator[None]:
    """With all in its place, which saving would find out by drawing the figure once for nothing."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
    try:
        yield
    finally:
        figure.set_layout_engine(engine)


def envelope(
    time: np.ndarray, values: np.ndarray, bins: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean time, minimum and maximum of ``values`` in consecutive stretches of samples.

    Args:
        time: (n,).
        values: (n,).
        bins: number of stretches, n at most.
    """
    starts = np.linspace(0, len(time), bins, endpoint=False).astype(int)
    counts = np.diff(starts, append=len(time))
    return (
        np.add.reduceat(time, starts) / counts,
        np.minimum.reduceat(values, starts),
        np.maximum.reduceat(values, starts),
    )


def draw_line(axes: Axes, time: np.ndarray, values: np.ndarray, **look: Any) -> None:
    """A line, or for more samples than can be seen its middle in a pale band from peak to peak.

    A vibration much faster than the picture's resolution stays a band of its full height, and
    lines that vibrate across each other stay distinct.
    """
    if len(time) > 2 * BINS:
        time, low, high = envelope(time, values, BINS)
        axes.fill_between(time, low, high, color=look.get("color"), alpha=0.25, linewidth=0.0)
        values = 0.5 * (low + high)
    axes.plot(time, values, **look)


def draw_lines(axes: Axes, time: np.ndarray, values: np.ndarray, labels: Sequence[str]) -> None:
    """One line for each column of ``values`` (n, line), each with its colour and dashes."""
    for i, label in enumerate(labels):
        draw_line(
            axes,
            time,
            values[:, i],
            color=COLOURS[i % len(COLOURS)],
            linestyle=DASHES[i % len(DASHES)],
            label=label,
        )


def share_legend(figure: Figure, axes: Axes) -> None:
    """One legend below the figure for the lines of ``axes``."""
    handles, labels = axes.get_legend_handles_labels()
    if len(labels) > 1:
        columns = _columns(labels, float(figure.get_figwidth()))
        figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def _columns(labels: Sequence[str], width: float) -> int:
    """Columns of a legend, up to 8, that fit into ``width`` [in]."""
    em = _RC["font.size"] / 72.0
    beside = _RC["legend.handlelength"] + 0.8 + 2.0  # line, gap, distance of columns

    def needed(columns: int) -> float:
        parts = np.array_split(np.array([len(label) for label in labels]), columns)
        return em * sum(beside + 0.55 * part.max() for part in parts)

    return next((n for n in range(min(len(labels), 8), 1, -1) if needed(n) <= width), 1)


def explain(axes: Axes, reason: str, columns: int = 70) -> None:
    """Say in an empty picture why it is empty, in lines of at most so many letters."""
    text = textwrap.fill(reason, columns)
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="0.3")
    axes.set(xticks=[], yticks=[])


def scaled(peak: float, unit: str) -> tuple[float, str]:
    """Factor and unit for values up to ``peak``: 3e-4 deg/s is 300 of 10^-6 deg/s."""
    if not (np.isfinite(peak) and peak > 0.0):
        return 1.0, unit
    exponent = 3 * int(np.floor(np.log10(peak) / 3.0 + 1e-9))
    return (1.0, unit) if exponent == 0 else (10.0**-exponent, rf"$10^{{{exponent}}}$ {unit}")


def span_text(low: float, high: float, digits: int) -> str:
    """Two numbers as a range; one number where they read alike: "18", not "18 to 18"."""
    first, last = f"{low:.{digits}g}", f"{high:.{digits}g}"
    return first if first == last else f"{first} to {last}"
