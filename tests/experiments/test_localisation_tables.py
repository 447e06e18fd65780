"""Tables of localisation from trials made up for the purpose."""

import math

import pytest

from contactsafe.experiments.localisation_tables import localisation_tables
from contactsafe.results.experiment import Trial

STILL, MOVED, TWO = "still, wrench of zero", "moved, wrench of zero", "two contacts, still, wrench of zero"


def trial(scenario, seed, controller="safe", plant="real", **figures):
    return Trial(scenario, controller, seed, {"link": 5.0, "felt": 1.0} | figures, plant)


def rows(table):
    return {(row["contact"], row["figure"]): row for row in table.as_records()}


def test_estimator_and_limit_stand_side_by_side():
    trials = [
        trial(STILL, 0, within_5_cm=1.0, limit_within_5_cm=1.0, limit_in_set=1.0),
        trial(STILL, 1, within_5_cm=0.0, limit_within_5_cm=1.0, limit_in_set=1.0),
    ]
    row = rows(localisation_tables(trials)[0])[STILL, "best point within 5 cm"]
    assert (row["limit"], row["safe"], row["aim, at least"]) == (100.0, 50.0, "70")


def test_once_moved_the_aim_is_another():
    trials = [trial(MOVED, 0, within_5_cm_moved=1.0, limit_within_5_cm_moved=0.0, limit_in_set=1.0)]
    row = rows(localisation_tables(trials)[0])[MOVED, "best point within 5 cm"]
    assert (row["limit"], row["safe"], row["aim, at least"]) == (0.0, 100.0, "85")


def test_what_was_not_felt_is_left_out_but_counted():
    trials = [trial(STILL, 0, point_error_cm=2.0, limit_in_set=1.0), trial(STILL, 1, felt=0.0, limit_in_set=1.0)]
    found = rows(localisation_tables(trials)[0])
    assert found[STILL, "contacts felt"]["safe"] == 50.0
    assert found[STILL, "best point, from the true one, median"]["safe"] == 2.0


def test_of_two_contacts_the_limit_says_whether_one_explains_them_and_the_estimator_nothing():
    trials = [trial(TWO, 0, nearest_point_error_cm=7.0, limit_told=1.0), trial(TWO, 1, limit_told=0.0)]
    found = rows(localisation_tables(trials)[0])
    told = found[TWO, "told that no single contact explains it"]
    assert told["limit"] == 50.0
    assert math.isnan(told["safe"])
    assert (TWO, "best point within 5 cm") not in found
    assert found[TWO, "best point, from the nearest of them, median"]["safe"] == 7.0


def test_plants_have_tables_of_their_own_and_links_are_of_the_first():
    trials = [
        trial(STILL, seed, plant=plant, link=link, in_set=1.0, limit_in_set=1.0)
        for plant in ("real", "clean")
        for seed, link in enumerate((3.0, 3.0, 7.0))
    ]
    real, clean, links = localisation_tables(trials)
    assert (real.name, clean.name, links.name) == ("limit_real", "limit_clean", "links_safe")
    assert [(row["link"], row["contacts"]) for row in links.as_records()] == [(3, 2), (7, 1)]
    assert all(row["contact"] == f"{STILL}, real" for row in links.as_records())


def test_estimators_share_the_limit():
    figures = {"in_set": 0.0, "limit_in_set": 1.0}
    trials = [trial(STILL, 0, name, **figures) for name in ("paper", "safe")]
    beside, *links = localisation_tables(trials)
    assert beside.columns[3:6] == ("limit", "paper", "safe")
    assert rows(beside)[STILL, "true point in the 95 % set"]["limit"] == pytest.approx(100.0)
    assert [table.name for table in links] == ["links_paper", "links_safe"]
