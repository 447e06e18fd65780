"""Models of files through the battery: loaded by path, compared with the baseline, refused with the reason."""

import math
from pathlib import Path

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.any_arm import any_arm
from contactsafe.experiments.any_arm_tables import compared
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.report import write_report
from contactsafe.results.experiment import Trial
from contactsafe.sim.model_arms import load_model, pushed_at
from contactsafe.sim.model_scenes import build_scene, sphere_in_path

SERVO_ARM = str(Path(__file__).parents[2] / "examples" / "servo_arm.xml")


@pytest.fixture(scope="module")
def battery():
    return any_arm(ExperimentConfig(("vices", "safe"), models=(SERVO_ARM, f"{SERVO_ARM}:wrist3")))


def test_arm_of_a_file_is_stable_arrives_and_is_gentle(battery):
    by_controller = {name: [t for t in battery.trials if t.controller == name] for name in ("vices", "safe")}
    for vices, safe in zip(by_controller["vices"], by_controller["safe"], strict=True):
        assert safe.metrics["not_finite"] == 0.0
        assert safe.metrics["hold_mm"] < 1.0
        assert safe.metrics["move_mm"] < 2.0
        assert safe.metrics["peak_regression"] == safe.metrics["pushed_further"] == 0.0
        assert safe.metrics["sprung_peak_n"] < vices.metrics["sprung_peak_n"]


def test_every_model_has_a_row_and_a_picture(battery, tmp_path):
    assert len(battery.tables[0].rows) == 8
    assert [portrait.name for portrait in battery.portraits] == [
        "examples/servo_arm: 6 joints", "examples/servo_arm:wrist3: 6 joints",
    ]  # fmt: skip
    page = write_report(tmp_path, [battery], {"command": "contactsafe experiment robots"}).read_text()
    assert page.count('class="portrait strip"') == 2


def test_file_that_is_none_is_refused_by_name():
    with pytest.raises(InvalidInputError, match=r"model 'nowhere\.xml' is no file"):
        any_arm(ExperimentConfig(models=("nowhere.xml",)))


def test_no_model_is_refused():
    with pytest.raises(InvalidInputError, match="no model given; give --models"):
        any_arm(ExperimentConfig())


def test_model_that_cannot_be_driven_has_its_reason_in_the_table(tmp_path):
    bad = tmp_path / "bad.xml"
    bad.write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    found = any_arm(ExperimentConfig(("vices",), models=(str(bad), SERVO_ARM)))
    assert "chain of 0 hinges" in found.tables[0].rows[0][-1]
    assert len(found.trials) == 2


def test_worse_than_the_baseline_is_told_model_by_model():
    figures = {"pushed_mm": 10.0, "sprung_peak_n": 20.0}
    trials = [
        Trial("s", "vices", 0, figures),
        Trial("s", "safe", 0, {"pushed_mm": 15.0, "sprung_peak_n": 27.0}),
        Trial("s", "safe", 1, figures),
    ]
    one, other, without = (trial.metrics for trial in compared(trials))
    assert (one["pushed_further"], one["peak_regression"]) == (0.0, 0.0)
    assert (other["pushed_further"], other["peak_regression"]) == (1.0, 1.0)
    assert "peak_regression" not in without


def test_sphere_is_clear_of_the_arm_at_first_and_met_on_the_way():
    of = load_model(SERVO_ARM)
    q = np.linspace(of.arm.home, of.q_end, 1000)
    centre = sphere_in_path(of, q)
    scene = build_scene(of, centre)
    assert scene.force_on_sphere() == 0.0
    scene.data.qpos[scene.at.qpos] = of.q_end
    scene.step(np.zeros(of.arm.n))
    assert scene.force_on_sphere() > 0.0


def test_push_is_no_more_than_a_tenth_of_what_the_arm_holds():
    of = load_model(SERVO_ARM)
    _, force = pushed_at(of)
    assert 0.0 < np.linalg.norm(force) <= 25.0
    assert math.isclose(abs(force).max(), np.linalg.norm(force))
