"""`contactsafe bench` and `contactsafe warmup`."""

import json

import pytest

from contactsafe.cli import main
from contactsafe.experiments import speed
from contactsafe.experiments.speed import Speed


@pytest.mark.slow
def test_warming_up_says_where_it_lies(capsys):
    """In the folder that the other tests have filled: each part runs."""
    assert main(["warmup", "--joints", "7"]) == 0
    said = capsys.readouterr()
    from contactsafe.core.compiled import CACHE_FOLDER

    assert CACHE_FOLDER in said.out
    assert said.out.count("\n") == 1


@pytest.fixture
def two_speeds(monkeypatch):
    """Stand in for measuring, which takes a minute; tells which task and policy were asked for."""
    asked = []

    def measure(scenes, bundle, progress):
        asked.append((scenes.name, bundle.manifest["task"]))
        for _ in range(speed.ROUNDS):
            progress()
        return [Speed("bare physics", 20.0, 18.0, 1.0), Speed("environment, one step", 2000.0, 1900.0, 100.0)]

    monkeypatch.setattr(speed, "measure_speed", measure)
    return asked


def test_the_speed_of_this_machine_is_a_table_with_the_steps_per_second(two_speeds, capsys):
    assert main(["bench"]) == 0
    _, *rows, last = capsys.readouterr().out.splitlines()
    assert [row.split()[0] for row in rows] == ["bare", "environment,"]
    assert all("µs" in row for row in rows)
    assert last == "environment steps per second: 500"
    assert [policy for _, policy in two_speeds] == ["wiping"]


def test_the_speed_of_this_machine_is_json_where_that_is_asked_for(two_speeds, capsys):
    assert main(["bench", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert [row["name"] for row in rows] == ["bare physics", "environment, one step"]
    assert rows[1]["ratio"] == 100.0
