"""A replay says what touched the arm, when, where and how hard, and what is wrong with the robot's signals."""

import json

import mujoco
import numpy as np
import pytest
from tests.robot.worlds import TWO_JOINTS

from contactsafe import robots
from contactsafe.cli import main
from contactsafe.core.errors import InvalidInputError
from contactsafe.logs.log import Log
from contactsafe.logs.replay import replay
from contactsafe.logs.results import results_of

PUSH_N = np.array([0.0, 25.0, 0.0])


@pytest.fixture(scope="module")
def arm():
    return robots.panda("hand")


def recorded(arm, push=True, load_nm=0.0, noise=0.0, rate_hz=1000):
    """Hold an arm by a joint controller, push it on its forearm from 1 s to 1.5 s, and record it."""
    model, data, rng = arm.model, mujoco.MjData(arm.model), np.random.default_rng(0)
    data.qpos[:] = arm.home
    drift = np.zeros(7)  # noise of a real robot's velocity lies below 50 Hz
    every, rows = 1000 // rate_hz, {name: [] for name in ("time", "q", "qd", "torque", "command", "wrench_base")}
    for tick in range(2500):
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        moment, force = data.cfrc_int[1].reshape(2, 3)  # of the base on the arm, about its centre of mass
        at_base = -np.concatenate([force, moment + np.cross(data.subtree_com[1], force)])
        command = 400.0 * (arm.home - data.qpos) - 40.0 * data.qvel + data.qfrc_bias
        data.xfrc_applied[model.body("link5").id, :3] = PUSH_N if push and 1000 <= tick < 1500 else 0.0
        drift += 0.2 * (noise * rng.standard_normal(7) - drift)
        if tick % every == 0:
            shown = command - model.dof_armature * data.qacc + load_nm
            seen = (0.001 * tick, data.qpos.copy(), data.qvel + drift, shown, command, at_base)
            for values, value in zip(rows.values(), seen, strict=True):
                values.append(value)
        data.qfrc_applied[:] = command
        mujoco.mj_step(model, data)
    return {name: np.array(values) for name, values in rows.items()}


def log_of(rows):
    return Log("a log", rows["time"], rows["q"], rows["qd"], rows["torque"])


def test_a_wrench_at_the_base_is_played_too_and_tells_the_force_better(arm):
    rows = recorded(arm)
    log = Log("a log", rows["time"], rows["q"], rows["qd"], rows["torque"], wrench_base=rows["wrench_base"])
    told, untold = (replay(one, arm).touches[0] for one in (log, log_of(rows)))
    assert np.linalg.norm(told.force - PUSH_N) < np.linalg.norm(untold.force - PUSH_N) + 0.5
    assert told.force @ PUSH_N / 25.0 == pytest.approx(25.0, rel=0.1)


@pytest.mark.parametrize("rate_hz", [1000, 200, 100])
def test_a_push_is_found_with_its_time_its_link_and_its_force(arm, rate_hz):
    played = replay(log_of(recorded(arm, rate_hz=rate_hz)), arm)
    first = played.touches[0]
    assert first.start_s == pytest.approx(1.0, abs=0.05)
    assert first.stop_s == pytest.approx(1.5, abs=0.15)
    assert abs(first.link - 5) <= 1
    assert first.force @ PUSH_N / 25.0 == pytest.approx(25.0, rel=0.3)
    assert "if nothing touched the arm then, they are false" in played.verdict()


def test_a_log_without_a_touch_says_how_far_from_one_it_is(arm):
    played = replay(log_of(recorded(arm, push=False)), arm)
    assert not played.touches
    assert played.verdict().startswith("nothing felt in 2.5 s: the residual is at most ")


def test_another_arm_than_the_model_is_told_from_touches(arm):
    """A hand that is not there, a sensor that is off: the residual lies elsewhere all the time."""
    played = replay(log_of(recorded(arm, push=False, load_nm=np.array([0.0, 4.0, 0.0, 3.0, 0.0, 0.0, 0.0]))), arm)
    assert "as if the arm were another; check robot, tool, payload and gravity" in played.verdict()
    assert "joint 2" in played.verdict() or "joint 4" in played.verdict()


