# From a folder of raw light-field frames to velocity fields, their mean, and a page that shows the run. Copy this file,
# set the first part, and run
#
#     make -f pipeline.mk               make all that is missing or older than its input
#     make -f pipeline.mk -n            print what would be run
#     make -f pipeline.mk -j4 THREADS=1 process several frames at once, one thread each
#     make -f pipeline.mk -j200 RUN='srun -n1 -c4' THREADS=4      the same on Slurm, each line a step of its own
#
# One line below makes each file, whole or not at all, so that a stopped run resumes where it ended. A frame that cannot
# be read fails alone: the others go on, the mean is that of the fields that exist, and the end names what failed. make
# does not watch the settings: after changing one, choose another OUT or delete what it made. Names may hold no space,
# and a folder may hold some two thousand frames (the longest line of a shell). Needs GNU make 4.0 or later.

# The frames (TIFF, EXR or PNG): one name with % for the part that differs.
FRAME = raw/%.tif

# If a file holds several frames (a TIFF of many pages): the pairs of pages to correlate, counted from 0. 0-1: each file
# is a double frame; 0-1 2-3: two of them. pairs: 0-1 2-3 4-5 and so on, series: 0-1 1-2 2-3, to each file's last page.
# Then a frame's differing part is that of its file, a dot, and the page: 0007.0 is page 0 of raw/0007.tif.
PAGES =

# The channel of colour images, if their channels differ: r, g, b or luma.
CHANNEL =

# The pairs to correlate: two of those parts with one '-' between them. By default a pair is two frames whose parts
# differ only in their end, FIRST and SECOND: raw/0001a.tif and raw/0001b.tif. With PAGES they are those of every file.
FIRST = a
SECOND = b
PAIRS = $(if $(PAGES),$(paged),$(foreach stem,$(stems),$(stem)$(FIRST)-$(stem)$(SECOND)))

# The camera by its data sheets, and one or more white images taken with it. Without any, NOMINAL counts as calibrated.
# Words for lf-calib lattice: a dark image, and the flat field that it makes: --dark dark.exr --vignetting flat.exr
NOMINAL = nominal.json
WHITE = white.exr
WHITE_FLAGS =

# Two or more dark images (the cap on the lens): with two or more white images they show the sensor's noise, so that
# lf-fit does not take a wrong model for noise. Without them the noise is found from each frame.
DARKS =

# A dot target: its folder or images, and what lf-calib needs to know of it: --spacing 1.1 with --depths -4,-2,2,4, with
# a table --depths depths.csv (columns file,depth_mm), or with the depths in the images' names (dots_z-2.70.tif).
# Without a target, the main lens is that of the data sheets.
DOTS =
DOTS_FLAGS =

# Whether particles correct what the calibration left wrong. auto: if the fit of the first frame says that the camera is
# off, all frames begin with the camera that this fit corrected. Frames, by their differing parts: lf-calib refine takes
# them all; ten are enough. Nothing: each frame corrects its own camera.
REFINE = auto

# The background to subtract from every frame: an image, 'auto' for a low quantile of all frames, 'haze' for the light
# in each frame that is as smooth as WHITE (a microscope whose whole volume is lit), or nothing. With auto, FIRST and
# SECOND frames, which two lasers may light, have one each, and so have the first and the second pages of double frames.
# A % in the image's name stands for the FIRST or the SECOND of its frame (for pages: first or second), as in
# background%.tif.
BACKGROUND = auto
QUANTILE = 0.05

# An image of the frames' size that is 0 where walls and reflections hide the particles, or nothing. Take 0 where a
# background of the run is brighter than particles, and for a lenslet about that.
MASK =

# The volume: pixels per voxel, depth and sides in mm. Without pixels per voxel: 4,4,r for lf-fit, otherwise by the
# preset and the camera's depth resolution r. Without sides: what the sensor sees.
PVR =
DEPTH = -5,5
BOUNDS =

# Speed against accuracy: fast, balanced, accurate (--help of lf-prune and lf-mart), or nothing for the defaults. The
# settings below override it.
PRESET =
THRESHOLD =
ITERATIONS =
PRUNE_FLAGS =
MART_FLAGS =

# FIT: lf-fit finds the particles of every frame and draws them as a volume. Those found in both frames of a pair decide
# the vectors. 0: lf-mart reconstructs the volumes, and their correlation alone decides. With another program as MART,
# its volumes are correlated, and lf-fit begins at them.
FIT = 1
FIT_FLAGS =

