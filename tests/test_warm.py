"""Compiling is done, and said, when things are made: nothing is left of it in the first step."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from contactsafe.core.compiled import ANNOUNCEMENT

SIX = Path(__file__).parents[1] / "examples" / "own_scene.xml"

WATCHED = """
import gymnasium, numpy as np
from numba.core import event
import contactsafe as cs
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.robot.ik import InverseKinematics
from contactsafe.tasks.wiping.randomisation import Randomisation

class Count(event.Listener):
    count = 0
    def on_start(self, event):
        self.count += 1
    def on_end(self, event):
        pass

# Every signature that a function is called with for the first time takes this lock, compiled or loaded.
COUNT = Count()
event.register("numba:compiler_lock", COUNT)

def first(name, act):
    before = COUNT.count
    act()
    print(name, COUNT.count - before)

arm = {arm}
controller = cs.Controller(arm)
assert COUNT.count > 0
first("reset", lambda: controller.reset(arm.home))
target = cs.Target(arm.tool_pose(arm.home), [150.0] * 6)
measured = cs.Measurement(arm.home, np.zeros(arm.n))
first("step", lambda: controller.step(measured, target))
first("with a wrench", lambda: controller.step(measured._replace(wrench_ee=np.zeros(6)), target))
lists = target._replace(posture=list(arm.home), damping=[20.0] * 6)
first("of lists", lambda: controller.step(cs.Measurement(list(arm.home), [0] * arm.n), lists))
ik = InverseKinematics(arm)
first("inverse kinematics", lambda: ik.solve(target.pose))
{more}
"""

ENVIRONMENTS = """
for name, config in (("plain", WipingConfig()), ("varied", WipingConfig(randomisation=Randomisation.broad()))):
    env = gymnasium.make("contactsafe/Wiping-v0", config=config)
    first(name + " reset", lambda: env.reset(seed=0))
    first(name + " step", lambda: env.step(np.zeros(18, np.float32)))
    envs = gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=3, config=config)
    first(name + " resets", lambda: envs.reset(seed=0))
    first(name + " steps", lambda: envs.step(np.zeros((3, 18), np.float32)))
    envs.close()
"""


@pytest.mark.parametrize(
    ("arm", "more"), [("cs.robots.panda()", ENVIRONMENTS), (f"cs.robots.from_mjcf({str(SIX)!r}, site='tip')", "")]
)
def test_the_first_step_in_a_process_has_nothing_left_to_compile_or_load(arm, more):
    done = subprocess.run(
        [sys.executable, "-c", WATCHED.format(arm=arm, more=more)], capture_output=True, text=True, check=True
    )
    counts = dict(line.rsplit(" ", 1) for line in done.stdout.splitlines())
    assert len(counts) == (13 if more else 5)
    assert set(counts.values()) == {"0"}, counts


TWICE = """
import numpy as np
from contactsafe.core.rotation import quat_multiply
for kind in (np.float64, np.float32):
    quat_multiply(np.ones(4, kind), np.ones(4, kind))
"""
"""Compiles something small, twice."""


@pytest.mark.parametrize(("jit_cache", "said"), [("new", 1), ("used", 0)])
def test_what_compiles_says_so_once_beforehand_and_only_then(jit_cache, said, tmp_path_factory, capfd):
    folder = tmp_path_factory.getbasetemp() / "a cache of its own"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    done = subprocess.run([sys.executable, "-c", TWICE], capture_output=True, text=True, check=True, env=environment)
    assert done.stderr.splitlines() == [ANNOUNCEMENT] * said
    assert done.stdout == ""


def test_warming_up_recommended_itself(tmp_path):
    asked_for = "from contactsafe.core.compiled import compile_in_silence\ncompile_in_silence()\n"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    words = [sys.executable, "-c", asked_for + TWICE]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    assert done.stderr == ""
    assert list(tmp_path.rglob("*.nbi"))  # it did compile
