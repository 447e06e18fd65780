"""Experiments without a task ran on a Panda whatever arm was meant."""

from dataclasses import replace

import pytest

from contactsafe.core.errors import InvalidInputError, UnreachableError
from contactsafe.experiments import adversarial, clock, collisions, detection, localisation, pushes
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.robot import robots
from contactsafe.robot.arm import arm_from_description
from contactsafe.robot.franka import HAND
from contactsafe.robot.panda import PANDA

ARM = robots.fr3()
FIRST_CALL = {
    "adversarial": (adversarial, "run_adversarial"),
    "clock": (clock, "sample_scene"),
    "collisions": (collisions, "_run_batch"),
    "detection": (detection, "push_trials"),
    "localisation": (localisation, "dense_surface"),
    "pushes": (pushes, "_run_batch"),
}


class AskedError(Exception):
    """Ends an experiment at its first call."""


@pytest.mark.parametrize("name", FIRST_CALL)
def test_an_experiment_runs_on_the_arm_it_is_given(name, monkeypatch):
    seen = []

    def first(arm, *rest, **more):
        seen.append(arm)
        raise AskedError

    module, called = FIRST_CALL[name]
    monkeypatch.setattr(module, called, first)
    with pytest.raises(AskedError):
        getattr(module, name)(ExperimentConfig(("safe",), 1, arm=ARM))
    assert seen == [ARM]


def test_what_is_no_arm_is_refused():
    with pytest.raises(InvalidInputError, match=r"^arm is str; give an Arm such as contactsafe\.robots\.panda\(\)$"):
        ExperimentConfig(arm="fr3")


def test_motions_of_an_arm_that_reaches_none_were_sampled_for_ever():
    links = tuple(replace(link, position=tuple(0.3 * x for x in link.position)) for link in PANDA.links)
    with pytest.raises(UnreachableError, match=r"^arm 'panda' follows none of 2000 random paths"):
        sample_motion(arm_from_description(replace(PANDA, links=links), HAND), 0)


@pytest.mark.parametrize("seed", range(4))
def test_motions_of_another_arm_start_where_it_can_be(seed):
    motion = sample_motion(ARM, seed)
    assert ((motion.q_start > ARM.q_min) & (motion.q_start < ARM.q_max)).all()
