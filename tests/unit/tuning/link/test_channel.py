"""The counters of the channel, and the stream in the same memory."""

import json

import numpy as np
import pytest

from smadrive.errors import ConfigError
from smadrive.stream.samples import COLUMNS
from smadrive.stream.shared_memory import STATUS_BYTES, SharedReader
from smadrive.tuning.link.channel import MESSAGE_BYTES, WIRE_BYTES, PageEnd, check_wire
from smadrive.tuning.page.client_registry import ClientRegistry
from smadrive.tuning.session.status import MAX_EVENT_LENGTH, MAX_EVENTS


def test_reader_of_a_stream_reads_rows_and_status_of_a_channel(driver_end):
    page = PageEnd(driver_end.memory_fd, driver_end.page_socket)
    page.request_off()
    page.report_pages(2, is_controlled=True)
    row = tuple(np.arange(float(len(COLUMNS))))
    driver_end.append(row)
    driver_end.publish({"mode": "off"})
    reader = SharedReader(driver_end.memory_fd)
    assert reader.since(0)[1].tolist() == page.since(0)[1].tolist() == [list(row)]
    assert reader.status(-1)[1] == page.status(-1)[1] == {"mode": "off"}
    assert driver_end.off_requested()
    assert driver_end.pages == (2, True)


def test_status_that_is_too_long_leaves_the_last_one_readable(driver_end):
    driver_end.publish({"mode": "off"})
    with pytest.raises(ValueError, match=str(STATUS_BYTES)):
        driver_end.publish({"mode": "x" * STATUS_BYTES})
    reader = SharedReader(driver_end.memory_fd)
    assert reader.status(-1)[1] == driver_end.published == {"mode": "off"}
    driver_end.publish({"mode": "holding"})
    assert reader.status(-1)[1] == {"mode": "holding"}


def test_longest_wire_fits_into_a_message_and_into_a_status_with_all_events(driver_end):
    page = PageEnd(driver_end.memory_fd, driver_end.page_socket)
    text = "x" * (WIRE_BYTES - len(json.dumps([""])))
    check_wire(text, (), "wire.json")
    assert page.send({"number": 1, "act": "model", "text": text})
    assert [json.loads(message)["text"] for message in driver_end.received(1)] == [text]
    driver_end.publish({"wire": text, "events": [[0.01, "µ" * MAX_EVENT_LENGTH]] * MAX_EVENTS})


@pytest.mark.parametrize(("text", "caveats"), [("x" * WIRE_BYTES, ()), ("x", ("µ" * (WIRE_BYTES // 6),))])
def test_wire_that_is_too_long_is_refused(text, caveats):
    with pytest.raises(ConfigError) as refused:
        check_wire(text, caveats, "wire.json")
    assert (refused.value.where, refused.value.limit) == ("wire.json", WIRE_BYTES)


def test_request_that_is_too_long_is_refused_at_once(driver_end):
    clients, answers = ClientRegistry(PageEnd(driver_end.memory_fd, driver_end.page_socket), "token"), []
    assert clients.claim("page")
    clients.ask("page", "model", answers.append, text="x" * MESSAGE_BYTES)
    assert len(answers) == 1
    assert str(MESSAGE_BYTES) in answers[0]
    assert list(driver_end.received(1)) == []
