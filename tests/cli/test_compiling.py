"""What `contactsafe warmup` goes through."""

import pytest

from contactsafe.cli import compiling, main
from contactsafe.cli.compiling import steps
from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks import TASKS, task_by_name


def test_what_is_warmed_up_is_told_and_checked(capsys):
    of_arms = [f"{what}, {n} joints" for what in ("controller", "estimator") for n in (6, 7)]
    assert list(steps(["6", "7"]))[:5] == [*of_arms, "worlds"]
    with pytest.raises(InvalidInputError) as caught:
        steps(["0"])
    assert str(caught.value) == "joints = 0; give numbers from 1 to 14, such as 6,7"
    assert main(["warmup", "--joints", "many"]) == 2
    assert capsys.readouterr().err.startswith("contactsafe: --joints: 'many' is unknown; choose from 1, 2, 3, ")


@pytest.mark.parametrize("word", ["0", "15", "-1", "6.5", "", "seven"])
def test_joints_that_no_arm_has_are_refused(word):
    with pytest.raises(InvalidInputError, match="give numbers from 1 to 14, such as 6,7"):
        steps(["7", word])


def test_every_task_is_compiled_and_its_variants_where_their_packages_are_there(monkeypatch):
    monkeypatch.setattr(compiling.importlib.util, "find_spec", lambda name: object())
    every = set(steps())
    monkeypatch.setattr(compiling.importlib.util, "find_spec", lambda name: None)
    fewest = set(steps())
    assert set(TASKS) <= fewest < every
    variants = {f"{task}{name}" for task in TASKS for _, name, *_ in task_by_name(task).warmup}
    assert every - fewest == variants


@pytest.mark.parametrize("n", [1, 2, 6, 7, 14])
def test_an_arm_of_any_number_of_joints_can_be_made_to_compile_for(n):
    arm = compiling._arm_of(n)
    assert arm.n == n
    assert arm.home.shape == (n,)
