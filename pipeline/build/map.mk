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

CAIRN_RULES := $(dir $(lastword $(MAKEFILE_LIST)))
CAIRN ?= $(shell command -v cairn)
# Put before every command, for example a cluster's `srun` (docs/cluster.md).
LAUNCH ?=
# In how many parts stages 1 and 2 are done, each by a run of the program of its own: side by side with -j.
SHARDS ?= 1
# How often the pairs that matches predict are done in parts; what comes later, stage 2 does in one.
SHARD_ROUNDS ?= 4
THREADS ?= 0
# Most memory for a stage, MiB; empty: most of the machine's.
MEMORY ?=
# "no": stages 1 and 2 begin even if the disk seems too full for their results.
SPACE_CHECK ?=
PROGRESS ?= auto
LOG_LEVEL ?= info

# What changed, of a rule's prerequisites: the first, and how many more.
CAIRN_CHANGED = $(patsubst $(@D)/%,%,$(patsubst $(CAPTURE)/%,%,$(filter-out cairn-missing $(SHARD_STAMPS),$?)))
CAIRN_REASON = $(if $(wildcard $@),$(if $(filter cairn-missing,$?),is missing,$(patsubst options/program,the \
    program,$(firstword $(CAIRN_CHANGED))) changed$(if $(word 2,$(CAIRN_CHANGED)),$(,) $(words $(wordlist \
    2,$(words $(CAIRN_CHANGED)),$(CAIRN_CHANGED))) more)),not made yet)
, := ,
CAIRN_RESULT = $(notdir $(if $(filter map.stamp,$(@F)),$(MAP),$(@:.stamp=)))
# The names of a capture's images may hold what a terminal takes for a command: its bytes are shown as '?'.
CAIRN_PRINTABLE = LC_ALL=C sed 's/[\x01-\x1f\x7f]\|\xc2[\x80-\x9f]\|\xe2\x80[\xaa-\xae]\|\xe2\x81[\xa6-\xa9]/?/g'
CAIRN_WHY = $(if $(filter none,$(PROGRESS)),,@printf '%s\n' '$(subst ','\'',$(if $(filter json,$(PROGRESS)),{"event": \
    "run"$(,) "file": "$(CAIRN_RESULT)"$(,) "reason": "$(subst ",\",$(subst \,\\,$(CAIRN_REASON)))"},$(CAIRN_RESULT): \
    $(CAIRN_REASON)))' | $(CAIRN_PRINTABLE) >&2)

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

# Sets MAP, CAPTURE, SESSIONS, SESSION_QUERIES, SIMULATED, RECONSTRUCTED, KNOWN_PLACES, QUERIES, FLOOR_PLAN, VOCABULARY_TREE, NAME, SEED and PROGRAM;
# `cairn configure` writes it beside the options.
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

CAIRN_OUTPUTS := $(addprefix $(BUILD)/,features.db matches.db classes.db world.db regions.db vocabulary.db \
    appearance.db unsealed.cairn)
ifeq ($(RECONSTRUCTED),yes)
CAIRN_OUTPUTS += $(BUILD)/poses
endif
ifneq ($(FLOOR_PLAN),)
CAIRN_OUTPUTS += $(BUILD)/views.db
endif
# Poses, cameras and frame, read by the stages that know the capture.
CAPTURE_LISTS := $(wildcard $(addprefix $(CAPTURE)/,cameras.txt images.txt frame.json sessions.txt))
ifneq ($(SESSIONS),)
# What the joined capture consists of, there or not yet.
CAPTURE_LISTS := $(addprefix $(CAPTURE)/,sessions.txt $(if $(filter yes,$(RECONSTRUCTED)),,cameras.txt images.txt \
    frame.json $(if $(QUERIES),queries.txt)))
endif
# The images of the last run and their folders, from the dependency file that extract-features writes: a new or a
# removed image changes its folder's date.
CAPTURE_IMAGES :=
-include $(BUILD)/images.d
# Held-out images that exist, with a backslash before what Make would take for more than a name.  Pipes are no files: to
# read one would wait for ever.  Names that have backslashes themselves, or control characters, are left out: no escaping
# holds in all of Make.
QUERY_LIST := $(shell for list in $(wildcard $(QUERIES) $(CAPTURE)/queries.txt); do \
    [ -f $$list ] && echo $$list && break; done)
