# Maps of one survey that differ in what they keep, from a build folder that `cairn compile` has filled:
#   make -f maps/variants.mk BUILD=maps/demo.build CAIRN=build/release/cairn CAPTURE=... [FOREIGN="folder..."]
# VARIANTS/NAME.cairn for default (as compiled), all (every class), k10 and k40 (classes of regions with 10 and 40 common ones), and
# VARIANTS/NAME.json with what check-map says of it: held-out images of CAPTURE, and images of other places in FOREIGN.

OUT := $(BUILD)/variants
.DELETE_ON_ERROR:
.SECONDARY:
# The same recipe as the map's own, but for k.
REGIONS := --options $(BUILD)/options/decompose_regions.toml

all: $(OUT)/default.json $(OUT)/all.json $(OUT)/k10.json $(OUT)/k40.json

$(OUT):
	mkdir -p $@

$(OUT)/regions%.db: $(BUILD)/world.db $(BUILD)/options/decompose_regions.toml $(CAIRN) | $(OUT)
	$(CAIRN) stage decompose-regions $< --classes $(BUILD)/classes.db $(REGIONS) --k $* -o $@ --log-level error > /dev/null
	touch $@

MAP_INPUTS := $(BUILD)/classes.db $(BUILD)/vocabulary.db

$(OUT)/default.cairn: $(BUILD:.build=.cairn) | $(OUT)
	cp $< $@

$(OUT)/all.cairn: $(OUT)/regions40.db $(MAP_INPUTS)
	$(CAIRN) stage emit-map --classes $(BUILD)/classes.db --world $(BUILD)/world.db --vocabulary $(BUILD)/vocabulary.db \
	    --regions $< --name all --landmarks all -o $@ > /dev/null
	touch $@

$(OUT)/k%.cairn: $(OUT)/regions%.db $(MAP_INPUTS)
	$(CAIRN) stage emit-map --classes $(BUILD)/classes.db --world $(BUILD)/world.db --vocabulary $(BUILD)/vocabulary.db \
	    --regions $< --name k$* --landmarks regions -o $@ > /dev/null
	touch $@

$(OUT)/%.json: $(OUT)/%.cairn $(CAPTURE)/queries.txt
	$(CAIRN) check $< --capture $(CAPTURE) --queries $(CAPTURE)/queries.txt $(addprefix --foreign ,$(FOREIGN)) --json > $@
