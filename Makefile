# Two commands do everything on a machine with Python 3.11, Rust, gcc and make:
#   make demo    sets up and runs the whole job on the bundled clip
#   make test    sets up and passes all tests
# Also: make docs, the site in build/site and the reference of the core.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := $(shell find crates python -name '*.rs' -o -name '*.py' -o -name '*.pyi') \
           Cargo.toml Cargo.lock pyproject.toml $(wildcard crates/*/Cargo.toml)
PYTHON_SOURCES := python tests benches scripts examples docs/conf.py docs/_extensions

.PHONY: demo test test-rust test-python lint docs site wheel clean

demo: $(VENV)/installed
	$(BIN)/unsmear demo -o unsmear_demo

test: test-rust test-python

test-rust:
	cargo test --workspace --locked --quiet

test-python: $(VENV)/developed
	$(BIN)/python -m pytest -q

lint: $(VENV)/developed
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --locked --quiet -- -D warnings
	$(BIN)/ruff format --check $(PYTHON_SOURCES)
	$(BIN)/ruff check $(PYTHON_SOURCES)
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest unsmear._unsmear

docs: site
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --quiet

# Runs the examples that have changed since the last time, all of them after a change of
# the package; a warning is an error.
site: $(VENV)/documented
	MPLBACKEND=Agg $(BIN)/python -m sphinx -b html -W --keep-going -q docs build/site

wheel: $(VENV)/tools
	$(BIN)/maturin build --release --locked --quiet --out dist

$(VENV)/tools:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check "maturin>=1.14,<2"
	touch $@

$(VENV)/installed: $(VENV)/tools $(SOURCES)
	$(BIN)/pip install --quiet --disable-pip-version-check .
	touch $@

# The editable build with everything the tests need; it takes the place of `installed`.
$(VENV)/developed: $(VENV)/tools $(SOURCES)
	$(BIN)/maturin develop --release --locked --quiet --extras dev
	touch $@ $(VENV)/installed

$(VENV)/documented: $(VENV)/developed
	$(BIN)/maturin develop --release --locked --quiet --extras dev,docs
	rm -rf docs/gallery build/site
	touch $@

clean:
	rm -rf $(VENV) target dist build docs/gallery unsmear_demo
