"""The counters of the channel, and the stream in the same memory."""

import numpy as np
import pytest

from smadrive.stream.samples import COLUMNS
from smadrive.stream.shared_memory import STATUS_BYTES, SharedReader
from smadrive.tuning.link.channel import PageEnd


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
