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

CAIRN ?= $(shell command -v cairn)
# Put before every command, for example a cluster's `srun`.
LAUNCH ?=
THREADS ?= 0
# Most memory for the features that match-features holds at a time, MiB; empty: its default.
MEMORY ?=
PROGRESS ?= auto
LOG_LEVEL ?= info

ifdef RECIPE
CAIRN_MAP := $(MAP)
$(BUILD)/config.mk: MAP := $(MAP)
$(BUILD)/config.mk: $(RECIPE) $(CAIRN)
	$(CAIRN) configure $< -o $(MAP) --build-dir $(@D)
	touch $@
endif

# Sets MAP, CAPTURE, SIMULATED, RECONSTRUCTED, KNOWN_PLACES, QUERIES, NAME and SEED; `cairn configure` writes it beside the options.
include $(BUILD)/config.mk

ifdef RECIPE
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
# The images of the last run, from the dependency file that extract-features writes, and their folders: a new or a
# removed image changes its folder's date.  One that is gone is no prerequisite any more.
CAPTURE_IMAGES := $(wildcard $(filter-out \ %:,$(file <$(BUILD)/features.d)))
CAPTURE_FOLDERS := $(wildcard $(sort $(dir $(CAPTURE_IMAGES)) $(CAPTURE)/images))
QUERY_LIST := $(firstword $(wildcard $(QUERIES) $(CAPTURE)/queries.txt))
QUERY_IMAGES := $(if $(QUERY_LIST),$(wildcard $(addprefix $(CAPTURE)/images/,$(shell awk 'NF == 10 && !/^#/ {print $$10}' $(QUERY_LIST)))))

.DELETE_ON_ERROR:
.PHONY: cairn-missing

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

# X.txt keeps what the stage printed about X, for summaries of runs that had nothing to do.
CAIRN_FLAGS = --results $(@:.stamp=.txt) --seed $(SEED) --threads $(THREADS) --progress $(PROGRESS) \
    --log-level $(LOG_LEVEL)

ifeq ($(SIMULATED),yes)
CAPTURE_STAMP := $(BUILD)/capture.stamp
$(if $(wildcard $(CAPTURE)/images.txt),,$(eval $(BUILD)/capture.stamp: cairn-missing))
$(BUILD)/capture.stamp: $(BUILD)/options/simulate.toml $(BUILD)/options/seed $(CAIRN)
	touch $@.begun
	$(LAUNCH) $(CAIRN) simulate $(@D)/options/simulate.toml -o $(CAPTURE) $(CAIRN_FLAGS)
	mv $@.begun $@
else
CAPTURE_STAMP :=
endif

# What the stages after matching take poses from.
POSES_READY := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses,$(CAPTURE_STAMP) $(CAPTURE_LISTS))
$(BUILD)/%: FRAME := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses/frame.json,$(wildcard $(CAPTURE)/frame.json))

$(BUILD)/features.db.stamp: $(BUILD)/options/extract_features.toml $(BUILD)/options/capture $(CAIRN) \
    $(CAPTURE_STAMP) $(CAPTURE_LISTS) $(CAPTURE_FOLDERS) $(CAPTURE_IMAGES)
	touch $@.begun
	$(LAUNCH) $(CAIRN) extract-features $(CAPTURE) --options $(@D)/options/extract_features.toml \
	    --depfile $(@D)/features.d -o $(@:.stamp=) $(CAIRN_FLAGS)
	mv $@.begun $@

# Matching wants the visual words first where it looks for images that look alike.
PAIRS_VOCABULARY := $(if $(filter 'retrieval' 'sequence',$(shell sed -n 's/^pairs = //p' \
    $(BUILD)/options/match_features.toml)),$(BUILD)/vocabulary.db)
$(BUILD)/matches.db.stamp: PAIRS_VOCABULARY := $(PAIRS_VOCABULARY)
$(BUILD)/matches.db.stamp: $(BUILD)/features.db $(BUILD)/options/match_features.toml $(BUILD)/options/seed $(CAIRN) \
    $(CAPTURE_STAMP) $(CAPTURE_LISTS) $(PAIRS_VOCABULARY)
	touch $@.begun
	$(LAUNCH) $(CAIRN) match-features $(@D)/features.db --capture $(CAPTURE) $(addprefix --memory ,$(MEMORY)) \
	    $(addprefix --vocabulary ,$(PAIRS_VOCABULARY)) --options $(@D)/options/match_features.toml -o $(@:.stamp=) \
	    $(CAIRN_FLAGS)
	mv $@.begun $@

