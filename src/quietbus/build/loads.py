"""External loads."""

from typing import Literal, cast

import numpy as np

from quietbus.build.arrays import array
from quietbus.model.load import Constant, HalfSine, Load, Profile, Step, Table
from quietbus.scenario import control as said


def load_of(load: said.Load, name: str) -> Load:
    vectors = (array(load.force), array(load.torque), array(load.point))
    return Load(name, (load.body,), load.frame, *vectors, _profile(load.profile))


def _profile(profile: said.Profile | Literal["constant"]) -> Profile:
    if profile == "constant":
        return Constant()
    if profile.step is not None:
        end = np.inf if profile.step.end is None else profile.step.end
        return Step(array(profile.step.start), array(end))
    if profile.half_sine is not None:
        return HalfSine(array(profile.half_sine.start), array(profile.half_sine.duration))
    table = cast("said.Table", profile.table)
    return Table(array(table.times), array(table.values))
