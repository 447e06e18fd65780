"""report.html: whole, alone, and true to the figures it was made from."""

import base64
import itertools
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from contactsafe.experiments.collisions import CURVES
from contactsafe.report import write_report
from contactsafe.report.film import FORCE_UNIT, Q_UNIT
from contactsafe.results.experiment import Experiment, Table, Trial
from contactsafe.results.metrics import Metric

VOID = {"meta", "link", "input", "br", "hr", "img"}


class Page(HTMLParser):
    """Checks that elements nest, and collects what tests ask for."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.figures, self.addresses, self.faults = [], [], {}, [], []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        values = dict(attrs)
        if len(values) != len(attrs):
            self.faults.append(f"{tag} repeats an attribute: {attrs}")
        if "id" in values:
            self.ids.append(values["id"])
        if "data-figure" in values:
            self.figures[values["data-figure"]] = values.get("data-value")
        self.addresses += [value for name, value in attrs if name in ("src", "href", "xlink:href", "srcset", "action")]

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.text += data

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> at line {self.getpos()[0]} closes nothing")


@pytest.fixture(scope="module")
def parsed(page):
    return Page(page)


def test_elements_nest(parsed):
    assert parsed.faults == []
    assert parsed.open == []


def test_ids_are_unique_and_links_lead_somewhere(parsed):
    assert len(parsed.ids) == len(set(parsed.ids))
    inside = {address[1:] for address in parsed.addresses if address.startswith("#")}
    assert inside <= set(parsed.ids)


def test_page_needs_nothing_but_itself(page, parsed):
    assert "http://" not in page
    assert "https://" not in page
    assert [a for a in parsed.addresses if not a.startswith(("#", "data:"))] == []
    assert not re.search(r"@import|url\((?!#)", page)


def test_no_nan_is_shown(page, parsed):
    assert len(parsed.text) > 1000
    assert not re.search(r"\b(nan|inf|None)\b", parsed.text, re.IGNORECASE)
    plots = "".join(re.findall(r"<svg.*?</svg>", page, re.DOTALL))
    assert not re.search(r"\bnan\b", re.sub(r'"data:image[^"]*"', "", plots), re.IGNORECASE)


def test_page_is_small(folder):
    assert (folder / "report.html").stat().st_size < 4_000_000


def test_every_figure_is_the_spreads_median_or_mean_where_the_row_says_so(parsed, experiments):
    known = 0
    for experiment in experiments:
        for scenario, by_controller in experiment.spreads().items():
            for controller, metrics in by_controller.items():
                for metric, spread in metrics.items():
                    shown = parsed.figures.get(f"{experiment.name}/{scenario}/{controller}/{metric}", "absent")
                    if metric == "something_new":
                        assert shown == "absent"
                    elif spread.n == 0:
                        assert shown is None
                    else:
                        middle = spread.mean if metric in ("ink_removed", "clean") else spread.median
                        assert float(shown) == pytest.approx(middle, rel=1e-5)
                        known += 1
    assert known == len(parsed.figures) - 1  # all but paper's time to a clean board


def test_missing_figure_is_a_dash(page):
    assert re.search(r'data-figure="task-safety/wiping/paper/time_s">–</td>', page)


def test_headline_shows_the_medians(page, experiments):
    cards = page[page.index('class="cards"') : page.index("<main>")]
    spread = experiments[1].spreads()["bottle"]
    for controller in ("vices", "paper", "safe"):
        assert f"<b>{spread[controller]['contact_steady_n'].median:.3g} N</b>" in cards


def test_page_says_where_paper_falls_short(page, experiments):
    metrics = {name: row["contact_steady_n"].median for name, row in experiments[1].spreads()["bottle"].items()}
    multiple = metrics["paper"] / metrics["vices"]
    assert (
        f"bottle: contact force, steady is {metrics['paper']:.1f} N, {multiple:.2f} of the {metrics['vices']:.1f} N of "
        "vices; the aim is at most 1/3 of vices." in page
    )
    assert "</strong> misses 6 of 6 aims:" in page


def test_page_says_where_all_aims_are_reached(page):
    section = page[page.index('<section id="joint-safety">') : page.index('<section id="disturbance">')]
    assert re.search(r">safe</strong> reaches 6 of 6 aims\.", section)


def test_stiffness_and_damping_are_drawn_against_contact_for_one_controller(page):
    caption = page.index("What the policy does with its impedance. Shaded: contact, above 0.5 N. Under safe, seed 0.")
    figure = page[:caption].rpartition("<figure>")[2]
    for label in ("stiffness K1 along z", "damping D1 along z", "stiffness K1 along x", "damping D1 along x"):
        assert label in figure
    assert "var(--band)" in figure
    assert "--c-vices" not in figure


def test_stiffness_is_drawn_at_the_type_size_of_all_other_plots(page):
    """A page's column is so many px wide; what is drawn wider for it is shown at the same scale, and so is its type."""
    widths = {"plots": set(), "plots two": set()}
    for kind, figure in re.findall(r'<figure><div class="(plots[^"]*)">(.*?)</figure>', page, re.DOTALL):
        widths[kind] |= {float(box.split()[2]) for box in re.findall(r'viewBox="([^"]*)"', figure)}
        assert set(re.findall(r"font(?:-size)?: (?:bold |700 )?([\d.]+)px", figure)) == {"9"}
    assert [len(found) for found in widths.values()] == [1, 1]
    narrow, wide = (found.pop() for found in widths.values())
    gap = 26  # of the grid, in style.css
    assert wide / narrow == pytest.approx(((1080 - gap) / 2) / ((1080 - 2 * gap) / 3), rel=0.02)


