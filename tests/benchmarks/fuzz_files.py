"""Damaged files given to the commands that read them: `python tests/benchmarks/fuzz_files.py [COUNT] [SEED]`.

First a valid log, model, table, trace, rig, wire and simulated device are made. Then bytes of one of them are changed
at random places, or a number is replaced by an absurd one, and a command reads the file in a process of its own. The
command must end with exit code 0, 2, 3, 4 or 5, within `LONGEST_S` of processor time, and without a traceback. A
damaged log with checksums must give the result of the valid log, or be rejected.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from oldlog import without_checksums

import firmware_sim.cli
from smadrive import cli
from smadrive.cli import excite, identify, probe, replay, report, run, simulate  # noqa: F401 (before the forks)
from smadrive.files.shipped import configs_dir

LONGEST_S = 60
HANGS_S = 300  # a command that waits for ever uses no processor time
MEMORY = 6 << 30
GOOD_ENDS = {0, 2, 3, 4, 5}
FAILED = "FAILED"
ABSURD = ("1e300", "-1e300", "0", "-1", "1e-300", "nan", "inf", "9" * 5000, "2_0", "٢", "", "1e9", "0x" + "f" * 500)
NUMBER = re.compile(rb"-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?")

Command = Callable[[Path], list[str]]


class End(NamedTuple):
    """The end of a command. `how` describes a forbidden end, otherwise it is empty. `result` is the JSON object."""

    how: str
    code: int
    result: object


class Case(NamedTuple):
    """A file, the command that reads it, and whether it has checksums."""

    name: str
    file: str
    command: Command
    has_checksums: bool = False


def identified(at: Path, data: str) -> list[str]:
    """Return the command that fits a small model."""
    return ["identify", f"{at}/{data}", "-o", f"{at}/out.json", "--sets", "5", "--json"]


def simulated(at: Path) -> list[str]:
    """Return the command that simulates the model along the table."""
    return ["simulate", f"{at}/model.json", f"{at}/table.csv", "-o", f"{at}/out.csv", "--json"]


CASES = (
    Case("report", "run.h5", lambda at: ["report", f"{at}/run.h5", "--json"], has_checksums=True),
    Case("replay", "run.h5", lambda at: ["replay", f"{at}/run.h5", "--json"], has_checksums=True),
    Case("report, no checksums", "old.h5", lambda at: ["report", f"{at}/old.h5", "--json"]),
    Case("replay, no checksums", "old.h5", lambda at: ["replay", f"{at}/old.h5", "--json"]),
    Case("identify log", "excitation.h5", lambda at: identified(at, "excitation.h5"), has_checksums=True),
    Case("identify table", "table.csv", lambda at: identified(at, "table.csv")),
    Case("simulate, table", "table.csv", simulated),
    Case("simulate, model", "model.json", simulated),
    Case("replay, model", "model.json", lambda at: ["replay", f"{at}/run.h5", "--model", f"{at}/model.json", "--json"]),
    Case("trace", "bus.trace", lambda at: ["firmware-sim", "--replay", f"{at}/bus.trace", "--time", "lockstep"]),
    Case("rig", "rig.toml", lambda at: ["probe", f"{at}/rig.toml", "--json"]),
    Case("wire", "wire.toml", lambda at: ["probe", f"{at}/rig.toml", "--json"]),
    Case("simulated device", "sim.toml", lambda at: ["firmware-sim", f"{at}/sim.toml", "--time", "lockstep"]),
    Case("off", "rig.toml", lambda at: ["off", f"{at}/rig.toml", "--json"]),
)


def sound_files(at: Path) -> None:
    """Make one valid file of each kind."""
    rig = (configs_dir() / "rigs/in-process.toml").read_text()
    (at / "sim.toml").write_text((configs_dir() / "sims/flexinol-lt-0.15mm.toml").read_text())
    (at / "wire.toml").write_text((configs_dir() / "wires/flexinol-lt-0.15mm.toml").read_text())
    rig = rig.replace("sim://flexinol-lt-0.15mm", f"sim://{at}/sim.toml").replace('"flexinol-lt-0.15mm"', '"wire.toml"')
    (at / "rig.toml").write_text(rig)
    sine = "sine:low_mm=1,high_mm=3,period_s=20,cycles=1"
    for command in (
        ["excite", f"{at}/rig.toml", "-o", f"{at}/excitation.h5", "--json"],
        ["identify", f"{at}/excitation.h5", "-o", f"{at}/model.json", "--json"],
        ["run", f"{at}/rig.toml", "--reference", sine, "--model", f"{at}/model.json", "-o", f"{at}/run.h5", "--json"],
        ["report", f"{at}/excitation.h5", "--csv", f"{at}/table.csv", "--json"],
        ["probe", f"{at}/rig.toml", "--trace", f"{at}", "--json"],
    ):
        end = ended(command)
        if end.code or end.how:
            raise SystemExit(f"{' '.join(command)}: {end}")
    shutil.copy(at / "run.h5", at / "old.h5")
    without_checksums(at / "old.h5")
    next(at.glob("*.trace")).rename(at / "bus.trace")


def damaged(data: bytes, generator: random.Random, is_text: bool) -> bytes:
    """Return the content with a few changed bytes, or with a changed number."""
    if is_text and generator.random() < 0.5 and (numbers := list(NUMBER.finditer(data))):
        number = generator.choice(numbers)
        return data[: number.start()] + generator.choice(ABSURD).encode() + data[number.end() :]
    changed, reach = bytearray(data), generator.choice((2000, 20_000, len(data)))
    for _ in range(generator.choice((1, 1, 2, 4, 16))):
        changed[generator.randrange(min(reach, len(data)))] = generator.randrange(256)
    return bytes(changed)


def ended(arguments: list[str]) -> End:
    """Run a command in a forked process, and return its end."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        child = os.fork()
        if child == 0:
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S))
            signal.alarm(HANGS_S)
            os._exit(_run(arguments))
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        out.seek(0)
        err.seek(0)
        result, errors = _result(out.read()), err.read()
    if code < 0:
        return End(f"signal {signal.Signals(-code).name}", code, None)
    if "Traceback" in errors or code not in GOOD_ENDS:
        return End(f"exit code {code}: {errors.strip().splitlines()[-1][:120] if errors.strip() else ''}", code, None)
    return End("", code, result)


