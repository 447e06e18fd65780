"""The handful of names a user needs, used as the README uses them."""

import ast
import importlib
import re
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import contactsafe as cs

ROOT = Path(__file__).parents[2]
INDEX = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
ROOMS = {
    room: set(re.findall(r"`(\w+)`", names))
    for room, names in re.findall(r"^- \{py:mod\}`(contactsafe\.\w+)`: (.*(?:\n  .*)*)", INDEX, re.MULTILINE)
}


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


@pytest.mark.parametrize("room", ROOMS)
def test_index_page_names_what_a_room_makes_public(room):
    assert set(importlib.import_module(room).__all__) == ROOMS[room]
    assert all(hasattr(importlib.import_module(room), name) for name in ROOMS[room])


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.stem)
def test_examples_took_names_from_modules_that_no_page_lists(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert {one.name for one in node.names if one.name.startswith("contactsafe")} <= {"contactsafe"}
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("contactsafe"):
            assert {one.name for one in node.names} <= ROOMS[node.module]