def test_tables_are_not_cut_off_at_the_right(page, parsed):
    """Nothing of a table scrolls away; where the page is too narrow for columns, each cell says what it is of."""
    style = page[: page.index("</style>")]
    assert not re.search(r"\.wide \{[^}]*overflow", style)
    assert "td[data-of]::before" in style
    tables = re.findall(r'<div class="wide">.*?</table>', page, re.DOTALL)
    assert tables
    for cell in re.findall(r"<td([^>]*)>[^<]", "".join(tables)):
        assert "data-of" in cell or 'class="unit"' in cell or cell == ""


def test_film_holds_the_recordings(page, experiments):
    text = re.search(r'id="film-joint-safety">(.*?)</script>', page, re.DOTALL).group(1)
    film = json.loads(text)
    assert [scene["name"] for scene in film["scenes"]] == ["bottle", "thrust meter"]
    for scene in film["scenes"]:
        for run in scene["runs"]:
            recording = next(
                r for r in experiments[1].recordings if (r.scenario, r.controller) == (scene["name"], run["controller"])
            )
            values = np.frombuffer(base64.b64decode(run["channels"]), "<i2").reshape(run["frames"], -1)
            assert run["frames"] == 360
            np.testing.assert_allclose(values[:, :7] * Q_UNIT, recording.trace["q"][ticks(360)], atol=Q_UNIT)
            assert values[:, 10].max() * FORCE_UNIT == pytest.approx(
                recording.trace["obstacle_force"].max(), abs=FORCE_UNIT
            )
            named = dict(zip(film["channels"], values[:, 7:].T, strict=True))
            for name in ("mode", "link"):
                np.testing.assert_array_equal(named[name], recording.trace[name][ticks(360)])
            np.testing.assert_array_equal(pictures_of(run), recording.pictures)


def ticks(frames):
    return np.round(np.arange(frames) * 1000 / 60).astype(int)


def pictures_of(run):
    """Decode as film.js does: each picture follows the last; 0 leaves a cell as it was, another code is value + 1."""
    runs = np.frombuffer(base64.b64decode(run["pictures"]), "<u2").reshape(-1, 2)
    codes = np.repeat(runs[:, 0], runs[:, 1]).reshape(-1, *run["cells"])
    for before, now in itertools.pairwise(codes := codes.copy()):
        now[now == 0] = before[now == 0]
    return codes - 1


def test_names_are_escaped(fakes, tmp_path):
    trials = (Trial("<b>&", "vices", 0, {"depth_mm": 1.5}), Trial("<b>&", "<i>x", 0, {"depth_mm": float("nan")}))
    path = write_report(
        tmp_path,
        [Experiment("<odd>", "<Odd>", "Is 1 < 2?", trials, (Metric("depth_mm", "<depth>", "mm"),))],
        {"command": "contactsafe <demo>"},
    )
    parsed = Page(path.read_text(encoding="utf-8"))
    assert parsed.faults == []
    assert parsed.figures == {"<odd>/<b>&/vices/depth_mm": "1.5", "<odd>/<b>&/<i>x/depth_mm": None}


def test_figures_outlive_a_page_that_cannot_be_drawn(fakes, tmp_path, monkeypatch):
    def fail(*_):
        raise ValueError("no such shape")

    monkeypatch.setattr("contactsafe.report.page.render", fail)
    with pytest.raises(ValueError, match="no such shape"):
        write_report(tmp_path, [fakes.task_safety()], {})
    assert {path.name for path in tmp_path.iterdir()} == {"summary.json", "task-safety.csv"}


def test_one_controller_and_no_recordings(fakes, tmp_path):
    experiment = fakes.task_safety()
    alone = tuple(trial for trial in experiment.trials if trial.controller == "safe")
    path = write_report(tmp_path, [replace(experiment, trials=alone, recordings=())], {})
    page = path.read_text(encoding="utf-8")
    assert Page(page).faults == []
    assert "one controller" in page
    assert "data-film=" not in page.split("<script>")[1]


def test_own_tables_and_the_trial_over_time_are_shown(fakes, tmp_path):
    recordings = tuple(
        fakes.record("sweep, real plant", name, 3.0, ((0.3, -0.2, 0.4), 2e3)) for name in ("vices", "safe")
    )
    table = Table("worst", "The <worst>", ("seed", "replay"), ((17, "again --seed 17"),), "Look.")
    collisions = Experiment("collisions", "Collisions", "?", fakes.task_safety().trials, figures=(CURVES,))
    found = replace(collisions, recordings=recordings, tables=(table,))
    page = write_report(tmp_path, [found], {}).read_text(encoding="utf-8")
    assert Page(page).faults == []
    assert "The &lt;worst&gt;" in page
    assert "again --seed 17" in page
    for label in ("contact force (N)", "mode: 0 free, 1 comply", "tool away from its free motion (mm)"):
        assert label in page
    assert (tmp_path / "collisions.csv").exists()


def test_a_policy_is_named_only_where_one_was_run(fakes, tmp_path, page):
    assert "One learned policy, three controllers" in page
    other = write_report(tmp_path, [fakes.disturbance()], {}).read_text(encoding="utf-8")
    assert "learned policy" not in other[: other.index("<main>")].lower()


def test_nothing_measured(tmp_path):
    assert Page(write_report(tmp_path, [], {}).read_text(encoding="utf-8")).faults == []