QUERY_IMAGES := $(if $(QUERY_LIST),$(shell awk '/^\#/ || NF < 10 || $$10 ~ /^[-+.0-9eE]+$$/ {next} \
    {for (i = 1; i < 10; ++i) sub(/^[ \t]*[^ \t]+[ \t]+/, ""); sub(/[ \t\r]+$$/, ""); path = "$(CAPTURE)/images/" $$0} \
    path !~ /[\\[:cntrl:]]/ {print path}' $(QUERY_LIST) | \
    while IFS= read -r path; do [ -f "$$path" ] && printf '%s\n' "$$path"; done | sed 's/[ \t:;|*?[\#]/\\&/g'))

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

CAIRN_LAUNCH = $(if $(strip $(LAUNCH)),$(CAIRN_RULES)launch $@ $(LAUNCH))
# The stage holds the build folder, leaves X.report.json and then the stamp, with the date at which it began; where it
# fails, error.json.
CAIRN_FLAGS = --stamp $@ --seed $(SEED) --threads $(THREADS) $(addprefix --memory ,$(MEMORY)) --progress $(PROGRESS) \
    --log-level $(LOG_LEVEL)
CAIRN_NO_SPACE_CHECK = $(if $(filter no,$(SPACE_CHECK)),--no-space-check)

# Shards.  Each takes over what the output's last version and the shards of earlier rounds know, does its share of the
# rest, and leaves X-ROUND-IofN.db; done, it stays done when others are killed.  Then the stage itself takes all of them
# over, does what is missing and removes them, and those of an earlier SHARDS.  They are SECONDARY: without them nothing
# is out of date.
CAIRN_SHARD_NUMBERS := $(if $(filter-out 0 1,$(SHARDS)),$(shell seq $(SHARDS)))
# $(call CAIRN_SHARD_STAMPS,X,ROUNDS)
CAIRN_SHARD_STAMPS = $(foreach round,$(2),$(CAIRN_SHARD_NUMBERS:%=$(BUILD)/$(1)-$(round)-%of$(SHARDS).stamp))
# $(call CAIRN_SHARD_RULE,X,ROUND,I,COMMAND,EARLIER ROUNDS)
define CAIRN_SHARD_RULE
.SECONDARY: $(BUILD)/$(1)-$(2)-$(3)of$(SHARDS).stamp
$(BUILD)/$(1)-$(2)-$(3)of$(SHARDS).stamp: SHARD_STAMPS := $(call CAIRN_SHARD_STAMPS,$(1),$(5))
$(BUILD)/$(1)-$(2)-$(3)of$(SHARDS).stamp: PROGRESS := $(if $(filter json,$(PROGRESS)),json,none)
$(BUILD)/$(1)-$(2)-$(3)of$(SHARDS).stamp: $(or $(call CAIRN_SHARD_STAMPS,$(1),$(lastword $(5))),$(BUILD)/$(1).begun)
	$$(CAIRN_LAUNCH) $$(CAIRN) $$($(4)) --shard $(3)/$(SHARDS) $$(addprefix --reuse ,$$(wildcard $$(@D)/$(1).db)) \
	    $$(CAIRN_REUSE_SHARDS) -o $$(@:.stamp=.db) $$(CAIRN_FLAGS)
endef
# What the first round waits for: shards of other inputs are gone.
.SECONDARY: $(BUILD)/features.begun $(BUILD)/matches.begun
$(BUILD)/features.begun $(BUILD)/matches.begun:
	rm -f $(@:.begun=)-*of*
	touch $@
CAIRN_REUSE_SHARDS = $(patsubst %.stamp,--reuse %.db,$(SHARD_STAMPS))
CAIRN_REMOVE_SHARDS = rm -f $(@:.db.stamp=).begun $(@:.db.stamp=)-*of*

ifeq ($(SIMULATED),yes)
CAPTURE_STAMP := $(BUILD)/capture.stamp
$(if $(wildcard $(CAPTURE)/images.txt),,$(eval $(BUILD)/capture.stamp: cairn-missing))
$(BUILD)/capture.stamp: $(BUILD)/options/simulate.toml $(BUILD)/options/seed $(PROGRAM_HASH)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) simulate $(@D)/options/simulate.toml -o $(CAPTURE) $(CAIRN_FLAGS)
else
CAPTURE_STAMP :=
endif

