# `make run` and `make test` do all set-up; the rest is for working on the program.
PYTHON ?= python3
BIN := .venv/bin
NAME ?= reference
ARGS ?=

.DEFAULT_GOAL := help
.PHONY: help run test lint format bench wheel clean set-up-run set-up-test

help: ## Show these lines
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-8s %s\n", $$1, $$2}'

run: set-up-run ## Open the sample room (without a display: render it to a picture)
	@$(BIN)/lucarne demo $(ARGS)

test: lint ## All checks and all tests (ARGS="-k undo" for some)
	@QT_QPA_PLATFORM=$${QT_QPA_PLATFORM:-offscreen} $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal --durations 25 --durations-min 4 $(ARGS)

lint: set-up-test ## Style, types, and who may import whom
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

format: set-up-test ## Lay the sources out as the checks want them
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

bench: set-up-test ## Measure (NAME=reference ARGS=--quick)
	@$(BIN)/lucarne bench $(NAME) $(ARGS)

wheel: set-up-test ## Build dist/lucarne-*.whl
	@$(BIN)/python -m build --wheel --no-isolation

clean: ## Forget the environment and everything made
	rm -rf .venv build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

set-up-run:
	@$(PYTHON) tools/set_up.py run

set-up-test:
	@$(PYTHON) tools/set_up.py test
