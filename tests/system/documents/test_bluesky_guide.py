"""The snippets of the guide to bluesky run one after the other, and leave the logs that it names."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SNIPPETS = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "bluesky.md").read_text(), re.DOTALL)


@pytest.mark.exhaustive
def test_all_snippets_run_one_after_the_other(tmp_path):
    pytest.importorskip("bluesky", reason="needs bluesky (extra `test`)")
    assert len(SNIPPETS) >= 5
    (tmp_path / "script.py").write_text("".join(SNIPPETS))
    command = [sys.executable, "-W", "error", "script.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    printed = done.stdout.split()
    assert [printed.count(name) for name in ("start", "stop", "descriptor")] == [2, 2, 2]
    assert (printed.count("event"), printed.count("event_page")) == (4, 1)
    assert "0 trips" in done.stdout
    assert {"excitation.h5", "wire.json", "servo.h5", "servo-2.h5"} <= {path.name for path in tmp_path.iterdir()}
