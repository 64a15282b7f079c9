# `make run` and `make test` set up everything they need on a fresh Debian or Ubuntu machine.

# `make test EXTRAS=host,dev,train` also runs the tests that train; they need PyTorch.

PYTHON ?= python3
VENV   ?= .venv
EXTRAS ?= host,dev
comma  := ,
PAANI  := $(VENV)/bin/paani
BIN    := $(VENV)/bin
DEBIAN := libegl1 libopengl0 libgl1 libgl1-mesa-dri
DEBIAN_TEST := $(DEBIAN) chromium

.PHONY: run test check lint docs setup setup-test system system-test lock clean

run: setup ## start the whole loop on the river world
	$(PAANI) up $(ARGS)

test: setup-test lint ## everything that CI runs
	$(BIN)/python -m pytest -q tests

check: setup-test lint ## the fast check: lint, types, import contracts, unit and contract tests
	$(BIN)/python -m pytest -q -n 2 --hypothesis-profile=quick tests/unit tests/contract -m "not train and not gl and not data and not slow"

lint:
	$(BIN)/ruff check -q .
	$(BIN)/ruff format -q --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/.stamp-host-docs ## build the documentation into runs/docs, strictly: a broken link fails
	$(BIN)/python -m docs.build runs/docs

setup: $(VENV)/.stamp-host system
setup-test: $(VENV)/.stamp-$(subst $(comma),-,$(EXTRAS)) system-test

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "paani needs Python >= 3.11 (PYTHON=...)"; exit 2; }
	@$(PYTHON) -m venv $(VENV) || { echo "cannot make $(VENV): install python3-venv"; exit 2; }

$(VENV)/.stamp-%: pyproject.toml requirements.lock | $(VENV)/bin/python
	$(BIN)/python -m pip install -q -c requirements.lock -e ".[$(subst -,$(comma),$*)]"
	@mkdir -p runs
	@mkdir -p runs
	@touch $@

system:
	@sh deploy/system-packages.sh $(DEBIAN)

system-test:
	@sh deploy/system-packages.sh $(DEBIAN_TEST)

lock: ## pin what the next installation takes
	$(BIN)/uv pip compile -q --python-version 3.11 --extra host --extra dev --no-header --no-annotate --no-emit-index-url --no-emit-find-links pyproject.toml -o requirements.lock

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
