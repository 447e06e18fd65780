"""Other versions of MuJoCo give the same torques; those that `benchmarks/other_mujoco.py` has put into build/mujoco."""

import importlib.util
from pathlib import Path

import pytest

_PATH = Path(__file__).parents[2] / "benchmarks" / "other_mujoco.py"


@pytest.mark.slow
def test_robosuite_and_metaworld_pin_a_mujoco_that_the_library_did_not_run_on():
    spec = importlib.util.spec_from_file_location("other_mujoco", _PATH)
    other = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(other)
    folders = other.installed()
    if not folders:
        pytest.skip("no other MuJoCo here; python benchmarks/other_mujoco.py 3.3.0 gets one")
    here = other.torques_with(None)
    for folder in folders:
        assert abs(other.torques_with(folder) - here).max() <= other.ALLOWED_NM, folder.name