# FLOW: if set, lf-flow treats every field before the mean: solenoidal (the flow is incompressible: continuity corrects
# w), or smooth. The fields as measured stay beside them.
FLOW =
FLOW_FLAGS =

# Interrogation windows of the first and the last pass, mm. Without WINDOW_MM, windows hold about ten of the particles
# found in the first pair that can be reconstructed; OUT/windows.txt keeps them for all pairs. DT: seconds between the
# frames of a pair, if known.
INITIAL_MM =
WINDOW_MM =
DT =
XCORR_FLAGS =

# The slice of the mean that is drawn.
SLICE = z

# OUT: where results go. BIN: where the tools are, with a '/' at the end; empty: on the PATH. THREADS: threads of each
# tool; 0: all cores. TIDY: if set, delete a support once its volume exists; then only one make may run in a folder at a
# time.
OUT = .
BIN =
THREADS = 0
TIDY =

# The stages: any program that takes the same arguments (scripts/README.md, "A stage of your own").
CALIB = $(BIN)lf-calib
PRUNE = $(BIN)lf-prune
MART = $(BIN)lf-mart
FITTER = $(BIN)lf-fit
XCORR = $(BIN)lf-xcorr
TREAT = $(BIN)lf-flow

# RUN: what every recipe line begins with, which sends it to a machine. TRIES: how often one call of make tries a stage.
# ESTIMATE: if set, a stage makes nothing and prints the memory that it would take.
RUN =
TRIES = 1
ESTIMATE =

# Nothing below needs to change.

SHELL = /bin/sh
.SUFFIXES:
.DELETE_ON_ERROR:
.SECONDEXPANSION:

spaced := $(shell for file in $(subst %,*,$(FRAME)); do case "$$file" in (*' '*) echo "$$file"; break; esac; done)
$(if $(spaced),$(error FRAME: '$(spaced)' holds a space; rename such frames))

# The frames that exist, and the parts of their names before FIRST or SECOND.
found := $(sort $(patsubst $(FRAME),%,$(wildcard $(subst %,*,$(FRAME)))))
ends = $(patsubst %$1,%,$(filter %$1,$(found)))
stems := $(sort $(call ends,$(FIRST)) $(call ends,$(SECOND)))
split = $(subst -, ,$1)

# With PAGES: the pages of a file, its pairs, the file and the page of a frame, and the frame as the tools name it.
pages-in = $(shell $(BIN)lf-validate info -q '$(patsubst %,$(FRAME),$1)' 2> /dev/null | \
    sed -n 's/^ *pages  *\([0-9 ]*\),.*/\1/p' | tr -d ' ')
last-page = $(shell expr $(or $(call pages-in,$1),1) - 1)
counted = $(shell n=0; while [ $$n -lt $(call last-page,$2) ]; do echo $$n-$$((n + 1)); n=$$((n + $1)); done)
step-of = $(patsubst pairs,2,$(patsubst series,1,$(PAGES)))
pages-of = $(if $(filter pairs series,$(PAGES)),$(call counted,$(step-of),$1),$(PAGES))
paged = $(foreach file,$(found),$(foreach pair,$(call pages-of,$(file)),$(file).$(subst -,-$(file).,$(pair))))
page-of = $(patsubst .%,%,$(suffix $1))
file-of = $(patsubst %,$(FRAME),$(if $(PAGES),$(basename $1),$1))
frame-of = $(call file-of,$1)$(if $(PAGES),:$(page-of))
shown = $(subst %,*$1,$(FRAME))
none = $(if $(PAGES),pages ($(PAGES)) in $(shown),frames $(call shown,$(FIRST)) and $(call shown,$(SECOND)))

pairs := $(PAIRS)
$(if $(pairs),,$(error PAIRS: no pair of $(none)))
$(foreach pair,$(pairs),$(if $(filter 2,$(words $(call split,$(pair)))),,$(error PAIRS: '$(pair)' is not A-B)))
names := $(sort $(call split,$(pairs)))
$(if $(filter-out 0 1,$(words $(FLOW)))$(filter-out solenoidal smooth,$(FLOW)),$(error FLOW: '$(FLOW)'; wanted solenoidal or smooth))

