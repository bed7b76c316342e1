"""The counters of the channel, and the stream in the same memory."""

import numpy as np

from smadrive.stream.samples import COLUMNS
from smadrive.stream.shared_memory import SharedReader
from smadrive.tuning.link.channel import PageEnd


def test_reader_of_a_stream_reads_rows_and_status_of_a_channel(control):
    page = PageEnd(control.memory_fd, control.page_socket)
    page.request_off()
    page.report_pages(2, is_controlled=True)
    row = tuple(np.arange(float(len(COLUMNS))))
    control.append(row)
    control.publish({"mode": "off"})
    reader = SharedReader(control.memory_fd)
    assert reader.since(0)[1].tolist() == page.since(0)[1].tolist() == [list(row)]
    assert reader.status(-1)[1] == page.status(-1)[1] == {"mode": "off"}
    assert control.off_requested()
    assert control.pages == (2, True)
