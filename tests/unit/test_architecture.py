"""The house keeps its order: standard terms as names, small files, small folders, packages with a description.

The directions of imports are checked by `lint-imports`.
"""

import ast
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("smadrive", "firmware_sim")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
FOLDERS = sorted({path.parent for path in FILES})

MOST_LINES = 250
MOST_FILES = 12
MOST_LOOSE_FILES = 8
LARGE_FOLDERS = (ROOT / "smadrive" / "cli",)
"""Folders with one file for each command."""

EVERY_KIND = ("module", "class", "function", "attribute", "variable")


class Rule(NamedTuple):
    """A word that names do not contain, or are not (`whole`): of these kinds of things, in files below `area`."""

    word: str
    term: str
    kinds: tuple[str, ...] = EVERY_KIND
    area: str = ""
    whole: bool = False

    def forbids(self, name):
        is_found = name.words == f"_{self.word}_" if self.whole else f"_{self.word}_" in name.words
        return is_found and name.kind in self.kinds and name.place.startswith(self.area)


RULES = (
    Rule("workbench", "change queue"),
    Rule("workshop", "model builder"),
    Rule("order", "BuildRequest", ("class",), whole=True),
    Rule("outcome", "BuildResult", ("class",), "smadrive/tuning", whole=True),
    Rule("parcel", "mailbox, socket"),
    Rule("parcels", "mailbox, socket"),
    Rule("presses", "button events"),
    Rule("punctual", "real-time scheduling"),
    Rule("beside", "supervised subprocess"),
    Rule("desk", "client registry, session access"),
    Rule("offered", "reference catalogue"),
    Rule("adapting", "adaptation runner", whole=True),
    Rule("live_controller", "SwappableController"),
    Rule("exchange", "swap", ("function",), "smadrive/control/controllers", whole=True),
    Rule("lottery", "random wires"),
    Rule("draw", "random_wire", ("function",), "firmware_sim/physics", whole=True),
    Rule("chance", "random bus faults"),
    Rule("door", "endpoint"),
    Rule("doors", "endpoints"),
    Rule("tcpdoor", "endpoint"),
    Rule("way_in", "listen address"),
    Rule("ways", "listen addresses", whole=True),
    Rule("talk", "connection", whole=True),
    Rule("ear", "client"),
    Rule("ailment", "sensor fault"),
    Rule("ailments", "sensor faults"),
    Rule("refusal", "Modbus exception", ("module", "class")),
    Rule("refusal", "Modbus exception", area="smadrive/modbus"),
    Rule("refusal", "Modbus exception", area="firmware_sim"),
    Rule("companion", "dependent register"),
    Rule("companions", "dependent registers"),
    Rule("words", "register types, bit packing", ("module",), whole=True),
    Rule("meaning", "PDU description", ("module",), whole=True),
    Rule("vectors", "golden frames", ("module",), whole=True),
    Rule("sections", "profile schema", ("module",), whole=True),
    Rule("insist", "retry_all"),
    Rule("see_it_off", "wait_for_zero_current"),
    Rule("brief", "configure", ("function",), whole=True),
    Rule("hold", "heartbeat", ("function",), "smadrive/devices/guardian", whole=True),
    Rule("rest", "stand_down", ("function",), whole=True),
    Rule("lose", "disconnect", ("function",), whole=True),
    Rule("lease", "port access"),
    Rule("placement", "displacement band"),
    Rule("plausibility", "temperature band"),
    Rule("turn", "reversal", ("class",), whole=True),
    Rule("turn", "reversal", area="smadrive/control", whole=True),
    Rule("turn", "reversal", area="firmware_sim/physics", whole=True),
    Rule("turning", "reversal", ("module",), whole=True),
    Rule("rehearsal", "feasibility"),
    Rule("rehearse", "simulate_run"),
    Rule("rehearsed", "simulate_run"),
    Rule("confirmation", "leave-one-out", ("module", "function"), whole=True),
    Rule("bounded", "bounded Levenberg-Marquardt", ("module",), whole=True),
    Rule("blend", "interpolation matrix", whole=True),
    Rule("samewire", "rig configuration checks"),
    Rule("wirelimits", "rig configuration checks"),
    Rule("runfigures", "run metrics"),
    Rule("loggedrun", "run metadata"),
    Rule("about", "metadata", whole=True),
    Rule("nearest", "spelling suggestions", ("module", "function"), whole=True),
    Rule("onethread", "BLAS threads"),
    Rule("polyline", "piecewise-linear interpolation"),
    Rule("driven_time", "lockstep time"),
    Rule("wanted_mm", "setpoint_mm"),
    Rule("wanted_c", "setpoint_c"),
    Rule("wanted", "setpoint", area="smadrive/control"),
    Rule("wanted", "setpoint", area="smadrive/tuning/page"),
    Rule("told", "message, metadata: what it is"),
    Rule("known", "parameters, names: what it is", whole=True),
    Rule("doubt", "DisturbanceEvidence", area="smadrive/control"),
    Rule("doubts", "caveats"),
    Rule("bench", "SimulatedBench", ("class",), "firmware_sim", whole=True),
    Rule("bench", "Rig, SimulatedBench", area="smadrive/"),
)
"""The words of words.md whose names gave way to the standard terms of the field."""

STANDARD = ("simulated_bench", "bench_supply")
"""Standard terms that contain such a word."""

SIMULATED = ("smadrive/testing/",)
"""Files that hold the simulator's objects, under the simulator's names."""


