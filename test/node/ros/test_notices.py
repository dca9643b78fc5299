from markerless_tracker.node.ros.notices import HOLD_S, Notices


class Log:
    def __init__(self) -> None:
        self.lines: list[str] = []
        self.now_s = 100.0
        self.notices = Notices(self.lines.append, lambda: self.now_s)


def test_repetitions_are_counted_and_logged_later() -> None:
    log = Log()
    for stamp in range(40):
        log.notices.say(f"stamp {stamp}: cam01: an image of 16{stamp}x4 px came")
        log.notices.say("cam02: an image of 16x4 px came")
    log.notices.flush()
    assert log.lines == [
        "stamp 0: cam01: an image of 160x4 px came",
        "cam02: an image of 16x4 px came",
    ]
    log.now_s += HOLD_S
    log.notices.flush()
    assert log.lines[2:] == [
        "stamp 39: cam01: an image of 1639x4 px came (39 times in 10 s)",
        "cam02: an image of 16x4 px came (39 times in 10 s)",
    ]


def test_all_repetitions_are_logged_at_the_end() -> None:
    log = Log()
    for _ in range(5):
        log.notices.say("cam01: too dark")
        log.now_s += 0.5
    log.notices.flush(last=True)
    assert log.lines == ["cam01: too dark", "cam01: too dark (4 times in 2.5 s)"]


def test_a_new_occurrence_after_a_pause_is_logged_again() -> None:
    log = Log()
    log.notices.say("cam01: too dark")
    log.now_s += HOLD_S + 0.1
    log.notices.flush()
    assert log.notices.say("cam01: too dark")
    assert log.lines == ["cam01: too dark", "cam01: too dark"]


def test_hostile_texts_are_cut_and_bounded_in_number() -> None:
    log = Log()
    for number in range(5000):
        log.notices.say(f"encoding {chr(300 + number)!r} {chr(300 + number) * 9} " + "y" * 2000)
    assert len(log.lines) <= 201 and max(map(len, log.lines)) < 600
