"""Basilisk flies a rigid satellite with unbalanced rotors; run by ``work_precision.py``.

Reads one JSON object on standard input and prints one: times, bus rates and seconds spent. The
interpreter needs the package ``bsk`` alone. The rotors are reaction wheels in the mode "fully
coupled jitter" without motor torque, on a hub that holds everything else.
"""

import json
import sys
import time
from typing import Any

import numpy as np
from Basilisk import __version__
from Basilisk.simulation import reactionWheelStateEffector, spacecraft
from Basilisk.utilities import RigidBodyKinematics, SimulationBaseClass, macros


def fly(given: dict[str, Any], timestep: float) -> dict[str, Any]:
    """One flight at a step [s]; outputs at ``given["rate"]`` [Hz]."""
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(timestep)))
    craft = spacecraft.Spacecraft()
    hub = given["hub"]
    craft.hub.mHub = hub["mass"]
    craft.hub.r_BcB_B = np.reshape(hub["centre"], (3, 1))
    craft.hub.IHubPntBc_B = hub["inertia"]
    craft.hub.sigma_BNInit = np.reshape(RigidBodyKinematics.EP2MRP(given["attitude"]), (3, 1))
    craft.hub.omega_BN_BInit = np.reshape(given["bus_rate"], (3, 1))
    wheels = reactionWheelStateEffector.ReactionWheelStateEffector()
    kept = []  # Basilisk holds no reference of its own
    for wheel in given["wheels"]:
        config = reactionWheelStateEffector.RWConfigPayload()
        for name, value in wheel.items():
            setattr(config, name, np.reshape(value, (3, 1)) if isinstance(value, list) else value)
        config.RWModel = reactionWheelStateEffector.JitterFullyCoupled
        wheels.addReactionWheel(config)
        kept.append(config)
    craft.addStateEffector(wheels)
    simulation.AddModelToTask("task", wheels)
    simulation.AddModelToTask("task", craft)
    recorder = craft.scStateOutMsg.recorder(macros.sec2nano(1.0 / given["rate"]))
    simulation.AddModelToTask("task", recorder)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(given["duration"]))
    started = time.process_time()
    simulation.ExecuteSimulation()
    spent = time.process_time() - started
    return {
        "seconds": spent,
        "time": (np.array(recorder.times()) * macros.NANO2SEC).tolist(),
        "bus_rate": np.array(recorder.omega_BN_B).tolist(),
    }


given = json.load(sys.stdin)
flights = [fly(given, timestep) for timestep in given["timesteps"]]
print("\n" + json.dumps({"version": __version__, "flights": flights}))
