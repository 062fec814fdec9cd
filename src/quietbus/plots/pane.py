"""A drawing of things in space, along an axis or in perspective: the same calls for both."""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LETTERS = "xyz"
_BOX = {"boxstyle": "round,pad=0.1", "facecolor": "w", "edgecolor": "none", "alpha": 0.7}


class Pane(abc.ABC):
    """Axes on which points of space are drawn."""

    shows_all: bool  # whether there is room to name every part

    def __init__(self, axes: Any, size: float) -> None:
        self.axes = axes
        self.size = size  # [m] of what is drawn
        self.labels: list[tuple[np.ndarray, str, Any]] = []

    @abc.abstractmethod
    def seen(self, points: Any) -> np.ndarray:
        """(..., 2 or 3) coordinates on this pane."""

    @abc.abstractmethod
    def area(self, corners: np.ndarray, colour: str, alpha: float) -> None:
        """A flat polygon (n, 2 or 3) on this pane, without its edge."""

    @abc.abstractmethod
    def pointer(
        self, a: np.ndarray, b: np.ndarray, whole: float, colour: str, width: float
    ) -> None:
        """An arrow from a to b on this pane, as long as ``whole`` in space."""

    @abc.abstractmethod
    def write(
        self, place: np.ndarray, away: np.ndarray, text: str, shift: float, look: Any
    ) -> None:
        """A word beside a place on this pane, in a direction, by about ``shift``."""

    @abc.abstractmethod
    def bound(self, points: Any, margin: float) -> None:
        """Show these points, and all directions to one scale."""

    def line(self, points: Any, **look: Any) -> None:
        """A line through points (n, 3)."""
        self.axes.plot(*self.seen(points).T, **look)

    def fill(self, points: Any, colour: str, label: str | None = None, alpha: float = 0.2) -> None:
        """A flat polygon."""
        self.area(self.seen(points), colour, alpha)
        self.line([*points, points[0]], color=colour, linewidth=1.0, label=label)

    def arrow(self, start: Any, along: Any, colour: str, width: float = 1.6) -> None:
        """An arrow; none where it points at the viewer."""
        a, b = self.seen(start), self.seen(np.asarray(start) + np.asarray(along))
        whole = float(np.linalg.norm(along))
        if np.linalg.norm(b - a) >= 0.02 * max(whole, 1e-12):
            self.pointer(a, b, whole, colour, width)

    def label(self, at: Any, text: str, **look: Any) -> None:
        """A word beside a point, or beside one of several (n, 3), drawn by ``finish``."""
        self.labels.append((np.atleast_2d(np.asarray(at, dtype=float)), text, look))

    def finish(self, centre: Any) -> None:
        """Draw the words, away from the centre; those at one place as one, others apart."""
        middle, apart = self.seen(centre), 0.09 * self.size
        groups: list[tuple[np.ndarray, list[str], Any]] = []
        for at, text, look in self.labels:
            places = self.seen(at)
            for taken, words, its in groups:
                same = its == look and np.linalg.norm(taken - places[0]) < 0.5 * apart
                if same and text not in words:
                    words.append(text)
                if same:
                    break
            else:
                groups.append((self._free(places, [taken for taken, *_ in groups]), [text], look))
        for place, words, look in groups:
            self.write(place, place - middle, _joined(words), 0.4 * apart, look)

    def _free(self, places: np.ndarray, taken: list[np.ndarray]) -> np.ndarray:
        """The first place with room around it, or the one with the most."""
        room = [
            min((float(np.linalg.norm(place - other)) for other in taken), default=np.inf)
            for place in places
        ]
        enough = [i for i, least in enumerate(room) if least > 0.16 * self.size]
        free: np.ndarray = places[enough[0] if enough else int(np.argmax(room))]
        return free


