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
# prerequisites are compared with the stamp: an input that changes during the run is seen by the next one.  The rules
# downstream are compared with X, and a run that gives the same bytes does not change the date of X: then nothing
# downstream runs.  Recipes only use variables that are set for the build folder of their target.
#
# machinery.mk has what the rules stand on: $(CAIRN_RUN), $(CAIRN_OPTIONS) and other names that begin with CAIRN_.
# docs/makefiles.md shows how a stage is added.
#
# Every rule that runs says first what changed.  `make -n` shows all that could run: what follows a stage runs only if
# that stage's result differs.

CAIRN_RULES := $(dir $(lastword $(MAKEFILE_LIST)))
CAIRN ?= $(shell command -v cairn)
# Put before every command, for example a cluster's `srun` (docs/cluster.md).
LAUNCH ?=
# The most parts of stages 1 and 2, each with its own run of the program: side by side with -j.
SHARDS ?= 1
# The fewest images of a part.
SHARD_IMAGES ?= 64
# The number of rounds in which pairs that matches predict are matched in parts; stage 2 itself matches later ones.
SHARD_ROUNDS ?= 4
THREADS ?= 0
# Maximum memory for a stage, MiB; empty: most of the machine's.
MEMORY ?=
# "no": stages 1 and 2 begin even if the disk seems too full for their results.
SPACE_CHECK ?=
PROGRESS ?= auto
LOG_LEVEL ?= info

# What the stages make in the build folder.
CAIRN_OUTPUTS = features.db matches.db $(if $(filter yes,$(RECONSTRUCTED)),poses) classes.db world.db regions.db \
    vocabulary.db appearance.db $(if $(FLOOR_PLAN),views.db) unsealed.cairn $(if $(filter yes,$(LEFT_OUT)),left_out)
include $(CAIRN_RULES)machinery.mk

# Stage 0: a capture that the recipe describes, rendered ...
ifeq ($(SIMULATED),yes)
$(BUILD)/capture.stamp: $(call CAIRN_OPTIONS,simulate) $(SEED_FILE)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) stage simulate $(@D)/options/simulate.toml -o $(CAPTURE) $(CAIRN_FLAGS)
endif

# ... or films and bags, whose keyframes become a capture each ...
ifneq ($(FOOTAGE),)
$(FOOTAGE_STAMPS): $(BUILD)/%.stamp: $(BUILD)/options/% $(PROGRAM_HASH)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) import $(SOURCE) $(IMPORT_OPTIONS) -o $(@:.stamp=) $(CAIRN_FLAGS)
endif

# ... or several captures as one.
ifneq ($(SESSIONS),)
$(BUILD)/capture.stamp: $(BUILD)/options/capture $(PROGRAM_HASH) $(SESSION_LISTS)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) join $(SESSIONS) -o $(CAPTURE) $(CAIRN_FLAGS)
endif

# Stage 1: the features of each image; in shards, if there are any.
CAIRN_EXTRACT = stage extract-features $(CAPTURE) $(CAIRN_NO_SPACE_CHECK) --options $(@D)/options/extract_features.toml $(addprefix --model ,$(MODEL))
FEATURES_INPUTS := $(call CAIRN_OPTIONS,extract_features) $(BUILD)/options/capture $(CAPTURE_STAMP) $(CAPTURE_LISTS) \
    $(CAPTURE_IMAGES) $(GIVEN_FEATURES) $(MODEL)
FEATURES_SHARDS := $(if $(CAIRN_SHARD_NUMBERS),$(call CAIRN_SHARD_STAMPS,features,1))
$(if $(FEATURES_SHARDS),$(eval $(call CAIRN_PLAN_RULE,features,1,)))
$(call CAIRN_PLAN,features,1).stamp:
	images=$(CAPTURE)/images; [ -d $$images ] || images=$(CAPTURE)/; \
	    n=$$(($$(find -L $$images -type f | wc -l) / $(SHARD_IMAGES))); [ $$n -le $(SHARDS) ] || n=$(SHARDS); \
	    [ $$n -ge 2 ] || n=0; echo $$n > $(@:.stamp=.db.shards)
	touch $@
