# Stillhook's chores. Everything runs in a private .venv beside this file: nothing is installed
# elsewhere, and the package names `models`, `synth` and `mpc` cannot meet anybody else's.

# Candidates for the interpreter, best first; name your own with `make demo PYTHON=/path/to/python`.
PYTHON ?= python3.11 python3 python3.12 python3.13
# Two workers: what the smallest machine that the tests run on can use.
PYTEST_ARGS ?= -n 2

# One BLAS thread a process: two workers with two threads each only get in each other's way.
export OPENBLAS_NUM_THREADS ?= 1

VENV := .venv
PY := $(VENV)/bin/python
PIP_INSTALL := $(PY) -m pip install --quiet --disable-pip-version-check -c constraints.txt

# Each writes its rows, then its pages and figures; those that only draw come after.
STUDIES := $(addprefix docs/make/,$(addsuffix .py,headline headline_page landing saturation \
    random_starts robust structures validation comparison structures_page said_structures said_mpc \
    operability_figures windows_figures hook_motion sea_figures)) \
    benchmarks/sweep.py

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help demo bem waves cluster zarr report page export test test-page test-ci test-all pythons lint bench docs studies holds clean

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | awk -F'\t' '{printf "make %-9s %s\n", $$1, $$2}'

demo: $(VENV)/.installed  ## install, then find the gains of the bundled subsea crane
	$(VENV)/bin/stillhook optimise subsea-crane --out out/subsea-crane

bem: $(VENV)/.installed-bem  ## the extra for vessels from their hulls

waves: $(VENV)/.installed-waves  ## the extra for measured and hindcast spectra

cluster: $(VENV)/.installed-cluster  ## the extra for sweeps on a cluster

zarr: $(VENV)/.installed-zarr  ## the extra for results as Zarr

report: $(VENV)/.installed-report  ## the extra for reports as PDF

page: $(VENV)/.installed-page  ## the extra for the design page in the browser

export: $(VENV)/.installed-export  ## the extra for FMUs

test: $(VENV)/.installed-dev  ## the tests of every change, within 6 minutes on two cores
	$(PY) -m pytest $(PYTEST_ARGS)

test-ci: $(VENV)/.installed-dev test-page  ## notebooks, pages, whole studies: what CI runs after those
	$(PY) -m pytest -m "ci and not slow and not page" $(PYTEST_ARGS)

# One after the other: what is timed and what moves shall not wait for a neighbour.
test-page: $(VENV)/.installed-dev $(VENV)/.installed-test-page  ## the design page, driven in chromium
	@command -v chromium >/dev/null || [ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null || \
	    { apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium; }
	$(PY) -m pytest -m page tests/stillhook/page

test-all: $(VENV)/.installed-dev  ## all tests
	$(PY) -m pytest -m "(slow or not slow) and not page" $(PYTEST_ARGS)

# A Python is left out where its packages cannot be had; `.venv-3.X` stays.
pythons: $(VENV)/.installed-dev  ## the same numbers on every later Python that is found
	@for version in 3.12 3.13 3.14; do \
	    for python in python$$version $${PYENV_ROOT:-$$HOME/.pyenv}/versions/$$version.*/bin/python; do \
	        if "$$python" -c 'import ensurepip, venv' 2>/dev/null; then \
	            echo "Python $$version: $$python"; \
	            "$$python" -m venv $(VENV)-$$version && $(VENV)-$$version/bin/python -m pip install \
	                --quiet --disable-pip-version-check -c constraints.txt -e . \
	                || rm -rf $(VENV)-$$version; \
	            break; \
	        fi; \
	    done; \
	done
	$(PY) -m pytest -m ci -k another_python tests/stillhook/commands/test_same_numbers.py

lint: $(VENV)/.installed-dev  ## ruff, mypy --strict and the import contract
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy --strict
	$(VENV)/bin/lint-imports

bench: $(VENV)/.installed-dev  ## how good and how fast the gain synthesis and the simulation are
	$(PY) benchmarks/synthesis.py
	$(PY) benchmarks/simulation.py

studies: $(VENV)/.installed-dev  ## the stored studies of the docs anew; takes hours
	@for script in $(STUDIES); do echo "== $$script"; $(PY) $$script || exit 1; done

holds: $(VENV)/.installed-dev  ## simulate what is called ok, for 3 h each; takes hours, and goes on where it stopped
	$(PY) docs/make/holds.py
	$(PY) docs/make/holds_page.py

docs: $(VENV)/.installed-docs  ## the documentation, into docs/_build/html
	$(PY) docs/make/notebook_pages.py
	$(PY) -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

clean:  ## remove what was built or measured; .venv stays
	rm -rf out dist build docs/_build docs/api
	rm -rf .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find stillhook models synth mpc tests benchmarks docs -type d -name __pycache__ -exec rm -rf {} +

# One stamp for each set of packages. A stamp is renewed when the requirements change, and on
# its first use in a .venv that was made by other means.
$(VENV)/.installed: pyproject.toml constraints.txt | $(PY)
	$(call install,.)
	@touch $@

$(VENV)/.installed-%: pyproject.toml constraints.txt | $(PY)
	$(call install,.[$*])
	@touch $(VENV)/.installed $@

define install
@$(PY) -c "import sys; v = sys.version_info; sys.exit(None if v >= (3, 11) else \
	f'Stillhook needs Python 3.11 or later, and $(VENV) holds {v.major}.{v.minor}: remove $(VENV) and try again.')"
@echo "Installing stillhook from $(1) into $(VENV); the first time this takes a minute or two."
@$(PIP_INSTALL) -e '$(1)'
endef

$(PY):
	@for python in $(PYTHON); do \
	    if "$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	        if "$$python" -c 'import ensurepip, venv' 2>/dev/null; then \
	            exec "$$python" -m venv $(VENV); \
	        fi; \
	        echo "$$python cannot make virtual environments: install its venv module" \
	             "(on Debian and Ubuntu: apt install python3-venv) and try again." >&2; \
	        exit 1; \
	    fi; \
	done; \
	echo "Stillhook needs Python 3.11 or later, and none of these is that: $(PYTHON)." \
	     "Name one with: make PYTHON=/path/to/python" >&2; \
	exit 1
