"""The file of a health record: entries come back, and no damage, kill or second program spoils it."""

import json
import os
import signal
import subprocess
import sys
from math import inf, isnan, nan

import pytest

from smadrive.errors import DataError
from smadrive.wire.health.entry import Estimate, HealthEntry, LoopShape
from smadrive.wire.health.record import append_entries, health_file, read_health

RUN = HealthEntry(
    kind="tracking",
    begun="2026-03-01T12:00:00+00:00",
    model="0123456789ab",
    cycles=1.5,
    rest_ohm=Estimate(16.5, 0.1),
    adapted=LoopShape(90.0, 70.0, 12.0),
)


@pytest.fixture
def wire_file(tmp_path):
    return tmp_path / "wire.json"


def lines_of(wire_file):
    return health_file(wire_file).read_bytes().splitlines(keepends=True)


def test_entries_come_back_in_their_order(wire_file):
    append_entries(wire_file, [RUN, RUN.model_copy(update={"cycles": 2.0})])
    append_entries(wire_file, [RUN.model_copy(update={"cycles": 3.0})])
    record = read_health(wire_file)
    assert [entry.cycles for entry in record.entries] == [1.5, 2.0, 3.0]
    assert not record.caveats
    assert (record.entries[0].rest_ohm, record.entries[0].adapted) == (RUN.rest_ohm, RUN.adapted)
    assert isnan(record.entries[0].stroke_mm.value)


def test_file_is_plain_json_with_its_schema(wire_file):
    append_entries(wire_file, [RUN])
    (document,) = map(json.loads, lines_of(wire_file))
    assert (document["schema"], document["rest_ohm"], document["stroke_mm"]) == (1, [16.5, 0.1], [None, None])


def test_missing_record_is_empty(wire_file):
    assert read_health(wire_file).entries == ()


@pytest.mark.parametrize("kept", [1, 40, -2])
def test_cut_line_loses_only_itself(wire_file, kept):
    append_entries(wire_file, [RUN, RUN])
    first, last = lines_of(wire_file)
    health_file(wire_file).write_bytes(first + last[:kept])
    record = read_health(wire_file)
    assert (len(record.entries), len(record.caveats)) == (1, 1)
    append_entries(wire_file, [RUN, RUN])
    record = read_health(wire_file)
    assert (len(record.entries), len(record.caveats)) == (3, 1)


@pytest.mark.parametrize("damaged", [b"\0\xff", b"[1, 2]", b"[" * 100_000, b'{"schema": 1, "kind": "tracking"}'])
def test_damaged_line_is_left_out(wire_file, damaged):
    append_entries(wire_file, [RUN, RUN])
    first, last = lines_of(wire_file)
    health_file(wire_file).write_bytes(first + damaged + b"\n" + last)
    record = read_health(wire_file)
    assert (len(record.entries), len(record.caveats)) == (2, 1)


@pytest.mark.parametrize("cycles", [nan, inf, -1.0])
def test_entry_with_an_impossible_number_of_cycles_is_left_out(wire_file, cycles):
    append_entries(wire_file, [RUN, RUN.model_copy(update={"cycles": cycles}), RUN])
    record = read_health(wire_file)
    assert (len(record.entries), len(record.caveats)) == (2, 1)


def test_changed_digit_is_damage(wire_file):
    append_entries(wire_file, [RUN, RUN])
    first, last = lines_of(wire_file)
    health_file(wire_file).write_bytes(first.replace(b"16.5", b"15.5") + last)
    assert len(read_health(wire_file).entries) == 1


def test_entry_of_a_later_version_is_left_out(wire_file):
    append_entries(wire_file, [RUN, RUN])
    record = health_file(wire_file)
    first, last = lines_of(wire_file)
    newer = {**json.loads(last), "schema": 2}
    del newer["crc32"]
    from zlib import crc32

    newer["crc32"] = crc32(json.dumps(newer).encode())
    record.write_bytes(first + json.dumps(newer).encode() + b"\n")
    found = read_health(wire_file)
    assert (len(found.entries), len(found.caveats)) == (1, 1)


@pytest.mark.parametrize("content", [b"\0" * 100 + b"\n", b"hello\nworld\n", b"\x89HDF\r\n\x1a\n\n"])
def test_foreign_file_is_an_error(wire_file, content):
    health_file(wire_file).write_bytes(content)
    with pytest.raises(DataError) as error:
        read_health(wire_file)
    assert (error.value.where, bool(error.value.cure)) == (str(health_file(wire_file)), True)


@pytest.mark.parametrize("make", [os.mkdir, os.mkfifo])
@pytest.mark.parametrize("use", [read_health, lambda wire_file: append_entries(wire_file, [RUN])])
def test_folder_or_pipe_is_an_error(wire_file, make, use):
    make(health_file(wire_file))
    with pytest.raises(DataError):
        use(wire_file)


def test_missing_folder_is_an_error(tmp_path):
    with pytest.raises(DataError) as error:
        append_entries(tmp_path / "none" / "wire.json", [RUN])
    assert error.value.cure


APPENDING = """
import sys
from pathlib import Path
from smadrive.wire.health.entry import HealthEntry
from smadrive.wire.health.record import append_entries
print("ready", flush=True)
for number in range(int(sys.argv[3])):
    append_entries(Path(sys.argv[1]), [HealthEntry(kind=sys.argv[2], begun="", model="x", cycles=number)] * 3)
"""


def appending(wire_file, kind, times):
    arguments = [sys.executable, "-c", APPENDING, str(wire_file), kind, str(times)]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE)


def test_two_programs_at_once_lose_no_entry(wire_file):
    both = [appending(wire_file, kind, 25) for kind in ("a", "b")]
    assert [program.wait() for program in both] == [0, 0]
    for program in both:
        program.stdout.close()
    record = read_health(wire_file)
    assert not record.caveats
    for kind in ("a", "b"):
        assert [entry.cycles for entry in record.entries if entry.kind == kind] == [n for n in range(25) for _ in "123"]


def test_killed_program_leaves_a_usable_record(wire_file):
    program = appending(wire_file, "a", 1_000_000)
    program.stdout.readline()
    while not health_file(wire_file).exists() or health_file(wire_file).stat().st_size < 2000:
        assert program.poll() is None
    program.send_signal(signal.SIGKILL)
    program.wait()
    program.stdout.close()
    before = len(read_health(wire_file).entries)
    append_entries(wire_file, [RUN])
    assert read_health(wire_file).entries[-1].kind == "tracking"
    assert len(read_health(wire_file).entries) == before + 1 > 5
