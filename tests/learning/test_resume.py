"""A run that was killed and resumed ends where the run that was left alone ends, to the bit."""

import dataclasses
import pickle
import signal
import subprocess
import sys
from functools import partial
from itertools import count
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.train
torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator  # noqa: E402
from tests.learning.fakes import FakeWiping  # noqa: E402

from contactsafe.cli import main  # noqa: E402
from contactsafe.core.copying import Threads  # noqa: E402
from contactsafe.core.errors import InvalidInputError, OutputError  # noqa: E402
from contactsafe.learning.algorithms import PpoConfig, SacConfig  # noqa: E402
from contactsafe.learning.checkpoints import load_checkpoint, save_checkpoint  # noqa: E402
from contactsafe.learning.curves import Curves  # noqa: E402
from contactsafe.learning.encoder import EncoderConfig  # noqa: E402
from contactsafe.learning.packing import pack, unpack  # noqa: E402
from contactsafe.learning.recorder import Recorder  # noqa: E402
from contactsafe.learning.run_settings import as_started  # noqa: E402
from contactsafe.learning.train_policy import train_policy  # noqa: E402
from contactsafe.learning.train_vae import VaeConfig  # noqa: E402
from contactsafe.tasks import make_vec  # noqa: E402
from contactsafe.tasks.wiping.config import WipingConfig  # noqa: E402

SMALL = {"num_envs": 4, "rollout_steps": 16, "batch": 32, "net": (16, 16), "evaluate_episodes": 0, "total_steps": 512}
PPO = PpoConfig(epochs=2, **SMALL)
SAC = SacConfig(buffer=256, learning_starts=96, update_every=4, gradient_steps=2, action_repeat=1, **SMALL)
"""Its memory is full after half the steps."""

short_boards = partial(FakeWiping, max_steps=23)


def real_boards(num_envs, seconds=0.3):
    """Make the real task with episodes of 18 steps."""
    return make_vec("wiping", num_envs, WipingConfig(episode_s=seconds))


def train_and_die(folder, config, make_env, calls=None, saves=None):
    """Train in a process of its own until it is killed; nothing of it is left but its files."""
    job = folder / "job"
    job.write_bytes(pickle.dumps((config, make_env, calls, saves)))
    command = [sys.executable, "-m", "tests.learning.killed_run", str(job)]
    ended = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, timeout=300, check=False)
    assert ended.returncode == -signal.SIGKILL, ended.stderr.decode()[-2000:]


def assert_same_run(a, b):
    """Compare all that two runs keep, but for the time they took."""
    for state in (a, b):
        state["env"] = unpack(state["env"])
        for session in ("minutes", "config"):
            state.pop(session, None)
    assert_same(a, b, "")


def assert_same(a, b, path):
    assert type(a) is type(b), path
    if isinstance(a, dict):
        assert list(a) == list(b), path
        for key in a:
            assert_same(a[key], b[key], f"{path}/{key}")
    elif isinstance(a, list | tuple):
        assert len(a) == len(b), path
        for index, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{path}/{index}")
    elif isinstance(a, torch.Tensor):
        assert torch.equal(a, b), path
    elif isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b, err_msg=path)
    else:
        assert a == b, path


@pytest.fixture(autouse=True, scope="module")
def no_bundles():
    """Leave out what comes after training; it takes longer than these runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("contactsafe.learning.train_policy.export_bundle", lambda *args, **options: None)
        yield


@pytest.fixture(scope="module")
def uninterrupted(encoder, tmp_path_factory):
    """Return the last checkpoint of a run that was left alone."""
    known = {}

    def run(config, make_env):
        if config not in known:
            out = tmp_path_factory.mktemp("whole") / "run"
            train_policy(dataclasses.replace(config, encoder=encoder, out=out), make_env)
            known[config] = out
        return load_checkpoint(known[config])

    return run


def test_what_is_packed_comes_back():
    state = {
        "numbers": [1, 2.5, float("inf"), 2**127 + 1, None, True, "text"],
        "arrays": [np.arange(6).reshape(2, 3)[:, ::2], np.array([True, False]), np.zeros((0, 4)), np.float32([[0.1]])],
        "nothing": {},
    }
    back = unpack(pack(state))
    assert back["numbers"] == state["numbers"]
    assert back["nothing"] == {}
    for array, expected in zip(back["arrays"], state["arrays"], strict=True):
        np.testing.assert_array_equal(array, expected, strict=True)
        assert array.flags.writeable
    assert unpack(pack({})) == {}


@pytest.mark.parametrize("config", [PPO, SAC], ids=["ppo", "sac"])
def test_one_seed_gives_one_result(config, encoder, tmp_path, uninterrupted):
    again = dataclasses.replace(config, encoder=encoder, out=tmp_path / "run")
    train_policy(again, short_boards)
    assert_same_run(uninterrupted(config, short_boards), load_checkpoint(again.out))


@pytest.mark.slow
@pytest.mark.parametrize("calls", [5, 16, 75])
@pytest.mark.parametrize("config", [PPO, SAC], ids=["ppo", "sac"])
def test_killed_and_resumed_equals_uninterrupted(config, calls, encoder, tmp_path, uninterrupted):
    """Killed in the first rollout, between two, or late; 128 steps of each environment in all."""
    config = dataclasses.replace(config, encoder=encoder, out=tmp_path / "run")
    train_and_die(tmp_path, config, short_boards, calls=calls)
    assert load_checkpoint(config.out)["counters"]["num_timesteps"] == 4 * 16 * (calls // 16)
    train_policy(dataclasses.replace(config, resume=True), short_boards)
    expected = uninterrupted(dataclasses.replace(config, encoder=Path("runs/vae"), out=type(config).out), short_boards)
    assert_same_run(expected, load_checkpoint(config.out))


@pytest.mark.slow
@pytest.mark.parametrize("config", [PPO, SAC], ids=["ppo", "sac"])
def test_killed_while_saving_goes_on_from_the_checkpoint_before(config, encoder, tmp_path, uninterrupted):
    """SAC's memory was written already then, and runs over its end."""
    expected = uninterrupted(config, short_boards)
    config = dataclasses.replace(config, encoder=encoder, out=tmp_path / "run")
    train_and_die(tmp_path, config, short_boards, saves=6)
    assert load_checkpoint(config.out)["counters"]["num_timesteps"] == 5 * 64
    train_policy(dataclasses.replace(config, resume=True), short_boards)
    assert_same_run(expected, load_checkpoint(config.out))