CAMERA = $(OUT)/camera.json
LOG = $(OUT)/log
supports := $(names:%=$(OUT)/support-%.lfv)
volumes := $(names:%=$(OUT)/volume-%.lfv)
fits := $(filter-out 0,$(FIT))
# Whether lf-fit draws the volumes; otherwise it reads them, and makes a table of each.
draws := $(if $(fits),$(filter lf-mart,$(notdir $(MART))))
fitted := $(if $(draws),,$(if $(fits),$(names:%=$(OUT)/particles-%.csv)))
fields := $(pairs:%=$(OUT)/field-%.exr)
flows := $(if $(FLOW),$(pairs:%=$(OUT)/flow-%.exr))
results := $(or $(flows),$(fields))

.PHONY: all calibrate prune reconstruct fit windows correlate fields flows report list
.SECONDARY: $(supports) $(volumes) $(fitted)

# The file of the windows, unless they are set.
WINDOWS = $(if $(WINDOW_MM)$(filter --window% --pass%,$(XCORR_FLAGS)),,$(OUT)/windows.txt)

# First as many fields as possible; then the mean of those that exist, and a list of the missing ones.
dry = $(findstring n,$(firstword -$(MAKEFLAGS)))
again := $(MAKE) -f $(lastword $(MAKEFILE_LIST)) --no-print-directory
all:
	+@n=0; status=1; while [ $$status != 0 ] && [ $$n -lt $(TRIES) ]; do \
	    $(if $(auto),$(if $(dry),,$(again) -s calibrate &&)) $(again) -k correlate && status=0; n=$$((n + 1)); \
	done; $(if $(dry),,$(again) report &&) exit $$status

calibrate: $(CAMERA)
prune: $(supports)
reconstruct: $(volumes)
fit: $(or $(fitted),$(if $(fits),$(volumes)))
fields: $(fields)
flows: $(results)
ifeq ($(WINDOWS),)
correlate: flows
else
correlate:
	+@$(again) windows; $(again) flows
endif

$(LOG):
	mkdir -p $@

# The report takes the fields as they are and does not look at their frames.
ifneq ($(MAKECMDGOALS),report)

# A log keeps what a stage prints. When a stage fails, its old result is deleted, because it is older than its input,
# and so are the results made from it, $2. $3 is the option that names the result, if it is not -o.
log = $(LOG)/$(basename $(notdir $@)).txt
say = @printf '%s\n' '$(subst ','\'',$(strip $(RUN) $1))'
step = $(if $(ESTIMATE),@$(RUN) $1 --threads $(THREADS) --quiet --estimate,$(made))
made = $(call say,$1 $(or $3,-o) $@); \
    $(RUN) $1 --threads $(THREADS) --stats $(basename $@).stats.json $(or $3,-o) $@ 2> $(log); status=$$?; cat $(log) >&2; \
    [ $$status = 0 ] && echo $@ >> $(LOG)/done.txt || { rm -f $@ $2; exit 2; }

# Calibration: the lattice by white images, the main lens by a dot target, the noise by dark images, drift by particles.
# Each step starts from the camera of the step before.
lattice := $(if $(WHITE),$(OUT)/camera-lattice.json,$(NOMINAL))
lens := $(if $(DOTS),$(OUT)/camera-volume.json,$(lattice))
$(if $(DARKS),$(if $(WHITE),,$(error DARKS: the noise needs WHITE images too)))
steady := $(if $(DARKS),$(OUT)/camera-noise.json,$(lens))
refining := $(filter-out auto,$(REFINE))
drift := $(if $(refining),$(OUT)/camera-refine.json,$(steady))
each = $(foreach name,$2,$(call $1,$(name)))
colour = $(addprefix --channel ,$(CHANNEL))

$(OUT)/camera-lattice.json: $(WHITE) $(NOMINAL) | $(LOG)
	$(call step,$(CALIB) lattice $(WHITE) $(WHITE_FLAGS) -c $(NOMINAL) $(colour))

