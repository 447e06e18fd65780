"""Logs in MCAP: joint states of ROS 2 and JSON messages, joints put in the arm's order, mistakes in one line."""

import json

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.logs import mcap_reading
from contactsafe.logs.mcap_reading import joint_order
from contactsafe.logs.reading import read_log

ros2 = pytest.importorskip("mcap_ros2.writer")
plain = pytest.importorskip("mcap.writer")

ROWS = 60
RNG = np.random.default_rng(0)
TIME = 100.0 + 0.01 * np.arange(ROWS)
Q, QD, TORQUE = (RNG.normal(size=(ROWS, 7)) for _ in range(3))
JOINTS = [f"joint{i}" for i in range(1, 8)]

JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def joint_states(path, topics=("/joint_states",), names=None, stamped=True):
    """Write joint states; `names` gives the names of each message, None for the Panda's."""
    with path.open("wb") as file:
        writer = ros2.Writer(file)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for topic in topics:
            for k, now in enumerate(TIME):
                called = names(k) if names else [f"panda_{joint}" for joint in JOINTS]
                at = [int(name[-1]) - 1 for name in called]
                stamp = {"sec": int(now), "nanosec": round(1e9 * (now % 1.0))} if stamped else {"sec": 0, "nanosec": 0}
                message = {
                    "header": {"stamp": stamp, "frame_id": ""},
                    "name": called,
                    "position": Q[k, at].tolist(),
                    "velocity": QD[k, at].tolist(),
                    "effort": TORQUE[k, at].tolist(),
                }
                nanoseconds = round(1e9 * now)
                writer.write_message(topic, schema, message, log_time=nanoseconds, publish_time=nanoseconds)
        writer.finish()
    return path


def messages(path, rows, topic="/robot"):
    """Write JSON messages."""
    with path.open("wb") as file:
        writer = plain.Writer(file)
        writer.start()
        schema = writer.register_schema("state", "jsonschema", b"{}")
        channel = writer.register_channel(topic, "json", schema)
        for now, row in zip(TIME, rows, strict=True):
            nanoseconds = round(1e9 * now)
            writer.add_message(channel, nanoseconds, json.dumps(row).encode(), nanoseconds)
        writer.finish()
    return path


def assert_same(log, joints=7):
    np.testing.assert_allclose(log.time, TIME, atol=1e-8)
    for found, written in ((log.q, Q), (log.qd, QD), (log.torque, TORQUE)):
        np.testing.assert_allclose(found, written[:, :joints])


@pytest.mark.parametrize("stamped", [True, False])
def test_joint_states_of_ros_2_are_read(tmp_path, stamped):
    assert_same(read_log(joint_states(tmp_path / "log.mcap", stamped=stamped), joints=JOINTS))


def test_joints_are_put_in_the_arms_order_by_their_names(tmp_path):
    def shuffled(k):
        return [f"panda_joint{i}" for i in np.random.default_rng(k).permutation(7) + 1]

    assert_same(read_log(joint_states(tmp_path / "log.mcap", names=shuffled), joints=JOINTS))


def test_what_else_has_a_name_is_left_out(tmp_path):
    path = joint_states(tmp_path / "log.mcap")
    log = read_log(path, joints=JOINTS[:3])
    np.testing.assert_allclose(log.q, Q[:, :3])


def test_json_messages_are_read_by_the_usual_names(tmp_path):
    rows = [
        {"q": q, "dq": qd, "tau_J": tau, "note": "x"}
        for q, qd, tau in zip(Q.tolist(), QD.tolist(), TORQUE.tolist(), strict=True)
    ]
    assert_same(read_log(messages(tmp_path / "log.mcap", rows)))


def test_a_stamp_in_json_is_the_time(tmp_path):
    rows = [
        {"header": {"stamp": {"sec": k, "nanosec": 500_000_000}}, "q": Q[k].tolist(), "effort": TORQUE[k].tolist()}
        for k in range(ROWS)
    ]
    np.testing.assert_allclose(read_log(messages(tmp_path / "log.mcap", rows)).time, 0.5 + np.arange(ROWS))


def test_effort_may_be_what_was_commanded(tmp_path):
    log = read_log(joint_states(tmp_path / "log.mcap"), {"command": "effort"}, joints=JOINTS)
    np.testing.assert_allclose(log.command, TORQUE)
    assert log.torque is None


