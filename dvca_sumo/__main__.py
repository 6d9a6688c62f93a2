"""The command, as `dvca-sumo` or `python -m dvca_sumo`."""

import sys
from typing import NoReturn


def main() -> NoReturn:
    """The program, which takes a second to load: an interrupt then ends it as any other does."""
    try:
        from dvca_sumo import cli  # noqa: PLC0415
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)
    cli.main()


if __name__ == "__main__":
    main()
