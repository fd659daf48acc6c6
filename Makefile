# make demo   transfer a bundled recording to the Panda
# make test   all tests
# make coverage   all tests with coverage of lines and branches, except for drawing code (about ten minutes)
# make fuzz   read 10 000 mutated files of every format in separate processes (about half an hour)
# make kills  stop commands that write results at 1200 random times, by SIGKILL and Ctrl-C (about half an hour)
# make mutants   change spd and transfer in one place at a time, and list changes that no test detects (mutmut)
# make nightly   5000 configurations of each arm of example-robot-data on exact meshes; then fuzz, kills and mutants
# make others  datasets, bags and the teleoperator in the libraries of others, in an environment of their own (8 GB)
# make docs   the site in build/docs, with all examples; warnings of Sphinx are errors (about three minutes)
# make links  check external links of the documentation; needs the network
# make dist   wheel and sdist in dist/, each checked, installed and run outside of the checkout
# make lint   style, types, import contracts, spelling and the measure of readability
# make bench  speed relative to other libraries; rewrites BENCHMARKS.md (about ten minutes)

# Another Python than the first one that is new enough: make demo PYTHON=/path/to/python3.11
PYTHON ?=
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test coverage fuzz kills mutants nightly others docs links dist lint bench clean

demo: $(VENV)/.compiled
	$(BIN)/maniport demo -o maniport-demo --overwrite

# One worker per core, each with one BLAS thread.
test: $(VENV)/.installed-test
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal

coverage: $(VENV)/.installed-test
	$(BIN)/coverage erase
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/coverage run -m pytest -n auto --dist worksteal
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

fuzz: $(VENV)/.installed-test
	PYTHONPATH=tests $(BIN)/python -m fuzz

kills: $(VENV)/.installed-test
	OMP_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/python -m kills

mutants: $(VENV)/.installed-mutation
	OMP_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/mutmut run $(MUTANTS)

nightly: $(VENV)/.installed-nightly
	MANIPORT_NIGHTLY=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n auto tests/arms/test_collision_coverage.py
	$(MAKE) fuzz kills mutants

# LeRobot has other versions of packages.
others:
	@sh scripts/create_environment.sh build/others $(PYTHON)
	build/others/bin/python -m pip install --quiet --extra-index-url https://download.pytorch.org/whl/cpu \
	    lerobot mcap-ros2-support pytest hypothesis '.[datasets,mcap]' ./plugins/lerobot_teleoperator_maniport
	OMP_NUM_THREADS=1 build/others/bin/python -m pytest tests/others/check_*.py plugins/lerobot_teleoperator_maniport/tests

docs: $(VENV)/.installed-docs
	mkdir -p build
	$(BIN)/maniport demo -o build/demo --overwrite --quiet
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -b html docs build/docs

# Without running the examples.
links: $(VENV)/.installed-docs
	$(BIN)/python -m sphinx --quiet -D plot_gallery=0 -D html_extra_path= -b linkcheck docs build/links

dist: $(VENV)/.installed-release
	rm -rf dist
	$(BIN)/python scripts/check_distribution.py dist

lint: $(VENV)/.installed-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell
	$(BIN)/python scripts/readability.py --check src/maniport

bench: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks

$(BIN)/pip:
	@sh scripts/create_environment.sh $(VENV) $(PYTHON)

$(VENV)/.installed: pyproject.toml | $(BIN)/pip
	$(BIN)/python -m pip install --quiet --editable .
	@$(BIN)/python -c 'import pinocchio' || { echo "maniport: if libgomp is missing: apt-get install libgomp1" >&2; exit 1; }
	@touch $@

$(VENV)/.compiled: $(VENV)/.installed
	$(BIN)/maniport compile --quiet
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	@touch $@

$(VENV)/.installed-nightly: $(VENV)/.installed-test
	$(BIN)/python -m pip install --quiet --editable '.[test,robots]'
	@touch $@

$(VENV)/.installed-lint: $(VENV)/.installed-test
	$(BIN)/python -m pip install --quiet --editable '.[test,lint]'
	@touch $@

$(VENV)/.installed-docs: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	@touch $@

$(VENV)/.installed-release: | $(BIN)/pip
	$(BIN)/python -m pip install --quiet build twine check-wheel-contents
	@touch $@

$(VENV)/.installed-mutation: $(VENV)/.installed-test
	$(BIN)/python -m pip install --quiet --editable '.[test,mutation]'
	@touch $@

$(VENV)/.installed-bench: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --editable '.[bench]'
	@touch $@

clean:
	rm -rf $(VENV) build maniport-demo .coverage .coverage.*
