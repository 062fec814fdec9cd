"""Runs as labelled data: what they hold, their files, their numbers."""

from quietbus.results.dataset import to_dataset as to_dataset
from quietbus.results.delivery import delivery_notes as delivery_notes
from quietbus.results.files import load_run as load_run
from quietbus.results.files import save_run as save_run
from quietbus.results.origin import has_gimbals as has_gimbals
from quietbus.results.origin import method_of as method_of
from quietbus.results.origin import scenario_of as scenario_of
from quietbus.results.schema import AXES as AXES
from quietbus.results.schema import CHANGING_VARIABLES as CHANGING_VARIABLES
from quietbus.results.schema import CONTROL_VARIABLES as CONTROL_VARIABLES
from quietbus.results.schema import JOINT_VARIABLES as JOINT_VARIABLES
from quietbus.results.schema import VARIABLES as VARIABLES
from quietbus.results.schema import rate_of as rate_of
from quietbus.results.signals import reconstruct as reconstruct
from quietbus.results.summary import Summary as Summary
from quietbus.results.summary import aliasing as aliasing
from quietbus.results.summary import rotor_notes as rotor_notes
from quietbus.results.summary import summarize as summarize
from quietbus.results.summary import with_worst_phases as with_worst_phases