# Several captures become one.  Lists that stay the same keep their dates.
ifneq ($(SESSIONS),)
$(if $(filter-out $(wildcard $(CAPTURE_LISTS)),$(CAPTURE_LISTS)),$(eval $(BUILD)/capture.stamp: cairn-missing))
UNCHANGED := $(shell for list in $(CAPTURE_LISTS); do [ $(BUILD)/capture.stamp -nt $$list ] && echo $$list; done)
$(filter-out $(UNCHANGED),$(CAPTURE_LISTS)): $(BUILD)/capture.stamp ;
$(UNCHANGED): $(BUILD)/capture.stamp
	+@: # the same bytes as before
SESSION_FOLDERS := $(foreach session,$(SESSIONS),$(lastword $(subst =, ,$(session))))
SESSION_LISTS := $(wildcard $(foreach list,cameras.txt images.txt queries.txt frame.json,$(SESSION_FOLDERS:%=%/$(list)))) \
    $(foreach session,$(SESSION_QUERIES),$(lastword $(subst =, ,$(session))))
$(BUILD)/capture.stamp: SESSIONS := $(SESSIONS) $(addprefix --queries ,$(SESSION_QUERIES))
$(BUILD)/capture.stamp: $(BUILD)/options/capture $(PROGRAM_HASH) $(SESSION_LISTS)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) join-captures $(SESSIONS) -o $(CAPTURE) $(CAIRN_FLAGS)
endif

# What the stages after matching take poses from.
POSES_READY := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses,$(CAPTURE_STAMP) $(CAPTURE_LISTS))
$(BUILD)/%: FRAME := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses/frame.json,$(filter %/frame.json,$(CAPTURE_LISTS)))

CAIRN_EXTRACT = extract-features $(CAPTURE) $(CAIRN_NO_SPACE_CHECK) --options $(@D)/options/extract_features.toml
FEATURES_INPUTS := $(BUILD)/options/extract_features.toml $(BUILD)/options/capture $(PROGRAM_HASH) $(CAPTURE_STAMP) \
    $(CAPTURE_LISTS) $(CAPTURE_IMAGES)
FEATURES_SHARDS := $(call CAIRN_SHARD_STAMPS,features,1)
$(foreach shard,$(CAIRN_SHARD_NUMBERS),$(eval $(call CAIRN_SHARD_RULE,features,1,$(shard),CAIRN_EXTRACT,)))
$(BUILD)/features.begun: $(FEATURES_INPUTS)

$(BUILD)/features.db.stamp: SHARD_STAMPS := $(FEATURES_SHARDS)
$(BUILD)/features.db.stamp: $(FEATURES_INPUTS) $(FEATURES_SHARDS)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) $(CAIRN_EXTRACT) --depfile $(@D)/images.d $(CAIRN_REUSE_SHARDS) -o $(@:.stamp=) \
	    $(CAIRN_FLAGS)
	$(CAIRN_REMOVE_SHARDS)

# Matching wants the visual words first where it looks for images that look alike.  Those of a reconstructed capture
# come after its poses, which say what is held out, and so after the matches: there matching takes the tree that the
# recipe names, or grows one for itself from all images.
PAIRS_VOCABULARY := $(if $(filter 'retrieval' 'sequence',$(shell sed -n 's/^pairs = //p' \
    $(BUILD)/options/match_features.toml)),$(if $(filter yes,$(RECONSTRUCTED)),$(VOCABULARY_TREE),$(BUILD)/vocabulary.db))
$(BUILD)/%: PAIRS_VOCABULARY := $(PAIRS_VOCABULARY)
CAIRN_MATCH = match-features $(@D)/features.db --capture $(CAPTURE) $(CAIRN_NO_SPACE_CHECK) $(addprefix --vocabulary ,$(PAIRS_VOCABULARY)) \
    --options $(@D)/options/match_features.toml
MATCHES_INPUTS := $(BUILD)/features.db $(BUILD)/options/match_features.toml $(BUILD)/options/seed $(PROGRAM_HASH) \
    $(CAPTURE_STAMP) $(CAPTURE_LISTS) $(PAIRS_VOCABULARY)
