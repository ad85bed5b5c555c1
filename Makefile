# Everything a fresh machine needs is Python >= 3.11, make and git.
PYTHON ?= python3
BIN := .venv/bin

PIP_INSTALL := -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

# What hangs is ended after so many seconds, ten times what two quiet cores need: LIMIT=7200 for others, LIMIT=0
# for none. What prints nothing for long says what it does, every ten seconds.
export LIMIT
limit = @$(PYTHON) .ci/limited.py $(or $(2),$@) $(1)
saying = @$(PYTHON) .ci/limited.py --say $(2) $(or $(3),$@) $(1)

.PHONY: benchmark judge restamp help setup cluster video fmi plan tune drake kernels validate test test-docs test-benchmark test-processors test-plan test-drake test-viewer lint drive fuzz bench mutations package clean
help: ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 14

setup: .venv/ready ## create .venv and install cranectl into it

.venv/ready: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "cranectl needs Python 3.11 or newer; choose one with make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 2; }
	$(call saying,600,"making .venv",setup) $(PYTHON) -m venv .venv
	$(call saying,3600,"installing cranectl and what it needs into .venv",setup) $(BIN)/python $(PIP_INSTALL) --editable '.[dev]'
	@touch $@

cluster: .venv/extra-cluster ## add what campaigns on several machines need (Dask)
video: .venv/extra-video ## add what renders videos (PyAV)
fmi: .venv/extra-fmi ## add what reads FMUs (FMPy)
plan: .venv/extra-plan ## add the solver that tests hold plans to (CasADi with IPOPT)
tune: .venv/extra-tune ## add what tunes laws (pycma)
drake: .venv/extra-drake ## add the plant in Drake, 270 MB

.venv/extra-%: .venv/ready
	$(call saying,3600,"installing the extra $*",$*) $(BIN)/python $(PIP_INSTALL) --editable '.[$*]'
	@touch $@

kernels: setup cluster video fmi ## compile and plan what tests need, before two processes do so at once; a minute, then seconds
	$(call saying,1800,"compiling kernels and planning motions") $(BIN)/python -m tests.kernels

validate: setup ## run every scenario with every controller on three plants and judge
	$(call limit,1800) $(BIN)/cranectl validate

test: setup cluster video fmi kernels ## run the tests, those of these three extras too
	$(call saying,3600,"looking for EGL and a C compiler") tests/install
	$(call limit,7200) $(BIN)/python -m pytest --ignore tests/docs --ignore tests/thesis --ignore tests/drake --ignore tests/planning \
		--ignore tests/benchmark --ignore tests/campaign/benchmark

test-benchmark: setup cluster tune ## hold the laws of the benchmark to what they claim, its page and its tuning to what they say; a minute
	$(call limit,3600) $(BIN)/python -m pytest tests/benchmark tests/campaign/benchmark --ignore tests/benchmark/test_nmpc_plans.py

PROCESSOR_TESTS = -m processor --ignore tests/docs --ignore tests/thesis --ignore tests/drake --ignore tests/live \
	--ignore tests/planning --ignore tests/benchmark/test_nmpc_plans.py
test-processors: setup cluster video fmi tune ## answers with the BLAS kernels of old processors, and with code compiled for any
	$(call limit,3600) env OPENBLAS_CORETYPE=Nehalem $(BIN)/python -m pytest $(PROCESSOR_TESTS)
	$(call limit,3600) env NUMBA_CPU_NAME=generic $(BIN)/python -m pytest $(PROCESSOR_TESTS)

test-docs: setup cluster video fmi tune ## run what README, docs and examples show, and hold the pages on thesis and mutants to what they say
	$(call saying,3600,"looking for EGL and a C compiler") tests/install
	$(call limit,3600) $(BIN)/python -m pytest tests/docs tests/thesis

test-plan: setup plan ## hold plans in minimum time to lower bounds, a second solver and fine samples, those of nmpc to the solver; minutes, PLAN_CASES=200 for a share
	$(call limit,5400) $(BIN)/python -m pytest tests/planning tests/benchmark/test_nmpc_plans.py

test-drake: setup drake ## hold the plant in Drake to the one in MuJoCo; minutes, DRAKE_CASES=12 takes as many of the cases
	$(call limit,14400) $(BIN)/python -m pytest tests/drake

test-viewer: setup ## open logs in a real viewer, read them with other parsers
	@viewer/install $(BIN)
	$(call limit,5400) $(BIN)/python -m pytest -n 0 viewer

