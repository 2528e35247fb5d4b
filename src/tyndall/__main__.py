"""``python -m tyndall`` is the ``tyndall`` command."""

from tyndall.app.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
