"""Pages of the site that docs/ does not hold: README, changelog, and the reference of the Python interface.

A link to a file outside the site, such as a source file, becomes plain text.
"""

import re
from pathlib import Path
from posixpath import normpath

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
FILE_BLOCK = re.compile(r"^```(\w+) (\S+)$", re.MULTILINE)
"""A block of code that names the file which the reader is to write."""
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\(([^)\s]+)\)")
MODULES = (
    "smadrive.scripting.open_rig",
    "smadrive.scripting.run",
    "smadrive.scripting.wire",
    "smadrive.hysteresis",
    "smadrive.identification",
    "smadrive.wire.identified_wire",
    "smadrive.control.references.reference",
    "smadrive.control.references.shapes",
    "smadrive.rig.rig",
    "smadrive.rig.config",
    "smadrive.runs.log.reader",
    "smadrive.measurement",
    "smadrive.errors",
)


def on_files(files, config):
    """Add the pages."""
    readme = (ROOT / "README.md").read_text().replace("](docs/", "](").replace("](CHANGELOG.md)", "](changelog.md)")
    reference = "# Python interface\n\n" + "\n\n".join(f"::: {name}" for name in MODULES)
    pages = {"index.md": readme, "changelog.md": (ROOT / "CHANGELOG.md").read_text(), "reference.md": reference}
    for path, content in pages.items():
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown, page, config, files):
    """Keep only the text of links to files outside the site; show the names of files above their code."""
    folder = Path(page.file.src_uri).parent

    def kept(link):
        target = link[3].partition("#")[0]
        if "://" in target or not target or files.get_file_from_path(normpath(folder / target)):
            return link[0]
        return link[2]

    return FILE_BLOCK.sub(r'```\1 title="\2"', LINK.sub(kept, markdown))