MATCHES_ROUNDS := $(if $(CAIRN_SHARD_NUMBERS),$(shell seq $(SHARD_ROUNDS)))
MATCHES_SHARDS := $(call CAIRN_SHARD_STAMPS,matches,$(MATCHES_ROUNDS))
$(foreach round,$(MATCHES_ROUNDS),$(foreach shard,$(CAIRN_SHARD_NUMBERS),$(eval $(call \
    CAIRN_SHARD_RULE,matches,$(round),$(shard),CAIRN_MATCH,$(wordlist 2,$(round),0 $(MATCHES_ROUNDS))))))
$(BUILD)/matches.begun: $(MATCHES_INPUTS)

$(BUILD)/matches.db.stamp: SHARD_STAMPS := $(MATCHES_SHARDS)
$(BUILD)/matches.db.stamp: $(MATCHES_INPUTS) $(MATCHES_SHARDS)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) $(CAIRN_MATCH) $(CAIRN_REUSE_SHARDS) -o $(@:.stamp=) $(CAIRN_FLAGS)
	$(CAIRN_REMOVE_SHARDS)

# Captures without poses only.  The folder's date is that of its last change.  The hash of each image, and so of its GPS
# tags, is in features.db.
$(BUILD)/poses.stamp: $(BUILD)/matches.db $(BUILD)/features.db $(BUILD)/options/reconstruct.toml \
    $(BUILD)/options/seed $(PROGRAM_HASH) $(KNOWN_PLACES)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) reconstruct $(@D)/matches.db --capture $(CAPTURE) \
	    --options $(@D)/options/reconstruct.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/classes.db.stamp: $(BUILD)/matches.db $(BUILD)/options/group_classes.toml $(BUILD)/options/seed \
    $(PROGRAM_HASH) $(POSES_READY)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) group-classes $(@D)/matches.db --capture $(POSES) \
	    --options $(@D)/options/group_classes.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/world.db.stamp: $(BUILD)/classes.db $(BUILD)/options/filter_visibility.toml $(PROGRAM_HASH)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) filter-visibility $(@D)/classes.db \
	    --options $(@D)/options/filter_visibility.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/regions.db.stamp: $(BUILD)/world.db $(BUILD)/classes.db $(BUILD)/options/decompose_regions.toml \
    $(BUILD)/options/seed $(PROGRAM_HASH)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) decompose-regions $(@D)/world.db --classes $(@D)/classes.db \
	    --options $(@D)/options/decompose_regions.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

# Held-out images of a reconstructed capture have features too, but no words.
$(BUILD)/vocabulary.db.stamp: VOCABULARY_TREE := $(VOCABULARY_TREE)
$(BUILD)/vocabulary.db.stamp: $(BUILD)/features.db $(BUILD)/options/build_vocabulary.toml $(BUILD)/options/seed \
    $(PROGRAM_HASH) $(if $(filter yes,$(RECONSTRUCTED)),$(POSES_READY)) $(VOCABULARY_TREE)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) build-vocabulary $(@D)/features.db \
	    $(if $(filter-out $(CAPTURE),$(POSES)),--capture $(POSES)) \
	    --options $(@D)/options/build_vocabulary.toml $(addprefix --tree-from ,$(VOCABULARY_TREE)) -o $(@:.stamp=) $(CAIRN_FLAGS)

# Held-out images of a reconstructed capture are linked in matches.db, but are no survey.
$(BUILD)/appearance.db.stamp: $(BUILD)/matches.db $(BUILD)/vocabulary.db $(BUILD)/options/link_appearance.toml $(BUILD)/options/seed \
    $(PROGRAM_HASH) $(POSES_READY)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) link-appearance $(@D)/matches.db $(@D)/vocabulary.db --capture $(POSES) \
	    --options $(@D)/options/link_appearance.toml -o $(@:.stamp=) $(CAIRN_FLAGS)

# Where the recipe names a floor plan; that of a simulated capture is one of its files.
ifneq ($(FLOOR_PLAN),)
$(BUILD)/views.db.stamp: FLOOR_PLAN := $(FLOOR_PLAN)
$(BUILD)/views.db.stamp: $(if $(filter yes,$(SIMULATED)),$(CAPTURE_STAMP),$(FLOOR_PLAN)) \
    $(BUILD)/options/floor_plan $(BUILD)/options/decompose_views.toml $(PROGRAM_HASH)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) decompose-views $(FLOOR_PLAN) \
	    --options $(@D)/options/decompose_views.toml -o $(@:.stamp=) $(CAIRN_FLAGS)