lint: setup cluster video ## format, style, types, import directions
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(call limit,1200) $(BIN)/mypy
	$(BIN)/lint-imports --no-cache

benchmark: setup ## run every law of the benchmark on one crane of each plant: two minutes, for a page in build/
	rm -rf build/benchmark
	$(call limit,1800) $(BIN)/cranectl benchmark run --set-of-cranes nominal --scenario hoist-and-go --draws 1 --out build/benchmark
	$(call limit,600) $(BIN)/cranectl benchmark report build/benchmark

TABLE ?= build/literature
JUDGED := validation/benchmark/literature.parquet
NMPC = --controller $(TABLE)/nmpc.so --tuned $(TABLE)/tuned
judge: setup tune $(TABLE)/tuned/nmpc.toml ## judge every law, as published and tuned: hours, goes on after a kill; writes the table that is shipped, and its page
	for laws in "" "$(NMPC)"; do \
		$(BIN)/cranectl benchmark run --out $(TABLE) $$laws --set-of-cranes nominal --set-of-cranes lab-rig && \
		$(BIN)/cranectl benchmark run --out $(TABLE) $$laws --division tuned || exit; done
	$(BIN)/cranectl benchmark report $(TABLE) $(NMPC) --out $(TABLE)/nmpc.html --table $(TABLE)/nmpc.parquet
	$(BIN)/cranectl benchmark report $(TABLE) --beside $(TABLE)/nmpc.parquet --table $(JUDGED)
	$(BIN)/cranectl benchmark report $(JUDGED) --out docs/proofs/literature.html

$(TABLE)/tuned/nmpc.toml: $(TABLE)/nmpc.so | tune # the shipped numbers are of laws in Python: a compiler's work has its own digest
	$(BIN)/cranectl tune $< --out $(@D)

$(TABLE)/nmpc.so: $(addprefix validation/benchmark/nmpc/,nmpc.c model.c) cranectl/loaders/cranectl.h
	@mkdir -p $(@D)
	cc -O2 -shared -fPIC -ffp-contract=off -Icranectl/loaders -o $@ $(filter %.c,$^) -lm

restamp: setup tune $(TABLE)/nmpc.so ## after a change of names alone: run rows of the judged table again; if all are equal, write the new digests
	$(BIN)/python validation/restamp.py --controller $(TABLE)/nmpc.so

RUNS ?= 1000
drive: setup ## drive cranes by a random joystick, RUNS=1000 minutes; others with each commit
	$(call limit,43200) $(BIN)/python validation/random_joystick.py --runs $(RUNS)

MINUTES ?= 30
fuzz: setup fmi kernels ## try odd files, controllers, machines and command lines for MINUTES=30; what is found is kept in .hypothesis
	$(BIN)/python -m tests.fuzz --minutes $(MINUTES)

bench: .venv/extra-bench ## measure, and write docs/proofs/performance.md
	$(call limit,43200) $(BIN)/python validation/performance.py --json logs/bench.json --write docs/proofs/performance.md

mutations: .venv/extra-drake .venv/extra-plan ## change every term of the physics and of plans' limits and see a test fail; write docs/proofs/mutations.md
	$(call limit,43200) $(BIN)/python validation/mutations.py --write docs/proofs/mutations.md

package: setup ## build the wheel, install it into an empty environment, validate and test the example from there
	rm -rf build/package && mkdir -p build/package/work
	$(BIN)/python -m hatchling build -t wheel -d build/package
	$(PYTHON) -m venv build/package/venv
	$(call saying,3600,"installing the wheel") build/package/venv/bin/python $(PIP_INSTALL) build/package/*.whl
	cd build/package/work && $(PYTHON) $(CURDIR)/.ci/limited.py $@ 1800 ../venv/bin/cranectl validate fixed-position slack-rope
	cp -r examples/harbour-crane build/package/example
	cd build/package/example && PATH="$(CURDIR)/build/package/venv/bin:$$PATH" PIP_CONSTRAINT=$(CURDIR)/constraints.txt \
		$(PYTHON) $(CURDIR)/.ci/limited.py $@ 3600 sh -exc "$$(sed -n 's/^ *- run: //p' .github/workflows/test.yml)"

clean: ## remove the environment and everything generated
	rm -rf .venv viewer/node_modules viewer/failures logs build dist .mypy_cache .ruff_cache .pytest_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
