# The front door.  `make help` lists the verbs; the build itself is CMake's, the maps are `cairn compile`'s.

PRESET ?= release
CAIRN := build/$(PRESET)/cairn
# Real captures for development, beside the repository; what needs them says so in one line where they are absent.
DATA ?= ../shared/data
PREFIX ?= /usr/local

# Debian 12 packages: what the build needs, what the tests and benchmarks run beside it (a browser for reports, ROS for its node, what
# builds and checks Debian packages), what checks the style.
PACKAGES := build-essential cmake ninja-build ccache pkg-config \
    libopencv-dev libceres-dev libeigen3-dev libsqlite3-dev libsqlitecpp-dev libcli11-dev libtomlplusplus-dev \
    nlohmann-json3-dev libyaml-cpp-dev libspdlog-dev libfmt-dev libxxhash-dev libexif-dev libjpeg-dev libsodium-dev libzstd-dev \
    coinor-libcbc-dev libgeos++-dev libgtest-dev libgmock-dev libbenchmark-dev sqlite3 colmap slurmctld slurmd slurm-client munge procps jq \
    libjs-leaflet libjs-chart.js chromium chromium-driver python3-selenium \
    pybind11-dev python3-dev python3-numpy debhelper dh-python lintian debootstrap \
    libroscpp-dev libsensor-msgs-dev libgeometry-msgs-dev libdiagnostic-msgs-dev rosout python3-roslaunch python3-rosmaster \
    python3-rospy python3-sensor-msgs python3-geometry-msgs python3-diagnostic-msgs \
    python3 time man-db clang libclang-rt-14-dev clang-format clang-tidy
# Nothing fails without these.  The demo's picture as PNG; tests of the matching kernels of other processors: Intel's
# instructions emulated, an ARM compiler and emulator.
OPTIONAL_PACKAGES := librsvg2-bin libsimde-dev g++-aarch64-linux-gnu qemu-user-static

# A clone elsewhere compiles the same files: let ccache see that.
export CCACHE_BASEDIR := $(CURDIR)
export CCACHE_NOHASHDIR := true

SOURCES = $(shell git ls-files '*.h' '*.cc' '*.c')

.DEFAULT_GOAL := all
.PHONY: all help deps demo test bench maps compile install deb format format-check tidy docs clean
# Verbs run one after the other, whatever MAKEFLAGS says; the steps inside of them run in parallel.
.NOTPARALLEL:

all: build/$(PRESET)/build.ninja  ## Build the release: build/release/cairn
	@cmake --build build/$(PRESET)

build/$(PRESET)/build.ninja: CMakePresets.json
	@cmake --preset $(PRESET)
	@touch $@

help:  ## List the verbs
	@awk -F ':.*##' '/^[a-z-]+:.*##/ {printf "make %-14s%s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

deps:  ## Install the Debian packages that are missing (sudo only if needed)
	@scripts/install_packages $(PACKAGES) -- $(OPTIONAL_PACKAGES)

demo: deps all  ## Render a survey, compile its map, localize held-out images, print the tables, draw the regions
	@CAIRN=$(CAIRN) DATA=$(DATA) scripts/demo

test: deps all  ## Build and run all tests
	@ctest --preset $(PRESET) --parallel $(shell nproc)

bench: deps  ## Build and run the benchmarks
	@cmake --preset $(PRESET) -DCAIRN_BUILD_BENCHMARKS=ON
	@cmake --build build/$(PRESET)
	@scripts/run_benchmarks build/$(PRESET)

maps: deps all  ## Compile every recipe under maps/ whose capture is here
	@CAIRN=$(CAIRN) scripts/compile_maps maps

compile: deps all  ## Compile MAP=RECIPE.toml or MAP=maps/NAME; in SHARDS=N parts, on a cluster with LAUNCH='srun -n1 -c2'
	@$(if $(MAP),,$(error which map? make compile MAP=maps/demo, or MAP=RECIPE.toml))
	@$(CAIRN) compile $(if $(filter %.toml,$(MAP)),$(MAP),$(MAP)/recipe.toml) -o $(MAP:.toml=).cairn \
	    $(addprefix --shards ,$(SHARDS)) $(if $(LAUNCH),--launch '$(LAUNCH)')

install: all  ## Install program, library, headers, Python module and manual under PREFIX [/usr/local], in DESTDIR
	@cmake --install build/$(PRESET) --prefix $(PREFIX)

deb: deps  ## Build the Debian packages into build/deb
	@scripts/build_packages build/deb

format: deps  ## Format all sources in place
	@clang-format -i $(SOURCES)

format-check: deps  ## Fail if a source is not formatted
	@clang-format --dry-run --Werror $(SOURCES) && echo "all sources are formatted"

tidy: deps build/$(PRESET)/build.ninja  ## Run clang-tidy over all sources
	@run-clang-tidy -quiet -p build/$(PRESET) '$(CURDIR)/(core|stages|pipeline|runtime)/.*\.cc' | grep -v '^clang-tidy-'

docs: all  ## Write docs/recipe.md from the options that the stages declare
	@$(CAIRN) recipe-reference > docs/recipe.md

clean:  ## Remove everything that was built, maps included
	@rm -rf build maps/*.cairn maps/*.build maps/*.report.json maps/*.pareto.csv maps/*.svg maps/*.png
