# make demo   sets everything up, then renders out/demo.mp4
# make test   sets everything up, then runs the tests
# make lint   ruff and mypy
# make clean  removes what was built and rendered, but not .venv

BIN := .venv/bin
STAMP := .venv/.installed
TYPES := build/types

.PHONY: setup demo test lint clean

setup: $(STAMP)

$(STAMP): requirements.txt pyproject.toml .ci/setup .ci/egl.py
	.ci/setup
	@touch $@

demo: setup
	$(BIN)/ripple-sim render duck -o out/demo.mp4

test: setup
	$(BIN)/python -m pytest

# mypy knows nothing of setuptools' package-dir, so it is shown the package as it is installed, made of links.
lint: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	@rm -rf $(TYPES) && mkdir -p $(TYPES)/ripple_sim
	@ln -s $(addprefix $(CURDIR)/,$(wildcard ripple_sim/*) solver scenes) $(TYPES)/ripple_sim
	MYPYPATH=$(TYPES) $(BIN)/mypy -p ripple_sim

clean:
	rm -rf build dist out .mypy_cache .pytest_cache .ruff_cache
