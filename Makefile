# `make help` lists the targets.  CMake builds the program; `cairn compile` makes the maps.

PRESET ?= release
CAIRN := build/$(PRESET)/cairn
# Real captures for development, beside the repository; where they are absent, targets that need them print one line.
DATA ?= ../shared/data
PREFIX ?= /usr/local

# Debian 12 packages, by what needs them.  What the program is compiled with:
LIBRARIES := libopencv-dev libceres-dev libeigen3-dev libsqlite3-dev libsqlitecpp-dev libcli11-dev libtomlplusplus-dev \
    libavformat-dev libavcodec-dev libavutil-dev libswscale-dev \
    nlohmann-json3-dev libyaml-cpp-dev libspdlog-dev libfmt-dev libxxhash-dev libexif-dev libsodium-dev libzstd-dev \
    liblz4-dev libbz2-dev zlib1g-dev libzip-dev \
    libglpk-dev libgeos++-dev
# Python's module:
PACKAGES_PYTHON := pybind11-dev python3 python3-dev python3-numpy
# Tests in C++:
LIBRARIES_TEST := libgtest-dev libgmock-dev libbenchmark-dev libjpeg-dev
# The program:
PACKAGES := build-essential cmake ninja-build ccache pkg-config $(LIBRARIES) libjs-leaflet libjs-chart.js jq
# Captures without poses, Python's module, ROS's node:
PACKAGES_MORE := colmap $(PACKAGES_PYTHON) \
    libroscpp-dev libsensor-msgs-dev libgeometry-msgs-dev libdiagnostic-msgs-dev libnav-msgs-dev
# Tests and benchmarks: films, a browser for reports, a cluster, a running ROS, tools for Debian packages, tools for the style.
PACKAGES_TEST := $(PACKAGES_MORE) $(LIBRARIES_TEST) sqlite3 ffmpeg \
    python3-fusepy slurmctld slurmd slurm-client munge procps time man-db chromium chromium-driver python3-selenium \
    rosout python3-roslaunch python3-rosmaster python3-rospy python3-sensor-msgs python3-geometry-msgs python3-diagnostic-msgs \
    python3-rosbag python3-nav-msgs python3-tf2-msgs \
    debhelper dh-python lintian debootstrap gnupg clang libclang-rt-14-dev clang-format clang-tidy
# Another architecture: its compiler, an emulator, and what fetches its packages.
PACKAGES_CROSS := g++-aarch64-linux-gnu qemu-user-static mmdebstrap fakechroot
# Optional: the demo's picture as PNG; for tests of the kernels of other processors, an emulation of Intel's instructions and
# what 64-bit ARM needs.
PACKAGES_OPTIONAL := librsvg2-bin libsimde-dev $(PACKAGES_CROSS)
# Of another architecture, in a folder of their own: the C library and what is compiled with it.
PACKAGES_SYSROOT := libc6-dev $(LIBRARIES) $(PACKAGES_PYTHON) $(LIBRARIES_TEST)

SOURCES = $(shell git ls-files --cached --others --exclude-standard '*.h' '*.cc' '*.c' | sort -u | xargs ls 2>/dev/null)

.DEFAULT_GOAL := all
.PHONY: all help program whole deps deps-all demo tables test test-arm64 mutation bench reproduce maps compile install deb release sysroot sysroot-packages format format-check tidy docs clean
# Targets run one after the other, whatever MAKEFLAGS says; the steps inside them run in parallel.
.NOTPARALLEL:

all: program  ## Build the program: build/release/cairn

# ON: tests, Python's module and ROS's node too, which need more packages than the program.
parts = -DCAIRN_BUILD_TESTS=$(1) -DCAIRN_BUILD_PYTHON=$(1) -DCAIRN_BUILD_ROS=$(1)

program: deps build/$(PRESET)/build.ninja
	@cmake --build build/$(PRESET) --parallel $(shell nproc) --target cairn

whole: NEW_PARTS := ON
whole: deps-all build/$(PRESET)/build.ninja
	@grep -q CAIRN_BUILD_TESTS:BOOL=ON build/$(PRESET)/CMakeCache.txt || cmake --preset $(PRESET) $(call parts,ON)
	@cmake --build build/$(PRESET) --parallel $(shell nproc)

# A new build folder has the parts that are asked for; one that is there keeps those that it has.
NEW_PARTS := OFF
build/$(PRESET)/build.ninja: CMakePresets.json
	@cmake --preset $(PRESET) $(if $(wildcard build/$(PRESET)/CMakeCache.txt),,$(call parts,$(NEW_PARTS)))
	@touch $@

help:  ## List the verbs
	@awk -F ':.*##' '/^[a-z-]+:.*##/ {printf "make %-14s%s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

