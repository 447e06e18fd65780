"""Algorithms through the one path: SAC, one that a user brings, and what their settings refuse."""

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

pytestmark = pytest.mark.train
torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from stable_baselines3 import TD3  # noqa: E402
from stable_baselines3.common.noise import NormalActionNoise  # noqa: E402
from tests.learning.fakes import FakeWiping, GuidedWiping  # noqa: E402

from contactsafe.core.errors import InvalidInputError  # noqa: E402
from contactsafe.learning.algorithms import ALGORITHMS, PpoConfig, SacConfig  # noqa: E402
from contactsafe.learning.policy_config import PolicyConfig  # noqa: E402
from contactsafe.learning.replay import ReplayFile  # noqa: E402
from contactsafe.learning.train_policy import train_policy  # noqa: E402
from contactsafe.policy.bundle import Bundle  # noqa: E402
from contactsafe.policy.observation import ObservationScaling  # noqa: E402

SMALL = {
    "num_envs": 4,
    "rollout_steps": 16,
    "batch": 32,
    "net": (16, 16),
    "total_steps": 256,
    "evaluate_episodes": 4,
    "action_repeat": 1,
}


@dataclass(frozen=True)
class Td3Config(PolicyConfig):
    """An algorithm of the user's own choice."""

    algorithm: ClassVar[str] = "td3"

    def make_model(self, env):
        noise = NormalActionNoise(np.zeros(18), np.full(18, 0.1))
        return TD3(
            "MlpPolicy", env, learning_rate=self.falling_rate(), buffer_size=512, learning_starts=64,
            gamma=self.discount, action_noise=noise, policy_kwargs={"net_arch": list(self.net)}, seed=self.seed,
            device="cpu",
        )  # fmt: skip

    def actor(self, model):
        return model.actor.mu


def test_a_time_limit_is_no_end_to_an_off_policy_algorithm_either(encoder, tmp_path, monkeypatch):
    """The memory knows it for what it is, and the value behind it counts."""
    models = []
    make_model = SacConfig.make_model
    monkeypatch.setattr(SacConfig, "make_model", lambda self, env: models.append(make_model(self, env)) or models[0])
    monkeypatch.setattr("contactsafe.learning.train_policy.export_bundle", lambda *args, **options: None)
    config = SacConfig(
        encoder=encoder, out=tmp_path / "run", buffer=512, learning_starts=512, **{**SMALL, "evaluate_episodes": 0}
    )
    train_policy(config, lambda n: FakeWiping(n, max_steps=9))
    memory = models[0].replay_buffer
    assert memory.dones[:64].sum() == 4 * 7
    np.testing.assert_array_equal(memory.timeouts, memory.dones)


@pytest.mark.parametrize(
    "config",
    [SacConfig(buffer=512, learning_starts=64, **SMALL), Td3Config(**SMALL), PpoConfig(epochs=1, **SMALL)],
    ids=lambda config: config.algorithm,
)
def test_the_bundle_acts_as_the_model_does(config, encoder, tmp_path, monkeypatch):
    models = []
    make_model = type(config).make_model
    monkeypatch.setattr(type(config), "make_model", lambda self, env: models.append(make_model(self, env)) or models[0])
    config = dataclasses.replace(config, encoder=encoder, out=tmp_path / "run")
    train_policy(config, FakeWiping)
    bundle = Bundle.load(config.out / "bundle")
    assert bundle.manifest["training"][config.algorithm]["batch"] == 32
    assert bundle.manifest["training"]["steps"] == 256
    assert bundle.manifest["results"]["episodes"] == 4
    rng = np.random.default_rng(0)
    seen = {name: rng.normal(size=(9, k)).astype(np.float32) for name, k in bundle.observes.items()}
    latent = rng.normal(size=(9, 128)).astype(np.float32)
    observes = tuple(bundle.observes)
    scaling = ObservationScaling(observes, **bundle.manifest["observation_scaling"])
    wanted, _ = models[0].predict(scaling(seen, latent), deterministic=True)
    state = np.concatenate([seen[name] for name in observes], axis=1)
    found = bundle.policy.run(None, {"state": state, "latent": latent})[0]
    np.testing.assert_allclose(found, wanted, atol=1e-4)


