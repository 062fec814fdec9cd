"""What parts of your own are made of: docs/extending.md shows how.

A part has two sides: what a scenario says of it (a pydantic type with a word at ``type``), and its
physics (an Equinox module). A registration joins them.
"""

from quietbus.build import actuator_of as actuator_of
from quietbus.build import strut_of as strut_of
from quietbus.model.element import AbstractActuator as AbstractActuator
from quietbus.model.element import AbstractElement as AbstractElement
from quietbus.model.element import Around as Around
from quietbus.model.element import Authority as Authority
from quietbus.model.element import Driven as Driven
from quietbus.model.element import Energy as Energy
from quietbus.model.element import Own as Own
from quietbus.model.element import Rates as Rates
from quietbus.model.element import RigidParts as RigidParts
from quietbus.model.report import Output as Output
from quietbus.model.report import Quantity as Quantity
from quietbus.model.struts import AbstractStrut as AbstractStrut
from quietbus.scenario import units
from quietbus.scenario.actuators import ACTUATORS as ACTUATORS
from quietbus.scenario.base import Part as Part
from quietbus.scenario.struts import STRUTS as STRUTS
from quietbus.scenario.struts import StrutKind as StrutKind

Measure = units.Quantity  # a number of a scenario, with its unit; Quantity is an output
