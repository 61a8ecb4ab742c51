# From a capture to a landmark map: one rule per file, GNU Make as the scheduler.
#
# `cairn compile` runs this file with BUILD and CAIRN set.  A project of many maps includes it once per map; each
# include needs BUILD, RECIPE and MAP, and a later one leaves the rules of the earlier ones alone:
#
#   CAIRN := /usr/bin/cairn
#   BUILD := kitchen.build
#   RECIPE := kitchen/recipe.toml
#   MAP := kitchen.cairn
#   include /usr/share/cairn/map.mk
#
# Every output X has a stamp X.stamp with the time at which its rule last began and then succeeded.  The rule's
# prerequisites are compared with the stamp: an input that changes during the run is seen by the next one.  What is
# downstream compares itself with X, whose date a run that gives the same bytes leaves alone: then nothing downstream
# runs.  Recipes only use variables that are set for the build folder of their target.
#
# Every rule that runs says first what changed.  `make -n` shows all that could run: what follows a stage runs only if
# that stage's result differs.

CAIRN ?= $(shell command -v cairn)
# Put before every command, for example a cluster's `srun`.
LAUNCH ?=
THREADS ?= 0
# Most memory for a stage, MiB; empty: most of the machine's.
MEMORY ?=
PROGRESS ?= auto
LOG_LEVEL ?= info

# What changed, of a rule's prerequisites: the first, and how many more.
CAIRN_CHANGED = $(patsubst $(@D)/%,%,$(patsubst $(CAPTURE)/%,%,$(filter-out cairn-missing,$?)))
CAIRN_REASON = $(if $(wildcard $@),$(if $(filter cairn-missing,$?),is missing,$(patsubst options/program,the \
    program,$(firstword $(CAIRN_CHANGED))) changed$(if $(word 2,$(CAIRN_CHANGED)),$(,) $(words $(wordlist \
    2,$(words $(CAIRN_CHANGED)),$(CAIRN_CHANGED))) more)),not made yet)
, := ,
CAIRN_RESULT = $(notdir $(if $(filter map.stamp,$(@F)),$(MAP),$(@:.stamp=)))
CAIRN_WHY = $(if $(filter none,$(PROGRESS)),,@echo '$(subst ','\'',$(if $(filter json,$(PROGRESS)),{"event": \
    "run"$(,) "file": "$(CAIRN_RESULT)"$(,) "reason": "$(subst ",\",$(subst \,\\,$(CAIRN_REASON)))"},$(CAIRN_RESULT): \
    $(CAIRN_REASON)))' >&2)

# Stages of one run of make share their build folders; another run is refused.
ifndef CAIRN_BUILD_SESSION
CAIRN_BUILD_SESSION := $(shell echo $$PPID@$$(uname -n))
endif
export CAIRN_BUILD_SESSION

ifdef RECIPE
# The first target: what `make` without one makes.
$(MAP):
CAIRN_MAP := $(MAP)
# Once per make: a recipe dated in the future would have it start over for ever.
$(BUILD)/config.mk: CONFIGURE := $(RECIPE) -o $(MAP) --build-dir $(BUILD)
$(BUILD)/config.mk: $(if $(MAKE_RESTARTS),,$(RECIPE) $(CAIRN))
	$(CAIRN) configure $(CONFIGURE)
	touch $@
endif

# Sets MAP, CAPTURE, SIMULATED, RECONSTRUCTED, KNOWN_PLACES, QUERIES, NAME, SEED and PROGRAM; `cairn configure` writes
# it beside the options.
include $(BUILD)/config.mk

ifdef RECIPE
# Another program may be dated before it, as installed ones are.
ifneq ($(PROGRAM),$(shell stat -L -c %s-%Y $(CAIRN)))
$(BUILD)/config.mk: $(if $(MAKE_RESTARTS),,cairn-missing)
endif
# As the including Makefile spells it.
MAP := $(CAIRN_MAP)
endif
$(BUILD)/%: MAP := $(MAP)
$(BUILD)/%: CAPTURE := $(CAPTURE)
$(BUILD)/%: POSES := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses,$(CAPTURE))
$(BUILD)/%: QUERIES := $(QUERIES)
$(BUILD)/%: NAME := $(NAME)
$(BUILD)/%: SEED := $(SEED)

