# Every target makes its own .venv with python3 -m venv and pip; nothing else is needed.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo serve test test-slow bench lint samples docs chart clean

# Run the main job on a sample: read, fit every candidate model, rank, draw.
demo: .venv/user
	$(BIN)/lobefit fit samples/rough_copper.csv --out demo-output

# Serve the HTTP interface and the page on http://127.0.0.1:8000 until Ctrl-C.
serve: .venv/user
	$(BIN)/lobefit serve

test: .venv/dev
	$(BIN)/python -m pytest -m "not slow" -n 2 --dist worksteal

# Statistical runs of minutes: coverage of intervals over hundreds of seeds.
test-slow: .venv/dev
	$(BIN)/python -m pytest -m slow -n 2 --dist worksteal

bench: .venv/dev
	$(BIN)/python -m benchmarks

lint: .venv/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# Make the pages of the models and the stability atlas again, where they are stale.
docs: .venv/dev
	$(BIN)/python -m docs.make
	$(BIN)/python -m docs.stability

# Measure and draw the charts of speed against accuracy again, on an idle machine.
chart: .venv/dev
	$(BIN)/python -m docs.tradeoffs

# Make the sample measurements again from the commands recorded beside them.
samples: .venv/user
	$(BIN)/python samples/make.py

.venv/user: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

.venv/dev: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@ .venv/user

clean:
	rm -rf .venv demo-output dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
