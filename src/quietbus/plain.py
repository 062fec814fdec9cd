"""Numbers for readers: angles in arcseconds, speeds in rpm, values as JSON has them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

ARCSEC = 3600.0 * math.degrees(1.0)  # in a radian
RPM = 30.0 / math.pi  # turns per minute in a radian per second


def json_ready(value: Any) -> Any:
    """Plain lists, dicts and finite numbers: infinite or undefined ones become None."""
    if isinstance(value, dict):
        return {key: json_ready(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [json_ready(item) for item in value]
    if isinstance(value, (complex, np.complexfloating)):
        return [json_ready(value.real), json_ready(value.imag)]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value