CAIRN_OUTPUTS := $(addprefix $(BUILD)/,features.db matches.db classes.db world.db regions.db vocabulary.db unsealed.cairn)
ifeq ($(RECONSTRUCTED),yes)
CAIRN_OUTPUTS += $(BUILD)/poses
endif
# Poses, cameras and frame, read by the stages that know the capture.
CAPTURE_LISTS := $(wildcard $(CAPTURE)/cameras.txt $(CAPTURE)/images.txt $(CAPTURE)/frame.json)
# The images of the last run and their folders, from the dependency file that extract-features writes: a new or a
# removed image changes its folder's date.
CAPTURE_IMAGES :=
-include $(BUILD)/images.d
# Held-out images that exist, with a backslash before what Make would take for more than a name.
QUERY_LIST := $(firstword $(wildcard $(QUERIES) $(CAPTURE)/queries.txt))
QUERY_IMAGES := $(if $(QUERY_LIST),$(shell awk '/^\#/ || NF < 10 || $$10 ~ /^[-+.0-9eE]+$$/ {next} \
    {for (i = 1; i < 10; ++i) sub(/^[ \t]*[^ \t]+[ \t]+/, ""); sub(/[ \t\r]+$$/, ""); path = "$(CAPTURE)/images/" $$0} \
    (getline line < path) >= 0 {close(path); gsub(/[ \t:;|*?[\#]/, "\\\\&", path); print path}' $(QUERY_LIST)))

.DELETE_ON_ERROR:
.PHONY: cairn-missing

# A clock that was ahead has left dates in the future, to which later changes would seem old.
CAIRN_FUTURE := $(shell find $(BUILD) -maxdepth 2 -type f -newermt '10 seconds' -print \
    \( -name '*.stamp' -exec touch -d @0 {} \; -o -exec touch {} \; \))
$(if $(CAIRN_FUTURE),$(warning $(words $(CAIRN_FUTURE)) files of $(BUILD) were dated in the future, $(firstword \
    $(CAIRN_FUTURE)) the first: is the clock right? What they belong to is made again))

# The default goal of `make -f map.mk`.
$(MAP): $(BUILD)/map.stamp ;

# Whether an output's date changed is seen after its stamp's rule has run.  Outputs whose last run gave the same bytes
# are older than their stamps: for them Make has to look even with -n and -q (the '+').
UNCHANGED := $(shell for output in $(CAIRN_OUTPUTS); do [ $$output.stamp -nt $$output ] && echo $$output; done)
$(filter-out $(UNCHANGED),$(CAIRN_OUTPUTS)): %: %.stamp ;
$(UNCHANGED): %: %.stamp
	+@: # the same bytes as before
# A stamp without its output says nothing.
$(foreach output,$(CAIRN_OUTPUTS),$(if $(wildcard $(output)),,$(eval $(output).stamp: cairn-missing)))
$(if $(wildcard $(MAP)),,$(eval $(BUILD)/map.stamp: cairn-missing))

# Changes with the program's bytes, whatever its date.
PROGRAM_HASH := $(BUILD)/options/program

# The stage holds the build folder, leaves X.report.json and then the stamp, with the date at which it began; where it
# fails, error.json.
CAIRN_FLAGS = --stamp $@ --seed $(SEED) --threads $(THREADS) $(addprefix --memory ,$(MEMORY)) --progress $(PROGRESS) \
    --log-level $(LOG_LEVEL)

ifeq ($(SIMULATED),yes)
CAPTURE_STAMP := $(BUILD)/capture.stamp
$(if $(wildcard $(CAPTURE)/images.txt),,$(eval $(BUILD)/capture.stamp: cairn-missing))
$(BUILD)/capture.stamp: $(BUILD)/options/simulate.toml $(BUILD)/options/seed $(PROGRAM_HASH)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) simulate $(@D)/options/simulate.toml -o $(CAPTURE) $(CAIRN_FLAGS)
else
CAPTURE_STAMP :=
endif

# What the stages after matching take poses from.
POSES_READY := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses,$(CAPTURE_STAMP) $(CAPTURE_LISTS))
$(BUILD)/%: FRAME := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses/frame.json,$(wildcard $(CAPTURE)/frame.json))

$(BUILD)/features.db.stamp: $(BUILD)/options/extract_features.toml $(BUILD)/options/capture $(PROGRAM_HASH) \
    $(CAPTURE_STAMP) $(CAPTURE_LISTS) $(CAPTURE_IMAGES)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) extract-features $(CAPTURE) --options $(@D)/options/extract_features.toml \
	    --depfile $(@D)/images.d -o $(@:.stamp=) $(CAIRN_FLAGS)

