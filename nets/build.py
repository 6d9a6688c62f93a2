"""Builds the networks of the built-in scenarios, nets/*.net.xml, from their plain-XML sources in nets/plain.

Run `python nets/build.py` after a change to a source. Needs netconvert (package eclipse-sumo).
"""

import re
import subprocess
import tempfile
from pathlib import Path

import sumolib

NETS = Path(__file__).parent
SOURCES = tuple(sorted((NETS / "plain").glob("*.netccfg")))

# netconvert's header comment: when, by which version and with which file names the network was built.
HEADER = re.compile(r"<!-- generated on \S+ by Eclipse SUMO netconvert (?P<version>\S+).*?-->", re.DOTALL)


def build(source: Path, target: Path) -> None:
    """Writes the network that the netconvert configuration `source` describes to `target`.

    Equal sources and netconvert versions give equal bytes: of the header only the version is kept.

    Raises:
        subprocess.CalledProcessError: netconvert refused the sources; its reason is on stderr.
    """
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder, "raw.net.xml")
        command = (sumolib.checkBinary("netconvert"), "-c", str(source), "-o", str(raw))
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603  (our own command and files)
        text = raw.read_text(encoding="utf-8")
    text = HEADER.sub(r"<!-- built by nets/build.py with netconvert \g<version> -->", text, count=1)
    target.write_text(text, encoding="utf-8", newline="\n")


def main() -> None:
    """Builds every network into nets/."""
    for source in SOURCES:
        target = NETS / f"{source.stem}.net.xml"
        build(source, target)
        print(target.relative_to(NETS.parent))


if __name__ == "__main__":
    main()
