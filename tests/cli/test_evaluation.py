"""`contactsafe evaluate`."""

import json

import numpy as np
import pytest
from tests.cli.mistakes import mistake

from contactsafe.cli import main
from contactsafe.robot.calibration import Calibration
from contactsafe.tasks import TASKS
from contactsafe.tasks.wiping.figures import FIGURES


def test_a_bundle_and_a_scripted_policy_are_one_too_many(bundle, capsys):
    told = mistake(capsys, "evaluate", str(bundle), "--scripted", "raster")
    assert told == "a bundle and --scripted raster are both given; name one"


def test_evaluate_says_how_the_policy_did(bundle, capsys):
    assert main(["evaluate", str(bundle), "--episodes", "2", "--seed", "3", "--json"]) == 0
    results = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert results["seed"] == 3
    assert len(results["records"]) == 2


def test_evaluate_explains_every_figure_it_prints(bundle, capsys):
    assert main(["evaluate", str(bundle), "--episodes", "1", "--seed", "3"]) == 0
    asked, *rows = capsys.readouterr().out.splitlines()
    assert asked.startswith(f"task wiping, policy {bundle}, seed 3, controller safe, pushed False, boards strokes")
    assert [row.split()[0] for row in rows] == [figure.name for figure in FIGURES]
    assert all(figure.doc in row for figure, row in zip(FIGURES, rows, strict=True))


def test_evaluate_says_with_which_calibration(tmp_path, capsys):
    noise, path = np.full(7, 0.1), str(tmp_path / "robot.json")
    Calibration("panda", "wiper", noise, noise, noise).save(path)
    words = ["evaluate", "--scripted", "random", "--episodes", "1", "--calibration", path]
    assert main(words) == 0
    assert f"seed 0, calibration {path}, controller safe" in capsys.readouterr().out
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["calibration"] == path


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_scripted_policies_of_every_task_run_by_name_and_repeat(task, engine, capsys):
    if engine == "pybullet":
        pytest.importorskip("pybullet")
    words = ["evaluate", "--task", task, "--scripted", "random", "--episodes", "1", "--engine", engine, "--json"]
    found = []
    for _ in range(1 if engine == "pybullet" else 2):
        assert main(words) == 0
        found.append(json.loads(capsys.readouterr().out, parse_constant=pytest.fail))
    assert found[0] == found[-1]
    assert found[0]["task"] == task
    assert found[0]["policy"] == "random"
    assert found[0]["options"]["engine"] == engine


def test_a_preset_with_other_parameters_is_what_the_arm_is_evaluated_under(capsys):
    words = "evaluate --scripted random --episodes 1 --json --controller safe:tank_j=2:passive_gains=no"
    assert main(words.split()) == 0
    results = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert results["controller"] == "safe:tank_j=2:passive_gains=no"
    assert main(words.replace("tank_j=2", "tank_j=-2").split()) == 2
    assert "tank_j = -2.0" in capsys.readouterr().err