# Matching wants the visual words first where it looks for images that look alike.
PAIRS_VOCABULARY := $(if $(filter 'retrieval' 'sequence',$(shell sed -n 's/^pairs = //p' \
    $(BUILD)/options/match_features.toml)),$(BUILD)/vocabulary.db)
$(BUILD)/matches.db.stamp: PAIRS_VOCABULARY := $(PAIRS_VOCABULARY)
$(BUILD)/matches.db.stamp: $(BUILD)/features.db $(BUILD)/options/match_features.toml $(BUILD)/options/seed $(PROGRAM_HASH) \
    $(CAPTURE_STAMP) $(CAPTURE_LISTS) $(PAIRS_VOCABULARY)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) match-features $(@D)/features.db --capture $(CAPTURE) \
	    $(addprefix --vocabulary ,$(PAIRS_VOCABULARY)) --options $(@D)/options/match_features.toml -o $(@:.stamp=) \
	    $(CAIRN_FLAGS)

# Captures without poses only.  The folder's date is that of its last change.
$(BUILD)/poses.stamp: $(BUILD)/matches.db $(BUILD)/options/reconstruct.toml $(BUILD)/options/seed $(PROGRAM_HASH) \
    $(CAPTURE_IMAGES) $(KNOWN_PLACES)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) reconstruct $(@D)/matches.db --capture $(CAPTURE) \
	    --options $(@D)/options/reconstruct.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/classes.db.stamp: $(BUILD)/matches.db $(BUILD)/options/group_classes.toml $(BUILD)/options/seed $(PROGRAM_HASH) \
    $(POSES_READY)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) group-classes $(@D)/matches.db --capture $(POSES) \
	    --options $(@D)/options/group_classes.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/world.db.stamp: $(BUILD)/classes.db $(BUILD)/options/filter_visibility.toml $(PROGRAM_HASH)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) filter-visibility $(@D)/classes.db \
	    --options $(@D)/options/filter_visibility.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/regions.db.stamp: $(BUILD)/world.db $(BUILD)/classes.db $(BUILD)/options/decompose_regions.toml \
    $(BUILD)/options/seed $(PROGRAM_HASH)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) decompose-regions $(@D)/world.db --classes $(@D)/classes.db \
	    --options $(@D)/options/decompose_regions.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

# Held-out images of a reconstructed capture have features too, but no words.
$(BUILD)/vocabulary.db.stamp: $(BUILD)/features.db $(BUILD)/options/build_vocabulary.toml $(BUILD)/options/seed $(PROGRAM_HASH) \
    $(if $(filter yes,$(RECONSTRUCTED)),$(POSES_READY))
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) build-vocabulary $(@D)/features.db \
	    $(if $(filter-out $(CAPTURE),$(POSES)),--capture $(POSES)) \
	    --options $(@D)/options/build_vocabulary.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

# The map notes the options of every stage that made it.
STAGE_OPTIONS := extract_features match_features $(if $(filter yes,$(RECONSTRUCTED)),reconstruct) group_classes \
    filter_visibility decompose_regions build_vocabulary emit_map
$(BUILD)/%: STAGE_OPTIONS := $(STAGE_OPTIONS)
$(BUILD)/unsealed.cairn.stamp: $(BUILD)/classes.db $(BUILD)/world.db $(BUILD)/regions.db $(BUILD)/vocabulary.db \
    $(STAGE_OPTIONS:%=$(BUILD)/options/%.toml) $(BUILD)/options/name $(CAIRN) $(POSES_READY)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) emit-map --classes $(@D)/classes.db --world $(@D)/world.db --regions $(@D)/regions.db \
	    --vocabulary $(@D)/vocabulary.db --name $(NAME) $(if $(FRAME),--frame $(FRAME)) \
	    $(foreach stage,$(STAGE_OPTIONS),--stage-options $(stage)=$(@D)/options/$(stage).toml) \
	    --options $(@D)/options/emit_map.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/map.stamp: $(BUILD)/unsealed.cairn $(BUILD)/options/check_map.toml $(BUILD)/options/queries \
    $(BUILD)/options/seed $(CAIRN) $(POSES_READY) $(QUERY_LIST) $(QUERY_IMAGES)
	$(CAIRN_WHY)
	$(LAUNCH) $(CAIRN) check-map $(@D)/unsealed.cairn $(if $(QUERIES),--queries $(QUERIES) --capture $(POSES)) \
	    --options $(@D)/options/check_map.toml -o $(MAP) $(CAIRN_FLAGS)
