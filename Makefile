# A fresh machine needs Python >= 3.11, make and git. Everything else is installed here.
PYTHON ?= python3
BIN := .venv/bin
# Python compiles what it imports. To compile everything at installation takes half of the time of `make setup`.
PIP_INSTALL := -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt

# $(call limit,SECONDS) COMMAND ends a command that hangs, after about ten times what two quiet cores need.
# LIMIT=7200 replaces every limit, and LIMIT=0 removes them.
# $(call saying,SECONDS,TEXT) COMMAND prints TEXT every ten seconds while a command prints nothing itself.
export LIMIT
limit = @$(PYTHON) .ci/limited.py $(or $(2),$@) $(1)
saying = @$(PYTHON) .ci/limited.py --say $(2) $(or $(3),$@) $(1)

.PHONY: help setup extras clean validate lint test test-more test-processors test-viewer test-all fuzz package \
	docs judge restamp
help: ## list the targets
	@sed -nE -e 's/^## (.*)/\n\1/p' -e 's/^([a-z-]+):.*## (.*)/  \1\t\2/p' $(MAKEFILE_LIST) | expand -t 20

## Install
setup: .venv/ready ## create .venv and install cranectl with its tools for developers
	@echo "next: . .venv/bin/activate     then: cranectl --help"
extras: .venv/extras .venv/oracles ## add all extras, and CasADi for tests
clean: ## remove .venv and all generated files
	rm -rf .venv viewer/node_modules viewer/failures build dist .mypy_cache .ruff_cache .pytest_cache
	git clean -fdXq logs  # what git ignores, so that its README.md stays
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/cranectl: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "cranectl needs Python 3.11 or newer; choose one with make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 2; }
	$(call saying,600,"creating .venv",setup) $(PYTHON) -m venv .venv
	$(call saying,600,"updating pip",setup) $(BIN)/python $(PIP_INSTALL) pip
	$(call saying,3600,"installing cranectl and its dependencies into .venv",setup) $(BIN)/python $(PIP_INSTALL) --editable .
	@touch $@

.venv/ready: .venv/cranectl
	$(call saying,3600,"installing the tools for developers",setup) $(BIN)/python $(PIP_INSTALL) --group dev
	@touch $@

.venv/extras: .venv/ready
	$(call saying,3600,"installing the extras that tests need",extras) \
		$(BIN)/python $(PIP_INSTALL) --editable '.[cluster,fmi,import,tune,video]'
	@touch $@

.venv/oracles: .venv/ready
	$(call saying,3600,"installing Drake and CasADi",extras) $(BIN)/python $(PIP_INSTALL) --editable '.[drake]' --group oracles
	@touch $@

.venv/site: .venv/ready
	$(call saying,3600,"installing what builds the site",docs) $(BIN)/python $(PIP_INSTALL) --group site
	@touch $@

## Use
validate: .venv/cranectl ## run all scenarios with all controllers on three plants, and judge them
	$(call limit,1800) $(BIN)/cranectl validate

## Test
lint: .venv/extras ## check format, style, spelling, types and directions of imports
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/typos
	$(call limit,1200) $(BIN)/mypy
	$(BIN)/lint-imports --no-cache

TOOLS = tests/tools/robustness tests/campaign tests/cases tests/tools/export tests/fuzz tests/tools/live \
	tests/loaders tests/tools/measured tests/tools/render tests/report
# Kernels are compiled and motions planned first, or two processes of the tests would do the same.
CORE = --ignore tests/docs --ignore tests/tools/thesis --ignore tests/drake --ignore tests/planning --ignore tests/benchmark \
	--ignore tests/tools/benchmark $(TOOLS:%=--ignore %) --ignore tests/test_processors.py
test: .venv/extras ## run the core tests
	$(call saying,3600,"looking for EGL and a C compiler") tests/install
	$(call saying,1800,"compiling kernels and planning motions") $(BIN)/python -m tests.kernels
	$(call limit,3600) $(BIN)/python -m pytest -m "not slow" $(CORE)

# A set is left out while nothing that it depends on has changed since its last full pass, in .ci/proven.json.
# ALL=1 runs every set and records those that pass. PLAN_CASES and DRAKE_CASES limit the number of random cases.
NMPC_PLANS = tests/benchmark/test_nmpc_plans.py
changed = $(BIN)/python .ci/proven.py $(1) $(if $(ALL),--always) --
test-more: .venv/extras ## slow tests, tools, documents, literature, plans, Drake, if sources changed
	$(call saying,3600,"looking for EGL and a C compiler") tests/install
	$(call limit,5400) $(call changed,core) $(BIN)/python -m pytest -m slow $(CORE)
	$(call limit,3600) $(call changed,tools) $(BIN)/python -m pytest $(TOOLS)
	$(call limit,3600) $(call changed,docs) $(BIN)/python -m pytest tests/docs tests/tools/thesis
	$(call limit,3600) $(call changed,literature) $(BIN)/python -m pytest tests/benchmark tests/tools/benchmark --ignore $(NMPC_PLANS)
	$(call limit,9000) $(call changed,planning) sh -c '$(MAKE) .venv/oracles && $(BIN)/python -m pytest tests/planning $(NMPC_PLANS)'
	$(call limit,14400) $(call changed,drake) sh -c '$(MAKE) .venv/oracles && $(BIN)/python -m pytest tests/drake'