class Plane(Pane):
    """Seen along an axis."""

    shows_all = True

    def __init__(self, axes: Any, size: float, right: int, up: int) -> None:
        super().__init__(axes, size)
        self.right, self.up = right, up  # indices of the axes of space
        axes.set_aspect("equal")
        axes.set(xlabel=f"{LETTERS[right]} [m]", ylabel=f"{LETTERS[up]} [m]")

    def seen(self, points: Any) -> np.ndarray:
        """(..., 2) coordinates on this pane."""
        return np.asarray(points, dtype=float)[..., [self.right, self.up]]

    def area(self, corners: np.ndarray, colour: str, alpha: float) -> None:
        """A polygon."""
        self.axes.fill(*corners.T, facecolor=colour, alpha=alpha, linewidth=0)

    def pointer(self, a: np.ndarray, b: np.ndarray, _: float, colour: str, width: float) -> None:
        """An arrow from a to b."""
        self.axes.annotate(
            "",
            b,
            a,
            arrowprops={
                "arrowstyle": "-|>",
                "color": colour,
                "linewidth": width,
                "mutation_scale": 9,
                "shrinkA": 0,
                "shrinkB": 0,
            },
        )
        self.axes.plot(*np.stack([a, b]).T, alpha=0.0)  # the limits hold the arrow too

    def write(self, place: np.ndarray, away: np.ndarray, text: str, _: float, look: Any) -> None:
        """A word beside a place, on the side away from the middle."""
        long = float(np.linalg.norm(away))
        self.axes.annotate(
            text,
            place,
            xytext=tuple(np.where(np.abs(away) > 0.3 * long, np.sign(away), 0.0) * 6.0),
            textcoords="offset points",
            ha=_side(away[0], long, ("right", "left")),
            va=_side(away[1], long, ("top", "bottom")),
            bbox=_BOX,
            **look,
        )

    def bound(self, points: Any, margin: float) -> None:
        """Show these points."""
        points = self.seen(points)
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


class Perspective(Pane):
    """Seen from afar, on axes in three dimensions."""

    shows_all = False

    def __init__(self, axes: Any, size: float) -> None:
        super().__init__(axes, size)
        axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
        axes.tick_params(labelsize=7, pad=-2)
        axes.view_init(elev=22, azim=-68)
        axes.set_proj_type("persp", focal_length=0.6)
        axes.locator_params(nbins=5)

    def seen(self, points: Any) -> np.ndarray:
        """(..., 3) coordinates."""
        return np.asarray(points, dtype=float)

    def area(self, corners: np.ndarray, colour: str, alpha: float) -> None:
        """A polygon."""
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        self.axes.add_collection3d(
            Poly3DCollection([corners], facecolor=colour, edgecolor=colour, alpha=alpha)
        )

    def pointer(
        self, a: np.ndarray, b: np.ndarray, whole: float, colour: str, width: float
    ) -> None:
        """An arrow from a to b."""
        head = min(0.3, 0.06 * self.size / whole)
        self.axes.quiver(*a, *(b - a), color=colour, linewidth=width, arrow_length_ratio=head)

    def write(
        self, place: np.ndarray, away: np.ndarray, text: str, shift: float, look: Any
    ) -> None:
        """A word beside a place, away from the middle."""
        moved = place + shift * away / max(float(np.linalg.norm(away)), 1e-12)
        self.axes.text(*moved, text, ha="center", va="center", bbox=_BOX, **look)

    def bound(self, points: Any, margin: float) -> None:
        """Show these points."""
        points = self.seen(points)
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        self.axes.set_box_aspect(high - low, zoom=0.88)


View = Callable[["Figure", Any, float], Pane]


def perspective(figure: Figure, spot: Any, size: float) -> Pane:
    """A perspective at a spot of a grid (or all of the figure: 111) of what is ``size`` [m]."""
    return Perspective(figure.add_subplot(spot, projection="3d"), size)


def along(right: int, up: int) -> View:
    """The view that has these axes of space to the right and up."""
    return lambda figure, spot, size: Plane(figure.add_subplot(spot), size, right, up)


def _side(component: float, long: float, names: tuple[str, str]) -> str:
    if abs(component) <= 0.3 * long:
        return "center"
    return names[0] if component < 0 else names[1]


def _joined(words: list[str]) -> str:
    """``leg 0``, ``leg 3`` as ``leg 0, 3``."""
    heads = {word.rpartition(" ")[0] for word in words}
    if len(words) > 1 and len(heads) == 1 and (head := heads.pop()):
        return f"{head} {', '.join(word.rpartition(' ')[2] for word in words)}"
    return ", ".join(words)
