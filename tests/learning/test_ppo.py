"""PPO on a board without physics: the adapter's bookkeeping, resuming, and the bundle at the end."""

import dataclasses
import json
from itertools import count

import numpy as np
import pytest

pytestmark = pytest.mark.train
torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from tests.learning.fakes import FakeWiping, GuidedWiping  # noqa: E402

from contactsafe.core.errors import InvalidInputError  # noqa: E402
from contactsafe.learning.algorithms import PpoConfig  # noqa: E402
from contactsafe.learning.checkpoints import load_checkpoint  # noqa: E402
from contactsafe.learning.recorder import Recorder  # noqa: E402
from contactsafe.learning.train_policy import train_policy  # noqa: E402
from contactsafe.learning.vec_env import EncodedVecEnv  # noqa: E402
from contactsafe.policy.bundle import Bundle  # noqa: E402
from contactsafe.policy.dither import Dither  # noqa: E402
from contactsafe.policy.observation import ObservationScaling  # noqa: E402
from contactsafe.tasks.wiping.observation import POSE  # noqa: E402

SCALING = ObservationScaling.from_statistics([POSE], np.zeros(128), np.ones(128))


def no_perception(masks, poses):
    return np.zeros((len(masks), 128), np.float32)


def make_adapter(**options):
    env = FakeWiping(3, max_steps=5)
    adapter = EncodedVecEnv(env, no_perception, SCALING, **options)
    adapter.seed(0)
    return env, adapter


def test_time_limit_is_not_an_end_and_its_last_observation_is_given():
    env, adapter = make_adapter()
    adapter.reset()
    action = np.zeros((3, 18), np.float32)
    for _ in range(4):
        _, _, done, infos = adapter.step(action)
        assert not done.any()
        assert infos == [{}, {}, {}]
    before = env.xy.copy()
    observation, _, done, infos = adapter.step(action)
    assert done.all()
    for i, info in enumerate(infos):
        assert info["TimeLimit.truncated"] is True
        assert info["episode"]["l"] == 5
        expected = (before[i] - [0.5, 0.0]) / 0.15
        np.testing.assert_allclose(info["terminal_observation"][:2], expected, atol=1e-5)
        assert not np.allclose(observation[i], info["terminal_observation"])


def test_a_clean_board_is_an_end():
    env, adapter = make_adapter()
    adapter.reset()
    env.boards[1].points = env.xy[1][None] + [[0.001, 0.0]]
    _, reward, done, infos = adapter.step(np.zeros((3, 18), np.float32))
    assert done.tolist() == [False, True, False]
    assert infos[1]["TimeLimit.truncated"] is False
    assert infos[1]["is_success"] is True
    assert reward[1] > 0.0
    assert adapter.finished[0]["ink_removed"] == 1.0
    assert adapter.finished[0]["reward_ink"] == pytest.approx(reward[1])


def test_metrics_are_of_the_episode_and_start_anew():
    _, adapter = make_adapter()
    adapter.reset()
    total = np.zeros(3)
    for step in range(10):
        _, reward, _, _ = adapter.step(np.full((3, 18), 0.5, np.float32))
        total += reward
        if step == 4:
            first, total = total, np.zeros(3)
    returns = [episode["return"] for episode in adapter.finished]
    np.testing.assert_allclose(returns, [*first, *total], atol=1e-5)
    assert {episode["force_mean_n"] for episode in adapter.finished} == {3.0}
    for episode in adapter.finished:
        assert episode["reward_ink"] + episode["reward_approach"] == pytest.approx(episode["return"], abs=1e-5)


def test_repeated_actions_sum_their_rewards_and_stop_at_the_end_of_an_episode():
    _, single = make_adapter()
    _, repeated = make_adapter(action_repeat=3)
    single.reset(), repeated.reset()
    action = np.full((3, 18), 0.3, np.float32)
    three = sum(single.step(action)[1] for _ in range(3))
    _, reward, done, _ = repeated.step(action)
    np.testing.assert_allclose(reward, three, rtol=1e-5)
    assert not done.any()
    two = sum(single.step(action)[1] for _ in range(2))
    _, reward, done, infos = repeated.step(action)
    assert done.all()
    np.testing.assert_allclose(reward, two, rtol=1e-5)
    assert [info["episode"]["l"] for info in infos] == [5, 5, 5]


def test_reward_scale_scales_rewards_and_not_the_log():
    _, plain = make_adapter()
    _, scaled = make_adapter(reward_scale=0.1)
    plain.reset(), scaled.reset()
    action = np.full((3, 18), 0.3, np.float32)
    for _ in range(5):
        np.testing.assert_allclose(scaled.step(action)[1], 0.1 * plain.step(action)[1], rtol=1e-5)
    assert plain.finished[0]["return"] == pytest.approx(scaled.finished[0]["return"])


def test_the_dither_is_laid_over_the_actions_by_the_step_of_each_episode():
    dither = Dither(amplitude=0.5, period_s=0.1)
    env, adapter = make_adapter(dither=dither)
    adapter.reset()
    taken, step = [], env.step
    env.step = lambda actions: (taken.append(np.array(actions)), step(actions))[1]
    for _ in range(7):
        adapter.step(np.zeros((3, 18), np.float32))
    still = np.zeros((3, 18))
    for k, actions in enumerate(taken):
        np.testing.assert_allclose(actions, dither.over(still, np.full(3, k % 5)), atol=1e-6)


