# What the rules of map.mk use.  map.mk includes it once per map, after it has set CAIRN_OUTPUTS.  In this order: the
# recipe's values, the capture's files, stamps and dates, what a rule runs, what it says, shards, captures that are made.

# Stages of one run of make may work in the same build folder; a second run of make is refused.
ifndef CAIRN_BUILD_SESSION
CAIRN_BUILD_SESSION := $(shell echo $$PPID@$$(uname -n))
endif
export CAIRN_BUILD_SESSION

# ---- The recipe's values

ifdef RECIPE
# The first target: what `make` without one makes.
$(MAP):
CAIRN_MAP := $(MAP)
# Once per run: make restarts when an included file is made again, and with a recipe dated in the future it would restart
# without end.
$(BUILD)/config.mk: CONFIGURE := $(RECIPE) -o $(MAP) --build-dir $(BUILD)
$(BUILD)/config.mk: $(if $(MAKE_RESTARTS),,$(RECIPE) $(CAIRN))
	$(CAIRN) stage configure $(CONFIGURE)
	touch $@
endif

# Sets MAP, CAPTURE, FOOTAGE, FOOTAGE_FILES, FOOTAGE_OPTIONS, SESSIONS, SESSION_QUERIES, SESSIONS_REGISTERED, SIMULATED, RECONSTRUCTED, REGISTERED, KNOWN_PLACES,
# QUERIES, LEFT_OUT, FLOOR_PLAN, FLOOR_PLAN_FILES, VOCABULARY_TREE, PREVIOUS_MAP, MODEL, NAME, SEED and PROGRAM; `cairn stage configure` writes it beside the options.
include $(BUILD)/config.mk

ifdef RECIPE
# Another program may have an older date than config.mk, as installed ones have: size and date are compared.
ifneq ($(PROGRAM),$(shell stat -L -c %s-%Y $(CAIRN)))
$(BUILD)/config.mk: $(if $(MAKE_RESTARTS),,cairn-missing)
endif
# A file more, or less, in a folder that is a bag.
CAIRN_VALUES = $(foreach pair,$($(1)),$(lastword $(subst =, ,$(pair))))
$(BUILD)/config.mk: $(if $(MAKE_RESTARTS),,$(wildcard $(filter-out $(call CAIRN_VALUES,FOOTAGE_FILES),$(call CAIRN_VALUES,FOOTAGE))))
# A floor plan that names its image may name another one.
$(BUILD)/config.mk: $(if $(MAKE_RESTARTS),,$(if $(FLOOR_PLAN_FILES),$(wildcard $(FLOOR_PLAN))))
# The map's path as the including Makefile spells it.
MAP := $(CAIRN_MAP)
endif
$(BUILD)/%: MAP := $(MAP)
$(BUILD)/%: CAPTURE := $(CAPTURE)
$(BUILD)/%: POSES := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses,$(CAPTURE))
$(BUILD)/%: QUERIES := $(QUERIES)
$(BUILD)/%: NAME := $(NAME)
$(BUILD)/%: SEED := $(SEED)
$(BUILD)/%: FLOOR_PLAN := $(FLOOR_PLAN)
$(BUILD)/%: VOCABULARY_TREE := $(VOCABULARY_TREE)
$(BUILD)/%: PREVIOUS_MAP := $(PREVIOUS_MAP)
$(BUILD)/%: MODEL := $(MODEL)

# ---- The capture's files

