from .analysis.isolator import SingleAxisIsolator as SingleAxisIsolator
from .analysis.run_up import compare_run_up as compare_run_up
from .analysis.waterfall import FitError as FitError
from .api import QuietbusWarning as QuietbusWarning
from .api import SimulationError as SimulationError
from .api import analyze as analyze
from .api import compare as compare
from .api import jitter as jitter
from .api import linearize as linearize
from .api import simulate as simulate
from .jitter_study import JitterStudy as JitterStudy
from .measured import MapError as MapError
from .measured import WaterfallFit as WaterfallFit
from .measured import fit_waterfall as fit_waterfall
from .measured import read_waterfall as read_waterfall
from .results import load_run as load_run
from .results import reconstruct as reconstruct
from .results import save_run as save_run
from .results import scenario_of as scenario_of
from .results import summarize as summarize
from .scenario import Scenario as Scenario
from .scenario import ScenarioError as ScenarioError
from .scenario import WheelTable as WheelTable
from .scenario import load_scenario as load_scenario
from .scenario import read_wheel_table as read_wheel_table
from .solve.harmonic import ResonanceError as ResonanceError

__version__: str