@pytest.mark.slow
def test_the_real_task_goes_on_amidst_its_episodes(encoder, tmp_path):
    """Killed twice; with another number of threads for the worlds, which do not know of each other."""
    config = PpoConfig(num_envs=3, rollout_steps=12, total_steps=144, batch=18, net=(16, 16), evaluate_episodes=0)
    whole, parts = (dataclasses.replace(config, encoder=encoder, out=tmp_path / name) for name in ("whole", "parts"))
    train_policy(whole, real_boards)
    train_and_die(tmp_path, parts, real_boards, calls=17)
    resumed = dataclasses.replace(parts, resume=True)
    train_and_die(tmp_path, resumed, real_boards, calls=14)
    assert load_checkpoint(parts.out)["counters"]["num_timesteps"] == 72
    train_policy(resumed, one_thread)
    assert_same_run(load_checkpoint(whole.out), load_checkpoint(parts.out))


def one_thread(num_envs):
    env = real_boards(num_envs)
    worlds = env.unwrapped.tasks.worlds
    worlds.close()
    worlds._threads = Threads(1)
    return env


def test_stopped_by_the_clock_and_resumed_equals_uninterrupted(encoder, tmp_path, uninterrupted, monkeypatch):
    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "run")
    limited = dataclasses.replace(config, max_minutes=1.0)
    with monkeypatch.context() as patch:
        minutes = count(start=0.0, step=0.2)
        patch.setattr(Recorder, "_session_minutes", lambda self: next(minutes))
        train_policy(limited, short_boards)
    stopped = load_checkpoint(config.out)["counters"]["num_timesteps"]
    assert 0 < stopped < 512
    train_policy(dataclasses.replace(config, resume=True), short_boards)
    assert_same_run(uninterrupted(PPO, short_boards), load_checkpoint(config.out))


@pytest.mark.slow
def test_curves_have_no_point_twice_and_none_missing(encoder, tmp_path):
    """What a killed session logged after its last checkpoint is hidden by the session that goes on."""
    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "run")
    train_and_die(tmp_path, config, short_boards, saves=4)
    train_policy(dataclasses.replace(config, resume=True), short_boards)
    curves = EventAccumulator(str(config.out)).Reload()
    # No episode is over after the first rollout.
    for tag, first in (("train/loss", 64), ("episode/return", 128), ("rollout/ep_rew_mean", 128)):
        assert [point.step for point in curves.Scalars(tag)] == list(range(first, 513, 64)), tag


def test_a_session_begun_within_the_same_second_is_logged_after_the_other(tmp_path):
    for steps in (0, 64):
        curves = Curves(tmp_path, steps)
        curves.write({"a": float(steps)}, {}, steps + 64)
        curves.close()
    seconds = [int(path.name.split(".")[3]) for path in sorted(tmp_path.iterdir())]
    assert seconds[0] < seconds[1]
    assert [point.step for point in EventAccumulator(str(tmp_path)).Reload().Scalars("a")] == [64, 128]


def test_an_environment_that_keeps_nothing_starts_new_episodes(encoder, tmp_path):
    class Forgetful(FakeWiping):
        state_dict = property()

    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "run", total_steps=128)
    train_policy(config, Forgetful)
    assert "worlds" not in unpack(load_checkpoint(config.out)["env"])["below"]
    train_policy(dataclasses.replace(config, resume=True, total_steps=256), Forgetful)
    assert load_checkpoint(config.out)["counters"]["num_timesteps"] == 256


