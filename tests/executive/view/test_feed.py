"""The feed: in order, without pictures, and never lost between two looks."""

import base64
import json
import threading

import pytest

from executive.view.feed import Feed

PICTURE = {"format": "png", "data": base64.b64encode(b"bytes").decode(), "source": "hand"}
START = (0, 0)


def test_messages_come_in_order_and_once():
    feed = Feed()
    for number in range(5):
        feed("pose", number / 10, {"x": number})
    cursor, texts = feed.since(START)
    assert [json.loads(text)["data"]["x"] for text in texts] == [0, 1, 2, 3, 4]
    assert feed.since(cursor) == (cursor, [])


def test_pictures_are_fetched_apart_from_messages():
    feed = Feed()
    feed("detections", 1.0, PICTURE)
    (text,) = feed.since(START)[1]
    assert json.loads(text)["data"] == {"format": "png", "source": "hand", "picture": 0}
    assert feed.picture(0) == ("png", b"bytes")
    with pytest.raises(LookupError, match="no picture 1"):
        feed.picture(1)


def test_only_the_latest_state_of_what_is_not_logged_is_sent():
    feed = Feed()
    for number in range(3):
        feed.tell("progress", {"now_s": number})
    cursor, texts = feed.since(START)
    assert [json.loads(text) for text in texts] == [{"live": "progress", "data": {"now_s": 2}}]
    feed.tell("control", {"mode": "paused"})
    assert len(feed.since(cursor)[1]) == 1


def test_a_long_run_keeps_the_newest_messages_and_the_last_of_each_node():
    feed = Feed(most=100)
    feed("tree", 0.0, {"robot": "Alice"})
    feed("transitions", 0.1, {"robot": "Alice", "node": "a", "to": "RUNNING"})
    feed("transitions", 0.2, {"robot": "Alice", "node": "a", "to": "SUCCESS"})
    slow, _ = feed.since(START)
    for number in range(1000):
        feed("pose", 1.0 + number, {"robot": "Alice", "x": number})
    kept = [json.loads(text) for text in feed.since(START)[1]]
    assert len(kept) <= 150
    assert [each["t"] for each in kept if each["topic"] != "pose"] == [0.0, 0.2]
    poses = [each["data"]["x"] for each in kept if each["topic"] == "pose"]
    assert poses == list(range(1000 - len(poses), 1000))
    cursor, late = feed.since(slow)
    assert (len(late), feed.since(cursor)[1]) == (len(poses), [])


def test_the_feed_keeps_the_newest_pictures_and_the_last_of_each_topic():
    feed = Feed(most=100_000, most_pictures=10)
    feed("map", 0.0, PICTURE)
    for number in range(100):
        feed("detections", 1.0 + number, PICTURE)
    kept = [number for number in range(feed.pictures) if has_picture(feed, number)]
    assert (kept[0], kept[-1], len(kept) <= 16) == (0, 100, True)
    assert kept[1:] == list(range(kept[1], 101))


def test_a_replay_keeps_all():
    feed = Feed(most=None)
    for number in range(30_000):
        feed("pose", number, {})
    assert len(feed.since(START)[1]) == 30_000


def has_picture(feed, number):
    try:
        return feed.picture(number) == ("png", b"bytes")
    except LookupError:
        return False


def test_a_writer_does_not_wait_when_no_page_reads():
    feed = Feed()
    feed("pose", 0.0, {})
    assert feed.wait_sent(60.0)


def test_a_writer_waits_until_a_page_has_all_messages():
    feed = Feed()
    feed.add_reader()
    feed("pose", 0.0, {})
    assert not feed.wait_sent(0.01)
    threading.Timer(0.05, lambda: feed.mark_sent(feed.since(START)[0])).start()
    assert feed.wait_sent(5.0)
    feed("pose", 0.1, {})
    threading.Timer(0.05, feed.remove_reader).start()
    assert feed.wait_sent(5.0)


def test_readers_in_other_threads_miss_nothing():
    feed, seen = Feed(), []
    done = threading.Event()

    def read() -> None:
        cursor = START
        while not done.is_set() or feed.since(cursor)[1]:
            cursor, texts = feed.since(cursor)
            seen.extend(json.loads(text)["data"]["x"] for text in texts)

    reader = threading.Thread(target=read)
    reader.start()
    for number in range(2000):
        feed("pose", 0.0, {"x": number})
    done.set()
    reader.join()
    assert seen == list(range(2000))
