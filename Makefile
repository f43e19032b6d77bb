# Two commands do all set-up: `make run` and `make test`.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: run test check unit many coverage bench soak clean

run: $(VENV)/run.stamp
	$(BIN)/sphmctl run configs/paths/octagon.yaml --dry-run

test: $(VENV)/dev.stamp
	tools/apt.sh
	$(MAKE) --no-print-directory check unit

check: $(VENV)/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Whole processes in real time get a second and third try: a shared machine may stall for longer
# than servos may be silent. What they show is shown again on a virtual clock, without another try.
unit: $(VENV)/dev.stamp
	$(BIN)/pytest -n auto --dist worksteal -m 'not hardware and not realtime and not many'
	$(BIN)/pytest -m 'realtime and not hardware and not many' --reruns 2

# Further seeds and instants of what `test` tries with a few: minutes, so not part of it.
many: $(VENV)/dev.stamp
	$(BIN)/pytest -n auto --dist worksteal -m 'many and not realtime'
	$(BIN)/pytest -m 'many and realtime' --reruns 2

# All that is on a virtual clock, with what it covers: twice as slow.
coverage: $(VENV)/dev.stamp
	$(BIN)/pytest -n auto --dist worksteal -m 'not hardware and not realtime and not many' --cov --cov-report=term

# Each figure beside its reference, in one run; minutes, so not part of `test`.
bench: $(VENV)/bench.stamp
	$(BIN)/python tools/bench/all.py

# Ten simulated minutes of the board's full cycle at 50 and at 100 Hz: minutes too.
soak: $(VENV)/dev.stamp
	$(BIN)/python tools/bench/soak_board.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: $(VENV)/bin/python pyproject.toml
	$(BIN)/pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/dev.stamp: $(VENV)/bin/python pyproject.toml
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

$(VENV)/bench.stamp: $(VENV)/bin/python pyproject.toml
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev,bench]'
	touch $@

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .coverage .import_linter_cache
