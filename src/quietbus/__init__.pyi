from .analysis.isolator import SingleAxisIsolator as SingleAxisIsolator
from .api import QuietbusWarning as QuietbusWarning
from .api import SimulationError as SimulationError
from .api import analyze as analyze
from .api import compare as compare
from .api import jitter as jitter
from .api import linearize as linearize
from .api import simulate as simulate
from .api import verify as verify
from .jitter_study import JitterStudy as JitterStudy
from .results import load_run as load_run
from .results import reconstruct as reconstruct
from .results import save_run as save_run
from .results import scenario_of as scenario_of
from .results import summarize as summarize
from .scenario import Scenario as Scenario
from .scenario import ScenarioError as ScenarioError
from .scenario import load_scenario as load_scenario
from .solve.harmonic import ResonanceError as ResonanceError
from .verification import Verification as Verification

__version__: str
