"""Steady responses along a slow motion.

The linearisation of some elements, the legs above all, costs most and changes least. It is computed
at some instants, so dense that the path of their configuration is straight in between, and
interpolated.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from quietbus.dynamics.coefficients import slow_motion
from quietbus.dynamics.equations import moving
from quietbus.dynamics.rotor_response import rotor_outputs
from quietbus.dynamics.state import State
from quietbus.dynamics.vibration import Vibration, sampled_coefficients, vibration_with
from quietbus.dynamics.views import NOTHING_SEEN, View
from quietbus.model.satellite import Satellite
from quietbus.programs import compiled

SAMPLE_ERROR = 1e-5  # of a configuration between linearisations, in the shares that elements give
INSTANTS = 128  # responses per call, so that one program serves start and run, which can be stopped
SAMPLES = 16  # linearisations per call

Chunk = tuple[dict[str, np.ndarray], np.ndarray, Vibration]


def at_one(satellite: Satellite, state: State, time: float = 0.0) -> tuple[Vibration, np.ndarray]:
    """Equations of small vibration and xi (cmg, order, m) of the free bodies at one state."""
    states = jax.tree.map(lambda leaf: np.asarray(leaf)[None], state)
    along = Along(satellite, np.array([time]), states)
    _, xi, small = along.chunk(np.zeros(1, int), NOTHING_SEEN)
    return instant(small, 0), xi[0]


def instant(small: Vibration, k: int) -> Vibration:
    """The equations at one instant of a chunk (NumPy)."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[k], small)


class Along:
    """Responses at instants of a slow motion, linearised as often as needed."""

    def __init__(self, satellite: Satellite, time: np.ndarray, states: State):
        """Of states (NumPy) with time [s] as the first axis."""
        self.satellite, self.time, self.states = satellite, time, states
        speeds = [np.asarray(cluster.units.rotor_speed) for cluster in satellite.clusters]
        self.one_speed = satellite.steady and len(np.unique(np.concatenate(speeds))) == 1
        path = np.asarray(_compiled_path(satellite, time, states))
        self.nodes = nodes(path, SAMPLE_ERROR)
        rows = []
        for start in range(0, len(self.nodes), SAMPLES):
            these = self.nodes[start : start + SAMPLES]
            values = _compiled_samples(satellite, *self._at(these, SAMPLES))
            rows.append(np.asarray(values)[: len(these)])
        self.values = np.concatenate(rows)

    def chunk(self, instants: np.ndarray, view: View) -> Chunk:
        """Complex amplitudes (instant, cmg, order, ...) and the equations that they solve.

        Of the equations there may be more than instants, as the last one is repeated.
        """
        t, states = self._at(instants, INSTANTS)
        rows = self._sampled(instants)
        rows = np.concatenate([rows, np.repeat(rows[-1:], len(t) - len(rows), axis=0)])
        values, xi, small = _compiled_chunk(self.satellite, t, states, rows, view, self.one_speed)
        count = len(instants)
        return {k: np.asarray(v)[:count] for k, v in values.items()}, np.asarray(xi)[:count], small

    def _at(self, instants, size):
        """Time and states at instants, the last one repeated to a size that programs share."""
        padded = np.concatenate([instants, np.repeat(instants[-1:], size - len(instants))])
        return self.time[padded], jax.tree.map(lambda leaf: leaf[padded], self.states)

    def _sampled(self, instants):
        """The sampled coefficients at instants, interpolated."""
        if len(self.nodes) == 1:
            return np.repeat(self.values, len(instants), axis=0)
        right = np.clip(np.searchsorted(self.nodes, instants), 1, len(self.nodes) - 1)
        left = right - 1
        span = self.nodes[right] - self.nodes[left]
        part = ((instants - self.nodes[left]) / span)[:, None]
        return (1.0 - part) * self.values[left] + part * self.values[right]


def nodes(path: np.ndarray, error: float) -> np.ndarray:
    """Instants between which a path (n, m) is straight to ``error``, ends included, ascending.

    A function of the path that is as curved as the square of its length is then interpolated as
    well: a stretch is no longer than ``sqrt(8 error)``.
    """
    last = len(path) - 1
    found, open_ = {0, last}, [(0, last)]
    while open_:
        a, b = open_.pop()
        if b - a < 2:
            continue
        part = np.arange(1, b - a) / (b - a)
        straight = path[a] + part[:, None] * (path[b] - path[a])
        off = np.max(np.abs(path[a + 1 : b] - straight), axis=1, initial=0.0)
        middle = a + 1 + int(np.argmax(off))
        if np.max(off) <= error:
            if np.max(np.abs(path[b] - path[a]), initial=0.0) <= np.sqrt(8.0 * error):
                continue
            middle = (a + b) // 2
        found.add(middle)
        open_ += [(a, middle), (middle, b)]
    return np.array(sorted(found))


@compiled
def _compiled_path(satellite, time, states):
    """What the sampled elements' equations depend on (n, c): configurations, and rates.

    Rates in shares of the slowest rotor's speed (of at least 10 rad/s).
    """
    sampled = [element for element in satellite.elements if element.sampled]
    speeds = jnp.abs(satellite.rotor_speed)
    slowest = jnp.min(jnp.where(speeds > 0.0, speeds, 1e3), initial=1e3)
    slowest = jnp.maximum(slowest, 10.0)

    def one(t, state):
        now = moving(satellite, t, state)
        rates = [m.R_AX.T @ m.w / slowest for m in now.motions.values()]
        return jnp.concatenate([*rates, *(e.configuration(now.around(e)) for e in sampled)])

    return jax.vmap(one)(time, states)


@compiled
def _compiled_samples(satellite, t, states):
    """The sampled coefficients as one row per instant."""
    averaged = satellite.averaged()

    def one(t, state):
        return ravel_pytree(sampled_coefficients(averaged, slow_motion(averaged, t, state)))[0]

    return jax.vmap(one)(t, states)


@compiled
def _compiled_chunk(satellite, t, states, rows, view, one_speed):
    satellite, averaged = satellite.prepared(), satellite.averaged()

    def one(t, state, row):
        slow = slow_motion(averaged, t, state)
        example = jax.eval_shape(lambda: sampled_coefficients(averaged, slow))
        _, unravel = ravel_pytree(jax.tree.map(lambda leaf: jnp.zeros(leaf.shape), example))
        small = vibration_with(averaged, slow, unravel(row))
        return *rotor_outputs(satellite, small, view, one_speed), small

    return jax.vmap(one)(t, states, rows)