# Poses, cameras and frame, read by the stages that know the capture.
CAPTURE_LISTS := $(wildcard $(addprefix $(CAPTURE)/,cameras.txt images.txt frame.json sessions.txt odometry.txt imu.csv))
ifneq ($(SESSIONS),)
# The files of the joined capture, whether they exist yet or not.
SESSIONS_WITHOUT_POSES := $(foreach session,$(SESSIONS),$(if $(wildcard $(lastword $(subst =, ,$(session)))/images.txt),,$(session)))
ODOMETRY := $(wildcard $(foreach session,$(SESSIONS_WITHOUT_POSES),$(lastword $(subst =, ,$(session)))/odometry.txt))
IMUS := $(foreach session,$(SESSIONS_WITHOUT_POSES),$(if $(wildcard $(lastword $(subst =, ,$(session)))/imu.csv),imu/$(firstword $(subst =, ,$(session))).csv))
CAPTURE_LISTS := $(addprefix $(CAPTURE)/,sessions.txt $(if $(ODOMETRY),odometry.txt) $(IMUS) \
    $(if $(filter yes,$(REGISTERED)),cameras.txt images.txt frame.json register.txt) \
    $(if $(filter yes,$(RECONSTRUCTED)),,cameras.txt images.txt frame.json $(if $(QUERIES),queries.txt)))
