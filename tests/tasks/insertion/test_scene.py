"""Peg and hole: clearances as stated, contact where geometry has it, no force out of nowhere."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsafe.core.rotation import rotvec_to_quat
from contactsafe.robot import robots
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import build_plant
from contactsafe.tasks.insertion.scene import HOLE_DEPTH, PEG, PEG_RADIUS, block, table

MOUTH = (0.5, 0.0, 0.05)


def peg_in_block(clearance_m):
    """A model of the block and a peg that can be put anywhere, in free space."""
    root = mujoco.MjSpec()
    boxes = block((0.0, 0.0, 0.0), PEG_RADIUS + clearance_m).boxes
    for box in boxes:
        root.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=box.half_size, pos=box.centre, quat=box.quat, name=box.name
        )
    body = root.worldbody.add_body(name="peg")
    body.add_freejoint()
    half = PEG.tip.half_size[2]
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=(PEG_RADIUS, half, 0.0), pos=(0.0, 0.0, half), mass=0.1, name="peg"
    )
    root.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
    model = root.compile()
    return model, mujoco.MjData(model)


def deepest(model, data, position, rotvec=(0.0, 0.0, 0.0)):
    """How deep the peg is in the block at most, m; 0 where nothing touches."""
    data.qpos[:3], data.qpos[3:] = position, rotvec_to_quat(np.array(rotvec))
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    return max([-contact.dist for contact in data.contact[: data.ncon]], default=0.0)


@pytest.mark.parametrize("clearance_m", [0.0005, 0.0002])
@settings(max_examples=60, deadline=None)
@given(angle=st.floats(0.0, 6.2832), depth=st.floats(0.001, 0.028), fraction=st.floats(0.0, 0.95))
def test_a_peg_within_the_clearance_touches_nothing(clearance_m, angle, depth, fraction):
    model, data = peg_in_block(clearance_m)
    away = fraction * clearance_m
    assert deepest(model, data, (away * np.cos(angle), away * np.sin(angle), -depth)) < 1e-5


@settings(max_examples=60, deadline=None)
@given(angle=st.floats(0.0, 6.2832), depth=st.floats(0.002, 0.028), more=st.floats(1.0, 2.0))
def test_a_peg_beyond_the_clearance_touches_the_wall(angle, depth, more):
    # Between the flat sides of the ring the hole is wider by 0.9 % of its radius.
    model, data = peg_in_block(0.0005)
    away = 0.0005 + 0.009 * (PEG_RADIUS + 0.0005) + 0.0001 * more
    assert deepest(model, data, (away * np.cos(angle), away * np.sin(angle), -depth)) > 0.0


def test_the_floor_is_where_the_hole_ends():
    model, data = peg_in_block(0.0005)
    assert deepest(model, data, (0.0, 0.0, -HOLE_DEPTH + 1e-4)) < 1e-5
    assert deepest(model, data, (0.0, 0.0, -HOLE_DEPTH - 1e-4)) > 0.0


def test_a_peg_that_lies_on_the_block_was_found_10_mm_deep_in_it():
    # With several contacts a pair, mujoco 4.0.0 did so in one look of some thousands: 274 N for a tick.
    model = build_plant(robots.panda(PEG), WorldConfig(fixtures=(table(), block(MOUTH, PEG_RADIUS + 0.0005))))
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_MULTICCD
    model, data = peg_in_block(0.0005)
    rng = np.random.default_rng(0)
    for _ in range(5000):
        away, turn = rng.uniform(-0.006, 0.006, 2), rng.uniform(-0.04, 0.04, 2)
        assert deepest(model, data, (*away, -1e-6), (*turn, 0.0)) < 0.0015