class Name(NamedTuple):
    """A name that the source of the project defines."""

    place: str
    kind: str
    text: str

    @property
    def words(self) -> str:
        """The name as lower-case words with `_` between, around and at both ends."""
        return words_of(self.text)


@cache
def words_of(text: str) -> str:
    return "_" + re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", text).lower().strip("_") + "_"


@cache
def names_of(path: Path) -> list[Name]:
    """Every name of a module, class, function, attribute or variable that the file defines."""
    place = path.relative_to(ROOT)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = [(1, "module", path.stem if path.stem != "__init__" else path.parent.name)]
    for node in ast.walk(tree):
        found += _defined_by(node)
    return [Name(f"{place}:{line}", kind, text) for line, kind, text in found]


def _defined_by(node: ast.AST) -> list[tuple[int, str, str]]:
    match node:
        case ast.ClassDef():
            return [(node.lineno, "class", node.name), *_fields(node)]
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            return [(node.lineno, "function", node.name)]
        case ast.Attribute(ctx=ast.Store()):
            return [(node.lineno, "attribute", node.attr)]
        case ast.Name(ctx=ast.Store()):
            return [(node.lineno, "variable", node.id)]
        case ast.arg():
            return [(node.lineno, "variable", node.arg)]
    return []


def _fields(node: ast.ClassDef) -> list[tuple[int, str, str]]:
    targets = [inner.target for inner in node.body if isinstance(inner, ast.AnnAssign)]
    targets += [target for inner in node.body if isinstance(inner, ast.Assign) for target in inner.targets]
    return [(target.lineno, "attribute", target.id) for target in targets if isinstance(target, ast.Name)]


def term_for(name: Name) -> str | None:
    """The standard term that the name has to use; None for a name that may stay."""
    if name.place.startswith(SIMULATED) or any(f"_{term}_" in name.words for term in STANDARD):
        return None
    return next((rule.term for rule in RULES if rule.forbids(name)), None)


def report(findings):
    """Fail with one finding a line."""
    if findings:
        pytest.fail("\n".join(findings), pytrace=False)


@pytest.mark.exhaustive
@pytest.mark.parametrize("package", PACKAGES)
def test_names_are_standard_terms(package):
    names = {name for path in FILES if path.is_relative_to(ROOT / package) for name in names_of(path)}
    terms = {name: term_for(name) for name in sorted(names)}
    report([f"{name.place}: {name.kind} {name.text} -> {term}" for name, term in terms.items() if term])


def test_files_are_short():
    lines = {path.relative_to(ROOT): len(path.read_text(encoding="utf-8").splitlines()) for path in FILES}
    report([f"{path}: {count} lines" for path, count in lines.items() if count > MOST_LINES])


def test_folders_are_small():
    counts = {folder: len(list(folder.glob("*.py"))) for folder in FOLDERS if folder not in LARGE_FOLDERS}
    report([f"{folder.relative_to(ROOT)}: {count} files" for folder, count in counts.items() if count > MOST_FILES])


def test_few_files_lie_loose():
    loose = [path.name for path in (ROOT / "smadrive").glob("*.py")]
    assert len(loose) <= MOST_LOOSE_FILES, loose


def test_every_folder_is_a_package():
    report([str(folder.relative_to(ROOT)) for folder in FOLDERS if not (folder / "__init__.py").exists()])


def test_every_package_describes_itself():
    heads = {folder: ast.parse((folder / "__init__.py").read_text(encoding="utf-8")) for folder in FOLDERS}
    report([str(folder.relative_to(ROOT)) for folder, head in heads.items() if not ast.get_docstring(head)])


def test_parts_of_scipy_are_imported_at_their_first_use():
    """`import scipy` imports scipy.optimize when it is used. `from scipy.optimize` costs every command up to 0.5 s."""
    early = re.compile(r"^(from scipy\.|import scipy\.)", re.MULTILINE)
    report([str(path.relative_to(ROOT)) for path in FILES if early.search(path.read_text(encoding="utf-8"))])


@pytest.mark.exhaustive
@pytest.mark.parametrize("package", PACKAGES)
def test_class_names_are_used_once(package):
    """Private classes are not counted; the simulated device has its own name for what the driver has, too."""
    places = {}
    for path in FILES:
        for name in names_of(path) if path.is_relative_to(ROOT / package) else ():
            if name.kind == "class" and not name.text.startswith("_"):
                places.setdefault(name.text, []).append(name.place)
    report([f"{text}: {', '.join(found)}" for text, found in places.items() if len(found) > 1])


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("class LiveController: ...", "SwappableController"),
        ("class Turn: ...", "reversal"),
        ("class TurnPreview: ...", None),
        ("def tcpdoor_of(): ...", "endpoint"),
        ("def rest(): ...", "stand_down"),
        ("def interest(): ...", None),
        ("class WayIn: ...", "listen address"),
        ("self.wanted_mm = 1.0", "setpoint_mm"),
        ("class Fit:\n    about: str", "metadata"),
        ("def f(known): ...", "parameters, names: what it is"),
        ("def unit_doubts(): ...", "caveats"),
        ("_bench = 1", "Rig, SimulatedBench"),
        ("class BenchSupply: ...", None),
        ("setpoint_mm = 1.0", None),
    ],
)
def test_rules_forbid_old_words_only(source, expected):
    defined = [entry for node in ast.walk(ast.parse(source)) for entry in _defined_by(node)]
    terms = {term_for(Name("smadrive/x.py:1", kind, text)) for _, kind, text in defined}
    assert terms - {None} == {expected} - {None}
