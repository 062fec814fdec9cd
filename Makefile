# make demo   the main job: the built-in satellite with its isolation platform and without
# make test   lint, types, import layers, the documentation and all tests
# make check  the fast lane: lint, types, layers and the tests that are not slow
# make docs   the documentation as a site in site/; a warning is an error
# make bench  speed against other engines, as ratios in one run
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test check lint docs bench clean

demo: $(VENV)/installed
	$(BIN)/quietbus compare zhang2012 --duration "60 s" --output out

test: lint docs
	$(BIN)/pytest -n 2 --dist loadfile --durations=25

check: lint
	$(BIN)/pytest -n 2 --dist loadfile -m "not slow"

lint: $(VENV)/developed
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/developed
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

bench: $(VENV)/developed
	@for each in benchmarks/*.py; do echo "== $$each"; $(BIN)/python $$each; done

$(VENV)/installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "quietbus needs Python 3.11 or newer; set PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --editable .
	@touch $@

$(VENV)/developed: $(VENV)/installed
	$(BIN)/pip install --quiet --editable '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) out site build dist
