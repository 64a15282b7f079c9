# `make run` and `make test` set up everything they need on a fresh Debian or Ubuntu machine.

# `make test EXTRAS=host,dev,train,rerun` also runs the tests that train (they need PyTorch) and those of the Rerun view.

PYTHON ?= python3
VENV   ?= .venv
EXTRAS ?= host,dev
PARTS  ?= 6
comma  := ,
LOCKED := base host dev
# Names no index, and takes one version for all Pythons: what was tested on the host is what the board runs.
COMPILE = $(VENV)/release/bin/uv pip compile -q --universal --fork-strategy fewest --python-version 3.11 --generate-hashes \
	--no-header --no-annotate --no-emit-index-url --no-emit-find-links
PAANI  := $(VENV)/bin/paani
BIN    := $(VENV)/bin
DEBIAN := libegl1 libopengl0 libgl1 libgl1-mesa-dri
DEBIAN_TEST := $(DEBIAN) chromium-headless-shell libatomic1
# What tests/deploy builds and runs containers with.
DEBIAN_DEPLOY := docker.io iptables debootstrap faketime
# What builds, emulates and checks the microcontroller's firmware: most of a gigabyte, which `make check` does without.
DEBIAN_FIRMWARE := gcc-arm-none-eabi qemu-system-arm g++ cppcheck
# What a Python that cannot make a virtual environment lacks; asked only before there is one.
DEBIAN_PYTHON = $(if $(wildcard $(BIN)/python),,$(shell $(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || echo python3-venv))

.PHONY: run test test-long check compiled-tests mutation lint docs firmware containers containers-down setup setup-test system system-test system-firmware system-deploy lock dist sbom clean
.NOTPARALLEL: # Python and its venv module come with the system packages

run: setup ## start the whole loop on the river world
	$(PAANI) up $(ARGS)

test: setup-test system-firmware system-deploy lint ## everything that CI runs; PARTS=1 runs what takes turns as well
	$(BIN)/python -m pytest -q -n 3 --durations=20 --parts=$(PARTS) tests -m "not long"

test-long: setup-test ## what takes hours: the standard suite of trials, tests marked `long`; interrupted, the same command goes on
	@mkdir -p runs
	$(PAANI) trial --suite standard --report runs/trial-standard.html
	$(PAANI) bench faults --runs 20 --out runs/faults.json
	$(BIN)/python -m pytest -q tests -m long || [ $$? -eq 5 ] # 5: no test is marked so

# It keeps what it compiled, as a third of the time goes into compiling tests, and does not even import files that mark all
# their tests as others than it runs: PyTorch alone takes seconds.
check: setup-test lint ## the fast check: lint, types, import contracts, unit and contract tests
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -q -n 2 --hypothesis-profile=quick tests/unit tests/contract -m "not train and not gl and not data and not slow" \
		$$(grep -rlE '^pytestmark = .*mark\.(train|gl|data|slow)\>' --include='*.py' tests/unit tests/contract | sed 's/^/--ignore=/')

compiled-tests: setup-test # once, as else every worker of pytest does so when it begins
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -qq --collect-only tests

mutation: system-test $(VENV)/.stamp-host-dev-mutation ## how many small changes of the safety path its unit tests notice; about an hour
	$(BIN)/python -m tests.mutation

lint:
	$(BIN)/ruff check -q .
	$(BIN)/ruff format -q --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/.stamp-host-dev ## build the documentation into runs/docs, strictly: a broken link fails
	$(BIN)/python -m docs.build runs/docs

firmware: system-firmware ## build the microcontroller's image for the emulator into runs/mcu/qemu; prints its bytes
	@$(MAKE) -s -C mcu/qemu
	@arm-none-eabi-size runs/mcu/qemu/paani.elf | awk 'NR == 2 { print "paani.elf: text " $$1 ", data " $$2 ", bss " $$3 " bytes" }'

setup: system $(VENV)/.stamp-host
setup-test: system-test $(VENV)/.stamp-$(subst $(comma),-,$(EXTRAS))

$(VENV)/bin/python:
	@sh deploy/system-packages.sh $(DEBIAN_PYTHON)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "paani needs Python >= 3.11 (PYTHON=...)"; exit 2; }
	@$(PYTHON) -m venv $(VENV) || { rm -f $@; echo "cannot make $(VENV): install python3-venv"; exit 2; }

# Extras that have a lock file are installed by its hashes, the others (train: PyTorch, as a build for this machine) by name.
$(VENV)/.stamp-%: pyproject.toml $(wildcard requirements/*.lock) | $(VENV)/bin/python
	$(BIN)/python -m pip install -q --require-hashes -r requirements/build.lock $(patsubst %,-r requirements/%.lock,$(filter $(LOCKED),$(subst -, ,$*)))
	$(BIN)/python -m pip install -q --no-deps --no-build-isolation -e .
	$(foreach extra,$(filter-out $(LOCKED),$(subst -, ,$*)),$(BIN)/python -m pip install -q --no-build-isolation -e ".[$(extra)]" &&) true
	@mkdir -p runs
	@touch $@

$(VENV)/release/.stamp: requirements/release.lock | $(VENV)/bin/python
	@$(BIN)/python -m venv $(@D)
	$(@D)/bin/python -m pip install -q --require-hashes -r $<
	@touch $@

system:
	@sh deploy/system-packages.sh $(DEBIAN) $(DEBIAN_PYTHON)

system-test:
	@sh deploy/system-packages.sh $(DEBIAN_TEST) $(DEBIAN_PYTHON)

system-firmware:
	@sh deploy/system-packages.sh $(DEBIAN_FIRMWARE)

system-deploy:
	@sh deploy/system-packages.sh $(DEBIAN_DEPLOY)

containers: ## board and host in containers of this one machine; `make containers-down` ends them
	@sh deploy/containers.sh up

containers-down:
	@sh deploy/containers.sh down

lock: $(VENV)/release/.stamp ## pin what the next installation takes, with hashes of its files for every machine
	$(COMPILE) pyproject.toml --extra dev -o requirements/dev.lock
	$(COMPILE) pyproject.toml --extra host -c requirements/dev.lock -o requirements/host.lock
	$(COMPILE) pyproject.toml -c requirements/dev.lock -o requirements/base.lock
	$(COMPILE) pyproject.toml --extra mavlink --extra ros2 --extra foxglove -c requirements/dev.lock -o requirements/ports.lock
	$(COMPILE) --group build -c requirements/dev.lock -o requirements/build.lock
	$(COMPILE) --group release -o requirements/release.lock

dist: setup sbom ## wheel, sdist and bill of materials into dist/, the same bytes for the same commit
	$(BIN)/python -m hatchling build -d dist

sbom: $(VENV)/release/.stamp ## what the host installs and what the page holds, as CycloneDX JSON, into dist/
	@mkdir -p dist
	$(VENV)/release/bin/cyclonedx-py requirements --pyproject pyproject.toml --mc-type application --output-reproducible \
		--of JSON -o dist/paani.cdx.json requirements/host.lock
	$(VENV)/release/bin/python -m deploy.page_libraries dist/paani.cdx.json

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