def test_a_noisy_velocity_is_named_and_no_contact(arm):
    rows = recorded(arm, push=False, noise=0.02)
    played = replay(log_of(rows), arm)
    assert not played.touches
    assert set(played.velocity_from) == {"positions"}


def test_a_log_without_velocities_is_played_with_those_of_its_positions(arm):
    rows = recorded(arm)
    played = replay(Log("a log", rows["time"], rows["q"], None, rows["torque"]), arm)
    assert played.touches[0].start_s == pytest.approx(1.0, abs=0.05)


def test_a_log_of_commands_is_played_too(arm):
    rows = recorded(arm)
    log = Log("a log", rows["time"], rows["q"], rows["qd"], command=rows["command"])
    assert replay(log, arm).touches[0].start_s == pytest.approx(1.0, abs=0.05)


def test_a_log_of_another_arm_is_refused(arm):
    rows = recorded(arm, push=False)
    with pytest.raises(InvalidInputError, match="has 6 joints, arm 'panda' has 7"):
        replay(Log("a log", rows["time"], rows["q"][:, :6], torque=rows["torque"][:, :6]), arm)


def test_results_are_tables_and_a_plot_for_every_joint(arm):
    found = results_of(replay(log_of(recorded(arm)), arm))
    assert [table.name for table in found.tables] == ["touches", "signals"]
    assert len(found.tables[1].rows) == len(found.figures[0].plots) == 7
    json.dumps(found.as_dict(), allow_nan=False)


@pytest.fixture(scope="module")
def file(arm, tmp_path_factory):
    rows = recorded(arm)
    path = tmp_path_factory.mktemp("logs") / "pushed.npz"
    np.savez(path, t=rows["time"], q=rows["q"], qd=rows["qd"], tau_J=rows["torque"])
    return path


def test_the_command_says_it_in_one_line_and_writes_a_page(file, tmp_path, capsys):
    assert main(["replay", str(file), "--out", str(tmp_path / "page")]) == 0
    printed = capsys.readouterr()
    assert printed.out.rstrip().splitlines()[-1].endswith("if nothing touched the arm then, they are false")
    assert "What was felt" in printed.out
    page = (tmp_path / "page" / "report.html").read_text(encoding="utf-8")
    assert page.count('class="plot"') == 7
    assert "simulated" not in page


def test_the_command_prints_json(file, capsys):
    assert main(["replay", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["tables"]["touches"][0]["kind"] in ("push", "obstacle")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--robot", "kuka"], "is neither panda, fr3 nor a file"),
        (["--tool", "spoon"], "is unknown; give one of flange, hand, wiper"),
        (["--columns", "torque"], "maps nothing; write what is held=its name in the log"),
        (["--columns", "torque=tau"], "has no 'tau' for torque"),
        (["--rate", "-1"], "give a number greater than 0"),
        (["--site", "tip"], "leave it out for panda"),
    ],
)
def test_what_makes_no_sense_is_one_line(file, capsys, words, text):
    assert main(["replay", str(file), *words]) == 1
    error = capsys.readouterr().err.strip()
    assert text in error
    assert "\n" not in error


def test_help_says_what_a_log_needs(capsys):
    assert main(["replay", "--help"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "a CSV, NPZ or MCAP file with time, q, and torque or command" in printed
    assert "--columns" in printed


def test_a_users_own_robot_is_replayed(tmp_path, capsys):
    """An arm of two joints that stands; a force turns it about the second."""
    path, rows = tmp_path / "arm.xml", 400
    path.write_text(TWO_JOINTS, encoding="utf-8")
    arm = robots.from_mjcf(str(path), "tip")
    q = np.tile([0.2, 0.5], (rows, 1))
    held = np.tile(arm.dynamics(q[0], np.zeros(2))["g"], (rows, 1))
    held[200:, 1] -= 6.0
    np.savez(tmp_path / "log.npz", t=0.002 * np.arange(rows), q=q, qd=0.0 * q, torque=held)
    assert main(["replay", str(tmp_path / "log.npz"), "--robot", str(path), "--site", "tip"]) == 0
    assert "1 contacts in 0.8 s" in capsys.readouterr().out
