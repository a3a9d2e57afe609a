# The two commands: `make run` simulates the study, `make test` checks everything. Each sets up .venv by itself.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
# All that is installed has its version in constraints.txt, pip and what builds the package too.
PIP := $(BIN)/python -m pip install --quiet --constraint constraints.txt --build-constraint constraints.txt
KERNELS := $(wildcard src/paraflex/kernel/*.py)

# Images often set it: every process would compile all of the package anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run test lint types imports tests coverage docs wheel clean

run: $(VENV)/.run
	$(BIN)/paraflex run raparm_i --out results

# Two at a time: checking types takes one core for a minute.
test:
	$(MAKE) --jobs 2 lint types imports docs tests

lint: $(VENV)/.dev
	$(BIN)/ruff format --check src tests benchmarks examples docs/hooks docs/notebooks hatch_build.py
	$(BIN)/ruff check src tests benchmarks examples docs/hooks docs/notebooks hatch_build.py

# The second looks at the installed package as those who import it do: every public name has a type.
types: $(VENV)/.dev
	$(BIN)/pyright
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/pyright --verifytypes paraflex --ignoreexternal >$(VENV)/.types \
		|| { cat $(VENV)/.types; exit 1; }

imports: $(VENV)/.dev
	$(BIN)/lint-imports

# One thread for small matrices, as commands have it: of several processes with several threads each waits for the others.
tests: $(VENV)/.dev $(VENV)/.kernels
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder

# Which lines no test reaches; a third slower, so not a part of the test.
coverage: $(VENV)/.dev $(VENV)/.kernels
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder --cov --cov-report=term

docs: $(VENV)/.dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --site-dir site

# Set-up is skipped while these stamps are newer than what they depend on.
$(VENV)/.run: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --upgrade pip
	$(PIP) --editable '.[edit]'
	touch $@

$(VENV)/.dev: $(VENV)/.run
	$(PIP) --editable '.[dev,all]'
	touch $@

$(VENV)/.kernels: $(VENV)/.run $(KERNELS)
	$(BIN)/python -m paraflex.compilation
	touch $@

# A wheel with compiled kernels, for this release of Python: what is installed with it starts without compiling.
wheel: $(VENV)/.dev
	rm -rf $(VENV)/wheel
	NUMBA_CACHE_DIR=$(VENV)/wheel $(BIN)/python -m paraflex.compilation
	PARAFLEX_KERNELS=$(VENV)/wheel $(BIN)/python -m build --no-isolation --wheel

clean:
	rm -rf $(VENV) site results .coverage .pytest_cache .ruff_cache
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +
