"""Nothing leaves the machine, and nothing is written outside the folders that the documentation names."""

import os
from pathlib import Path

import pytest

from contactsafe.core.compiled import CACHE_FOLDER
from tests.sandbox import opened_a_socket, run_without_sockets

ROOT = Path(__file__).parents[1]

LOAD = """
import time
from contactsafe.policy.bundle import Bundle, shipped_bundle
Bundle.load(shipped_bundle("wiping"))
time.sleep(1.0)
"""


@pytest.fixture
def fresh(tmp_path):
    """An environment whose home, temporary and working folder are new; the compiled code is that of the tests."""
    kept = {name: os.environ[name] for name in ("PATH", "MUJOCO_GL", "LD_LIBRARY_PATH") if name in os.environ}
    places = {name: tmp_path / name for name in ("home", "tmp", "here")}
    for place in places.values():
        place.mkdir()
    path = [str(ROOT), str(ROOT / "src"), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {
        **kept,
        "HOME": str(places["home"]),
        "TMPDIR": str(places["tmp"]),
        "NUMBA_CACHE_DIR": str(Path(CACHE_FOLDER).parent),
        "PYTHONPATH": os.pathsep.join(path),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    probe = run_without_sockets("import socket; socket.socket()", environment, places["here"])
    if not opened_a_socket(probe):
        pytest.skip("this machine cannot forbid a process to open sockets")
    return environment, places


def written(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if not path.is_dir())


def test_loading_the_shipped_policy_looks_up_no_host_and_leaves_no_device_id(fresh):
    environment, places = fresh
    ended = run_without_sockets(LOAD, environment, places["here"])
    assert ended.returncode == 0, ended.stderr
    assert {name: written(place) for name, place in places.items()} == {"home": [], "tmp": [], "here": []}


def test_a_switch_that_the_user_set_otherwise_is_set_back(fresh):
    environment, places = fresh
    ended = run_without_sockets(LOAD, {**environment, "ORT_DISABLE_TELEMETRY": "0"}, places["here"])
    assert ended.returncode == 0, ended.stderr
    assert not written(places["home"])


def test_worker_processes_have_the_switch_before_they_import_anything(fresh):
    environment, places = fresh
    code = """
import multiprocessing, os
import contactsafe
if __name__ == "__main__":
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        print(pool.apply(os.getenv, ["ORT_DISABLE_TELEMETRY"]))
"""
    script = places["here"] / "script.py"
    script.write_text(code)
    run = f"import runpy; runpy.run_path({str(script)!r}, run_name='__main__')"
    ended = run_without_sockets(run, environment, ROOT)
    assert (ended.returncode, ended.stdout) == (0, "1\n"), ended.stderr


def test_without_the_switch_onnx_runtime_is_seen(fresh):
    """The watch sees what it is there for; a version that tells nothing leaves nothing to be seen."""
    environment, places = fresh
    import onnxruntime

    if tuple(map(int, onnxruntime.__version__.split(".")[:2])) < (1, 31):
        pytest.skip("this ONNX Runtime tells nothing")
    ended = run_without_sockets("import onnxruntime, time; time.sleep(1.0)", environment, places["here"])
    assert opened_a_socket(ended) or written(places["home"])


@pytest.mark.slow
@pytest.mark.train
def test_evaluating_and_training_write_nowhere_but_where_they_are_told(fresh):
    pytest.importorskip("stable_baselines3")
    environment, places = fresh
    code = """
from contactsafe.cli import main
small = ["--num-envs", "2", "--rollout-steps", "4", "--batch", "8", "--total-steps", "8", "--evaluate-episodes", "1"]
assert main(["evaluate", "--episodes", "1"]) == 0
assert main(["experiment", "disturbance", "--trials", "1", "--controllers", "vices", "--out", "page"]) == 0
assert main(["train", "vae", "--held-out", "8", "--out", "runs/vae"]) == 0
assert main(["train", "ppo", "--encoder", "runs/vae", "--out", "runs/ppo", *small]) == 0
"""
    ended = run_without_sockets(code, environment, places["here"])
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert all(name.startswith((".cache/matplotlib/", ".cache/mesa")) for name in written(places["home"]))
    assert not written(places["tmp"])
    assert {Path(name).parts[0] for name in written(places["here"])} == {"page", "runs"}


def test_an_unstable_simulation_leaves_no_log_file_in_the_working_folder(fresh):
    environment, places = fresh
    code = """
import mujoco
import contactsafe
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>")
data = mujoco.MjData(model)
data.qpos[0] = float("nan")
mujoco.mj_step(model, data)
"""
    ended = run_without_sockets(code, environment, places["here"])
    assert ended.returncode == 0
    assert ended.stderr.startswith("MuJoCo: ")
    assert not written(places["here"])
