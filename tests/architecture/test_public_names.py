"""The handful of names a user needs, used as the README uses them."""

import gymnasium
import numpy as np
import pytest

import contactsafe as cs


@pytest.mark.parametrize("name", ["robots", "presets", "Controller", "Measurement", "Target", "ContactSafeError"])
def test_name_is_public(name):
    assert hasattr(cs, name)
    assert name in cs.__all__


def test_every_listed_name_exists():
    assert [name for name in cs.__all__ if not hasattr(cs, name)] == []


@pytest.mark.parametrize("preset", ["paper", "vices", "safe"])
def test_controller_alone_in_five_lines(preset):
    arm = cs.robots.panda()
    controller = cs.Controller(arm, getattr(cs.presets, preset)())
    controller.reset(arm.home)
    measurement = cs.Measurement(arm.home, np.zeros(arm.n), wrench_ee=None)
    target = cs.Target(arm.tool_pose(arm.home), np.full(6, 150.0), np.full(6, 25.0), arm.home)
    out = controller.step(measurement, target)
    assert out.torque.shape == (arm.n,)
    assert out.residual.shape == (arm.n,)
    assert not out.contact.in_contact
    assert hasattr(out.contact, "link")


def test_default_preset_is_safe():
    arm = cs.robots.panda()
    assert cs.Controller(arm).config == cs.presets.safe()


def test_environment_is_registered():
    assert "contactsafe/Wiping-v0" in gymnasium.registry
