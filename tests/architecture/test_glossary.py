"""One word for one thing: the glossary names what exists, and words that the field does not use have gone."""

import collections
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
SOURCES = [
    ROOT / "README.md",
    *sorted(path for folder in ("src", "docs", "examples") for path in (ROOT / folder).rglob("*") if path.is_file()),
]
TEXTS = {path: path.read_text(encoding="utf-8") for path in SOURCES if path.suffix in (".py", ".md", ".html", ".js")}

INSTEAD = {
    "detection, isolation, identification, classification": "locating judge judges judged judging",
    "impact; peak regression; larger force; acceptance criteria": "blow blows harder bars",
    "identify, estimate (a mass)": "weigh weighs weighed weighing unweighed",
    "surface": "skin",
    "push; contact kind; mode": "pusher pushers is_pushed holding pusher_stiffness",
    "contact_force_limit_...": "push_yield_n push_hold_n push_meet_n meet_s",
    "K_posture, D_posture, q_posture": "K_pose D_pose q_pose",
    "gain, scale, fraction, chunk": "trigger_gain observer_gain share shares",
    "displacement, path, direction; task force": "way ways pull pulls pulled pulling",
    "separate_tool_wrench, line_of_action_misses_tool": "part_tool_from_arm passes_elsewhere",
    "predict_velocity, horizon": "coming_speed ahead",
    "detection residual": "alarm alarms",
    "robot description": "facts",
    "vision encoder, log-polar features, image source": "eyes foveated sight retina",
    "ink index": "ledger",
    "state_dict, load_state_dict": "snapshot snapshots",
    "scripted policies, random policy, dither; target": "chance scan",
    "adversarial, corrupt, perturbed": "hostile spoil spoils spoiled spoiling knocked",
}
"""What to say, and what not, as whole words."""

EXCEPT = r"(?<!false )(?<!false_)"  # the rate of false alarms is the field's
BANNED = re.compile(rf"(?<![\w-]){EXCEPT}({'|'.join(' '.join(INSTEAD.values()).split())})(?![\w-])", re.IGNORECASE)


def area(path):
    """Return the room of a source file, the folder of a page."""
    relative = path.relative_to(ROOT)
    return "/".join(relative.parts[: 3 if relative.parts[0] == "src" else 2])


def found():
    words = collections.defaultdict(collections.Counter)
    for path, text in TEXTS.items():
        if "api" not in path.relative_to(ROOT).parts:
            words[area(path)].update(word.lower() for word in BANNED.findall(text))
    return words


@pytest.mark.parametrize("place", sorted({area(path) for path in TEXTS}))
def test_words_that_the_field_does_not_use_are_gone(place):
    words = found()[place]
    remedy = {word: say for say, banned in INSTEAD.items() for word in banned.lower().split() if word in words}
    assert not words, f"{place}: {dict(words)}; say {remedy}"


def test_identifiers_of_the_glossary_exist():
    identifiers = set(re.findall(r"`([A-Za-z_]\w*)`", GLOSSARY))
    assert len(identifiers) > 60
    code = {word for path, text in TEXTS.items() if path.suffix == ".py" for word in re.findall(r"\w+", text)}
    assert identifiers <= code, f"not in the package: {sorted(identifiers - code)}"


def test_every_row_of_the_glossary_has_five_cells():
    rows = [line for line in GLOSSARY.splitlines() if line.startswith("|")]
    assert len(rows) > 50
    assert all(len(re.split(r"(?<!\\)\|", re.sub(r"\$[^$]*\$", "", row))) == 7 for row in rows)


def test_no_term_is_explained_twice():
    terms = [line.split("|")[1].strip() for line in GLOSSARY.splitlines() if line.startswith("|")]
    terms = [term for term in terms if term != "term" and set(term) != {"-"}]
    assert len(set(terms)) == len(terms)