def _run(arguments: list[str]) -> int:
    name, *rest = arguments
    code = 0
    try:
        if name == "firmware-sim":
            sys.stdin = Path(os.devnull).open()  # noqa: SIM115
            firmware_sim.cli.main(rest)
        else:
            sys.argv = ["smadrive", *arguments]
            cli.main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 (a user would see it)
        traceback.print_exc()
        code = 1
    with contextlib.suppress(OSError):
        sys.stdout.flush()
        sys.stderr.flush()
    return code


def _result(out: str) -> object:
    try:
        return json.loads(out)
    except ValueError:
        return out


def trial(case: Case, sound: Path, at: Path, expected: object, seed: str) -> str:
    """Give the command one damaged file, and return the effect."""
    generator = random.Random(seed)
    for file in sound.iterdir():
        if file.name != case.file:
            shutil.copy(file, at / file.name)
    data = (sound / case.file).read_bytes()
    (at / case.file).write_bytes(damaged(data, generator, is_text=not case.file.endswith(".h5")))
    end = ended(case.command(at))
    if end.how:
        return f"{FAILED}: {end.how}"
    if end.code:
        return f"rejected, {end.code}"
    if case.has_checksums and end.result != expected:
        return f"{FAILED}: other data than was recorded"
    return "as before" if end.result == expected else "another result"


def tried(case: Case, sound: Path, at: Path, count: int, seed: int) -> int:
    """Give a command `count` damaged files, print their effects, and return the number of forbidden ends."""
    shutil.copytree(sound, at, dirs_exist_ok=True)
    expected = ended(case.command(at)).result
    begun_s, ends = time.monotonic(), Counter[str]()
    for n in range(count):
        how = trial(case, sound, at, expected, f"{seed} {case.name} {n}")
        ends[how] += 1
        if how.startswith(FAILED):
            print(f"{case.name}, {n}: {how}", flush=True)
    outcomes = ", ".join(f"{times} {how}" for how, times in ends.most_common() if not how.startswith(FAILED))
    print(f"{case.name}: {outcomes or 'none'}; {(time.monotonic() - begun_s) / count:.2f} s each", flush=True)
    return sum(times for how, times in ends.items() if how.startswith(FAILED))


def main() -> None:
    """Damage files, run commands, count the ends. Exit with code 1 after a forbidden end."""
    count, seed = (int(text) for text in (*sys.argv[1:], "20", "0")[:2])
    with tempfile.TemporaryDirectory() as folder:
        sound, at = Path(folder) / "sound", Path(folder) / "files"
        at.mkdir()
        sound_files(at)
        shutil.copytree(at, sound)
        failed = sum([tried(case, sound, at, count, seed) for case in CASES])
    print(f"{failed} of {count * len(CASES)} damaged files had a forbidden effect")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