def test_a_run_that_goes_on_keeps_its_settings_but_for_those_that_are_given(encoder, tmp_path, monkeypatch):
    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "run", total_steps=64, max_minutes=5.0, seed=3)
    train_policy(config, FakeWiping)
    told = []
    monkeypatch.setattr("contactsafe.learning.train_policy.train_policy", lambda config, *_: told.append(config))
    words = ["train", "ppo", "--out", str(config.out), "--resume"]
    assert main(words) == 0
    assert main([*words, "--total-steps", "128", "--max-minutes", "1"]) == 0
    resumed = dataclasses.replace(config, resume=True, max_minutes=0.0)
    assert told == [resumed, dataclasses.replace(resumed, total_steps=128, max_minutes=1.0)]


def test_an_encoder_that_is_trained_on_keeps_its_settings(encoder):
    again = as_started(VaeConfig(out=encoder, resume=True))
    assert again.encoder == EncoderConfig(size=32, channels=(4, 4, 8))
    assert (again.out, again.resume, again.representation, again.images) == (encoder, True, "tool", 64)


@pytest.mark.parametrize(
    ("changed", "seconds", "told"),
    [
        ({"seed": 4, "epochs": 3}, 0.3, "seed = 0, now it is 4; epochs = 2, now it is 3"),
        ({}, 0.4, "task.episode_s = 0.3, now it is 0.4"),
    ],
    ids=["settings", "task"],
)
def test_what_would_end_with_other_weights_is_refused_and_all_of_it_told(changed, seconds, told, encoder, tmp_path):
    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "run", total_steps=64)
    train_policy(config, real_boards)
    with pytest.raises(InvalidInputError) as error:
        train_policy(dataclasses.replace(config, resume=True, **changed), partial(real_boards, seconds=seconds))
    remedy = "keep the setting, or start anew with another --out"
    assert str(error.value) == f"the run was started with {told}; {remedy}"


def test_what_cannot_be_resumed(encoder, tmp_path):
    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "run", total_steps=64)
    train_policy(config, FakeWiping)
    with pytest.raises(
        OutputError, match=r"run holds a training run already; give --resume to go on with it, or another"
    ):
        train_policy(config, FakeWiping)
    with pytest.raises(InvalidInputError) as error:
        train_policy(dataclasses.replace(SAC, encoder=encoder, out=config.out, resume=True), FakeWiping)
    assert str(error.value) == f"{config.out} holds a run of ppo, not of sac; give another --out"
    other = tmp_path / "other"
    other.mkdir()
    (other / "encoder.onnx").write_bytes((encoder / "encoder.onnx").read_bytes())
    (other / "encoder.json").write_bytes((encoder / "encoder.json").read_bytes() + b" ")
    with pytest.raises(InvalidInputError) as error:
        train_policy(dataclasses.replace(config, encoder=other, resume=True), FakeWiping)
    assert str(error.value) == (
        f"the encoder in {other} is not the one that the run in {config.out} was started with; "
        "give that one's folder as --encoder, or start anew with another --out"
    )
    save_checkpoint(config.out, {"policy": {}})
    with pytest.raises(InvalidInputError) as error:
        train_policy(dataclasses.replace(config, resume=True), FakeWiping)
    assert str(error.value) == f"{config.out} holds a run of another version; start anew with another --out"


def test_fewer_steps_than_are_done_are_refused_where_nothing_happened_and_the_settings_lied(encoder, tmp_path):
    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "run", total_steps=128, resume=False)
    train_policy(config, FakeWiping)
    kept = (config.out / "config.json").read_bytes()
    with pytest.raises(InvalidInputError, match=r"total_steps = 64, but the run in .*run has done 128 already"):
        train_policy(dataclasses.replace(config, resume=True, total_steps=64), FakeWiping)
    assert (config.out / "config.json").read_bytes() == kept
    train_policy(dataclasses.replace(config, resume=True), FakeWiping)


def test_a_run_that_is_refused_leaves_no_folder_behind(encoder, tmp_path):
    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "run", observes=("foo",))
    with pytest.raises(InvalidInputError, match="observes"):
        train_policy(config, FakeWiping)
    assert not config.out.exists()


def test_a_folder_that_cannot_be_written_is_told_before_anything_is_made(encoder, tmp_path):
    (tmp_path / "file").write_text("")
    config = dataclasses.replace(PPO, encoder=encoder, out=tmp_path / "file" / "run")
    made = []
    with pytest.raises(OutputError) as error:
        train_policy(config, lambda num_envs: made.append(num_envs))
    assert str(error.value) == f"cannot write to {config.out}: Not a directory; choose a folder you may write to"
    assert not made
