"""The acts that a mode refuses, as the pages get them, and the requests that the session refuses in this mode."""

import json
from typing import get_args

import pytest

from smadrive.errors import ConfigError
from smadrive.tuning.link.requests import AnyRequest, parse_request
from smadrive.tuning.session.modes import Mode, check_allowed, refused_acts

VALUES = {
    "arm": {"offs": 0},
    "track": {"offs": 0, "reference": "sine"},
    "hold": {"offs": 0},
    "shape": {"key": "scale", "value": 1.0},
    "feedback": {"key": "integral_s", "value": 1.0},
    "source": {"displacement_from": "sensor"},
    "rule": {"index": 0, "direction": 1, "a": 0.0, "b": 0.0},
    "model": {"text": "", "source": ""},
    "note": {"text": ""},
    "keep": {"slot": "A"},
    "recall": {"slot": "A"},
    "compare": {"offs": 0, "on": True},
    "adapt": {"on": True},
}
"""The values of a request, by its act. A request without values is left out."""

ACTS = [act for kind in get_args(get_args(AnyRequest)[0]) for act in get_args(kind.model_fields["act"].annotation)]


def is_refused(act, mode, **values):
    message = {"number": 1, "act": act, **VALUES.get(act, {}), **values}
    try:
        check_allowed(parse_request(json.dumps(message).encode()), mode)
    except ConfigError:
        return True
    return False


@pytest.mark.parametrize("mode", Mode)
def test_published_acts_are_those_that_the_session_refuses(mode):
    assert [act for act in sorted(ACTS) if is_refused(act, mode)] == list(refused_acts(mode))


@pytest.mark.parametrize("mode", Mode)
def test_end_of_a_comparison_is_never_refused(mode):
    assert not is_refused("compare", mode, on=False)
