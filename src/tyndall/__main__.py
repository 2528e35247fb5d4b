"""``python -m tyndall`` is the ``tyndall`` command."""

from __future__ import annotations


def main() -> int:
    """Run the command line and return its exit code; an interrupt is quiet from the first import on."""
    try:
        from tyndall.app.cli import main as run

        return run()
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    raise SystemExit(main())