$(foreach shard,$(CAIRN_SHARD_NUMBERS),$(eval $(call CAIRN_SHARD_RULE,features,1,$(shard),CAIRN_EXTRACT,)))
$(BUILD)/features.begun: $(FEATURES_INPUTS)
$(BUILD)/features.db.stamp: SHARD_STAMPS := $(FEATURES_SHARDS)
$(BUILD)/features.db.stamp: SHARD_ROUNDS_BEFORE := $(if $(FEATURES_SHARDS),1)
$(BUILD)/features.db.stamp: $(FEATURES_INPUTS) $(FEATURES_SHARDS)
	$(CAIRN_WHY)
	exec $(CAIRN_LAUNCH) $(CAIRN) $(CAIRN_EXTRACT) --depfile $(@D)/images.d $(call CAIRN_REUSE_SHARDS,features) -o $(@:.stamp=) $(CAIRN_FLAGS)
	$(CAIRN_REMOVE_SHARDS)

# Stage 2: matches of pairs of images; in shards, if there are any.
# Matching wants the visual words first where it looks for images that look alike.  Those of a reconstructed capture
# come after its poses, which say what is held out, and so after the matches: there matching takes the tree that the
# recipe names, or grows one for itself from all images.
PAIRS_VOCABULARY := $(if $(filter 'retrieval' 'sequence',$(shell sed -n 's/^pairs = //p' \
    $(BUILD)/options/match_features.toml)),$(if $(filter yes,$(RECONSTRUCTED)),$(VOCABULARY_TREE),$(BUILD)/vocabulary.db))
$(BUILD)/%: PAIRS_VOCABULARY := $(PAIRS_VOCABULARY)
CAIRN_MATCH = stage match-features $(@D)/features.db --capture $(CAPTURE) $(CAIRN_NO_SPACE_CHECK) \
    $(addprefix --vocabulary ,$(PAIRS_VOCABULARY)) --options $(@D)/options/match_features.toml
MATCHES_INPUTS := $(BUILD)/features.db $(call CAIRN_OPTIONS,match_features) $(SEED_FILE) $(CAPTURE_STAMP) \
    $(CAPTURE_LISTS) $(PAIRS_VOCABULARY)
MATCHES_ROUNDS := $(if $(CAIRN_SHARD_NUMBERS),$(shell seq $(SHARD_ROUNDS)))
MATCHES_SHARDS := $(call CAIRN_SHARD_STAMPS,matches,$(MATCHES_ROUNDS))
$(foreach round,$(MATCHES_ROUNDS),$(foreach shard,$(CAIRN_SHARD_NUMBERS),$(eval $(call \
    CAIRN_SHARD_RULE,matches,$(round),$(shard),CAIRN_MATCH,$(wordlist 2,$(round),0 $(MATCHES_ROUNDS))))))
$(foreach round,$(MATCHES_ROUNDS),$(eval $(call CAIRN_PLAN_RULE,matches,$(round),$(wordlist 2,$(round),0 $(MATCHES_ROUNDS)))))
# Where too little is left to be divided, the stage itself does the rest.
$(foreach round,$(MATCHES_ROUNDS),$(call CAIRN_PLAN,matches,$(round)).stamp):
	if grep -qs last $(PLAN_BEFORE); then echo 0 last > $(@:.stamp=.db.shards); exec touch $@; fi; \
	    exec $(CAIRN_LAUNCH) $(CAIRN) $(CAIRN_MATCH) --plan $(SHARDS) --shard-images $(SHARD_IMAGES) \
	    $(addprefix --reuse ,$(wildcard $(@D)/matches.db)) $(call CAIRN_REUSE_SHARDS,matches) -o $(@:.stamp=.db) $(CAIRN_FLAGS)
$(BUILD)/matches.begun: $(MATCHES_INPUTS)
$(BUILD)/matches.db.stamp: SHARD_STAMPS := $(MATCHES_SHARDS)
$(BUILD)/matches.db.stamp: SHARD_ROUNDS_BEFORE := $(MATCHES_ROUNDS)
$(BUILD)/matches.db.stamp: $(MATCHES_INPUTS) $(MATCHES_SHARDS)
	$(CAIRN_WHY)
	exec $(CAIRN_LAUNCH) $(CAIRN) $(CAIRN_MATCH) $(call CAIRN_REUSE_SHARDS,matches) -o $(@:.stamp=) $(CAIRN_FLAGS)
	$(CAIRN_REMOVE_SHARDS)

