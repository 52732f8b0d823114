import io

import pytest

from stretchmap.base.progress import report, terminal, throttled


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_report_without_listener_is_silent():
    report(None, "volume", 1, 2, energy=3.0)


def test_report_passes_everything_on():
    seen = []
    report(lambda *args, **values: seen.append((args, values)), "volume", 1, 2, energy=3.0)
    assert seen == [(("volume", 1, 2), {"energy": 3.0})]


def test_throttle():
    now = 0.0
    seen = []
    progress = throttled(
        lambda stage, done, total: seen.append(done), delay=1.0, interval=0.5, clock=lambda: now
    )
    for tick in range(25):
        now = tick / 10
        progress("s", tick, 25)
    assert seen == [10, 15, 20]


@pytest.mark.parametrize(("quiet", "stream"), [(True, Terminal()), (False, io.StringIO())])
def test_no_bar_when_quiet_or_not_a_terminal(quiet, stream):
    with terminal(quiet, stream) as progress:
        assert progress is None
    assert stream.getvalue() == ""


@pytest.mark.parametrize("with_rich", [True, False])
def test_bar_appears_after_the_delay_and_is_removed(monkeypatch, with_rich):
    if with_rich:
        pytest.importorskip("rich")
    else:
        monkeypatch.setitem(__import__("sys").modules, "rich.console", None)
    clock = iter([0.0, 0.5, 2.0, 3.0])
    monkeypatch.setattr(
        "stretchmap.base.progress.throttled.__kwdefaults__",
        {"delay": 1.0, "interval": 0.1, "clock": lambda: next(clock)},
    )
    stream = Terminal()
    with terminal(False, stream) as progress:
        progress("volume", 1, 10, energy=0.5)
        assert stream.getvalue() == ""
        progress("volume", 4, 10, energy=0.25)
        progress("volume", 5, 10, energy=0.125)
    text = stream.getvalue()
    assert "volume" in text and "5/10" in text and "0.125" in text
    assert "1/10" not in text