deps:  ## Install the Debian packages that the program needs and that are missing (sudo only if needed)
	@scripts/install_packages $(PACKAGES)

deps-all:  ## Install those for tests, benchmarks, packages, Python and ROS, too
	@scripts/install_packages $(PACKAGES) $(PACKAGES_TEST) -- $(PACKAGES_OPTIONAL)

demo: program  ## Render a survey, compile its map, ask where held-out images were taken, draw the floor, write the report
	@CAIRN=$(CAIRN) scripts/demo

tables: program  ## Localize held-out images and images of other places in three maps of the demo and of the kitchen
	@CAIRN=$(CAIRN) DATA=$(DATA) scripts/tables

test: whole  ## Build all and run all tests
	@ctest --preset $(PRESET) --parallel $(shell nproc)

test-arm64: whole  ## Build packages and tests for 64-bit ARM, and run them in an emulator
	@CAIRN_ARM64=1 ctest --test-dir build/$(PRESET) --tests-regex '^Arm64' --output-on-failure

# Changes to try, and what draws them.
NUM ?= 100
SEED ?= 0
mutation: whole  ## Change sources of ROOM=core/seal one operator at a time: which changes does no test notice? NUM=100 SEED=0
	@/usr/bin/python3 -B tests/mutation/mutation.py build/$(PRESET) $(ROOM) --num $(NUM) --seed $(SEED)

bench: whole  ## Build and run the benchmarks
	@cmake --preset $(PRESET) -DCAIRN_BUILD_BENCHMARKS=ON
	@cmake --build build/$(PRESET)
	@scripts/run_benchmarks build/$(PRESET)

# Worlds of each setting (the source: 300).
WORLDS ?= 300
reproduce: deps-all build/$(PRESET)/build.ninja  ## Write the tables and figures of Sala06 beside the source's to build/reproduce; WORLDS=N [300]
	@cmake --preset $(PRESET) -DCAIRN_BUILD_BENCHMARKS=ON
	@cmake --build build/$(PRESET) --target cairn regions_tables survey_areas visual_map_tables
	@bench/reproduce.py build/$(PRESET) build/reproduce --worlds $(WORLDS)

maps: program  ## Compile every recipe under maps/ whose capture is here
	@CAIRN=$(CAIRN) scripts/compile_maps maps

compile: program  ## Compile MAP=RECIPE.toml or MAP=maps/NAME; in SHARDS=N parts, on a cluster with LAUNCH='srun -n1 -c2'
	@$(if $(MAP),,$(error which map? make compile MAP=maps/demo, or MAP=RECIPE.toml))
	@$(CAIRN) compile $(if $(filter %.toml,$(MAP)),$(MAP),$(MAP)/recipe.toml) -o $(MAP:.toml=).cairn \
	    $(addprefix --shards ,$(SHARDS)) $(addprefix --shard-images ,$(SHARD_IMAGES)) $(if $(LAUNCH),--launch '$(LAUNCH)')

install: whole  ## Install program, library, headers, Python module and manual under PREFIX [/usr/local], in DESTDIR
	@cmake --install build/$(PRESET) --prefix $(PREFIX)

deb: deps-all  ## Build the Debian packages into build/deb; those for another machine with ARCH=arm64
	@scripts/build_packages build/deb $(ARCH)

release: deps-all  ## Make a release of the commit in build/dist: source, packages, apt folder; VERSION=X.Y.Z KEY=GPG_KEY MAINTAINER='NAME <MAIL>' ARCHES=arm64
	@KEY='$(KEY)' MAINTAINER='$(MAINTAINER)' ARCHES='$(ARCHES)' scripts/make_release build/dist $(VERSION)

sysroot:  ## Unpack Debian's libraries for arm64 into build/sysroot/arm64, for cmake/arm64.cmake
	@scripts/make_sysroot arm64 build/sysroot/arm64 $(PACKAGES_SYSROOT)

sysroot-packages:
	@echo $(PACKAGES_SYSROOT)

format: deps-all  ## Format all sources in place
	@clang-format -i $(SOURCES)

format-check: deps-all  ## Fail if a source is not formatted
	@clang-format --dry-run --Werror $(SOURCES) && echo "all sources are formatted"

tidy: whole  ## Run clang-tidy over all sources
	@run-clang-tidy -quiet -p build/$(PRESET) '$(CURDIR)/(core|runtime|sim|stages|pipeline)/.*\.cc' | grep -v '^clang-tidy-'

docs: program  ## Write docs/recipe.md from the options that the stages declare
	@$(CAIRN) manual -o build/manual && cp build/manual/recipe.md docs/recipe.md

clean:  ## Remove everything that was built, maps included
	@rm -rf build maps/*.cairn maps/*.build maps/*.report.json maps/*.pareto.csv maps/*.svg maps/*.png
