"""Reading logs: CSV, NPZ and MCAP, whose columns have the usual names or are mapped."""

import csv
import re
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.logs.log import Log
from contactsafe.logs.mcap_reading import read_mcap
from contactsafe.logs.robot_run import run_arrays

NAMES: dict[str, tuple[str, ...]] = {
    "time": ("time", "t", "timestamp", "stamp", "time_s"),
    "q": ("q", "qpos", "position", "positions", "joint_position", "joint_positions"),
    "qd": ("qd", "dq", "qvel", "velocity", "velocities", "joint_velocity", "joint_velocities"),
    "torque": ("torque", "tau_J", "tau", "effort", "efforts", "joint_torque", "joint_torques", "measured_torque"),
    "command": ("command", "tau_J_d", "tau_d", "tau_cmd", "commanded_torque", "joint_command"),
    "wrench_ee": ("wrench_ee", "wrench"),
    "wrench_base": ("wrench_base", "base_wrench"),
}
"""What a log has, and the names by which it is found where none is given."""


def read_log(
    path: Path,
    columns: Mapping[str, str] | None = None,
    rate_hz: float | None = None,
    topic: str | None = None,
    joints: Sequence[str] | None = None,
) -> Log:
    """Read a log.

    Columns of a CSV are named by what they hold and a number, as q_0 … q_6, q1 … q7 or q[0] … q[6]; an NPZ has an array
    (T, n) by each name. An MCAP has joint states of ROS 2, or JSON messages with an array by each name;
    or it is the log of `contactsafe run`.

    Args:
        path: of a file that ends in .csv, .npz or .mcap.
        columns: names that differ from `NAMES`: what is held → name in the file.
        rate_hz: of its rows, in place of its time, if any.
        topic: of an MCAP's messages; None for the only one that has joint states.
        joints: names of the arm's joints from base to tip, by which an MCAP's are put in order; None for their own.

    Raises:
        InvalidInputError: it cannot be read, something needed is missing, or no robot recorded it; see `Log`.
    """
    columns = dict(columns or {})
    for known in columns:
        if known not in NAMES:
            raise InvalidInputError(f"column {shown(known)} is nothing a log has; choose from {', '.join(NAMES)}")
    readers = {
        ".csv": _read_csv,
        ".npz": _read_npz,
        ".mcap": lambda path: run_arrays(path) or read_mcap(path, topic, joints),
    }
    if path.suffix.lower() not in readers:
        raise InvalidInputError(f"{path.name} is no log that can be read; give a file that ends in .csv, .npz or .mcap")
    try:
        arrays = readers[path.suffix.lower()](path)
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror or error}; give a log") from None
    if topic is not None and path.suffix.lower() != ".mcap":
        raise InvalidInputError(f"topic = {shown(topic)} is for an MCAP; leave it out for {path.name}")
    mapped = set(columns.values())
    found = {}
    for known in NAMES:
        rest = arrays if known in columns else {name: array for name, array in arrays.items() if name not in mapped}
        found[known] = _pick(path.name, rest, known, columns.get(known))
    given = {known: values for known, values in found.items() if values is not None}
    if "q" not in given or ("time" not in given and rate_hz is None):
        raise InvalidInputError(
            f"{path.name} has no '{'time' if 'q' in given else 'q'}'; it has {', '.join(sorted(arrays))}: "
            "say which is it, or give the rate of its rows"
        )
    time = given.pop("time", None)
    if rate_hz is not None:
        time = np.arange(len(given["q"])) / rate_hz
    columns_of = {known: values[:, None] if values.ndim == 1 else values for known, values in given.items()}
    return Log(path.name, np.asarray(time).reshape(-1), **columns_of)


def _pick(source: str, arrays: Mapping[str, np.ndarray], known: str, name: str | None) -> np.ndarray | None:
    """Return what a log holds by one of its names, or by the name that was given."""
    if name is not None and name not in arrays:
        raise InvalidInputError(f"{source} has no '{name}' for {known}; it has {', '.join(sorted(arrays))}")
    for one in NAMES[known] if name is None else (name,):
        if one in arrays:
            return arrays[one]
    return None


def _read_npz(path: Path) -> dict[str, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as data:
            found = {name: data[name] for name in data.files}
    except (ValueError, zipfile.BadZipFile, EOFError, KeyError) as error:
        raise InvalidInputError(f"{path.name} is no sound NPZ: {shown(str(error))}; give arrays of numbers") from None
    return {name: array.astype(float) for name, array in found.items() if array.dtype.kind in "fiu" and array.ndim > 0}


def _read_csv(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        header = next(csv.reader(file), [])
        names = [name.strip() for name in header]
        if not names or any(_is_number(name) for name in names):
            raise InvalidInputError(f"{path.name} has no header; name its columns in the first line")
        try:
            values = np.loadtxt(file, delimiter=",", ndmin=2)
        except ValueError as error:
            raise InvalidInputError(f"{path.name} has a cell that is no number: {shown(str(error))}") from None
    if values.shape[1] != len(names):
        raise InvalidInputError(f"{path.name} has {len(names)} names and {values.shape[1]} columns; name every column")
    return _gathered(names, values)


def _gathered(names: Sequence[str], values: np.ndarray) -> dict[str, np.ndarray]:
    """Gather columns q_0, q_1, … into one array by the name before the number; others stand alone."""
    parts: dict[str, list[tuple[int, int]]] = {}
    for k, name in enumerate(names):
        numbered = re.fullmatch(r"(.*?)[_.\[]?(\d+)\]?", name)
        stem, index = (numbered[1], int(numbered[2])) if numbered else (name, 0)
        parts.setdefault(stem, []).append((index, k))
    return {stem: values[:, [k for _, k in sorted(found)]] for stem, found in parts.items()}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