targets := $(wildcard $(DOTS) $(DOTS:%=%/*))
$(OUT)/camera-volume.json: $(lattice) $(targets) | $(LOG)
	$(call step,$(CALIB) volume $(DOTS) $(DOTS_FLAGS) -c $< $(colour))

$(OUT)/camera-noise.json: $(lens) $(DARKS) | $(LOG)
	$(call step,$(CALIB) noise $(WHITE) $(addprefix --dark ,$(DARKS)) -c $< $(colour))

drifting = $(call each,file-of,$(refining)) $(call each,background-of,$(refining)) $(MASK)
shown = $1 -c $(steady) $(call subtract,$*) $(hidden) $(colour)
evidence := $(refining:%=$(OUT)/evidence-%.json)
$(refining:%=$(OUT)/evidence-support-%.lfv): $(OUT)/evidence-support-%.lfv: $(steady) $$(drifting) | $(LOG)
	$(call step,$(BIN)lf-prune $(call shown,$(call frame-of,$*)) --pvr $(coarse) --depth $(DEPTH))

$(evidence): $(OUT)/evidence-%.json: $(OUT)/evidence-support-%.lfv $(steady) | $(LOG)
	$(call step,$(BIN)lf-fit $< $(call shown,-i $(call frame-of,$*)) --particles $(OUT)/evidence-$*.csv,,--evidence)

$(OUT)/camera-refine.json: $(steady) $(evidence) | $(LOG)
	$(call step,$(CALIB) refine $(evidence) -c $<)

# With auto: fit the first frame that can be fitted. As long as lf-fit says that it corrected the camera, that camera
# replaces this one, and the frame is fitted again.
auto = $(if $(fits),$(filter auto,$(REFINE)))
corrected = $(OUT)/camera-corrected.json
first-fit = $(again) -s FITS_CAMERA=$$name $(OUT)/$(fits-made)-$$name.$(if $(fitted),csv,lfv)
fits-made = $(if $(fitted),particles,volume)
fits-said = s/; write the camera with --camera-out, and begin again with it/; all frames begin with that camera/p
$(CAMERA): $(drift) | $(LOG)
	$(if $(dry),,+@cp $< $@.$$$$ && mv $@.$$$$ $@$(if $(auto),$(if $(ESTIMATE),,; for name in $(wordlist 1,3,$(names)); do \
	    $(first-fit) || continue; \
	    for pass in 1 2 3; do \
	        by=$$(sed -n '$(fits-said)' $(LOG)/$(fits-made)-$$name.txt); [ -n "$$by" ] || break; \
	        echo "$$by" | tee -a $(LOG)/camera.txt >&2; \
	        cp $(corrected) $@.$$$$ && mv $@.$$$$ $@ && $(first-fit); \
	    done; break; \
	done)))

# The background is made once, from the frames that exist at that time; delete it to have it made anew. It leaves out
# frames that cannot be read.
firsts = $(sort $(foreach pair,$(pairs),$(firstword $(call split,$(pair)))))
seconds = $(sort $(foreach pair,$(pairs),$(lastword $(call split,$(pair)))))
series = $(filter $(firsts),$(seconds))
page-kind = $(if $(series),all,$(if $(filter $1,$(firsts)),first,$(if $(filter $1,$(seconds)),second,all)))
end-kind = $(if $(filter %$(FIRST),$1),$(FIRST),$(if $(filter %$(SECOND),$1),$(SECOND),all))
hazy = $(filter haze,$(BACKGROUND))
kind = $(if $(hazy),$1,$(if $(PAGES),$(page-kind),$(end-kind)))
paged-of = $(call each,frame-of,$(if $(filter first,$1),$(firsts),$(if $(filter second,$1),$(seconds),$(names))))
like = $(wildcard $(subst %,*$(filter-out all,$1),$(FRAME)))
frames-of = $(if $(hazy),$(call frame-of,$1),$(if $(PAGES),$(paged-of),$(like)))
background-of = $(if $(filter auto haze,$(BACKGROUND)),$(OUT)/background-$(call kind,$1).exr,$(subst %,$(call kind,$1),$(BACKGROUND)))
subtract = $(addprefix -b ,$(call background-of,$1))

$(if $(hazy),$(if $(WHITE),,$(error BACKGROUND: haze needs a WHITE image)))
lowest = $(if $(hazy),--haze $(firstword $(WHITE)),--quantile $(QUANTILE))
$(OUT)/background-%.exr: $(NOMINAL) $(if $(hazy),$$(call file-of,$$*)) | $(LOG)
	$(call step,$(CALIB) background $(call frames-of,$*) -c $< $(lowest) $(colour))

# One line per stage. Only our own lf-prune and lf-mart know presets, and lf-mart a log of its sweeps; a swapped stage
# does not get the options.
flow-of = $(if $(FLOW),$(OUT)/flow-$1.exr)
given = $(call file-of,$1) $(CAMERA) $(call background-of,$1) $(MASK)
hidden = $(addprefix --mask ,$(MASK))
# lf-fit finds no more particles on finer voxels. A swapped stage does not get this either.
coarse = 4,4,r
is-fitted = $(if $(draws),$(filter lf-prune,$(notdir $(firstword $(PRUNE)))))
voxels = $(or $(PVR),$(if $(PRESET),,$(if $(is-fitted),$(coarse))))
fields-of = $(foreach pair,$(pairs),$(if $(filter $1,$(call split,$(pair))),$(OUT)/field-$(pair).exr $(call flow-of,$(pair))))
preset = $(if $(filter lf-prune lf-mart,$(notdir $(firstword $1))),$(addprefix --preset ,$(PRESET)))
sweeps = $(if $(filter lf-mart,$(notdir $(firstword $(MART)))),--log $(OUT)/volume-$1.sweeps.jsonl)

$(supports): $(OUT)/support-%.lfv: $$(call given,$$*) | $(LOG)
	$(call step,$(PRUNE) $(call frame-of,$*) -c $(CAMERA) $(call subtract,$*) $(hidden) $(colour) $(addprefix --pvr ,$(voxels)) --depth $(DEPTH) \
	    $(addprefix --bounds ,$(BOUNDS)) $(call preset,$(PRUNE)) $(addprefix --threshold ,$(THRESHOLD)) $(PRUNE_FLAGS),\
	    $(OUT)/volume-$*.lfv $(call fields-of,$*))

# lf-fit writes its table, --particles, before the volume.
fitting = $(FITTER) $< -i $(call frame-of,$1) -c $(CAMERA) $(call subtract,$1) $(hidden) $(colour) \
    $(if $(filter $(FITS_CAMERA),$1),--camera-out $(corrected)) $(FIT_FLAGS)
table-of = $(OUT)/particles-$1.csv
$(volumes): $(OUT)/volume-%.lfv: $(OUT)/support-%.lfv $$(call given,$$*) | $(LOG)
ifneq ($(draws),)
	$(call step,$(call fitting,$*) --particles $(call table-of,$*),$(call table-of,$*) $(call fields-of,$*))
else
	$(call step,$(MART) $< -i $(call frame-of,$*) -c $(CAMERA) $(call subtract,$*) $(hidden) $(colour) $(call preset,$(MART)) \
	    $(addprefix --iterations ,$(ITERATIONS)) $(call sweeps,$*) $(MART_FLAGS),$(call fields-of,$*))
endif
	$(if $(TIDY),@rm -f $<)

volumes-of = $(foreach name,$(call split,$1),$(OUT)/volume-$(name).lfv)
tables-of = $(if $(fits),$(call each,table-of,$(call split,$1)))
fitted-of = $(filter $(fitted),$(call tables-of,$1))

$(fitted): $(OUT)/particles-%.csv: $(OUT)/volume-%.lfv $$(call given,$$*) | $(LOG)
	$(call step,$(call fitting,$*),$(call fields-of,$*),--particles)

# The fields of all pairs need the same windows to be averaged, so the first pair that can be reconstructed decides.
estimate = $(RUN) $(BIN)lf-xcorr $$volumes $(XCORR_FLAGS) --threads $(THREADS) --estimate
windows:
	+@$(if $(dry),,for pair in $(pairs); do \
	    [ ! -e $(WINDOWS) ] || break; \
	    volumes="$(OUT)/volume-$${pair%-*}.lfv $(OUT)/volume-$${pair#*-}.lfv"; \
	    $(again) -s $$volumes && sides=$$($(estimate)) && sides=$${sides#*\"window_mm\":[} && \
	        echo "--window-mm $${sides%%]*}" > $(WINDOWS).$$$$ && mv $(WINDOWS).$$$$ $(WINDOWS); \
	done; [ -e $(WINDOWS) ])

$(fields): $(OUT)/field-%.exr: $$(call volumes-of,$$*) $$(call fitted-of,$$*) | $(LOG)
	$(call step,$(XCORR) $(call volumes-of,$*) $(if $(fits),--particles $(call tables-of,$*)) $(addprefix --initial-mm ,$(INITIAL_MM)) \
	    $(if $(WINDOWS),$$(cat $(WINDOWS)),$(addprefix --window-mm ,$(WINDOW_MM))) $(addprefix --dt ,$(DT)) \
	    $(XCORR_FLAGS) --plot $(@:.exr=.svg),$(call flow-of,$*))

$(flows): $(OUT)/flow-%.exr: $(OUT)/field-%.exr | $(LOG)
	$(call step,$(TREAT) $(FLOW) $< $(FLOW_FLAGS))

# The stages as a list for other programs (scripts/Snakefile): stage, what it makes, what it makes that from. The
# windows are those of the first pair.
first-pair = $(firstword $(pairs))
list:
	$(info calibrate $(CAMERA) $(NOMINAL) $(WHITE) $(targets) $(DARKS) $(if $(refining),$(drifting)))
	$(foreach file,$(filter $(OUT)/background-%,$(sort $(call each,background-of,$(names)))),$(info background $(file) $(NOMINAL)))
	$(foreach name,$(names),$(info prune $(OUT)/support-$(name).lfv $(call given,$(name))))
	$(foreach name,$(names),$(info volume $(OUT)/volume-$(name).lfv $(OUT)/support-$(name).lfv $(call given,$(name))))
	$(if $(fitted),$(foreach name,$(names),$(info fit $(OUT)/particles-$(name).csv $(OUT)/volume-$(name).lfv $(call given,$(name)))))
	$(if $(WINDOWS),$(info windows $(WINDOWS) $(call volumes-of,$(first-pair))))
	$(foreach pair,$(pairs),$(info xcorr $(OUT)/field-$(pair).exr $(call volumes-of,$(pair)) $(call fitted-of,$(pair)) $(WINDOWS)))
	$(if $(FLOW),$(foreach pair,$(pairs),$(info flow $(OUT)/flow-$(pair).exr $(OUT)/field-$(pair).exr)))
	$(info mean $(OUT)/report.html $(results))
	@:

endif

# The list of the fields changes only when the set of fields does.
there := $(wildcard $(results))
missing := $(filter-out $(there),$(results))

$(OUT)/fields.txt: FORCE | $(LOG)
	@printf '%s\n' $(there) > $@.$$$$; cmp -s $@.$$$$ $@ && rm $@.$$$$ || mv $@.$$$$ $@
FORCE:

means := $(addprefix $(OUT)/mean.,exr vti svg json)
mean = $(BIN)lf-validate ensemble $(there) --slice $(SLICE) --plot $(OUT)/mean.svg -o $(OUT)/mean.vti -o $@
$(OUT)/mean.exr: $(OUT)/fields.txt $(there)
	@printf '%s\n' '$(strip $(RUN) $(BIN)lf-validate ensemble) ($(words $(there)) fields) -o $@'
	@part=$(OUT)/mean.json.$$$$; $(RUN) $(mean) > $$part && mv $$part $(OUT)/mean.json || { rm -f $$part $(means); exit 2; }

# The page that shows the run: everything that exists by now, and the warnings of all logs.
page = $(RUN) $(BIN)lf-validate report $(OUT) -o $(OUT)/report.html --frame $(call frame-of,$(firstword $(names))) \
    $(addprefix --white ,$(firstword $(WHITE)))

# For each pair without a field, print the last line that its first failed stage printed.
report: $(if $(there),$(OUT)/mean.exr) | $(LOG)
	$(if $(there),,@rm -f $(means) $(OUT)/fields.txt)
	$(file >$(LOG)/missing.txt,$(patsubst $(OUT)/field-%.exr,%,$(missing:$(OUT)/flow-%=$(OUT)/field-%)))
	@rm -f $(OUT)/report.html; page=; status=0; \
	$(page) && page="; $(OUT)/report.html shows the run" || status=2; \
	last() { tail -n 1 $(LOG)/$$1.txt 2> /dev/null; }; \
	for pair in $$(cat $(LOG)/missing.txt); do why=; \
	    [ -e $(CAMERA) ] || why="no $(CAMERA); see above"; \
	    for n in $${pair%-*} $${pair#*-}; do \
	        [ -z "$$why" ] && [ ! -e $(OUT)/volume-$$n.lfv ] || continue; \
	        file=$$n; $(if $(PAGES),file=$${n%.*};) frame=$$(echo '$(FRAME)' | sed "s|%|$$file|"); \
	        if [ ! -e $$frame ]; then why="$$frame: no such file"; \
	        elif [ ! -e $(OUT)/support-$$n.lfv ]; then why=$$(last support-$$n); \
	        else why=$$(last volume-$$n); fi; \
	    done; \
	    $(if $(fitted),for n in $${pair%-*} $${pair#*-}; do \
	        [ -n "$$why" ] || [ -e $(OUT)/particles-$$n.csv ] || why=$$(last particles-$$n); \
	    done;) \
	    [ -n "$$why" ] || [ -e $(OUT)/field-$$pair.exr ] || why=$$(last field-$$pair); \
	    $(if $(FLOW),[ -n "$$why" ] || why=$$(last flow-$$pair);) \
	    echo "no field $$pair: $${why:-not started; see above}" >&2; \
	done; echo "$(words $(there)) of $(words $(results)) fields are in $(OUT)$$page" >&2; exit $$status
