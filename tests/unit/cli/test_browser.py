"""The command goes on although the browser that shows its page does not return."""

import threading
import webbrowser

from smadrive.cli.live.page import open_browser

URL = "http://127.0.0.1:5006/"


class WaitingBrowser(webbrowser.BaseBrowser):
    """A browser that returns when it is closed, as a text browser does."""

    def __init__(self):
        super().__init__()
        self.opened = []
        self.is_open, self.is_closed = threading.Event(), threading.Event()

    def open(self, url, new=0, autoraise=True):
        self.opened.append((url, threading.current_thread()))
        self.is_open.set()
        self.is_closed.wait()
        return True


def test_browser_that_does_not_return_keeps_nothing_waiting(monkeypatch):
    browser = WaitingBrowser()
    monkeypatch.setattr(webbrowser, "_browsers", {})
    monkeypatch.setattr(webbrowser, "_tryorder", [])
    webbrowser.register("waiting", None, browser)
    open_browser(URL)
    browser.is_open.wait()
    ((url, thread),) = browser.opened
    assert url == URL
    assert thread.is_alive()
    browser.is_closed.set()
    thread.join()
