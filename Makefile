# make demo   sets up what running needs, then renders out/demo.mp4
# make test   sets everything up, then runs the tests
# make fuzz   10,000 strange inputs for each of the tests in tests/fuzz
# make lint   ruff, mypy and the layers of packages
# make docs   the documentation, into build/docs
# make sphere-maps  writes the sphere maps of the shipped scenes again, after a change of a mesh or of the mapping
# make package  builds the distributions and tries them on every Python that is here
# make clean  removes what was built and rendered, but not .venv

BIN := .venv/bin
RUNNING := .venv/.running
ALL := .venv/.installed
KERNELS := solver/__pycache__/.kernels
TYPES := build/types

.PHONY: setup demo test fuzz lint docs package sphere-maps types clean

# what running needs; the targets for which that is too little set up the rest
setup: $(RUNNING)

$(RUNNING): requirements.txt pyproject.toml .ci/setup .ci/egl.py
	.ci/setup requirements.txt
	@touch $@

$(ALL): requirements.txt requirements-dev.txt pyproject.toml .ci/setup .ci/egl.py
	.ci/setup requirements-dev.txt
	@touch $(RUNNING) $@

# numba notices a changed kernel only by its own file, not by the files of the kernels that it calls.
$(KERNELS): $(shell find solver ripple_sim/coupling -name "*.py")
	@find solver ripple_sim -name '*.nb[ic]' -delete
	@mkdir -p $(@D) && touch $@

demo: setup $(KERNELS)
	$(BIN)/ripple-sim render duck -o out/demo.mp4

# two processes, each with OpenGL and kernels of its own: as many as the smallest machine has cores, which threads of BLAS
# would only fight for; compiled modules are kept even where the environment says not to, since each of a hundred
# commands would compile them again
test: $(ALL) $(KERNELS)
	OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 2 --dist worksteal

# much more of tests/fuzz, by chance; what it finds is kept in .hypothesis, and tried first the next time
fuzz: $(ALL) $(KERNELS)
	RIPPLE_SIM_FUZZ=10000 $(BIN)/python -m pytest tests/fuzz -n 2

# mypy and the documentation know nothing of setuptools' package-dir, so they are shown the package as it is installed,
# made of links.
types:
	@rm -rf $(TYPES) && mkdir -p $(TYPES)/ripple_sim
	@ln -s $(addprefix $(CURDIR)/,$(wildcard ripple_sim/*) solver scenes) $(TYPES)/ripple_sim

lint: $(ALL) types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	MYPYPATH=$(TYPES) $(BIN)/mypy -p ripple_sim
	cd $(TYPES) && $(CURDIR)/$(BIN)/lint-imports --config $(CURDIR)/pyproject.toml --no-cache

docs: $(ALL) types
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet --site-dir build/docs

package: $(ALL)
	.ci/package

sphere-maps: setup $(KERNELS)
	$(BIN)/python .ci/sphere_maps.py

clean:
	rm -rf build dist out .mypy_cache .pytest_cache .ruff_cache