endif
# Of a capture some of whose sessions are registered to the others: what the registration reads.
POSED_LISTS := $(if $(filter yes,$(REGISTERED)),$(CAPTURE_LISTS) $(wildcard $(CAPTURE)/register.txt $(CAPTURE)/queries.txt $(CAPTURE)/poses/*.txt))
# The images of the last run and their folders, from the dependency file that extract-features writes: a new or a
# removed image changes its folder's date.
CAPTURE_IMAGES :=
-include $(BUILD)/images.d
# Features that the capture has of images: they stand for these, held-out ones, too.
GIVEN_FEATURES := $(wildcard $(CAPTURE)/features.db $(CAPTURE)/features/*.db)
# Held-out images that exist, with a backslash before each character that is special to Make.  Only regular files are
# read: a pipe would block.  Names with backslashes or control characters are left out, because no way of escaping them
# works everywhere in Make.
QUERY_LIST := $(shell for list in $(wildcard $(QUERIES) $(CAPTURE)/queries.txt); do \
    [ -f $$list ] && echo $$list && break; done)
QUERY_IMAGES := $(if $(QUERY_LIST),$(shell awk '/^\#/ || NF < 10 || $$10 ~ /^[-+.0-9eE]+$$/ {next} \
    {for (i = 1; i < 10; ++i) sub(/^[ \t]*[^ \t]+[ \t]+/, ""); sub(/[ \t\r]+$$/, ""); path = "$(CAPTURE)/images/" $$0} \
    path !~ /[\\[:cntrl:]]/ {print path}' $(QUERY_LIST) | \
    while IFS= read -r path; do [ -f "$$path" ] && printf '%s\n' "$$path"; done | sed 's/[ \t:;|*?[\#]/\\&/g'))

# ---- Stamps and dates

CAIRN_OUTPUT_FILES := $(addprefix $(BUILD)/,$(CAIRN_OUTPUTS))

.DELETE_ON_ERROR:
.PHONY: cairn-missing

# Files dated in the future, from a clock that was ahead, would hide later changes: they get the date of now, their stamps
# that of 1970.
CAIRN_FUTURE := $(shell find $(BUILD) -maxdepth 2 -type f -newermt '10 seconds' -print \
    \( -name '*.stamp' -exec touch -d @0 {} \; -o -exec touch {} \; \))
$(if $(CAIRN_FUTURE),$(warning $(words $(CAIRN_FUTURE)) files of $(BUILD) were dated in the future, $(firstword \
    $(CAIRN_FUTURE)) the first: is the clock right? What they belong to is made again))

# The default goal of `make -f map.mk`.
$(MAP): $(BUILD)/map.stamp ;

# Whether an output's date changed is known only after its stamp's rule has run.  An output whose last run gave the same
# bytes is older than its stamp; the '+' has Make compare its date again even with -n and -q.
UNCHANGED := $(shell for output in $(CAIRN_OUTPUT_FILES); do [ $$output.stamp -nt $$output ] && echo $$output; done)
$(filter-out $(UNCHANGED),$(CAIRN_OUTPUT_FILES)): %: %.stamp ;
$(UNCHANGED): %: %.stamp
	+@: # the same bytes as before
# A stamp without its output does not count.
$(foreach output,$(CAIRN_OUTPUT_FILES),$(if $(wildcard $(output)),,$(eval $(output).stamp: cairn-missing)))
$(if $(wildcard $(MAP)),,$(eval $(BUILD)/map.stamp: cairn-missing))

# ---- What a rule runs

# This file changes when the program's bytes change, whatever the program's date.
PROGRAM_HASH := $(BUILD)/options/program
# $(call CAIRN_OPTIONS,group_classes): the files, beside a stage's inputs, whose change runs the stage again.
CAIRN_OPTIONS = $(BUILD)/options/$(1).toml $(PROGRAM_HASH)
# For stages that draw random numbers.
SEED_FILE := $(BUILD)/options/seed

CAIRN_LAUNCH = $(if $(strip $(LAUNCH)),$(CAIRN_RULES)launch $@ $(LAUNCH))
CAIRN_COMMON = --seed $(SEED) --threads $(THREADS) $(addprefix --memory ,$(MEMORY)) --progress $(PROGRESS) --log-level $(LOG_LEVEL)
# The stage locks the build folder and writes X.report.json, then the stamp with the date at which it began; if it fails,
# error.json.
CAIRN_FLAGS = --stamp $@ $(CAIRN_COMMON)
CAIRN_NO_SPACE_CHECK = $(if $(filter no,$(SPACE_CHECK)),--no-space-check)
# $(call CAIRN_RUN,group_classes,COMMAND AND INPUTS): a recipe for X.stamp that prints why it runs, then makes X with the
# options of that name.
define CAIRN_RUN
$(CAIRN_WHY)
$(CAIRN_LAUNCH) $(CAIRN) $(2) --options $(@D)/options/$(1).toml -o $(@:.stamp=) $(CAIRN_FLAGS)
endef

# ---- What it says

# Which prerequisites of a rule changed: the first, and how many more.
CAIRN_CHANGED = $(patsubst $(@D)/%,%,$(patsubst $(CAPTURE)/%,%,$(filter-out cairn-missing $(SHARD_STAMPS),$?)))
CAIRN_REASON = $(if $(wildcard $@),$(if $(filter cairn-missing,$?),is missing,$(patsubst options/program,the \
    program,$(firstword $(CAIRN_CHANGED))) changed$(if $(word 2,$(CAIRN_CHANGED)),$(,) $(words $(wordlist \
    2,$(words $(CAIRN_CHANGED)),$(CAIRN_CHANGED))) more)),not made yet)
, := ,
CAIRN_RESULT = $(notdir $(if $(filter map.stamp,$(@F)),$(MAP),$(@:.stamp=)))
# An image's name may contain control sequences of terminals: their bytes are printed as '?'.
CAIRN_PRINTABLE = LC_ALL=C sed 's/[\x01-\x1f\x7f]\|\xc2[\x80-\x9f]\|\xe2\x80[\xaa-\xae]\|\xe2\x81[\xa6-\xa9]/?/g'
CAIRN_WHY = $(if $(filter none,$(PROGRESS)),,@printf '%s\n' '$(subst ','\'',$(if $(filter json,$(PROGRESS)),{"event": \
    "run"$(,) "file": "$(CAIRN_RESULT)"$(,) "reason": "$(subst ",\",$(subst \,\\,$(CAIRN_REASON)))"},$(CAIRN_RESULT): \
    $(CAIRN_REASON)))' | $(CAIRN_PRINTABLE) >&2)

# ---- Shards

# A plan says how many shards of a round have work, in X-ROUND-plan.db.shards: of a small survey fewer than SHARDS, or none
# ("0 last").
# Each of these computes its share of what earlier versions and earlier rounds lack and writes X-ROUND-IofN.db; the others
# are not launched.  A finished shard stays when others are killed.  Then the stage itself takes over all shards, computes
# what is missing and removes them, with those of an earlier SHARDS.  They are SECONDARY: a missing shard makes nothing out
# of date.
CAIRN_SHARD_NUMBERS := $(if $(filter-out 0 1,$(SHARDS)),$(shell seq $(SHARDS)))
# $(call CAIRN_PLAN,X,ROUND): of these numbers alone.
CAIRN_PLAN = $(BUILD)/$(1)-$(2)-plan-$(SHARDS)-$(SHARD_IMAGES)
# $(call CAIRN_SHARD_STAMPS,X,ROUNDS): those of plans, too.
CAIRN_SHARD_STAMPS = $(foreach round,$(2),$(CAIRN_SHARD_NUMBERS:%=$(BUILD)/$(1)-$(round)-%of$(SHARDS).stamp) \
    $(call CAIRN_PLAN,$(1),$(round)).stamp)
# What a round begins with.  $(call CAIRN_AFTER_ROUND,X,ROUND): no round is the inputs.
CAIRN_AFTER_ROUND = $(if $(2),$(call CAIRN_SHARD_STAMPS,$(1),$(2)),$(BUILD)/$(1).begun)
# $(call CAIRN_SHARD_RULE,X,ROUND,I,COMMAND,EARLIER ROUNDS): COMMAND is the name of a variable.  Here and where else a shell
# has more to do than to run a stage, "exec" puts the stage in the shell's place: who stops make stops the stage.
define CAIRN_SHARD_RULE
.SECONDARY: $(BUILD)/$(1)-$(2)-$(3)of$(SHARDS).stamp
$(BUILD)/$(1)-$(2)-$(3)of$(SHARDS).stamp: SHARD_ROUNDS_BEFORE := $(5)
$(BUILD)/$(1)-$(2)-$(3)of$(SHARDS).stamp: PROGRESS := $(if $(filter json,$(PROGRESS)),json,none)
$(BUILD)/$(1)-$(2)-$(3)of$(SHARDS).stamp: $(call CAIRN_PLAN,$(1),$(2)).stamp
	read -r n last < $(call CAIRN_PLAN,$(1),$(2)).db.shards; if [ $(3) -gt $$$$n ]; then exec touch $$@; fi; \
	    exec $$(CAIRN_LAUNCH) $$(CAIRN) $$($(4)) --shard $(3)/$$$$n $$(addprefix --reuse ,$$(wildcard $$(@D)/$(1).db)) \
	    $$(call CAIRN_REUSE_SHARDS,$(1)) $$(if $$(filter matches,$(1)),--planned $(call CAIRN_PLAN,$(1),$(2)).db) -o $$(@:.stamp=.db) $$(CAIRN_FLAGS)
endef
# $(call CAIRN_PLAN_RULE,X,ROUND,EARLIER ROUNDS)
define CAIRN_PLAN_RULE
.SECONDARY: $(call CAIRN_PLAN,$(1),$(2)).stamp
$(call CAIRN_PLAN,$(1),$(2)).stamp: SHARD_ROUNDS_BEFORE := $(3)
$(call CAIRN_PLAN,$(1),$(2)).stamp: PLAN_BEFORE := $(call CAIRN_PLAN,$(1),$(lastword 0 $(3))).db.shards
$(call CAIRN_PLAN,$(1),$(2)).stamp: $(call CAIRN_AFTER_ROUND,$(1),$(lastword $(3)))
endef
# Prerequisites of the first round: they remove shards of earlier inputs.
.SECONDARY: $(BUILD)/features.begun $(BUILD)/matches.begun
$(BUILD)/features.begun $(BUILD)/matches.begun:
	rm -f $(@:.begun=)-*of* $(@:.begun=)-*-plan*
	touch $@
# $(call CAIRN_REUSE_SHARDS,X): what the rounds before left.  The shell lists it: one word for it must not be too long.
CAIRN_REUSE_SHARDS = $(if $(SHARD_ROUNDS_BEFORE),$$(for shard in $(foreach round,$(SHARD_ROUNDS_BEFORE),$(@D)/$(1)-$(round)-*.db); \
    do [ ! -e $$shard ] || echo --reuse $$shard; done))
CAIRN_REMOVE_SHARDS = rm -f $(@:.db.stamp=).begun $(@:.db.stamp=)-*of* $(@:.db.stamp=)-*-plan*

# ---- The capture that map.mk makes: simulated, imported, or joined

CAPTURE_STAMP :=
# $(call CAIRN_OF,VARIABLE,NAME): the words that VARIABLE, NAME=WORD ..., has for what is called so.
CAIRN_OF = $(patsubst $(2)=%,%,$(filter $(2)=%,$($(1))))
# $(call CAIRN_MADE_LISTS,STAMP,LISTS): lists that the rule of STAMP writes, or may leave out.  Those whose contents stay
# the same keep their dates.
define CAIRN_MADE_LISTS
CAIRN_SAME := $(shell for list in $(2); do [ $(1) -nt $$list ] && echo $$list; done)
$$(filter-out $$(CAIRN_SAME),$(2)): $(1) ;
$$(CAIRN_SAME): $(1)
	+@: # the same bytes as before
endef
# $(call CAIRN_FOOTAGE,NAME): what the stamp of a film or bag depends on, and what its rule uses.
define CAIRN_FOOTAGE
$(BUILD)/$(1).stamp: $(call CAIRN_OF,FOOTAGE_FILES,$(1)) $(if $(wildcard $(BUILD)/$(1)/images),,cairn-missing)
$(BUILD)/$(1).stamp: SOURCE := $(call CAIRN_OF,FOOTAGE,$(1))
$(BUILD)/$(1).stamp: IMPORT_OPTIONS := $(call CAIRN_OF,FOOTAGE_OPTIONS,$(1))
$(call CAIRN_MADE_LISTS,$(BUILD)/$(1).stamp,$(wildcard $(BUILD)/$(1)/cameras.txt $(BUILD)/$(1)/odometry.txt $(BUILD)/$(1)/imu.csv))
endef
FOOTAGE_NAMES := $(foreach source,$(FOOTAGE),$(firstword $(subst =, ,$(source))))
FOOTAGE_STAMPS := $(FOOTAGE_NAMES:%=$(BUILD)/%.stamp)
$(foreach name,$(FOOTAGE_NAMES),$(eval $(call CAIRN_FOOTAGE,$(name))))
ifeq ($(SESSIONS),)
CAPTURE_STAMP := $(FOOTAGE_STAMPS)
endif
ifeq ($(SIMULATED),yes)
CAPTURE_STAMP := $(BUILD)/capture.stamp
$(if $(wildcard $(CAPTURE)/images.txt),,$(eval $(BUILD)/capture.stamp: cairn-missing))
endif
ifneq ($(SESSIONS),)
$(if $(filter-out $(wildcard $(CAPTURE_LISTS)),$(CAPTURE_LISTS)),$(eval $(BUILD)/capture.stamp: cairn-missing))
$(eval $(call CAIRN_MADE_LISTS,$(BUILD)/capture.stamp,$(CAPTURE_LISTS)))
SESSION_FOLDERS := $(foreach session,$(SESSIONS),$(lastword $(subst =, ,$(session))))
SESSION_LISTS := $(wildcard $(foreach list,cameras.txt images.txt queries.txt frame.json odometry.txt imu.csv features.db,$(SESSION_FOLDERS:%=%/$(list)))) \
    $(foreach session,$(SESSION_QUERIES),$(lastword $(subst =, ,$(session))))
$(BUILD)/capture.stamp: $(FOOTAGE_STAMPS)
$(BUILD)/capture.stamp: SESSIONS := $(SESSIONS) $(addprefix --queries ,$(SESSION_QUERIES)) $(addprefix --register ,$(SESSIONS_REGISTERED))
endif
# Where the stages after matching read poses.
POSES_READY := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses,$(CAPTURE_STAMP) $(CAPTURE_LISTS))
$(BUILD)/%: FRAME := $(if $(filter yes,$(RECONSTRUCTED)),$(BUILD)/poses/frame.json,$(filter %/frame.json,$(CAPTURE_LISTS)))
SESSION_LIST := $(filter %/sessions.txt,$(CAPTURE_LISTS))
$(BUILD)/%: SESSION_LIST := $(SESSION_LIST)