# Stage 2b: poses, for captures that have none, or none in the frame of others.  The folder's date is that of its last change.  The hash of each image, and so of
# its GPS tags, is in features.db; odometry and IMU are not.
$(BUILD)/poses.stamp: $(BUILD)/matches.db $(BUILD)/features.db $(call CAIRN_OPTIONS,reconstruct) $(SEED_FILE) $(KNOWN_PLACES) \
    $(BUILD)/options/odometry $(filter %/odometry.txt %.csv,$(CAPTURE_LISTS)) $(POSED_LISTS)
	$(call CAIRN_RUN,reconstruct,stage reconstruct $(@D)/matches.db --capture $(CAPTURE))

# Stage 3: matches that show the same point become feature classes.  Of several sessions it says which are still there.
$(BUILD)/classes.db.stamp: $(BUILD)/matches.db $(POSES_READY) $(call CAIRN_OPTIONS,group_classes) $(SEED_FILE) $(SESSION_LIST)
	$(call CAIRN_RUN,group_classes,stage group-classes $(@D)/matches.db --capture $(POSES) $(addprefix --sessions ,$(SESSION_LIST)))

# Stage 4: stations, and which classes are widely visible from them.
$(BUILD)/world.db.stamp: $(BUILD)/classes.db $(call CAIRN_OPTIONS,filter_visibility)
	$(call CAIRN_RUN,filter_visibility,stage filter-visibility $(@D)/classes.db)

# Stage 5: regions in each of which the same landmarks are visible.
$(BUILD)/regions.db.stamp: $(BUILD)/world.db $(BUILD)/classes.db $(call CAIRN_OPTIONS,decompose_regions) $(SEED_FILE)
	$(call CAIRN_RUN,decompose_regions,stage decompose-regions $(@D)/world.db --classes $(@D)/classes.db)

# Stage 6: visual words.  Held-out images of a reconstructed capture have features too, but no words.
$(BUILD)/vocabulary.db.stamp: $(BUILD)/features.db $(if $(filter yes,$(RECONSTRUCTED)),$(POSES_READY)) $(VOCABULARY_TREE) \
    $(call CAIRN_OPTIONS,build_vocabulary) $(SEED_FILE)
	$(call CAIRN_RUN,build_vocabulary,stage build-vocabulary $(@D)/features.db \
	    $(if $(filter-out $(CAPTURE),$(POSES)),--capture $(POSES)) $(addprefix --tree-from ,$(VOCABULARY_TREE)))

# Stage 7: which images see the same, and the fewest that still locate a robot.  Held-out images of a reconstructed
# capture are linked in matches.db, but are no survey.
$(BUILD)/appearance.db.stamp: $(BUILD)/matches.db $(BUILD)/vocabulary.db $(BUILD)/classes.db $(POSES_READY) $(call CAIRN_OPTIONS,link_appearance) $(SEED_FILE)
	$(call CAIRN_RUN,link_appearance,stage link-appearance $(@D)/matches.db $(@D)/vocabulary.db --capture $(POSES) --classes $(@D)/classes.db)

# Stage 8: regions of the floor plan, where the recipe names one; that of a simulated capture is one of its files.
ifneq ($(FLOOR_PLAN),)
$(BUILD)/views.db.stamp: $(if $(filter yes,$(SIMULATED)),$(CAPTURE_STAMP),$(FLOOR_PLAN) $(FLOOR_PLAN_FILES)) $(BUILD)/options/floor_plan \
    $(call CAIRN_OPTIONS,decompose_views)
	$(call CAIRN_RUN,decompose_views,plan decompose $(FLOOR_PLAN))
endif

# Stage 9: the map.  It notes the options of every stage that made it.
STAGE_OPTIONS := extract_features match_features $(if $(filter yes,$(RECONSTRUCTED)),reconstruct) group_classes \
    filter_visibility decompose_regions build_vocabulary link_appearance $(if $(FLOOR_PLAN),decompose_views) emit_map
$(BUILD)/%: STAGE_OPTIONS := $(STAGE_OPTIONS)
VIEWS := $(if $(FLOOR_PLAN),$(BUILD)/views.db)
$(BUILD)/%: VIEWS := $(VIEWS)
# emit-map and all that it reads, from the folder $(1).
CAIRN_EMIT = stage emit-map --matches $(1)/matches.db --classes $(1)/classes.db --world $(1)/world.db --regions $(1)/regions.db \
    --vocabulary $(1)/vocabulary.db --appearance $(1)/appearance.db --name $(NAME) $(if $(FRAME),--frame $(FRAME)) \
    $(addprefix --sessions ,$(SESSION_LIST)) $(addprefix --views ,$(VIEWS)) \
    $(foreach stage,$(STAGE_OPTIONS),--stage-options $(stage)=$(1)/options/$(stage).toml) --options $(1)/options/emit_map.toml \
    $(addprefix --previous ,$(PREVIOUS_MAP))
