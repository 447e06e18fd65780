"""What runs a trial again names all that is not usual: an arm that was calibrated, a law of one's own."""

from dataclasses import replace

import numpy as np

from contactsafe import presets, robots
from contactsafe.experiments.again import run_again, same_arm

USUAL = robots.panda()
SHIPPED = {"safe": presets.safe()}
CALIBRATION = ("--calibration", "my {robot}.json")


def biased():
    """Return a Panda whose description says nothing of what its sensors show."""
    return replace(USUAL, sensor_drag=np.eye(7)[:, :3])


def test_an_arm_is_the_same_only_if_all_its_numbers_are():
    assert same_arm(USUAL, robots.panda())
    assert not same_arm(USUAL, biased())
    assert not same_arm(USUAL, robots.fr3())
    heavy = robots.panda()
    heavy.model.body_mass[3] += 0.1
    assert not same_arm(USUAL, heavy)


def test_a_calibrated_arm_is_named_in_the_command():
    told = run_again("run_pushes", ["pushes"], SHIPPED, (biased(), USUAL), CALIBRATION).format(seed=7)
    assert told == ("contactsafe experiment pushes --calibration 'my {robot}.json' --trials 1 --out trial-7 --seed 7")


def test_what_no_command_says_is_python():
    assert (
        run_again("run_pushes", ["pushes"], SHIPPED, (biased(), USUAL)) == "run_pushes(controllers, [{seed}], arm=arm)"
    )
    own = {"softer": presets.safe()}
    assert run_again("run_pushes", ["pushes"], own, (USUAL, USUAL)) == "run_pushes(controllers, [{seed}])"
    assert "arm=arm" in run_again("run_pushes", ["pushes"], own, (biased(), USUAL), CALIBRATION)


def test_the_usual_arm_needs_no_words():
    told = run_again("run_pushes", ["pushes"], SHIPPED, (robots.panda(), USUAL)).format(seed=1)
    assert told == "contactsafe experiment pushes --trials 1 --out trial-1 --seed 1"
