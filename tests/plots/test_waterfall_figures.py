"""Names of rays in the picture of a fitted waterfall."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure

from quietbus.analysis.signals.waterfall import Waterfall
from quietbus.plots.waterfall import name_rays


@pytest.mark.parametrize(
    "orders", [[1.0, 2.0, 2.72], [0.4, 1, 1.6, 2, 2.9, 3, 4, 4.4], [2.0, 2.05]]
)
def test_names_of_orders_do_not_collide(orders):
    turns, frequency = np.linspace(8.0, 100.0, 40), np.arange(0.0, 512.0)
    measured = Waterfall("radial_force", 2 * np.pi * turns, frequency, np.ones((40, 512)))
    figure = Figure(figsize=(7.5, 4.3))
    axes = figure.subplots(1, 3)[1]
    axes.set(xlim=(0.0, 512.0), ylim=(480.0, 6000.0))
    name_rays(axes, measured, orders)
    assert [text.get_text() for text in axes.texts] == [f"{order:.3g}" for order in orders]
    boxes = [text.get_window_extent() for text in axes.texts]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert all(axes.bbox.contains(*corner) for box in boxes for corner in (box.min, box.max))
