"""`smadrive list`: the shipped rigs, wires, device profiles, simulated wires and campaigns."""

from __future__ import annotations

import shlex

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.files.shipped import ShippedFile, shipped_files

HEADER = ("name", "kind", "what it is")


def main(as_json: AsJson = False) -> None:
    """List the shipped rigs, wires, device profiles, simulated wires and campaigns.

    Other commands accept these names in place of the path of a file.
    """
    output = Output(as_json)
    files = shipped_files()
    rows = [(file.name, kind.removesuffix("s"), file.what) for kind, of_kind in files.items() for file in of_kind]
    output.table(HEADER, rows, notes=True)
    copied = f"`cp {shlex.quote(str(files['rigs'][0].path))} my-rig.toml`"
    output.say(f"own files: copy one of these, for example {copied}, change it, and give its path instead of the name")
    output.result({kind: [_result(file) for file in of_kind] for kind, of_kind in files.items()})


def _result(file: ShippedFile) -> dict[str, str]:
    return {"name": file.name, "what": file.what, "file": str(file.path)}