def test_of_several_topics_one_is_chosen(tmp_path):
    path = joint_states(tmp_path / "log.mcap", topics=("/left", "/right"))
    with pytest.raises(InvalidInputError, match="joint states are on /left, /right; say which, --topic NAME"):
        read_log(path, joints=JOINTS)
    assert_same(read_log(path, topic="/left", joints=JOINTS))
    with pytest.raises(InvalidInputError, match="no joint states on topic '/other'"):
        read_log(path, topic="/other", joints=JOINTS)


def test_a_topic_that_is_not_there_is_answered_with_those_that_are(tmp_path):
    path = joint_states(tmp_path / "log.mcap", topics=("/left", "/right"))
    with pytest.raises(InvalidInputError, match="no joint states on topic '/other'; joint states are on /left, /right"):
        read_log(path, topic="/other", joints=JOINTS)
    path = messages(tmp_path / "note.mcap", [["no object"]] * ROWS)
    for topic in (None, "/other"):
        with pytest.raises(
            InvalidInputError, match="has no messages that can be read: its topics are /robot; give one"
        ):
            read_log(path, topic=topic)


@pytest.mark.parametrize(
    "extra",
    [{"stamp": {"sec": None}}, {"stamp": {"sec": "a"}}, {"stamp": {"sec": 10**400}}, {"name": 3}, {"x": [10**400]}],
)
def test_json_that_is_not_as_expected_is_no_traceback(tmp_path, extra):
    rows = [
        {"q": q, "dq": qd, "tau_J": tau, **extra}
        for q, qd, tau in zip(*map(np.ndarray.tolist, (Q, QD, TORQUE)), strict=True)
    ]
    assert_same(read_log(messages(tmp_path / "log.mcap", rows)))


def test_a_joint_state_that_was_cut_is_told_in_one_line(tmp_path):
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = plain.Writer(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE.encode())
        channel = writer.register_channel("/joint_states", "cdr", schema)
        writer.add_message(channel, 1, b"\x00\x01\x00\x00\x05\x00", 1)
        writer.finish()
    with pytest.raises(InvalidInputError, match=r"log.mcap is no sound MCAP: .*; record it anew") as caught:
        read_log(path, joints=JOINTS)
    assert "\n" not in str(caught.value)


def test_a_topic_is_for_an_mcap(tmp_path):
    np.savez(tmp_path / "log.npz", time=TIME, q=Q, torque=TORQUE)
    with pytest.raises(InvalidInputError, match="topic = '/a' is for an MCAP"):
        read_log(tmp_path / "log.npz", topic="/a")


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"not an mcap at all", b"\x89MCAP0\r\n" + b"\xff" * 100])
def test_what_is_no_mcap_is_told_in_one_line(tmp_path, content):
    (tmp_path / "log.mcap").write_bytes(content)
    with pytest.raises(InvalidInputError) as caught:
        read_log(tmp_path / "log.mcap")
    assert "log.mcap" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_truncated_one_is_told_in_one_line(tmp_path):
    path = joint_states(tmp_path / "log.mcap")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InvalidInputError) as caught:
        read_log(path, joints=JOINTS)
    assert "\n" not in str(caught.value)


def test_without_the_extra_the_remedy_is_told(tmp_path, monkeypatch):
    path = joint_states(tmp_path / "log.mcap")
    monkeypatch.setattr(mcap_reading.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InvalidInputError, match=r"needs mcap, mcap_ros2; run: pip install 'contactsafe\[mcap\]'"):
        read_log(path, joints=JOINTS)


def test_names_that_fit_decide_the_order():
    assert joint_order("log", ["elbow", "pan", "lift"], ["pan", "lift", "elbow"]) == [1, 2, 0]
    assert joint_order("log", ["arm_joint2", "arm_joint1"], ["joint1", "joint2"]) == [1, 0]
    hand = [*(f"panda_joint{i}" for i in range(1, 8)), "panda_finger_joint1", "panda_finger_joint2"]
    assert joint_order("log", hand, JOINTS) == list(range(7))
    assert joint_order("log", hand[::-1], JOINTS) == list(range(8, 1, -1))
    assert joint_order("log", ["A1", "A2", "A3"], ["x", "y", "z"]) == [0, 1, 2]


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        (["b", "a"], ["x", "y"]),
        (["A2", "A1"], ["x", "y"]),
        (["left_joint1", "right_joint1"], ["joint1"]),
        (["left_joint1", "right_joint1", "left_joint2", "right_joint2"], ["joint1", "joint2"]),
        (["pan", "elbow"], ["pan", "lift"]),
    ],
)
def test_names_that_do_not_tell_are_refused(names, joints):
    with pytest.raises(InvalidInputError, match="say which are the arm's from base to tip, --joints NAME"):
        joint_order("log", names, joints)
