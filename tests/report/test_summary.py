"""summary.json, the terminal's table, and the folder they go to."""

import json
import os
import stat

import pytest

import contactsafe
from contactsafe.core.errors import OutputError
from contactsafe.core.files import LOCK
from contactsafe.report import prepare_output, terminal_table, write_report, write_summary
from contactsafe.report.output import write_whole
from contactsafe.report.summary import trials_csv
from contactsafe.results.experiment import Experiment, Table, Trial
from contactsafe.results.metrics import Aim, Metric


def strict(text):
    def refuse(word):
        raise AssertionError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


def test_summary_is_strict_json_with_every_spread(folder, fakes, experiments):
    summary = strict((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["version"] == contactsafe.__version__
    for key in ("when", "seeds", "bundle_sha256", "command"):
        assert summary[key] == fakes.INFO[key]
    assert set(summary["versions"]) >= {"python", "numpy", "mujoco"}
    assert summary["experiments"] == {experiment.name: experiment.as_dict() for experiment in experiments}
    assert summary["experiments"]["task-safety"]["spread"]["wiping"]["paper"]["time_s"]["median"] is None


def test_folder_that_is_a_file_is_refused(tmp_path, fakes, experiments):
    taken = tmp_path / "results"
    taken.write_text("mine")
    expected = rf"^cannot write to {taken}: file exists; give a folder you may write to with --out$"
    for act in (lambda: prepare_output(taken), lambda: write_report(taken, experiments, fakes.INFO)):
        with pytest.raises(OutputError, match=expected):
            act()
    assert [path.name for path in tmp_path.iterdir()] == ["results"]
    assert taken.read_text() == "mine"


def test_folder_below_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"cannot write to .*: not a directory; give a folder"):
        prepare_output(tmp_path / "file" / "results")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not stop this user")
def test_read_only_folder_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="permission denied; give a folder you may write to"):
        prepare_output(tmp_path)
    tmp_path.chmod(0o700)


def test_folder_is_made_and_left_empty(tmp_path):
    folder = prepare_output(tmp_path / "a" / "b")
    assert folder.is_dir()
    assert list(folder.iterdir()) == []


def test_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "summary.json"
    path.write_text("old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match=r"summary.json: no space left on device; give a folder"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["summary.json"]


@pytest.mark.skipif(os.name != "posix", reason="POSIX permissions")
def test_files_have_the_usual_permissions(tmp_path):
    mask = os.umask(0o022)
    try:
        path = write_summary(tmp_path, [], {})
    finally:
        os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


def test_terminal_table_shows_medians_spreads_ratios_and_aims(experiments):
    table = terminal_table(experiments)
    assert table.isascii()
    lines = table.splitlines()
    assert " ".join(lines[0].split()) == "median [p5, p95] over seeds vices paper safe safe/vices aim"
    block = lines[lines.index("Joint safety: bottle") + 1]
    spread = experiments[1].spreads()["bottle"]
    cells = [spread[name]["contact_steady_n"] for name in ("vices", "paper", "safe")]
    words = [word for cell in cells for word in (f"{cell.median:.3g}", f"[{cell.p5:.3g},", f"{cell.p95:.3g}]")]
    multiple = cells[2].median / cells[0].median
    expected = f"contact force, steady N {' '.join(words)} {multiple:.2f} at most 1/3 of vices ok"
    assert " ".join(block.split()) == expected


def test_terminal_table_aligns(experiments):
    lines = terminal_table(experiments).splitlines()
    end = lines[0].index("safe/vices") + len("safe/vices")
    figures = [line for line in lines[1:] if line.startswith("  ")]
    assert len(figures) == 3 + 6 + 6
    assert all(line[end - 4 : end].strip().replace(".", "").isdigit() for line in figures)


def test_an_aim_of_several_scenarios_is_said_once():
    metric = Metric("error_mm", "tool error", "mm", main=True, aim=Aim(at_most=10.0))
    trials = [Trial(where, "safe", 0, {"error_mm": value}) for where, value in (("at rest", 5.0), ("moving", 12.0))]
    table = terminal_table([Experiment("pushes", "Pushes", "?", tuple(trials), (metric,))])
    _, _, heading, rest, moving = table.splitlines()
    assert heading == "Pushes: tool error; aim: under 10 mm"
    assert rest.endswith("  ok")
    assert moving.endswith("  MISSED")


def test_terminal_table_of_nothing():
    assert "median" in terminal_table([])


def test_csv_has_a_row_a_trial_and_is_empty_where_nothing_is():
    trials = (
        Trial("hold, pushed", "safe", 3, {"peak_n": 0.1 + 0.2, "detect_ms": float("nan")}, "real"),
        Trial("sweep", "vices", 3, {"peak_n": 2.0, "only_n": 1.0}),
    )
    assert trials_csv(Experiment("collisions", "Collisions", "?", trials)).splitlines() == [
        "seed,scenario,controller,plant,peak_n,detect_ms,only_n",
        '3,"hold, pushed",safe,real,0.30000000000000004,,',
        "3,sweep,vices,,2.0,,1.0",
    ]


def test_own_tables_follow_in_the_terminal():
    table = Table(
        "worst", "The worst – of all", ("seed", "words", "peak (N)"), ((3, "so", 4.5), (12, "what", float("nan")))
    )
    text = terminal_table([Experiment("collisions", "Collisions", "?", tables=(table,))])
    assert text.isascii()
    assert text.splitlines() == [
        "The worst - of all",
        "  seed  words  peak (N)",
        "  3     so         4.50",
        "  12    what          -",
    ]


def test_a_report_does_not_go_into_the_folder_of_a_training_run(tmp_path):
    (tmp_path / LOCK).write_text("")
    with pytest.raises(OutputError, match="holds a training run; give another folder with --out"):
        prepare_output(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]
