"""Training takes a task by its name: its settings, its observation, with a camera or none, and its paper's wording."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.train
torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from tests.learning.fakes import FakeWiping, camera_homography, sample_masks  # noqa: E402

from contactsafe.cli import main  # noqa: E402
from contactsafe.core.errors import InvalidInputError  # noqa: E402
from contactsafe.learning.algorithms import PpoConfig, SacConfig  # noqa: E402
from contactsafe.learning.checkpoints import load_checkpoint  # noqa: E402
from contactsafe.learning.encoder import EncoderConfig  # noqa: E402
from contactsafe.learning.train_policy import encoded, train_policy  # noqa: E402
from contactsafe.learning.train_vae import VaeConfig, train_vae  # noqa: E402
from contactsafe.policy.bundle import Bundle, blank_observation  # noqa: E402
from contactsafe.policy.conditions import Conditions  # noqa: E402
from contactsafe.policy.policy import Policy  # noqa: E402
from contactsafe.tasks import TASKS, make_vec, task_by_name  # noqa: E402
from contactsafe.tasks.base.config import TaskConfig  # noqa: E402
from contactsafe.tasks.base.task import Task  # noqa: E402
from contactsafe.tasks.base.tasks import Tasks  # noqa: E402

TINY = {"num_envs": 2, "total_steps": 32, "rollout_steps": 8, "batch": 16, "net": (8, 8), "evaluate_episodes": 0}
WORDS = ["--num-envs", "2", "--rollout-steps", "8", "--batch", "16", "--net", "8", "8", "--evaluate-episodes", "2"]


# -- settings ---------------------------------------------------------------------------------------------------------


def test_a_task_is_learned_with_its_own_settings_unless_told_otherwise():
    own = task_by_name("insertion").training_settings["ppo"]
    config = PpoConfig.for_task("insertion", num_envs=3)
    assert (config.task, config.num_envs) == ("insertion", 3)
    assert all(getattr(config, name) == value for name, value in own.items() if name != "num_envs")
    assert SacConfig.for_task("insertion") == SacConfig(task="insertion")


def test_a_task_without_settings_of_its_own_is_learned_with_those_of_the_algorithm():
    assert PpoConfig.for_task("wiping") == PpoConfig()


@pytest.mark.parametrize("words", [["--task", "insertion"], ["--task=insertion"]])
def test_help_shows_the_settings_of_the_task(words, capsys):
    assert main(["train", "ppo", *words, "--help"]) == 0
    own = task_by_name("insertion").training_settings["ppo"]
    assert f"default: {own['total_steps']}" in capsys.readouterr().out


def test_words_say_otherwise(monkeypatch):
    told = []
    monkeypatch.setattr("contactsafe.learning.train_policy.train_policy", lambda config, *_: told.append(config))
    assert main(["train", "ppo", "--task", "insertion", "--num-envs", "5", "--gains", "low"]) == 0
    assert told == [PpoConfig.for_task("insertion", num_envs=5, gains="low")]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("gains", "gains = 'none'; choose from learned, low, middle, high"),
        ("controller", "controller 'none' is unknown; choose from vices, paper, safe"),
    ],
)
def test_a_name_that_is_unknown_is_told(name, told):
    with pytest.raises(InvalidInputError, match=told):
        Conditions(**{name: "none"})


def test_gentleness_multiplies_what_the_reward_takes_for_force_and_nothing_else():
    for task in map(task_by_name, TASKS):
        usual, gentler = task.training_config(False), task.training_config(False, gentleness=3.0)
        assert gentler.reward.force == 3.0 * usual.reward.force
        assert replace(gentler, reward=usual.reward) == usual


def test_a_reward_that_takes_nothing_for_force_cannot_be_made_gentler():
    @dataclass(frozen=True)
    class Plain(TaskConfig):
        pass

    task = Task(type("Still", (Tasks,), {"name": "still", "config_type": Plain}))
    assert task.training_config(True, gentleness=1.0) == Plain()
    with pytest.raises(InvalidInputError, match=r"gentleness = 0.0, but the reward of task 'still' has no weight"):
        task.training_config(True, gentleness=0.0)


def test_a_policy_is_trained_over_a_preset_with_other_values_of_its_parameters(monkeypatch):
    told = []
    monkeypatch.setattr("contactsafe.learning.train_policy.train_policy", lambda config, *_: told.append(config))
    assert main(["train", "ppo", "--task", "insertion", "--controller", "safe:tool_force_limit_n=12"]) == 0
    assert told[0].conditions.controller == "safe:tool_force_limit_n=12"
    assert main(["train", "ppo", "--task", "insertion", "--controller", "safe:tool_force=12"]) == 2
    assert len(told) == 1


# -- a task without a camera ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def inserted(tmp_path_factory):
    """A run of the insertion task over the command line."""
    out = tmp_path_factory.mktemp("insertion") / "run"
    words = [*WORDS, "--total-steps", "32", "--no-randomise", "--out", str(out)]
    assert main(["train", "ppo", "--task", "insertion", *words]) == 0
    return out


def test_a_task_without_a_camera_leaves_a_bundle_without_an_encoder(inserted):
    bundle = Bundle.load(inserted / "bundle")
    vectors = make_vec("insertion", 1).unwrapped.observation_vectors
    assert bundle.manifest["task"] == "insertion"
    assert bundle.observes == {vector.name: vector.size for vector in vectors}
    assert not bundle.sees
    assert sorted(path.name for path in bundle.folder.iterdir()) == ["bundle.json", "policy.onnx"]
    assert bundle.conditions == Conditions()
    assert bundle.manifest["results"]["episodes"] == 2


def test_it_is_evaluated_by_the_name_of_its_task(inserted, capsys):
    assert main(["evaluate", str(inserted / "bundle"), "--task", "insertion", "--episodes", "2", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["task"], result["controller"], result["episodes"]) == ("insertion", "safe", 2)
    assert main(["evaluate", str(inserted / "bundle"), "--episodes", "2"]) == 1
    assert capsys.readouterr().err.endswith(
        "is a policy for the task insertion, not for wiping; give --task insertion\n"
    )


def test_it_goes_on_without_its_task_being_named_again(inserted):
    before = load_checkpoint(inserted)["counters"]["num_timesteps"]
    assert main(["train", "ppo", "--out", str(inserted), "--resume", "--total-steps", str(2 * before)]) == 0
    state = load_checkpoint(inserted)
    assert (state["counters"]["num_timesteps"], state["config"]["task"]) == (2 * before, "insertion")


# -- constant gains ---------------------------------------------------------------------------------------------------


def test_with_constant_gains_six_actions_are_learned_and_the_bundle_says_so(tmp_path):
    config = PpoConfig(
        task="insertion", out=tmp_path / "run", gains="low", controller="vices", dither=0.0, **TINY
    )  # fmt: skip
    train_policy(config)
    assert load_checkpoint(config.out)["parameters"]["policy"]["action_net.weight"].shape == (6, 8)
    bundle = Bundle.load(config.out / "bundle")
    assert bundle.conditions == Conditions("vices", "low", False)
    observation = {name: value + 0.01 for name, value in blank_observation(bundle, 3).items()}
    action = Policy(bundle).act(observation)
    assert action.shape == (3, 18)
    assert np.abs(action[:, :6]).min() > 0.0
    assert not action[:, 6:].any()


def test_a_policy_is_run_under_the_gains_and_over_the_controller_it_was_trained_with():
    task = task_by_name("insertion")
    under = task.config(None, Conditions("vices", "high"))
    assert (under.controller, under.action.gains) == ("vices", "high")
    assert under.action == replace(task.config().action, gains="high")
    named = task.config(task.options(controller="paper"), Conditions("vices", "high"))
    assert (named.controller, named.action.gains) == ("paper", "high")
    assert task.config() == task.config(None, Conditions())


def test_actions_that_are_not_learned_are_zero():
    env = FakeWiping(2)
    taken, step = [], env.step
    env.step = lambda actions: (taken.append(actions), step(actions))[1]
    adapter = encoded(env, None, PpoConfig(encoder=None, gains="middle", dither=0.0))
    assert adapter.action_space.shape == (6,)
    adapter.reset()
    adapter.step(np.full((2, 6), 0.5, np.float32))
    np.testing.assert_array_equal(taken[0], np.repeat([[0.5, 0.0]], [6, 12], axis=1).repeat(2, axis=0))


# -- as the paper has it ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paper_encoder(tmp_path_factory):
    out = tmp_path_factory.mktemp("vae_paper") / "run"
    shape = EncoderConfig(size=128, channels=(4, 4, 8))
    small = {"images": 32, "held_out": 16, "epochs": 1, "batch": 16, "probe_steps": 0}
    train_vae(VaeConfig(out=out, representation="paper", encoder=shape, **small), sample_masks, camera_homography())
    return out


def test_the_settings_as_the_paper_has_them():
    config = PpoConfig.for_task("wiping", as_paper=True)
    changed = {"as_paper": True, "controller": "vices", "observes": ("pose",), "randomise": False, "dither": 0.0}
    assert config == PpoConfig(encoder=Path("runs/vae_paper"), **changed)
    assert config.conditions == Conditions("vices", "learned", True)


def test_the_task_as_the_paper_has_it_differs_in_reward_and_controller_alone():
    from contactsafe.tasks.wiping.config import RewardConfig, WipingConfig

    conditions = PpoConfig.for_task("wiping", as_paper=True).conditions
    wanted = WipingConfig(controller="vices", reward=RewardConfig.as_paper())
    assert task_by_name("wiping").training_config(False, conditions) == wanted


def test_a_task_that_the_paper_has_not_is_told(capsys):
    assert main(["train", "ppo", "--task", "insertion", "--as-paper"]) == 1
    assert capsys.readouterr().err == "contactsafe: the paper has no task 'insertion'; leave --as-paper out\n"


def test_another_encoder_than_the_papers_is_told(encoder, tmp_path):
    config = PpoConfig.for_task("wiping", as_paper=True, encoder=encoder, out=tmp_path / "run", **TINY)
    with pytest.raises(InvalidInputError) as error:
        train_policy(config, FakeWiping)
    assert str(error.value) == (
        f"the encoder in {encoder} is of representation tool, and the paper's is of paper; run `contactsafe train vae "
        "--representation paper --out runs/vae_paper` and give that folder as --encoder"
    )


def test_a_run_as_the_paper_has_it(paper_encoder, tmp_path, capsys):
    words = [*WORDS, "--total-steps", "16", "--encoder", str(paper_encoder), "--out", str(tmp_path / "run")]
    assert main(["train", "ppo", "--as-paper", *words]) == 0
    folder = tmp_path / "run" / "bundle"
    bundle = Bundle.load(folder)
    assert (bundle.manifest["representation"], bundle.manifest["latent_size"]) == ("paper", 128)
    assert (bundle.observes, bundle.conditions) == ({"pose": 6}, Conditions("vices", "learned", True))
    capsys.readouterr()
    assert main(["evaluate", str(folder), "--episodes", "1", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["controller"], result["as_paper"]) == ("vices", True)
    assert "gains" not in result