endif

SESSION_LIST := $(filter %/sessions.txt,$(CAPTURE_LISTS))
$(BUILD)/%: SESSION_LIST := $(SESSION_LIST)
# The map notes the options of every stage that made it.
STAGE_OPTIONS := extract_features match_features $(if $(filter yes,$(RECONSTRUCTED)),reconstruct) group_classes \
    filter_visibility decompose_regions build_vocabulary link_appearance \
    $(if $(FLOOR_PLAN),decompose_views) emit_map
$(BUILD)/%: STAGE_OPTIONS := $(STAGE_OPTIONS)
VIEWS := $(if $(FLOOR_PLAN),$(BUILD)/views.db)
$(BUILD)/%: VIEWS := $(VIEWS)
# emit-map and all that it reads, from the folder $(1).
CAIRN_EMIT = emit-map --matches $(1)/matches.db --classes $(1)/classes.db --world $(1)/world.db --regions $(1)/regions.db \
    --vocabulary $(1)/vocabulary.db --appearance $(1)/appearance.db --name $(NAME) $(if $(FRAME),--frame $(FRAME)) \
    $(addprefix --sessions ,$(SESSION_LIST)) $(addprefix --views ,$(VIEWS)) \
    $(foreach stage,$(STAGE_OPTIONS),--stage-options $(stage)=$(1)/options/$(stage).toml) --options $(1)/options/emit_map.toml
EMIT_NEEDS := $(BUILD)/matches.db $(BUILD)/classes.db $(BUILD)/world.db $(BUILD)/regions.db \
    $(BUILD)/vocabulary.db $(BUILD)/appearance.db $(VIEWS) $(STAGE_OPTIONS:%=$(BUILD)/options/%.toml) \
    $(BUILD)/options/name $(BUILD)/options/floor_plan $(PROGRAM_HASH) $(POSES_READY) $(SESSION_LIST)
$(BUILD)/unsealed.cairn.stamp: $(EMIT_NEEDS)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) $(call CAIRN_EMIT,$(@D)) -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/map.stamp: $(BUILD)/unsealed.cairn $(BUILD)/options/check_map.toml $(BUILD)/options/queries \
    $(BUILD)/options/seed $(PROGRAM_HASH) $(POSES_READY) $(QUERY_LIST) $(QUERY_IMAGES)
	$(CAIRN_WHY)
	$(CAIRN_LAUNCH) $(CAIRN) check-map $(@D)/unsealed.cairn $(if $(QUERIES),--queries $(QUERIES) --capture $(POSES)) \
	    --options $(@D)/options/check_map.toml --details $(@D)/check.json -o $(MAP) $(CAIRN_FLAGS)

# The map in other sizes, for `cairn pareto`: pareto/N.cairn has at most N bytes (0: every class) and pareto/N.json what
# the held-out images say of it; no gate.
.PRECIOUS: $(BUILD)/pareto/%.unsealed.stamp
$(BUILD)/pareto/%.unsealed.stamp: $(EMIT_NEEDS)
	$(CAIRN_LAUNCH) $(CAIRN) $(call CAIRN_EMIT,$(@D)/..) --landmarks all --max-bytes $* -o $(@:.stamp=) $(CAIRN_FLAGS)

$(BUILD)/pareto/%.json: $(BUILD)/pareto/%.unsealed.stamp $(BUILD)/options/check_map.toml $(BUILD)/options/queries \
    $(QUERY_LIST) $(QUERY_IMAGES)
	$(CAIRN_LAUNCH) $(CAIRN) check-map $(<:.stamp=) --queries $(QUERIES) --capture $(POSES) \
	    --options $(@D)/../options/check_map.toml --min-localized-ratio 0 --min-precision-ratio 0 \
	    --min-region-localized-ratio 0 --min-region-precision-ratio 0 --plan-must-fit false --json -o $(@:.json=.cairn) \
	    --seed $(SEED) --threads $(THREADS) $(addprefix --memory ,$(MEMORY)) --progress $(PROGRESS) --log-level $(LOG_LEVEL) > $@