EMIT_INPUTS := $(BUILD)/matches.db $(BUILD)/classes.db $(BUILD)/world.db $(BUILD)/regions.db $(BUILD)/vocabulary.db \
    $(BUILD)/appearance.db $(VIEWS) $(STAGE_OPTIONS:%=$(BUILD)/options/%.toml) $(BUILD)/options/name \
    $(BUILD)/options/floor_plan $(PROGRAM_HASH) $(POSES_READY) $(SESSION_LIST) $(PREVIOUS_MAP)
$(BUILD)/unsealed.cairn.stamp: $(EMIT_INPUTS)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) $(call CAIRN_EMIT,$(@D)) -o $(@:.stamp=) $(CAIRN_FLAGS)

# Stage 9b: where no images are held out, maps without runs of the survey's images, which try them.
LEFT_OUT_FOLDER := $(if $(filter yes,$(LEFT_OUT)),$(BUILD)/left_out)
$(BUILD)/%: LEFT_OUT_FOLDER := $(LEFT_OUT_FOLDER)
ifneq ($(LEFT_OUT_FOLDER),)
$(BUILD)/left_out.stamp: $(BUILD)/unsealed.cairn $(BUILD)/matches.db $(BUILD)/classes.db $(BUILD)/world.db $(BUILD)/regions.db \
    $(BUILD)/vocabulary.db $(BUILD)/appearance.db $(call CAIRN_OPTIONS,leave_out)
	$(call CAIRN_RUN,leave_out,stage leave-out $(@D)/unsealed.cairn --matches $(@D)/matches.db --classes $(@D)/classes.db \
	    --world $(@D)/world.db --regions $(@D)/regions.db --vocabulary $(@D)/vocabulary.db --appearance $(@D)/appearance.db)
endif

# Stage 10: held-out or left-out images are localized, and the map is sealed.
$(BUILD)/map.stamp: $(BUILD)/unsealed.cairn $(LEFT_OUT_FOLDER) $(call CAIRN_OPTIONS,check_map) $(SEED_FILE) \
    $(BUILD)/options/queries $(POSES_READY) $(QUERY_LIST) $(QUERY_IMAGES) $(if $(QUERIES),$(GIVEN_FEATURES)) $(MODEL)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) check $(@D)/unsealed.cairn $(if $(QUERIES),--queries $(QUERIES) --capture $(POSES)) \
	    $(if $(LEFT_OUT_FOLDER),--left-out $(LEFT_OUT_FOLDER) --capture $(POSES)) --options $(@D)/options/check_map.toml $(addprefix --model ,$(MODEL)) --details $(@D)/check.json -o $(MAP) $(CAIRN_FLAGS)

# The map in other sizes, for `cairn pareto`: pareto/N.cairn has at most N bytes (0: every class) and pareto/N.json
# the results of the held-out images; no gate.
.PRECIOUS: $(BUILD)/pareto/%.unsealed.stamp
$(BUILD)/pareto/%.unsealed.stamp: $(EMIT_INPUTS)
	$(CAIRN_LAUNCH) $(CAIRN) $(call CAIRN_EMIT,$(@D)/..) --landmarks all --max-bytes $* -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/pareto/%.json: $(BUILD)/pareto/%.unsealed.stamp $(BUILD)/options/check_map.toml $(BUILD)/options/queries \
    $(QUERY_LIST) $(QUERY_IMAGES)
	$(CAIRN_LAUNCH) $(CAIRN) check $(<:.stamp=) --queries $(QUERIES) --capture $(POSES) \
	    --options $(@D)/../options/check_map.toml $(addprefix --model ,$(MODEL)) --min-localized-ratio 0 --min-precision-ratio 0 \
	    --min-region-localized-ratio 0 --min-region-precision-ratio 0 --plan-must-fit false --json -o $(@:.json=.cairn) \
	    $(CAIRN_COMMON) > $@
