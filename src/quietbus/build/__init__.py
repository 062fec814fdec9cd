"""From the checked scenario to the parameters of the model; a registration for each part."""

from quietbus.build.actuators import actuator_of as actuator_of
from quietbus.build.legs import strut_of as strut_of
from quietbus.build.own_energy import energy_notes as energy_notes
from quietbus.build.satellite import build_initial_state as build_initial_state
from quietbus.build.satellite import build_satellite as build_satellite