PROCESSOR_TESTS = $(BIN)/python -m pytest -m processor --ignore tests/docs --ignore tests/tools/thesis --ignore tests/drake \
	--ignore tests/tools/live --ignore tests/planning --ignore $(NMPC_PLANS)
test-processors: .venv/extras ## compare answers with old processors' kernels and code, if sources changed
	$(call limit,7200) $(call changed,processors) sh -c \
		'OPENBLAS_CORETYPE=Nehalem $(PROCESSOR_TESTS) && NUMBA_CPU_NAME=generic $(PROCESSOR_TESTS)'

BROWSER_TESTS = sh -c 'viewer/install $(BIN) && $(BIN)/python -m pytest -n 0 $(1)'
test-viewer: .venv/site ## open logs in a real viewer and other parsers, if sources changed
	$(call limit,5400) $(call changed,viewer) $(call BROWSER_TESTS,viewer --ignore viewer/test_site.py)
	$(call limit,3600) $(call changed,site) $(call BROWSER_TESTS,viewer/test_site.py)

test-all: ## run everything above in full, and record the sets that passed
	$(MAKE) lint test test-more test-processors validate test-viewer package ALL=1

MINUTES ?= 30
fuzz: .venv/extras ## try odd files, controllers, machines and command lines for MINUTES=30
	$(call saying,1800,"compiling kernels and planning motions") $(BIN)/python -m tests.kernels
	$(BIN)/python -m tests.fuzz --minutes $(MINUTES)

INSTALLERS = env UV_SYSTEM_CERTS=1 UV_CACHE_DIR=$(CURDIR)/build/package/uv UV_CONSTRAINT=$(CURDIR)/constraints.txt \
	PIPX_HOME=$(CURDIR)/build/package/pipx PIP_CONSTRAINT=$(CURDIR)/constraints.txt
package: setup ## install the wheel with pip, uvx and pipx, run the examples' workflows
	rm -rf build/package && mkdir -p build/package/work
	$(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir build/package .
	$(PYTHON) -m venv build/package/venv
	$(call saying,3600,"installing the wheel") build/package/venv/bin/python $(PIP_INSTALL) build/package/*.whl
	cd build/package/work && $(PYTHON) $(CURDIR)/.ci/limited.py $@ 1800 ../venv/bin/python -m cranectl validate fixed-position slack-rope
	$(call saying,600,"installing uv and pipx") $(BIN)/python $(PIP_INSTALL) --group installers
	$(call limit,1800) $(INSTALLERS) $(BIN)/uvx --from build/package/*.whl cranectl list
	$(call limit,1800) $(INSTALLERS) $(BIN)/pipx run --spec build/package/*.whl cranectl list
	cp -r examples build/package/examples
	for example in build/package/examples/*; do PIP_CONSTRAINT=$(CURDIR)/constraints.txt $(PYTHON) .ci/limited.py $@ 3600 \
		$(BIN)/python .ci/workflow.py $$example --venv $$example.venv CRANECTL=$$(echo $(CURDIR)/build/package/*.whl) || exit; done

## Results
docs: .venv/site ## run the examples, and build the site of all pages into build/docs
	$(call saying,3600,"looking for EGL and a C compiler") tests/install
	$(call limit,3600) $(BIN)/python docs/build.py

TABLE ?= build/literature
JUDGED := validation/benchmark/literature.parquet
NMPC = --controller $(TABLE)/nmpc.so --tuned $(TABLE)/tuned
judge: .venv/extras $(TABLE)/tuned/nmpc.toml ## tune and judge every controller of the benchmark; hours, goes on after a kill
	$(BIN)/python validation/proofs/freeze.py --compiled $(TABLE)/tuned
	for controllers in "" "$(NMPC)"; do \
		$(BIN)/cranectl benchmark run --out $(TABLE) $$controllers --set-of-cranes nominal --set-of-cranes lab-rig && \
		$(BIN)/cranectl benchmark run --out $(TABLE) $$controllers --division tuned || exit; done
	$(BIN)/cranectl benchmark report $(TABLE) $(NMPC) --out $(TABLE)/nmpc.html --table $(TABLE)/nmpc.parquet
	$(BIN)/cranectl benchmark report $(TABLE) --beside $(TABLE)/nmpc.parquet --table $(JUDGED)

$(TABLE)/tuned/nmpc.toml: $(TABLE)/nmpc.so | .venv/extras # the compiled controller has a digest of its own
	$(BIN)/cranectl tune $< --out $(@D)

$(TABLE)/nmpc.so: $(addprefix validation/benchmark/nmpc/,nmpc.c model.c) cranectl/loaders/cranectl.h
	@mkdir -p $(@D)
	cc -O2 -shared -fPIC -ffp-contract=off -Icranectl/loaders -o $@ $(filter %.c,$^) -lm

restamp: .venv/extras $(TABLE)/nmpc.so ## compare judged rows, then write new digests, and all rows of JUDGE="lqr pid"
	$(BIN)/python validation/proofs/restamp.py --controller $(TABLE)/nmpc.so $(JUDGE:%=--judge %)
