# Two commands do everything: `make demo` and `make test`. Each sets the environment up first, once.

PYTHON := .venv/bin/python
READY := .venv/.ready

.PHONY: demo test lint types unit format lock clean

demo: $(READY)
	.venv/bin/tyndall compare box --size 240x135 --truth.seconds 40 --out out/demo --report

test: lint types unit

lint: $(READY)
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .

types: $(READY)
	.venv/bin/mypy

unit: $(READY)
	.venv/bin/pytest -n 2

format: $(READY)
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

# One lock for the package and its tools, for every platform, without index addresses. Needs uv.
lock:
	uv pip compile pyproject.toml --group dev --extra truth --extra sweep --universal --python-version 3.12 --generate-hashes \
		--no-annotate --no-header --upgrade --output-file requirements.lock

clean:
	rm -rf .venv out .mypy_cache .pytest_cache .ruff_cache

$(READY): requirements.lock pyproject.toml tools/setup.sh
	tools/setup.sh
	@touch $@
