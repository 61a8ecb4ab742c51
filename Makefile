# The front door.  `make help` lists the verbs; the build itself is CMake's, the maps are `cairn compile`'s.

PRESET ?= release
CAIRN := build/$(PRESET)/cairn
# Real captures for development, beside the repository; what needs them says so in one line where they are absent.
DATA ?= ../shared/data
PREFIX ?= /usr/local

# Debian 12 packages, by who needs them.  The program:
PACKAGES := build-essential cmake ninja-build ccache pkg-config \
    libopencv-dev libceres-dev libeigen3-dev libsqlite3-dev libsqlitecpp-dev libcli11-dev libtomlplusplus-dev \
    nlohmann-json3-dev libyaml-cpp-dev libspdlog-dev libfmt-dev libxxhash-dev libexif-dev libsodium-dev libzstd-dev \
    coinor-libcbc-dev libgeos++-dev libjs-leaflet libjs-chart.js jq
# Captures without poses, Python's module, ROS's node:
PACKAGES_MORE := colmap pybind11-dev python3 python3-dev python3-numpy \
    libroscpp-dev libsensor-msgs-dev libgeometry-msgs-dev libdiagnostic-msgs-dev
# Tests and benchmarks: a browser for reports, a cluster, ROS at work, what builds and checks Debian packages, what checks the style.
PACKAGES_TEST := $(PACKAGES_MORE) libgtest-dev libgmock-dev libbenchmark-dev libjpeg-dev sqlite3 \
    slurmctld slurmd slurm-client munge procps time man-db chromium chromium-driver python3-selenium \
    rosout python3-roslaunch python3-rosmaster python3-rospy python3-sensor-msgs python3-geometry-msgs python3-diagnostic-msgs \
    debhelper dh-python lintian debootstrap clang libclang-rt-14-dev clang-format clang-tidy
# Nothing fails without these.  The demo's picture as PNG; tests of the matching kernels of other processors: Intel's
# instructions emulated, an ARM compiler and emulator.
PACKAGES_OPTIONAL := librsvg2-bin libsimde-dev g++-aarch64-linux-gnu qemu-user-static

SOURCES = $(shell git ls-files '*.h' '*.cc' '*.c')

.DEFAULT_GOAL := all
.PHONY: all help program whole deps deps-all demo tables test bench maps compile install deb format format-check tidy docs clean
# Verbs run one after the other, whatever MAKEFLAGS says; the steps inside of them run in parallel.
.NOTPARALLEL:

all: program  ## Build the program: build/release/cairn

# A build folder that is there is left as it is configured: whoever has tests keeps them.
program: deps
	@test -f build/$(PRESET)/build.ninja || cmake --preset $(PRESET) -DCAIRN_BUILD_TESTS=OFF -DCAIRN_BUILD_PYTHON=OFF -DCAIRN_BUILD_ROS=OFF
	@cmake --build build/$(PRESET) --target cairn

whole: deps-all
	@grep -qs CAIRN_BUILD_TESTS:BOOL=ON build/$(PRESET)/CMakeCache.txt || \
	    cmake --preset $(PRESET) -DCAIRN_BUILD_TESTS=ON -DCAIRN_BUILD_PYTHON=ON -DCAIRN_BUILD_ROS=ON
	@cmake --build build/$(PRESET)

help:  ## List the verbs
	@awk -F ':.*##' '/^[a-z-]+:.*##/ {printf "make %-14s%s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

deps:  ## Install the Debian packages that the program needs and that are missing (sudo only if needed)
	@scripts/install_packages $(PACKAGES)

deps-all:  ## Those of tests, benchmarks, packages, Python and ROS besides
	@scripts/install_packages $(PACKAGES) $(PACKAGES_TEST) -- $(PACKAGES_OPTIONAL)

demo: program  ## Render a survey, compile its map, ask where held-out images were taken, draw the floor, write the report
	@CAIRN=$(CAIRN) scripts/demo

tables: program  ## The tables of the README: the demo's maps and the kitchen's, images of other places
	@CAIRN=$(CAIRN) DATA=$(DATA) scripts/tables

test: whole  ## Build all and run all tests
	@ctest --preset $(PRESET) --parallel $(shell nproc)

bench: whole  ## Build and run the benchmarks
	@cmake --preset $(PRESET) -DCAIRN_BUILD_BENCHMARKS=ON
	@cmake --build build/$(PRESET)
	@scripts/run_benchmarks build/$(PRESET)

maps: program  ## Compile every recipe under maps/ whose capture is here
	@CAIRN=$(CAIRN) scripts/compile_maps maps

compile: program  ## Compile MAP=RECIPE.toml or MAP=maps/NAME; in SHARDS=N parts, on a cluster with LAUNCH='srun -n1 -c2'
	@$(if $(MAP),,$(error which map? make compile MAP=maps/demo, or MAP=RECIPE.toml))
	@$(CAIRN) compile $(if $(filter %.toml,$(MAP)),$(MAP),$(MAP)/recipe.toml) -o $(MAP:.toml=).cairn \
	    $(addprefix --shards ,$(SHARDS)) $(if $(LAUNCH),--launch '$(LAUNCH)')

install: whole  ## Install program, library, headers, Python module and manual under PREFIX [/usr/local], in DESTDIR
	@cmake --install build/$(PRESET) --prefix $(PREFIX)

deb: deps-all  ## Build the Debian packages into build/deb
	@scripts/build_packages build/deb

format: deps-all  ## Format all sources in place
	@clang-format -i $(SOURCES)

format-check: deps-all  ## Fail if a source is not formatted
	@clang-format --dry-run --Werror $(SOURCES) && echo "all sources are formatted"

tidy: whole  ## Run clang-tidy over all sources
	@run-clang-tidy -quiet -p build/$(PRESET) '$(CURDIR)/(core|runtime|sim|stages|pipeline)/.*\.cc' | grep -v '^clang-tidy-'

docs: program  ## Write docs/recipe.md from the options that the stages declare
	@$(CAIRN) recipe-reference > docs/recipe.md

clean:  ## Remove everything that was built, maps included
	@rm -rf build maps/*.cairn maps/*.build maps/*.report.json maps/*.pareto.csv maps/*.svg maps/*.png
