# Every target sets up what it needs and starts in seconds when nothing changed.
# PYTHON=python3.12 chooses the interpreter, ARGS="..." goes to the tool that a target runs.

SHELL := /bin/bash
.DEFAULT_GOAL := help
ENTER := source ./env.sh &&
export PYTHON
unexport PYTHONDONTWRITEBYTECODE # else every start compiles what was edited since the set-up

.PHONY: help setup demo test docs lint fmt check reproduce replay fuzz build msgs lock clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z][a-z-]*:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' Makefile

setup:  ## .venv from locked requirements, messages and package built; nothing when current
	@scripts/set_up.sh

demo: setup  ## identify the wheels' momentum and track with it, on real nodes, into out/demo; ARGS='--robot FILE'
	@$(ENTER) spacerobot demo $(ARGS)

# glibc keeps the memory of freed arrays for the next ones: a tenth less time
test: export MALLOC_MMAP_THRESHOLD_ = 33554432
test: export MALLOC_TRIM_THRESHOLD_ = 268435456
test: setup  ## all tests, in two processes; ARGS='-n 0 -x test/setup' goes to pytest
	@$(ENTER) PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 python -m pytest -p xdist -n 2 --dist worksteal $(ARGS)

docs: setup  ## the documentation as a site, out/docs/site/index.html; strict
	@test .venv/docs/lock -nt requirements/docs.txt || { .venv/bin/python -m venv --clear --without-pip .venv/docs && \
		.venv/bin/uv pip sync -q --python .venv/docs/bin/python --require-hashes requirements/docs.txt && \
		touch .venv/docs/lock; }
	@$(ENTER) python scripts/make_docs.py
	@NO_MKDOCS_2_WARNING=1 .venv/docs/bin/mkdocs build -q -f out/docs/mkdocs.yml
	@rm -f out/docs/site/404.html # of servers alone: in a folder it finds nothing that it links to
	@echo out/docs/site/index.html

lint: setup  ## ruff, mypy, codespell
	@$(ENTER) ruff check . && ruff format --check . && mypy && codespell

fmt: setup  ## format the code and mend what ruff can
	@$(ENTER) ruff format . && ruff check --fix .

check: lint test  ## what CI runs

reproduce: setup  ## an experiment, campaign or benchmark; NAME=wheel-momentum, ARGS='--quick'; NAME=--help lists them
	@$(ENTER) OMP_NUM_THREADS=1 python -m validation $(or $(NAME),--help) $(ARGS)

replay: setup  ## what changed of the answers to 130 recordings, in words; QUICK=1: twenty of them; ARGS='arm-00' some
	@$(ENTER) python -m validation.replay $(if $(QUICK),--quick) $(ARGS)

fuzz: setup  ## readers against inputs guided by coverage; ARGS='robot_file -max_total_time=60'; needs atheris
	@$(ENTER) cd fuzz && PYTHONPATH=$(CURDIR):$$PYTHONPATH python fuzz.py $(ARGS)

build:  ## build messages and package again with colcon, changed or not
	@scripts/set_up.sh --rebuild

msgs: setup  ## build the messages if they changed, and show what they hold
	@for file in msg_defs/msg/*.msg; do echo "== $$file"; cat "$$file"; echo; done

lock:  ## regenerate the lock files from pyproject.toml
	@test -x .venv/bin/uv || scripts/set_up.sh
	@scripts/lock.sh

clean:  ## remove everything that the set-up, builds, tests and runs made
	rm -rf .venv build install log out .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