def test_exploration_falls_with_the_steps_done(encoder, tmp_path):
    config = ppo_config(encoder, tmp_path / "run", total_steps=1000, batch=48, log_std_init=-1.0, log_std_final=-2.0)
    _, adapter = make_adapter()
    model = config.make_model(adapter)
    for steps, wanted in ((0, -1.0), (500, -1.5), (1000, -2.0), (1500, -2.0)):
        model.num_timesteps = steps
        config.prepare_rollout(model)
        assert model.policy.log_std.detach().numpy() == pytest.approx(np.full(18, wanted))


def test_what_the_adapter_refuses():
    env = FakeWiping(2)
    env.metadata = {"autoreset_mode": "NEXT_STEP"}
    with pytest.raises(InvalidInputError) as error:
        EncodedVecEnv(env, no_perception, SCALING)
    assert str(error.value) == "the environment resets by NEXT_STEP; make it with AutoresetMode.SAME_STEP"
    with pytest.raises(InvalidInputError) as error:
        EncodedVecEnv(FakeWiping(2), no_perception, SCALING, action_repeat=0)
    assert str(error.value) == "action_repeat = 0; give 1 or more"


def ppo_config(encoder, out, **changes):
    settings = {"num_envs": 4, "total_steps": 256, "rollout_steps": 16, "batch": 32, "epochs": 2, "net": (16, 16)}
    return PpoConfig(encoder=encoder, out=out, **{**settings, "evaluate_episodes": 4, **changes})


def test_trains_resumes_and_ships(encoder, tmp_path):
    config = ppo_config(encoder, tmp_path / "run")
    results = train_policy(config, FakeWiping)
    assert results["episodes"] == 4
    state = load_checkpoint(config.out)
    assert state["counters"]["num_timesteps"] == 256
    longer = dataclasses.replace(config, resume=True, total_steps=512)
    train_policy(longer, FakeWiping)
    resumed = load_checkpoint(config.out)
    assert resumed["counters"]["num_timesteps"] == 512
    assert resumed["counters"]["_n_updates"] == 2 * state["counters"]["_n_updates"] == 16
    before, after = (run["parameters"]["policy"]["action_net.weight"] for run in (state, resumed))
    assert not torch.equal(before, after)
    manifest = Bundle.load(config.out / "bundle").manifest
    assert manifest["training"]["steps"] == 512
    assert manifest["training"]["ppo"]["discount"] == 0.995
    assert manifest["results"]["episodes"] == 4
    assert "records" not in manifest["results"]
    assert list(config.out.glob("events.out.tfevents*"))
    json.loads((config.out / "config.json").read_text())
    with pytest.raises(InvalidInputError, match=r"the run was started with discount = 0\.995, now it is 0\.9"):
        train_policy(dataclasses.replace(longer, discount=0.9), FakeWiping)


def test_resuming_restores_policy_optimiser_and_random_numbers(encoder, tmp_path):
    """A finished run, resumed with nothing left to do, exports the policy of its checkpoint."""
    config = ppo_config(encoder, tmp_path / "run", evaluate_episodes=0)
    train_policy(config, FakeWiping)
    before = (config.out / "bundle" / "policy.onnx").read_bytes()
    train_policy(dataclasses.replace(config, resume=True), FakeWiping)
    assert (config.out / "bundle" / "policy.onnx").read_bytes() == before


def test_stops_in_time_and_keeps_what_it_has(encoder, tmp_path, monkeypatch):
    config = ppo_config(encoder, tmp_path / "run", total_steps=10_000_000, max_minutes=1.0, evaluate_episodes=0)
    minutes = count(start=0.0, step=0.2)  # a clock that a busy machine does not hurry
    monkeypatch.setattr(Recorder, "_session_minutes", lambda self: next(minutes))
    train_policy(config, FakeWiping)
    assert 0 < load_checkpoint(config.out)["counters"]["num_timesteps"] < 10_000_000
    Bundle.load(config.out / "bundle")


def test_without_an_encoder_it_says_what_to_do(tmp_path):
    with pytest.raises(InvalidInputError) as error:
        train_policy(ppo_config(tmp_path, tmp_path / "run"), FakeWiping)
    assert str(error.value) == (
        f"{tmp_path} holds no vision encoder (encoder.json, and encoder.onnx where it is learned); "
        f"run `contactsafe train vae --out {tmp_path}` first"
    )
    assert not (tmp_path / "run").exists()


def test_an_encoder_of_another_version_is_refused(encoder, tmp_path):
    """Their numbers would be read as something else."""
    text = (encoder / "encoder.json").read_text(encoding="utf-8")
    (tmp_path / "encoder.json").write_text(text.replace('"format": 4', '"format": 3'), encoding="utf-8")
    (tmp_path / "encoder.onnx").write_bytes(b"")
    with pytest.raises(InvalidInputError) as error:
        train_policy(ppo_config(tmp_path, tmp_path / "run"), FakeWiping)
    assert str(error.value) == (
        f"{tmp_path / 'encoder.json'} has format 3, this version reads 4; "
        f"run `contactsafe train vae --out {tmp_path}` anew"
    )


def test_ppo_learns_to_go_where_the_ink_is(encoder, tmp_path):
    """With the ink's place readable off the observation, a few thousand steps must pay, over what one rollout does."""
    removed = []
    for steps in (512, 6144):
        config = ppo_config(
            encoder, tmp_path / str(steps), num_envs=16, total_steps=steps, rollout_steps=32, batch=128, epochs=6,
            learning_rate=2e-3, net=(64, 64), target_kl=0.05,
            discount=0.95, evaluate_episodes=16, dither=0.0, observes=("pose",),
        )  # fmt: skip
        removed.append(train_policy(config, lambda n: GuidedWiping(n, max_steps=40))["ink_removed_mean"])
    assert removed[1] > removed[0] + 0.4
