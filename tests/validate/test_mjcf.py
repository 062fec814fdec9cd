"""The MuJoCo model that users can open."""

import sys

import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, paper_satellite
from quietbus.dynamics.closed_loop import initial_state
from quietbus.reference.engine import import_mujoco
from quietbus.validate.mjcf import write_mjcf
from quietbus.validate.states import kicked_state, random_state
from quietbus.validate.trajectory import fly, held_gimbals
from quietbus.validate.translate import motion_of

mujoco = pytest.importorskip("mujoco")


def _load(satellite, state, legs):
    model = mujoco.MjModel.from_xml_string(write_mjcf(satellite, state, legs, timestep=2e-4))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("mount", ["isolated", "rigid"])
@pytest.mark.parametrize(("legs", "leg_mass"), [("tendons", 0.0), ("bodies", 6 * 0.5)])
def test_shapes_add_no_mass(legs, leg_mass, mount):
    satellite = paper_satellite(mount)
    model, _ = _load(satellite, random_state(satellite, np.random.default_rng(0)), legs)
    assert model.ngeom > 0
    assert sum(model.body_mass) == pytest.approx(1082.8 + leg_mass, rel=1e-9)
    assert model.opt.timestep == 2e-4
    assert not model.opt.gravity.any()


@pytest.mark.parametrize("mount", ["isolated", "rigid"])
def test_keyframe_is_the_state_with_every_leg_reaching_the_plate(mount):
    satellite = awkward_satellite(mount)
    state = random_state(satellite, np.random.default_rng(1))
    _, data = _load(satellite, state, "bodies")
    place = motion_of(satellite, 0.0, state).p_NX_N[1]
    np.testing.assert_allclose(data.body("plate").xpos, place, atol=1e-12)
    np.testing.assert_allclose(data.joint("bus").qvel[3:], state.bus.w_NX_X, atol=1e-12)
    np.testing.assert_allclose(data.joint("rotor2").qpos, 1.4)
    for i in range(6):
        np.testing.assert_allclose(data.site(f"tip{i}").xpos, data.site(f"U{i}").xpos, atol=1e-12)


def test_exported_legs_with_mass_fly_roughly_like_ours():
    """The file's soft constraints do for a look: half a second without control."""
    satellite = paper_satellite()
    state = initial_state(satellite, jnp.array([1.0, 0, 0, 0]), jnp.zeros(3), jnp.zeros(4))
    state = kicked_state(satellite, state, np.random.default_rng(2))
    times = jnp.array([0.0, 0.5])
    ours = fly(held_gimbals(satellite), state, times, 1e-9)
    model, data = _load(satellite, state, "bodies")
    mujoco.mj_step(model, data, 2500)
    for i in range(6):
        gap = data.site(f"tip{i}").xpos - data.site(f"U{i}").xpos
        assert np.linalg.norm(gap) < 1e-6
    between = data.body("plate").xpos - data.body("bus").xpos
    apart = ours.bodies["plate"].p_NX_N[-1] - ours.bus.p_NX_N[-1]
    np.testing.assert_allclose(between, apart, atol=5e-4)


def test_without_mujoco_the_message_tells_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ImportError, match=r"pip install 'quietbus\[validate\]'"):
        import_mujoco()
