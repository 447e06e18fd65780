"""A log is read by the names that its columns usually have, or by those that are given; mistakes are one line."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.logs.log import Log
from contactsafe.logs.reading import read_log

ROWS = 60
RNG = np.random.default_rng(0)
TIME = 0.001 * np.arange(ROWS)
ARRAYS = {name: RNG.normal(size=(ROWS, 7)) for name in ("q", "qd", "torque")}


def csv_of(path, columns):
    """Write arrays as columns; `columns` gives the header's name of each."""
    header, values = [], []
    for name, array in columns.items():
        header += [name] if array.ndim == 1 else [name.format(i) for i in range(array.shape[1])]
        values += [array[:, None] if array.ndim == 1 else array]
    np.savetxt(path, np.hstack(values), delimiter=",", header=",".join(header), comments="")
    return path


def same(log):
    np.testing.assert_allclose(log.time, TIME)
    for name, array in ARRAYS.items():
        np.testing.assert_allclose(getattr(log, name), array)


@pytest.mark.parametrize("form", ["{0}_{{}}", "{0}{{}}", "{0}[{{}}]", "{0}.{{}}"])
def test_a_csv_is_read_whatever_its_columns_are_numbered_like(tmp_path, form):
    columns = {"t": TIME, **{form.format(name): array for name, array in ARRAYS.items()}}
    same(read_log(csv_of(tmp_path / "log.csv", columns)))


def test_columns_may_stand_in_any_order_and_count_from_one(tmp_path):
    columns = {f"q{i + 1}": ARRAYS["q"][:, i] for i in reversed(range(7))}
    columns |= {"tau_J_{}": ARRAYS["torque"], "timestamp": TIME, "dq_{}": ARRAYS["qd"], "comment": TIME}
    same(read_log(csv_of(tmp_path / "log.csv", columns)))


def test_an_npz_is_read(tmp_path):
    np.savez(tmp_path / "log.npz", time=TIME, **ARRAYS)
    same(read_log(tmp_path / "log.npz"))


def test_a_single_joint_may_be_without_columns(tmp_path):
    """A one-joint NPZ with q of shape (T,)."""
    np.savez(tmp_path / "log.npz", time=TIME, q=ARRAYS["q"][:, 0], torque=ARRAYS["torque"][:, 0])
    log = read_log(tmp_path / "log.npz")
    assert log.n == 1
    np.testing.assert_array_equal(log.torque, ARRAYS["torque"][:, :1])
    with pytest.raises(InvalidInputError, match=r"here: 'q' has shape \(60,\); give \(T, n\)"):
        Log("here", TIME, ARRAYS["q"][:, 0], torque=ARRAYS["torque"][:, 0])


def test_names_are_mapped_and_a_rate_stands_for_the_time(tmp_path):
    np.savez(tmp_path / "log.npz", a_q=ARRAYS["q"], a_dq=ARRAYS["qd"], a_tau=ARRAYS["torque"])
    same(read_log(tmp_path / "log.npz", {"q": "a_q", "qd": "a_dq", "torque": "a_tau"}, rate_hz=1000.0))


def test_what_is_not_needed_may_be_missing(tmp_path):
    np.savez(tmp_path / "log.npz", time=TIME, q=ARRAYS["q"], command=ARRAYS["torque"])
    log = read_log(tmp_path / "log.npz")
    assert log.qd is None
    assert log.torque is None
    assert log.wrench_ee is None
    assert log.wrench_base is None


def test_a_wrench_at_the_base_is_read_by_its_name_or_another(tmp_path):
    at_base = RNG.normal(size=(ROWS, 6))
    columns = {"t": TIME, "q_{}": ARRAYS["q"], "tau_{}": ARRAYS["torque"], "wrench_base_{}": at_base}
    np.testing.assert_allclose(read_log(csv_of(tmp_path / "log.csv", columns)).wrench_base, at_base)
    np.savez(tmp_path / "log.npz", time=TIME, **ARRAYS, stand=at_base)
    np.testing.assert_array_equal(read_log(tmp_path / "log.npz", {"wrench_base": "stand"}).wrench_base, at_base)


@pytest.mark.parametrize(
    ("arrays", "columns", "text"),
    [
        ({"time": TIME, "angles": ARRAYS["q"]}, None, "has no 'q'; it has angles, time: say which is it"),
        ({"q": ARRAYS["q"], "torque": ARRAYS["torque"]}, None, "or give the rate of its rows"),
        ({"time": TIME, "q": ARRAYS["q"]}, None, "has neither 'torque' nor 'command'"),
        ({"time": TIME, **ARRAYS}, {"torque": "tau"}, "has no 'tau' for torque; it has q, qd, time, torque"),
        ({"time": TIME, **ARRAYS}, {"speed": "qd"}, "'speed' is nothing a log has; choose from time, q, qd"),
        ({"time": TIME[::-1], **ARRAYS}, None, "time does not go on at row 1"),
        ({"time": 1e6 * TIME + 1e5 * np.arange(ROWS), **ARRAYS}, None, "give it in seconds"),
        ({"time": TIME, **ARRAYS, "qd": ARRAYS["qd"][:, :6]}, None, r"'qd' has shape \(60, 6\); give \(60, 7\)"),
        ({"time": TIME, **ARRAYS, "wrench_base": ARRAYS["q"]}, None, r"'wrench_base' has shape .*; give \(60, 6\)"),
        ({"time": TIME, **ARRAYS, "qd": ARRAYS["qd"][:50]}, None, r"'qd' has shape \(50, 7\)"),
        ({"time": TIME[:20], "q": ARRAYS["q"][:20]}, None, "has 20 rows; give at least 50"),
        (
            {"time": TIME, **ARRAYS, "q": np.where(np.arange(ROWS)[:, None] == 7, np.nan, ARRAYS["q"])},
            None,
            "'q' is not finite in 1 rows, first in row 7",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_in_one_line(tmp_path, arrays, columns, text):
    np.savez(tmp_path / "log.npz", **arrays)
    with pytest.raises(InvalidInputError, match=text) as caught:
        read_log(tmp_path / "log.npz", columns)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("log.csv", b"0.1,0.2,0.3\n", "has no header"),
        ("log.csv", b"", "has no header"),
        ("log.csv", b"t,q0\n0.0,a\n", "has a cell that is no number"),
        ("log.csv", b"t,q0,q1\n0.0,1.0\n", "3 names and 2 columns"),
        ("log.npz", b"PK not a zip", "is no sound NPZ"),
        ("log.bag", b"", "is no log that can be read"),
    ],
)
def test_a_file_that_is_no_log_is_told_in_one_line(tmp_path, name, content, text):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidInputError, match=text) as caught:
        read_log(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InvalidInputError, match="cannot be read"):
        read_log(tmp_path / "none.csv")


def test_nothing_in_an_npz_is_run(tmp_path):
    np.savez(tmp_path / "log.npz", q=np.array([{"a": 1}], dtype=object))
    with pytest.raises(InvalidInputError, match="no sound NPZ"):
        read_log(tmp_path / "log.npz")


def test_a_log_knows_its_rate():
    log = Log("here", TIME, ARRAYS["q"], torque=ARRAYS["torque"])
    assert log.step_s == pytest.approx(0.001)
    assert log.seconds == pytest.approx(0.059)
    assert log.n == 7