# Captures without poses only.  The folder's date is that of its last change.
$(BUILD)/poses.stamp: $(BUILD)/matches.db $(BUILD)/options/reconstruct.toml $(BUILD)/options/seed $(CAIRN) \
    $(CAPTURE_IMAGES) $(KNOWN_PLACES)
	touch $@.begun
	$(LAUNCH) $(CAIRN) reconstruct $(@D)/matches.db --capture $(CAPTURE) \
	    --options $(@D)/options/reconstruct.toml -o $(@:.stamp=) $(CAIRN_FLAGS)
	mv $@.begun $@

$(BUILD)/classes.db.stamp: $(BUILD)/matches.db $(BUILD)/options/group_classes.toml $(BUILD)/options/seed $(CAIRN) \
    $(POSES_READY)
	touch $@.begun
	$(LAUNCH) $(CAIRN) group-classes $(@D)/matches.db --capture $(POSES) \
	    --options $(@D)/options/group_classes.toml -o $(@:.stamp=) $(CAIRN_FLAGS)
	mv $@.begun $@

$(BUILD)/world.db.stamp: $(BUILD)/classes.db $(BUILD)/options/filter_visibility.toml $(CAIRN)
	touch $@.begun
	$(LAUNCH) $(CAIRN) filter-visibility $(@D)/classes.db \
	    --options $(@D)/options/filter_visibility.toml -o $(@:.stamp=) $(CAIRN_FLAGS)
	mv $@.begun $@

$(BUILD)/regions.db.stamp: $(BUILD)/world.db $(BUILD)/classes.db $(BUILD)/options/decompose_regions.toml \
    $(BUILD)/options/seed $(CAIRN)
	touch $@.begun
	$(LAUNCH) $(CAIRN) decompose-regions $(@D)/world.db --classes $(@D)/classes.db \
	    --options $(@D)/options/decompose_regions.toml -o $(@:.stamp=) $(CAIRN_FLAGS)
	mv $@.begun $@

# Held-out images of a reconstructed capture have features too, but no words.
$(BUILD)/vocabulary.db.stamp: $(BUILD)/features.db $(BUILD)/options/build_vocabulary.toml $(BUILD)/options/seed $(CAIRN) \
    $(if $(filter yes,$(RECONSTRUCTED)),$(POSES_READY))
	touch $@.begun
	$(LAUNCH) $(CAIRN) build-vocabulary $(@D)/features.db \
	    $(if $(filter-out $(CAPTURE),$(POSES)),--capture $(POSES)) \
	    --options $(@D)/options/build_vocabulary.toml -o $(@:.stamp=) $(CAIRN_FLAGS)
	mv $@.begun $@

# The map notes the options of every stage that made it.
STAGE_OPTIONS := extract_features match_features $(if $(filter yes,$(RECONSTRUCTED)),reconstruct) group_classes \
    filter_visibility decompose_regions build_vocabulary emit_map
$(BUILD)/%: STAGE_OPTIONS := $(STAGE_OPTIONS)
$(BUILD)/unsealed.cairn.stamp: $(BUILD)/classes.db $(BUILD)/world.db $(BUILD)/regions.db $(BUILD)/vocabulary.db \
    $(STAGE_OPTIONS:%=$(BUILD)/options/%.toml) $(BUILD)/options/name $(CAIRN) $(POSES_READY)
	touch $@.begun
	$(LAUNCH) $(CAIRN) emit-map --classes $(@D)/classes.db --world $(@D)/world.db --regions $(@D)/regions.db \
	    --vocabulary $(@D)/vocabulary.db --name $(NAME) $(if $(FRAME),--frame $(FRAME)) \
	    $(foreach stage,$(STAGE_OPTIONS),--stage-options $(stage)=$(@D)/options/$(stage).toml) \
	    --options $(@D)/options/emit_map.toml -o $(@:.stamp=) $(CAIRN_FLAGS)
	mv $@.begun $@

$(BUILD)/map.stamp: $(BUILD)/unsealed.cairn $(BUILD)/options/check_map.toml $(BUILD)/options/queries \
    $(BUILD)/options/seed $(CAIRN) $(POSES_READY) $(QUERY_LIST) $(QUERY_IMAGES)
	touch $@.begun
	$(LAUNCH) $(CAIRN) check-map $(@D)/unsealed.cairn $(if $(QUERIES),--queries $(QUERIES) --capture $(POSES)) \
	    --options $(@D)/options/check_map.toml -o $(MAP) $(CAIRN_FLAGS)
	mv $@.begun $@
