"""The report of a run as one HTML file: complete, closed, and nothing in it that a text could break."""

import re
from html.parser import HTMLParser

import pytest

from executive.app.report import ReportedAnswer, ReportedObject, RobotReport
from executive.app.report_file import MissionRow, ReportPage, ReportPart, StepRow
from executive.run.outcome import Said
from executive.view.html import render
from executive.view.styles import Styles
from executive.words.goal import RefereeReport

NASTY = "<script>alert(\"1\")</script> & 'x' \x1b[31m"
JPEG = b"\xff\xd8 a picture"


def part(title="Alice (spot)", colour="#0072b2", *, cause=None, message="done", referee=None, commands=(), **changes):
    report = RobotReport("success", cause, message, referee, commands, "spot")
    return ReportPart(title, colour, report, **changes)


def page(**changes):
    facts = {"title": "patrol", "request": "patrol and tell me what you saw", "facts": (("world", "flat"),)}
    return render("run.html", page=ReportPage(**{**facts, "alone": part(), **changes}))


class Reader(HTMLParser):
    """Notes tags and texts, and that every tag is closed in its turn."""

    VOID = frozenset({"meta", "link", "img", "br"})

    def __init__(self, html):
        super().__init__()
        self.tags, self.texts, self.open = [], [], []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.texts).split())


def test_answers_stand_in_order_with_time_place_and_picture():
    answers = (
        ReportedAnswer("hammer in the office", False, "no: no hammer in the office", 26.95, "office"),
        ReportedAnswer("hammer in the workshop", True, "yes: hammer in the workshop", 127.3, "workshop", 0),
        ReportedAnswer("Where is Robin?", "in the shed", "Robin is in the shed", 130.0),
    )
    read = Reader(page(answers=answers, answer_pictures=(JPEG,)))
    parts = ("0:26.9", "office", "hammer in the office?", "no", "2:07.3", "workshop", "yes", "Where is Robin?", "shed")
    places = [read.text.index(part, read.text.index("Answers")) for part in parts]
    assert places == sorted(places)
    (image,) = [attrs for tag, attrs in read.tags if tag == "img"]
    assert image["src"].startswith("data:image/jpeg;base64,")
    assert read.open == []


@pytest.mark.parametrize(
    "changes",
    [
        {"title": NASTY, "request": NASTY, "facts": ((NASTY, NASTY),)},
        {"alone": part(cause=NASTY, message=NASTY, commands=(NASTY,), referee=RefereeReport(None, NASTY, 0, 0))},
        {"parts": (part(NASTY, message=NASTY, commands=(NASTY,)),)},
        {"answers": (ReportedAnswer(NASTY, NASTY, NASTY, 0.0, NASTY, 0),), "answer_pictures": (JPEG,)},
        {
            "said": (Said(1.0, NASTY),),
            "seen": (ReportedObject(NASTY, NASTY, NASTY, (0.0, 0.0, 0.0), 1.0),),
            "events": (NASTY,),
        },
        {"alone": part(steps=(StepRow(NASTY, Styles.FAILURE.value, NASTY, 2, (0.0, 1.0), NASTY),))},
        {"map": (NASTY, JPEG), "alone": part(pictures=((NASTY, JPEG),))},
        {"missions": (MissionRow(1, NASTY, NASTY, True, NASTY, 1, NASTY),)},
    ],
)
def test_every_text_is_escaped(changes):
    html = page(**changes)
    read = Reader(html)
    assert not any(tag == "script" for tag, _ in read.tags)
    assert "\x1b" not in html
    assert "alert" in html


def test_it_needs_no_script_and_nothing_from_elsewhere():
    html = page(map=("map", JPEG), alone=part(tree_svg="<svg></svg>"))
    assert "<script" not in html
    assert not re.search(r'(src|href)="(?!data:)|url\(|@import', html)


def test_an_empty_section_has_no_heading():
    text = Reader(page()).text
    assert not any(name in text for name in ("Answers", "Speech", "Seen objects", "Pictures", "Behaviour tree"))


def test_a_step_tells_status_cause_and_time():
    steps = (StepRow("go to the hall", Styles.FAILURE.value, "failure (PLANNING)", 1, (61.0, 75.5), "no way"),)
    text = Reader(page(alone=part(steps=steps))).text
    assert "go to the hall failure (PLANNING) 1:01.0–1:15.5 no way" in text


def test_each_of_several_robots_has_a_part_with_its_verdicts_steps_pictures_and_tree():
    parts = [
        part(
            f"{name} (spot)",
            colour,
            message=f"{name} is there",
            steps=(StepRow(f"go as {name}", Styles.SUCCESS.value, "success"),),
            pictures=((f"the grasp of {name}", JPEG),),
            tree_svg=f"<svg><title>{name}</title></svg>",
        )
        for name, colour in (("Alice", "#0072b2"), ("Bob", "#e69f00"))
    ]
    read = Reader(page(alone=None, parts=parts))
    assert [dict(attrs)["style"] for tag, attrs in read.tags if attrs.get("class") == "part"] == [
        "border-color:#0072b2",
        "border-color:#e69f00",
    ]
    for name in ("Alice", "Bob"):
        for text in (f"{name} (spot)", f"{name} is there", f"go as {name}", f"the grasp of {name}"):
            assert text in read.text
    assert [tag for tag, _ in read.tags].count("svg") == 2
    assert "script" not in {tag for tag, _ in read.tags}


def test_the_missions_of_a_fleet_stand_in_a_table():
    rows = (
        MissionRow(1, "go <b>", "Bob", True, "success, fulfilled", 1, "there"),
        MissionRow(2, "wait", "", None, "queued", 0, ""),
    )
    read = Reader(page(alone=None, missions=rows))
    assert "1 go <b> Bob success, fulfilled 1 there" in read.text
    assert [attrs["class"] for tag, attrs in read.tags if attrs.get("class", "").startswith("pill")] == [
        "pill success",
        "pill open",
    ]
