# make demo   sets up what running needs, then renders out/demo.mp4
# make test   sets everything up, then runs the tests
# make test-mujoco  runs the tests of the coupling with each version of MuJoCo that is supported
# make check-bounds  runs the tests of the solver with every index in a kernel checked
# make test-drivers  runs the tests of OpenGL on each driver that needs no GPU, and a validator over all shaders
# make fuzz   10,000 strange inputs for each of the tests in tests/fuzz
# make lint   ruff, mypy and the layers of packages
# make docs   the documentation, into build/docs
# make sphere-maps  writes the sphere maps of the shipped scenes again, after a change of a mesh or of the mapping
# make package  builds the distributions and tries them on every Python that is here
# make clean  removes what was built and rendered, but not .venv and .venv-mujoco

BIN := .venv/bin
RUNNING := .venv/.running
ALL := .venv/.installed
TYPES := build/types
MUJOCOS := mujoco==3.16.0 mujoco==3.17.0 mujoco-core==4.0.1

.PHONY: setup demo test test-mujoco check-bounds test-drivers fuzz lint docs package sphere-maps types clean

# what running needs; the targets for which that is too little set up the rest
setup: $(RUNNING)

$(RUNNING): requirements.txt pyproject.toml .ci/setup .ci/egl.py
	.ci/setup requirements.txt
	@touch $@

$(ALL): requirements.txt requirements-dev.txt pyproject.toml .ci/setup .ci/egl.py
	.ci/setup requirements-dev.txt
	@touch $(RUNNING) $@

demo: setup
	$(BIN)/ripple-sim render duck -o out/demo.mp4

# two processes, each with OpenGL and kernels of its own: as many as the smallest machine has cores, which threads of BLAS
# would only fight for; compiled modules are kept even where the environment says not to, since each of a hundred
# commands would compile them again
test: $(ALL)
	OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 2 --dist worksteal

# each version is alone in a folder, which Python searches before .venv; all else is that of .venv
test-mujoco: $(ALL)
	for package in $(MUJOCOS); do \
	    folder=.venv-mujoco/$$package; \
	    [ -d $$folder ] || { $(BIN)/pip install -q --no-deps --target $$folder.new $$package && mv $$folder.new $$folder; } || exit 1; \
	    echo $$package; \
	    PYTHONPATH=$$folder OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 2 --dist worksteal -q \
	        tests/coupling || exit 1; \
	done

# in an empty folder of their own, since compiled kernels are loaded from there; an index out of bounds is an IndexError
check-bounds: $(ALL)
	rm -rf build/bounds
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(CURDIR)/build/bounds OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= \
	    $(BIN)/python -m pytest -n 2 --dist worksteal tests/solver

# what draws and what solves in OpenGL, on each driver that needs no GPU: Mesa's llvmpipe, the same as OpenGL 4.1, and zink
# over Vulkan; every text of a shader also goes through Khronos's validator (packages mesa-vulkan-drivers, glslang-tools)
DRIVEN := $(BIN)/python -m pytest -n 2 --dist worksteal -q tests/solver/backends tests/render
test-drivers: $(ALL)
	rm -rf build/shaders
	PYTHONPATH=tests/support RIPPLE_SIM_SHADER_TEXTS=$(CURDIR)/build/shaders OPENBLAS_NUM_THREADS=1 $(DRIVEN) -p shader_texts
	for text in build/shaders/*; do glslangValidator $$text || exit 1; done
	MESA_GL_VERSION_OVERRIDE=4.1 MESA_GLSL_VERSION_OVERRIDE=410 OPENBLAS_NUM_THREADS=1 $(DRIVEN)
	GALLIUM_DRIVER=zink LIBGL_ALWAYS_SOFTWARE=1 OPENBLAS_NUM_THREADS=1 $(DRIVEN)

# much more of tests/fuzz, by chance; what it finds is kept in .hypothesis, and tried first the next time
fuzz: $(ALL)
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

sphere-maps: setup
	$(BIN)/python .ci/sphere_maps.py

clean:
	rm -rf build dist out .mypy_cache .pytest_cache .ruff_cache