@pytest.mark.slow
def test_sac_learns_to_go_where_the_ink_is(encoder, tmp_path):
    """Over what it does before the first update; where the last bits of a processor lead it is anybody's guess."""
    config = SacConfig(
        encoder=encoder, num_envs=16, rollout_steps=32, batch=128, net=(64, 64),
        learning_rate=2e-3, learning_starts=1000, buffer=20_000, discount=0.95,
        evaluate_episodes=16, dither=0.0, observes=("pose",), action_repeat=1, entropy_start=0.1,
    )  # fmt: skip
    removed = []
    for steps in (512, 6144):
        trained = dataclasses.replace(config, out=tmp_path / str(steps), total_steps=steps)
        removed.append(train_policy(trained, lambda n: GuidedWiping(n, max_steps=40))["ink_removed_mean"])
    assert removed[1] > removed[0] + 0.4


def test_the_learning_rate_falls_with_absolute_steps():
    rate = PpoConfig(learning_rate=0.1).falling_rate()
    assert [rate(left) for left in (1.0, 0.5, 0.0)] == pytest.approx([0.1, 0.05, 0.005])


class Memory:
    """A ReplayBuffer of 6 rows, as far as it is saved."""

    def __init__(self):
        self.buffer_size, self.pos, self.full = 6, 0, False
        for name in ("observations", "next_observations", "actions"):
            setattr(self, name, np.zeros((6, 2, 3), np.float32))
        for name in ("rewards", "dones", "timeouts"):
            setattr(self, name, np.zeros((6, 2), np.float32))

    def add(self, number):
        for name in ("observations", "rewards", "timeouts"):
            getattr(self, name)[self.pos] = number
        self.pos = (self.pos + 1) % 6
        self.full |= self.pos == 0


def test_memory_on_disk_is_whole_at_every_moment(tmp_path):
    """After each save, the rows of that save and of the one before can both be read back."""
    memory, before = Memory(), None
    file = ReplayFile(tmp_path / "replay.bin", memory, slack=4)
    for number in range(1, 41):
        memory.add(number)
        if number % 3:
            continue
        now = (file.save(), memory.rewards.copy(), memory.pos, memory.full)
        for rows, rewards, pos, full in filter(None, (before, now)):
            read = Memory()
            ReplayFile(tmp_path / "replay.bin", read, slack=4).load(rows)
            np.testing.assert_array_equal(read.rewards, rewards)
            assert (read.pos, read.full) == (pos, full)
        before = now


def test_memory_cut_short_is_told(tmp_path):
    memory = Memory()
    file = ReplayFile(tmp_path / "replay.bin", memory, slack=4)
    memory.add(1)
    file.save()
    with pytest.raises(InvalidInputError) as error:
        file.load(2)
    assert str(error.value) == f"{tmp_path / 'replay.bin'} is missing or cut short; start anew with another --out"


@pytest.mark.parametrize(
    ("algorithm", "settings", "text"),
    [
        ("ppo", {"num_envs": 0}, "num_envs = 0; give 1 or more"),
        ("ppo", {"max_minutes": -1.0}, "max_minutes = -1.0; give 0 or more"),
        ("ppo", {"discount": 1.5}, "discount = 1.5; give more than 0, at most 1"),
        ("sac", {"buffer": 100}, "buffer = 100; give 8192 or more: two rollouts of every environment"),
        ("sac", {"update_every": 0}, "update_every = 0; give 1 or more"),
    ],
)
def test_settings_that_cannot_work_are_told(algorithm, settings, text):
    with pytest.raises(InvalidInputError) as error:
        ALGORITHMS[algorithm](**settings)
    assert str(error.value) == text
