# From raw light-field images to velocity fields. Copy this file, set the first part, and run
#
#     make -f pipeline.mk               every stage that is missing or older than its input
#     make -f pipeline.mk -n            what would be run
#     make -f pipeline.mk -j4 THREADS=1 several frames at once, one thread each
#
# Each file is made by one line below and appears whole or not at all, so a run that was stopped is taken up where it
# ended. Settings are no prerequisites: after changing one, choose another OUT or delete what it made.
# No name may hold a space. GNU make 3.82 or later.

# The camera by its data sheets, and one or more white images taken with it.
NOMINAL = nominal.json
WHITE = white.exr

# The frames (EXR, TIFF or PNG), % for the part of the name that differs, and the pairs to correlate: the two
# differing parts with one '-' between them.
FRAME = frame-%.exr
PAIRS = 0000-0001

# An image to subtract from every frame, or nothing. `lf-calib background` makes one from many frames.
BACKGROUND =

# The volume: pixels per voxel, depth and sides in mm (no sides: what the sensor sees).
PVR = 1,1,10
DEPTH = -5,5
BOUNDS =

# Pruning (auto: found from each frame) and reconstruction (sweeps, at most); --help of the tools says what else can
# stand in the FLAGS.
THRESHOLD = auto
ITERATIONS = 60
PRUNE_FLAGS =
MART_FLAGS =

# Interrogation windows of the first and the last pass, voxels.
INITIAL = 320,320,32
WINDOW = 160,160,16
OVERLAP = 0.75
XCORR_FLAGS =

# Where results go, where the tools are (empty: on the PATH; otherwise with a '/' at the end), and threads per tool
# (0: all cores).
OUT = .
BIN =
THREADS = 0

# Nothing below needs to change.

SHELL = /bin/sh
.SUFFIXES:
.DELETE_ON_ERROR:
.SECONDEXPANSION:

CAMERA = $(OUT)/camera.json
split = $(subst -, ,$1)
$(foreach pair,$(PAIRS),$(if $(filter 2,$(words $(call split,$(pair)))),,$(error PAIRS: '$(pair)' is not A-B)))
names := $(sort $(call split,$(PAIRS)))
supports := $(names:%=$(OUT)/support-%.lfv)
volumes := $(names:%=$(OUT)/volume-%.lfv)
fields := $(PAIRS:%=$(OUT)/field-%.exr)
pictures := $(fields:.exr=.svg)

# What every stage writes beside its result: seconds, peak memory and counts.
common = --threads $(THREADS) --stats $(basename $1).stats.json
background = $(if $(BACKGROUND),-b $(BACKGROUND))

.PHONY: all calibrate prune reconstruct correlate
all: correlate
calibrate: $(CAMERA)
prune: $(supports)
reconstruct: $(volumes)
correlate: $(fields) $(pictures)

$(OUT):
	mkdir -p $@

$(CAMERA): $(WHITE) $(NOMINAL) | $(OUT)
	$(BIN)lf-calib lattice $(WHITE) -c $(NOMINAL) $(call common,$@) -o $@

$(supports): $(OUT)/support-%.lfv: $(FRAME) $(CAMERA) $(BACKGROUND) | $(OUT)
	$(BIN)lf-prune $< -c $(CAMERA) $(background) --pvr $(PVR) --depth $(DEPTH) $(if $(BOUNDS),--bounds $(BOUNDS)) \
	    --threshold $(THRESHOLD) $(PRUNE_FLAGS) $(call common,$@) -o $@

$(volumes): $(OUT)/volume-%.lfv: $(OUT)/support-%.lfv $(FRAME) $(CAMERA) $(BACKGROUND)
	$(BIN)lf-mart $< -i $(word 2,$^) -c $(CAMERA) $(background) --iterations $(ITERATIONS) \
	    $(MART_FLAGS) $(call common,$@) -o $@

# One run writes a field and its picture. The field is the target; the picture follows it, and is drawn anew by
# another run only where somebody deleted it.
volumes-of = $(patsubst %,$(OUT)/volume-%.lfv,$(call split,$1))
lf-xcorr = $(BIN)lf-xcorr $(call volumes-of,$1) --initial $(INITIAL) --window $(WINDOW) --overlap $(OVERLAP) \
    $(XCORR_FLAGS) --plot $(OUT)/field-$1.svg $(call common,$(OUT)/field-$1.exr) -o $(OUT)/field-$1.exr

$(fields): $(OUT)/field-%.exr: $$(call volumes-of,$$*)
	$(call lf-xcorr,$*)

$(pictures): $(OUT)/field-%.svg: $(OUT)/field-%.exr
	@test -e $@ || $(call lf-xcorr,$*)
	@touch $@
