"""The words of the published status. Other programs read them, so they must not change."""

import json

import pytest

from smadrive.stream.published_state import PublishedEnd, PublishedMode


def test_words_on_the_wire_stay():
    modes = ["off", "tracking", "holding", "exciting", "heating", "off, unconfirmed"]
    assert json.loads(json.dumps(list(PublishedMode))) == modes
    assert json.loads(json.dumps(list(PublishedEnd))) == ["off", "unconfirmed"]


def test_loop_runs_in_every_mode_but_off():
    assert [mode.value for mode in PublishedMode if not mode.heats] == ["off", "off, unconfirmed"]


@pytest.mark.parametrize(("confirmed", "words"), [(True, ("off", "off")), (False, ("off, unconfirmed", "unconfirmed"))])
def test_words_after_switching_off_say_whether_it_is_confirmed(confirmed, words):
    kinds = PublishedMode, PublishedEnd
    assert tuple(kind.switched_off(confirmed=confirmed) for kind in kinds) == words
