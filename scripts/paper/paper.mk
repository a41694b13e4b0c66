# The paper's figures and claims, measured with these tools: S. Shi, J. Ding, T. H. New & J. Soria, Exp. Fluids
# (2017). Run it from the root of the repository, with the tools on the PATH or BIN=target/release/:
#
#     make -j2 -f scripts/paper/paper.mk burn         make all that is missing (small: half an hour on two cores)
#     make -f scripts/paper/paper.mk fig8             make one figure: fig4 to fig15, fig17; trade
#     make -f scripts/paper/paper.mk view             list the pictures, and print the claims as a table
#     make -f scripts/paper/paper.mk measured         write that table and those of the trade into scripts/measured/
#     make -f scripts/paper/paper.mk clean            delete what this SIZE has made
#     make -j2 -f scripts/paper/paper.mk SIZE=medium  larger volumes, more seeds, more sweeps: hours; SIZE=paper: weeks
#
# Needs GNU make 3.82 and bash 4.3 or later (macOS comes with older ones), Python 3.9, and matplotlib for pictures of
# several runs. Each run writes one file of JSON lines. One rule makes it, in a temporary folder that is deleted however
# the rule ends. Every parameter stands in the rule or in the list of its SIZE. Volumes are cubes of lenslets of the
# ready scene `core` (square stop), the test volume of the paper's section 3.

SIZE = small
OUT = out/paper/$(SIZE)
BIN =
# Threads of each tool; with -j2 two tools run at a time.
THREADS = 1

# ---- Sizes ----------------------------------------------------------------------------------------------------------
# Sides of volumes are in lenslets, depths in mm; sweeps are those of MART and DRT-MART. MART on all voxels stores the
# weights of all: 4 x 4 lenslets at 5 mm of depth take 1.3 GB, and more in proportion to the volume.

ifeq ($(SIZE),small)
SEEDS = 1 2 3
DRT_SWEEPS = 100
FIG4_MART = 100
FIG5_SEEDS = 1 2 3 4
FIG5_SIDE = 6
FIG6_SIDE = 12
FIG6_DRT = 1 2 5 10 20 50 100 200 400
FIG6_DRT_RELAXATIONS = 0.5 1 2 2.5 4
FIG6_MART = 5 10 23 46
FIG6_MART_RELAXATIONS = 1 2 2.5
FIG6_MART_SEEDS = 1 2
FIG8_SIDE = 10
FIG8_DENSITIES = 0.05 0.1 0.2 0.5 1
FIG8_MART_DENSITIES = 0.1 1
FIG8_MART_SEEDS = 1 2
FIG9_SEEDS = 1 2 3 4 5 6 7 8 9 10
FIG9_SIDE = 12
FIG10_DRT = 400
FIG10_MART = 200
FIG10_MART_DENSITIES = 1
FIG10_SEEDS = 1
WAVE_SIDE = 24
WAVE_DRT_SIDE = 20
WAVE_DRT_DEPTH = 2.5025
WAVE_DRT_SWEEPS = 20
WAVE_SEEDS = 1 2
WAVE_DRT_SEEDS = 1
FIG13_OURS = 1 2 3 5 10 20 40 60
FIG13_DRT = 5 10 20 50 100 200
FIG13_PVR = 2,2,10
FIG14_DRT =
FIG17_FRAMES = 6
TRADE_SIDE = 32
TRADE_DEPTH = 2.5025
TRADE_SEEDS = 1 2
else ifeq ($(SIZE),medium)
SEEDS = 1 2 3 4 5
DRT_SWEEPS = 400
FIG4_MART = 400
FIG5_SEEDS = 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20
FIG5_SIDE = 8
FIG6_SIDE = 20
FIG6_DRT = 1 2 5 10 20 50 100 200 400
FIG6_DRT_RELAXATIONS = 0.5 1 1.5 2 2.5 3 4
FIG6_MART = 5 10 23 46 100 200
FIG6_MART_RELAXATIONS = 0.5 1 1.5 2 2.5 3 4
FIG6_MART_SEEDS = 1 2 3 4 5
FIG8_SIDE = 20
FIG8_DENSITIES = 0.05 0.1 0.2 0.3 0.5 0.7 1
FIG8_MART_DENSITIES = 0.1 0.2 0.5 1
FIG8_MART_SEEDS = 1 2 3 4 5
FIG9_SEEDS = $(shell seq 30)
FIG9_SIDE = 20
FIG10_DRT = 400
FIG10_MART = 200
FIG10_MART_DENSITIES = 0.1 0.5 1
FIG10_SEEDS = 1 2 3
WAVE_SIDE = 60
WAVE_DRT_SIDE = 24
WAVE_DRT_DEPTH = 5.005
WAVE_DRT_SWEEPS = 100
WAVE_SEEDS = 1 2 3
WAVE_DRT_SEEDS = 1 2 3
FIG13_OURS = 1 2 3 5 10 20 40 60
FIG13_DRT = 5 10 20 50 100 200
FIG13_PVR = 2,2,10
FIG14_DRT = A1 A4 B1 B4
FIG17_FRAMES = 30
TRADE_SIDE = 60
TRADE_DEPTH = 5.005
TRADE_SEEDS = 1 2 3
else ifeq ($(SIZE),paper)
SEEDS = $(shell seq 10)
DRT_SWEEPS = 400
FIG4_MART = 400
FIG5_SEEDS = $(shell seq 1000)
FIG5_SIDE = 8
FIG6_SIDE = 20
FIG6_DRT = 1 2 5 10 20 50 100 200 400
FIG6_DRT_RELAXATIONS = 0.5 1 1.5 2 2.5 3 4
FIG6_MART = 5 10 23 46 100 200
FIG6_MART_RELAXATIONS = 0.5 1 1.5 2 2.5 3 4
FIG6_MART_SEEDS = $(shell seq 10)
FIG8_SIDE = 20
FIG8_DENSITIES = 0.05 0.1 0.2 0.3 0.5 0.7 1
FIG8_MART_DENSITIES = 0.05 0.1 0.2 0.3 0.5 0.7 1
FIG8_MART_SEEDS = $(shell seq 10)
FIG9_SEEDS = $(shell seq 30)
FIG9_SIDE = 20
FIG10_DRT = 400
FIG10_MART = 200
FIG10_MART_DENSITIES = 0.1 0.2 0.5 1
FIG10_SEEDS = 1 2 3 4 5
WAVE_SIDE = 130
WAVE_DRT_SIDE = 60
WAVE_DRT_DEPTH = 5.005
WAVE_DRT_SWEEPS = 400
WAVE_SEEDS = 1 2 3
WAVE_DRT_SEEDS = 1 2 3
FIG13_OURS = 1 2 3 5 10 20 40 60
FIG13_DRT = 5 10 20 50 100 200 400
FIG13_PVR = 1,1,10
FIG14_DRT = A1 A2 A3 A4 B1 B2 B3 B4
FIG17_FRAMES = 30
TRADE_SIDE = 130
TRADE_DEPTH = 5.005
TRADE_SEEDS = 1 2 3
else
$(error SIZE is '$(SIZE)'; wanted small, medium or paper)
endif

# ---- What recipes share ---------------------------------------------------------------------------------------------

ifeq ($(filter oneshell,$(.FEATURES)),)
$(error this is make $(MAKE_VERSION); wanted GNU make 3.82 or later)
endif
SHELL = bash
.SHELLFLAGS = -euo pipefail -c
.ONESHELL:
.SILENT:
.SUFFIXES:
.DELETE_ON_ERROR:
.DEFAULT_GOAL = burn

# $(call part,N): part N of a run's name, whose parts are separated by '-'.
part = $(word $1,$(subst -, ,$(basename $(notdir $@))))

# The paper's methods take its relaxation.
relaxation = $(if $(filter ours fit,$(call part,1)),,--relaxation 2.5)

define steps
export LC_ALL=C LF_HISTORY=off
d=$$target.part
rm -rf "$$d"
mkdir -p "$$d"
trap 'rm -rf "$$d"' EXIT
trap 'exit 130' INT TERM HUP
[ "$${BASH_VERSINFO[0]}$${BASH_VERSINFO[1]}" -ge 43 ] || { echo "bash $$BASH_VERSION; wanted 4.3 or later" >&2; exit 2; }
quiet=(--quiet --threads "$$threads")

# cube LENSLETS DEPTH: sets $$box (for lf-prune) and $$sets (for scenes) to a box of LENSLETS a side, -DEPTH to DEPTH
# mm. The sensor is wider, because particles at the sides send light beyond the box.
cube() {
    local half=$$(awk -v n="$$1" 'BEGIN { printf "%.6g", n * 0.0385 }')
    local pixels=$$(awk -v n="$$1" -v z="$$2" 'BEGIN { print 14 * (n + 2 * int(1.8 * z + 1)) }')
    box=(--depth "-$$2,$$2" "--bounds=-$$half,$$half,-$$half,$$half")
    sets=("camera.sensor.width=$$pixels" "camera.sensor.height=$$pixels" "volume.x_mm=[-$$half,$$half]"
        "volume.y_mm=[-$$half,$$half]" "volume.z_mm=[-$$2,$$2]")
}

# render SCENE KEY=VALUE...: renders a ready scene with the cube's size into $$d.
render() {
    local scene=$$1 set=()
    shift
    for words in $${sets[@]+"$${sets[@]}"} "$$@"; do set+=(--set "$$words"); done
    "$$bin"lf-synth scene "$$scene" "$${set[@]}" > "$$d/scene.json"
    "$$bin"lf-synth frames "$$d/scene.json" -o "$$d" "$${quiet[@]}"
}

# Options of each method for lf-prune and lf-mart: the paper's DRT-MART behind our threshold, MART on all voxels, ours
# with blobs, which is best in Q, and three sweeps, from which lf-fit starts.
prune_drt=() prune_drtsmall=() prune_mart=(--keep-all) prune_ours=() prune_fit=()
solve_drt=(--weights drt --method mart --max-memory 20) solve_drtsmall=("$${solve_drt[@]}") solve_mart=("$${solve_drt[@]}")
solve_ours=(--max-memory 20 --basis blob) solve_fit=(--max-memory 20)

# prune METHOD FRAME [OPTIONS]: makes $$d/support-FRAME.lfv, with statistics in $$d/prune.json.
prune() {
    local -n how=prune_$$1
    local frame=$$2
    shift 2
    "$$bin"lf-prune "$$d/frame-$$frame.exr" -c "$$d/camera.json" "$${box[@]}" $${how[@]+"$${how[@]}"} "$$@" "$${quiet[@]}" \
        -o "$$d/support-$$frame.lfv" --stats "$$d/prune.json"
}

# solve METHOD FRAME [OPTIONS]: makes $$d/volume-FRAME.lfv; statistics go to $$d/mart.json, sweeps to $$d/sweeps.jsonl.
# The method `fit` has lf-fit draw its particles in the volume's place; they stand in $$d/found-FRAME.csv.
solve() {
    local -n how=solve_$$1
    local method=$$1 frame=$$2
    shift 2
    "$$bin"lf-mart "$$d/support-$$frame.lfv" -i "$$d/frame-$$frame.exr" -c "$$d/camera.json" "$${how[@]}" "$$@" "$${quiet[@]}" \
        -o "$$d/volume-$$frame.lfv" --stats "$$d/mart.json" --log "$$d/sweeps.jsonl"
    if [ "$$method" = fit ]; then
        "$$bin"lf-fit "$$d/volume-$$frame.lfv" -i "$$d/frame-$$frame.exr" -c "$$d/camera.json" \
            --frame "$$frame" "$${quiet[@]}" --particles "$$d/found-$$frame.csv" --stats "$$d/fit.json" -o "$$d/drawn.lfv"
        mv "$$d/drawn.lfv" "$$d/volume-$$frame.lfv"
    fi
}

# quality: scores the first volume, in $$d/quality.json. line ...: appends settings and scores to $$d/line.jsonl.
quality() { "$$bin"lf-validate quality "$$d/truth-0000.lfv" "$$d/volume-0000.lfv" --quiet > "$$d/quality.json"; }
line() { scripts/paper/curves line "$$@" >> "$$d/line.jsonl"; }

# seconds_of FILE: prints the seconds of a run, from its --stats.
seconds_of() { sed -n 's/^ *"seconds": \([0-9.e-]*\),/\1/p' "$$1"; }

# after SWEEPS: prints the seconds that the last solve took for its first SWEEPS sweeps.
after() { sed -n "s/.*\"iteration\":$$1,.*\"seconds\":\([0-9.e-]*\).*/\1/p" "$$d/sweeps.jsonl"; }

# field VOLUMES [OPTIONS]: correlates $$d/VOLUMES-0000.lfv and -0001.lfv, with the particles of both frames where lf-fit
# has found some, and scores the field in $$d/error.json.
# Windows are the paper's, 320 x 320 x 32 and 160 x 160 x 16 voxels of 1 x 1 x 10 px, given in mm so that they suit any
# voxels.
field() {
    local volumes=$$1 found=()
    shift
    [ ! -e "$$d/found-0000.csv" ] || found=(--particles "$$d/found-0000.csv" "$$d/found-0001.csv")
    "$$bin"lf-xcorr "$$d/$$volumes-0000.lfv" "$$d/$$volumes-0001.lfv" $${found[@]+"$${found[@]}"} \
        --initial-mm 1.76,1.76,1.76 --window-mm 0.88,0.88,0.88 \
        "$$@" "$${quiet[@]}" -o "$$d/field.exr" --stats "$$d/xcorr.json"
    "$$bin"lf-validate displacement "$$d/flow.exr" "$$d/field.exr" -c "$$d/camera.json" --quiet > "$$d/error.json"
}

# keep PICTURE FILE: moves a picture out of $$d; without matplotlib it is missing.
keep() { [ ! -e "$$d/$$1" ] || mv "$$d/$$1" "$$2"; }

# done_ FILE: moves the finished file to the rule's target.
done_() { mv "$$d/$$1" "$$target"; }
endef
export steps
begin = echo "$@"; mkdir -p $(@D); target=$@ bin=$(BIN) threads=$(THREADS); eval "$$steps"

# The number of a run's figure, from its folder.
figure = $(patsubst fig%,%,$(notdir $(@D)))

# $(call curves,INPUTS,OPTIONS): a picture and its numbers from runs.
define curves
$(begin)
scripts/paper/curves draw $1 --plot "$$d/picture.svg" $2 > "$$d/curves.json"
keep picture.svg $(basename $@).svg
done_ curves.json
endef

# $(call wave,CASE,OMEGA): scene settings for a pair of frames of the paper's waves. Omega counts cycles over the
# paper's 1820 px; the crest moves 25 px. The middle of the volume is an eighth of a cycle from the crest, where
# displacement and gradient both have 0.7 of their largest values.
wave = frames=2 particles.per_lenslet=0.5 'flow={"kind":"wave","case":"$1","omega":$2,"amplitude_px":25,"length_px":1820,"phase_rad":0.785}'

figures = fig4 fig5 fig6 fig7 fig8 fig9 fig10 fig11 fig12 fig13 fig14 fig15 fig17
.PHONY: burn view measured clean trade claims $(figures)
burn: trade $(figures) claims

# ---- Figure 4: one particle, seen from above, by three methods ------------------------------------------------------

fig4 := $(foreach m,drt-$(DRT_SWEEPS) mart-$(FIG4_MART) mart-23 ours-60,$(OUT)/fig4/$m.svg)
fig4: $(fig4)

$(fig4):
	$(begin)
	cube 4 2.5025
	render core particles.per_lenslet=null particles.count=1 particles.rays=null seed=5
	prune $(call part,1) 0000
	solve $(call part,1) 0000 --iterations $(call part,2) $(relaxation)
	$(BIN)lf-validate depth "$$d/volume-0000.lfv" --slab=-2.5025,2.5025 --plot "$$d/depth.svg" > "$$d/depth.json"
	done_ depth.svg

# ---- Figure 5: diameters of particles -------------------------------------------------------------------------------

fig5 := $(foreach s,$(FIG5_SEEDS),$(foreach m,drt-$(DRT_SWEEPS) mart-23 ours-60,$(OUT)/fig5/$m-$s.lfv))
fig5: $(OUT)/fig5-x.json $(OUT)/fig5-y.json $(OUT)/fig5-z.json

$(fig5):
	$(begin)
	cube $(FIG5_SIDE) 2.5025
	render core particles.per_lenslet=0.2 particles.rays=null seed=$(call part,3)
	prune $(call part,1) 0000
	solve $(call part,1) 0000 --iterations $(call part,2) $(relaxation)
	mv "$$d/particles.csv" $(basename $@).csv
	mv "$$d/camera.json" $(basename $@).camera.json
	done_ volume-0000.lfv

# All volumes of a method count as one run.
fig5_lines := $(foreach m,drt-$(DRT_SWEEPS) mart-23 ours-60,$(OUT)/fig5/$m.jsonl)
$(fig5_lines): $(fig5)
	$(begin)
	pairs=()
	for s in $(FIG5_SEEDS); do pairs+=($(basename $@)-$$s.csv $(basename $@)-$$s.lfv); done
	set -- "$${pairs[@]}"
	first=("$$1" "$$2")
	shift 2
	and=()
	while [ $$# -gt 0 ]; do and+=(--and "$$1" "$$2"); shift 2; done
	camera=$(basename $@)-$(firstword $(FIG5_SEEDS)).camera.json
	$(BIN)lf-validate elongation "$${first[@]}" $${and[@]+"$${and[@]}"} -c "$$camera" --plot "$$d/size.svg" > "$$d/size.json"
	line figure=5 method=$(call part,1) iterations=$(call part,2) "$$d/size.json"
	mv "$$d/size.svg" $(OUT)/fig5-sizes-$(call part,1).svg
	done_ line.jsonl

$(OUT)/fig5-x.json $(OUT)/fig5-y.json $(OUT)/fig5-z.json: $(OUT)/fig5-%.json: $(fig5_lines)
	$(call curves,$^,-x histogram.$*_px -y histogram.$* --by method --reference-x "ideal=$(if $(filter z,$*),30,3)" \
	    --x-name "diameter along $*$(comma) px" --y-name "share of the particles" --title "Fig. 5: diameters along $*")
comma := ,

# ---- Figure 6: quality by sweeps and relaxation ----------------------------------------------------------------------
# A row action can go on from its own result, so that a run of many sweeps consists of several runs of fewer.

fig6 := $(foreach s,$(SEEDS),$(foreach r,$(FIG6_DRT_RELAXATIONS),$(OUT)/fig6/drt-$r-$s.jsonl) $(foreach r,0.5 1 1.5 2,$(OUT)/fig6/ours-$r-$s.jsonl))
fig6 += $(foreach s,$(FIG6_MART_SEEDS),$(foreach r,$(FIG6_MART_RELAXATIONS),$(OUT)/fig6/mart-$r-$s.jsonl))
fig6: $(OUT)/fig6.json

side-drt = $(FIG6_SIDE)
side-mart = 4
side-ours = $(FIG6_SIDE)
sweeps-drt = $(FIG6_DRT)
sweeps-mart = $(FIG6_MART)
sweeps-ours = 1 2 3 5 10 20 50 100

$(filter $(OUT)/fig6/ours-%,$(fig6)):
	$(begin)
	cube $(side-ours) 2.5025
	render core particles.per_lenslet=0.1 particles.rays=null seed=$(call part,3)
	prune ours 0000
	for n in $(sweeps-ours); do
	    solve ours 0000 --iterations $$n --until never --relaxation $(call part,2)
	    quality
	    line figure=6 method=ours relaxation=$(call part,2) iterations=$$n set.seed=$(call part,3) "$$d/quality.json"
	done
	done_ line.jsonl

$(filter-out $(OUT)/fig6/ours-%,$(fig6)):
	$(begin)
	cube $(side-$(call part,1)) 2.5025
	render core particles.per_lenslet=0.1 particles.rays=null seed=$(call part,3)
	prune $(call part,1) 0000
	start=() before=0
	for n in $(sweeps-$(call part,1)); do
	    solve $(call part,1) 0000 --iterations $$((n - before)) --relaxation $(call part,2) $${start[@]+"$${start[@]}"}
	    quality
	    line figure=6 method=$(call part,1) relaxation=$(call part,2) iterations=$$n set.seed=$(call part,3) "$$d/quality.json"
	    cp "$$d/volume-0000.lfv" "$$d/start.lfv"
	    start=(--start "$$d/start.lfv") before=$$n
	done
	done_ line.jsonl

$(OUT)/fig6.json: $(fig6)
	$(call curves,$^,-x iterations -y q --by relaxation --panel method --log-x --y-range 0$(comma)1 --x-name "sweeps" --y-name "Q" \
	    --title "Fig. 6: quality by sweeps and relaxation$(comma) 0.1 particles a lenslet")

# ---- Figure 7: brightest voxels by depth, after few sweeps and many -------------------------------------------------
# The density is high enough that every slice has particles.

fig7 := $(foreach s,$(SEEDS),$(OUT)/fig7/drt-0.5-$s.jsonl $(OUT)/fig7/ours-0.5-$s.jsonl) \
    $(foreach s,$(FIG6_MART_SEEDS),$(OUT)/fig7/mart-1-$s.jsonl)
fig7: $(OUT)/fig7.json

few-drt = 20
many-drt = 200
few-mart = 5
many-mart = 23
few-ours = 5
many-ours = 60

$(fig7):
	$(begin)
	cube $(if $(filter mart,$(call part,1)),4,$(FIG8_SIDE)) 2.5025
	render core particles.per_lenslet=$(call part,2) particles.rays=null seed=$(call part,3)
	prune $(call part,1) 0000
	for n in $(few-$(call part,1)) $(many-$(call part,1)); do
	    solve $(call part,1) 0000 --iterations $$n $(relaxation)
	    $(BIN)lf-validate depth "$$d/volume-0000.lfv" > "$$d/depth.json"
	    line figure=7 method=$(call part,1) iterations=$$n set.seed=$(call part,3) "$$d/depth.json"
	done
	done_ line.jsonl

$(OUT)/fig7.json: $(fig7)
	$(call curves,$^,-x z_mm -y peak --by iterations --panel method --x-name "z$(comma) mm" \
	    --y-name "brightest voxel of a slice$(comma) counts" --title "Fig. 7: brightest voxels by depth and sweeps")

# ---- Figure 8: quality by density -----------------------------------------------------------------------------------

fig8 := $(foreach s,$(SEEDS),$(foreach n,$(FIG8_DENSITIES),$(foreach m,drt-$(DRT_SWEEPS) ours-60 fit-3,$(OUT)/fig8/$m-$n-$s.jsonl)))
# MART, and DRT-MART on the same small volume for comparison.
fig8 += $(foreach s,$(FIG8_MART_SEEDS),$(foreach n,$(FIG8_MART_DENSITIES),$(OUT)/fig8/mart-23-$n-$s.jsonl $(OUT)/fig8/drtsmall-$(DRT_SWEEPS)-$n-$s.jsonl))
fig8: $(OUT)/fig8.json

$(fig8):
	$(begin)
	cube $(if $(filter mart drtsmall,$(call part,1)),4,$(FIG8_SIDE)) 2.5025
	render core particles.per_lenslet=$(call part,3) particles.rays=null seed=$(call part,4)
	prune $(call part,1) 0000 --truth "$$d/particles.csv"
	solve $(call part,1) 0000 --iterations $(call part,2) $(relaxation)
	quality
	$(BIN)lf-validate elongation "$$d/particles.csv" "$$d/volume-0000.lfv" -c "$$d/camera.json" --quiet > "$$d/size.json"
	line figure=8 method=$(call part,1) iterations=$(call part,2) per_lenslet=$(call part,3) set.seed=$(call part,4) \
	    "$$d/quality.json" prune:"$$d/prune.json" mart:"$$d/mart.json" size:"$$d/size.json"
	done_ line.jsonl

$(OUT)/fig8.json: $(fig8)
	$(call curves,$^,-x per_lenslet -y q --by method --y-range 0$(comma)1 --x-name "particles a lenslet" --y-name "Q" \
	    --title "Fig. 8: quality by density")

# ---- Figure 9: light outside the seeded slab ------------------------------------------------------------------------
# Particles lie within 2.5 mm, voxels within 4 mm. `beyond` is light more than 0.2 mm outside, about a particle's depth.

fig9 := $(foreach s,$(FIG9_SEEDS),$(foreach m,drt-50 ours-60 fit-3,$(OUT)/fig9/$m-$s.lfv))
fig9_lines := $(foreach m,drt-50 ours-60 fit-3,$(OUT)/fig9/$m.jsonl)
fig9: $(fig9_lines)

$(fig9):
	$(begin)
	cube $(FIG9_SIDE) 4.015
	render core particles.per_lenslet=0.5 particles.rays=null seed=$(call part,3) 'volume.z_mm=[-2.5,2.5]'
	prune $(call part,1) 0000
	solve $(call part,1) 0000 --iterations $(call part,2) $(relaxation)
	done_ volume-0000.lfv

$(fig9_lines): $(fig9)
	$(begin)
	$(BIN)lf-validate depth $(filter $(basename $@)-%,$(fig9)) --slab=-2.5,2.5 --plot "$$d/depth.svg" > "$$d/depth.json"
	$(BIN)lf-validate depth $(filter $(basename $@)-%,$(fig9)) --slab=-2.7,2.7 > "$$d/beyond.json"
	line figure=9 method=$(call part,1) "$$d/depth.json" beyond:"$$d/beyond.json"
	mv "$$d/depth.svg" $(OUT)/fig9-$(call part,1).svg
	done_ line.jsonl

# ---- Figure 10: time by density -------------------------------------------------------------------------------------
# All methods run on 4 x 4 lenslets and one thread. MART's time does not depend on the density.

fig10 := $(foreach s,$(FIG10_SEEDS),$(foreach n,$(FIG8_DENSITIES),$(foreach m,drt-$(FIG10_DRT) ours-60 fit-3,$(OUT)/fig10/$m-$n-$s.jsonl)))
fig10 += $(foreach s,$(FIG10_SEEDS),$(foreach n,$(FIG10_MART_DENSITIES),$(OUT)/fig10/mart-$(FIG10_MART)-$n-$s.jsonl))
fig10: $(OUT)/fig10.json

$(fig10):
	$(begin)
	cube 4 2.5025
	render core particles.per_lenslet=$(call part,3) particles.rays=null seed=$(call part,4)
	prune $(call part,1) 0000
	solve $(call part,1) 0000 --iterations $(call part,2) $(relaxation)
	quality
	fit=0
	if [ -e "$$d/fit.json" ]; then fit=$$(seconds_of "$$d/fit.json"); fi
	seconds=$$(awk -v a="$$(seconds_of "$$d/prune.json")" -v b="$$(seconds_of "$$d/mart.json")" -v c="$$fit" \
	    'BEGIN { print a + b + c }')
	line figure=10 method=$(call part,1) iterations=$(call part,2) per_lenslet=$(call part,3) set.seed=$(call part,4) \
	    seconds=$$seconds $(if $(filter ours fit,$(call part,1)),,seconds_after_23=$$(after 23) seconds_after_all=$$(after $(call part,2))) "$$d/quality.json" mart:"$$d/mart.json"
	done_ line.jsonl

$(OUT)/fig10.json: $(fig10)
	$(call curves,$^,-x per_lenslet -y seconds --by method --log-y --x-name "particles a lenslet" --y-name "seconds$(comma) one thread" \
	    --title "Fig. 10: time of DRT-MART ($(FIG10_DRT) sweeps)$(comma) MART ($(FIG10_MART))$(comma) ours and lf-fit$(comma) 4 x 4 lenslets")

# ---- Figures 11 and 12: displacement errors by pixels per voxel -----------------------------------------------------
# MART is left out: the weights of the smallest volume that holds the windows take 60 GB.

pvr11 = 1,1,10 2,2,10 3,3,10
pvr12 = 1,1,5 1,1,10 1,1,20
wave_runs = $(foreach s,$(WAVE_SEEDS),$(foreach p,$(pvr$1),$(foreach m,truth-0 ours-60 fit-3,$(OUT)/fig$1/$m-$p-$s.jsonl))) \
    $(foreach s,$(WAVE_DRT_SEEDS),$(foreach p,$(pvr$1),$(OUT)/fig$1/drt-$(WAVE_DRT_SWEEPS)-$p-$s.jsonl))
fig11 := $(call wave_runs,11)
fig12 := $(call wave_runs,12)
fig11: $(OUT)/fig11.json
fig12: $(OUT)/fig12.json

$(fig11) $(fig12):
	$(begin)
	cube $(WAVE_DRT_SIDE) $(WAVE_DRT_DEPTH)
	render core $(call wave,$(if $(filter fig11,$(notdir $(@D))),A1,B1),0.25) particles.rays=null seed=$(call part,4) \
	    'truth.pixels_per_voxel=[$(call part,3)]'
	volumes=truth
	if [ $(call part,1) != truth ]; then
	    volumes=volume
	    for n in 0000 0001; do
	        prune $(call part,1) $$n --pvr $(call part,3)
	        solve $(call part,1) $$n --iterations $(call part,2) $(relaxation)
	    done
	fi
	field $$volumes
	line figure=$(figure) method=$(call part,1) pvr=$(call part,3) set.seed=$(call part,4) "$$d/error.json" \
	    xcorr.seconds=$$(seconds_of "$$d/xcorr.json")
	done_ line.jsonl

$(OUT)/fig11.json: $(fig11)
	$(call curves,$^,-x pdf.x_u -y pdf.u --by pvr --panel method --x-range=-1$(comma)1 --x-name "error of u$(comma) px" --y-name "density$(comma) 1/px" \
	    --title "Fig. 11: errors by pixels per voxel in x and y$(comma) Case A1$(comma) a quarter of a cycle")
$(OUT)/fig12.json: $(fig12)
	$(call curves,$^,-x pdf.x_w -y pdf.w --by pvr --panel method --x-range=-10$(comma)10 --x-name "error of w$(comma) px" --y-name "density$(comma) 1/px" \
	    --title "Fig. 12: errors by pixels per voxel in z$(comma) Case B1$(comma) a quarter of a cycle")

# ---- Figure 13: displacement errors by sweeps -----------------------------------------------------------------------

fig13 := $(foreach c,A1 B1,$(foreach s,$(WAVE_SEEDS),$(OUT)/fig13/ours-$c-$s.jsonl $(OUT)/fig13/truth-$c-$s.jsonl) \
    $(foreach s,$(WAVE_DRT_SEEDS),$(OUT)/fig13/drt-$c-$s.jsonl))
fig13: $(OUT)/fig13-u.json $(OUT)/fig13-w.json

$(fig13):
	$(begin)
	cube $(WAVE_DRT_SIDE) $(WAVE_DRT_DEPTH)
	render core $(call wave,$(call part,2),0.25) particles.rays=null seed=$(call part,3) 'truth.pixels_per_voxel=[$(FIG13_PVR)]'
	case $(call part,1) in
	truth) field truth
	    for n in $(sort $(firstword $(FIG13_OURS)) $(lastword $(FIG13_OURS))); do
	        line figure=13 method=truth case=$(call part,2) iterations=$$n set.seed=$(call part,3) "$$d/error.json"
	    done ;;
	ours) for n in 0000 0001; do prune ours $$n --pvr $(FIG13_PVR); done
	    for sweeps in $(FIG13_OURS); do
	        for n in 0000 0001; do solve ours $$n --iterations $$sweeps --until never; done
	        field volume
	        line figure=13 method=ours case=$(call part,2) iterations=$$sweeps set.seed=$(call part,3) "$$d/error.json"
	    done ;;
	drt) for n in 0000 0001; do prune drt $$n --pvr $(FIG13_PVR); done
	    start=no before=0
	    for sweeps in $(FIG13_DRT); do
	        for n in 0000 0001; do
	            from=()
	            if [ $$start = yes ]; then mv "$$d/volume-$$n.lfv" "$$d/start.lfv"; from=(--start "$$d/start.lfv"); fi
	            solve drt $$n --iterations $$((sweeps - before)) --relaxation 2.5 $${from[@]+"$${from[@]}"}
	        done
	        start=yes before=$$sweeps
	        field volume
	        line figure=13 method=drt case=$(call part,2) iterations=$$sweeps set.seed=$(call part,3) "$$d/error.json"
	    done ;;
	esac
	done_ line.jsonl

$(OUT)/fig13-u.json $(OUT)/fig13-w.json: $(OUT)/fig13-%.json: $(fig13)
	$(call curves,$^,-x iterations -y rms_$*_px --by method --panel case --log-x --log-y --x-name sweeps \
	    --y-name "RMS error of $*$(comma) px" --title "Fig. 13: errors of $* by sweeps$(comma) a quarter of a cycle")

# ---- Figures 14 and 15: displacement errors by gradient -------------------------------------------------------------

omegas = 0.25 0.5 1 2
fig14 := $(foreach s,$(WAVE_SEEDS),$(foreach o,$(omegas),$(foreach c,A1 A2 A3 A4,$(OUT)/fig14/$c-$o-$s.jsonl)))
fig15 := $(foreach s,$(WAVE_SEEDS),$(foreach o,$(omegas),$(foreach c,B1 B2 B3 B4,$(OUT)/fig15/$c-$o-$s.jsonl)))
# lf-fit at the gradients of which the claims speak.
fig14_fit := $(foreach s,$(WAVE_SEEDS),$(foreach c,A1 A2 A3 A4,$(OUT)/fig14/$c-0.5-$s-fit.jsonl))
fig15_fit := $(foreach s,$(WAVE_SEEDS),$(foreach o,0.5 2,$(foreach c,B1 B2 B3 B4,$(OUT)/fig15/$c-$o-$s-fit.jsonl)))
fig14_drt := $(foreach o,0.25 1,$(foreach c,$(FIG14_DRT),$(OUT)/$(if $(findstring A,$c),fig14,fig15)/$c-$o-1-drt.jsonl))
fig14: $(OUT)/fig14.json
fig15: $(OUT)/fig15.json

$(fig14) $(fig15):
	$(begin)
	cube $(WAVE_SIDE) 5.005
	render core $(call wave,$(call part,1),$(call part,2)) particles.rays=null seed=$(call part,3)
	field truth
	line figure=$(figure) method=truth case=$(call part,1) omega=$(call part,2) set.seed=$(call part,3) "$$d/error.json"
	for n in 0000 0001; do
	    prune ours $$n
	    solve ours $$n --iterations 60 --until stall
	done
	field volume
	line figure=$(figure) method=ours case=$(call part,1) omega=$(call part,2) set.seed=$(call part,3) "$$d/error.json"
	done_ line.jsonl

$(fig14_fit) $(fig15_fit):
	$(begin)
	cube $(WAVE_SIDE) 5.005
	render core $(call wave,$(call part,1),$(call part,2)) particles.rays=null seed=$(call part,3)
	for n in 0000 0001; do
	    prune fit $$n
	    solve fit $$n --iterations 3
	done
	field volume
	line figure=$(figure) method=fit case=$(call part,1) omega=$(call part,2) set.seed=$(call part,3) "$$d/error.json"
	done_ line.jsonl

$(fig14_drt):
	$(begin)
	cube $(WAVE_DRT_SIDE) $(WAVE_DRT_DEPTH)
	render core $(call wave,$(call part,1),$(call part,2)) particles.rays=null seed=$(call part,3)
	for n in 0000 0001; do
	    prune drt $$n
	    solve drt $$n --iterations $(WAVE_DRT_SWEEPS) --relaxation 2.5
	done
	field volume
	line figure=$(figure) method=drt case=$(call part,1) omega=$(call part,2) set.seed=$(call part,3) "$$d/error.json"
	done_ line.jsonl

$(OUT)/fig14.json: $(fig14) $(fig14_fit) $(filter $(OUT)/fig14/%,$(fig14_drt))
	$(call curves,$^,-x omega -y rms_u_px --by method --panel case --log-x --log-y --x-name "omega$(comma) cycles over 1820 px" \
	    --y-name "RMS error of u$(comma) px" --title "Fig. 14: errors of u by gradient$(comma) Cases A1 to A4")
$(OUT)/fig15.json: $(fig15) $(fig15_fit) $(filter $(OUT)/fig15/%,$(fig14_drt))
	$(call curves,$^,-x omega -y rms_w_px --by method --panel case --log-x --log-y --x-name "omega$(comma) cycles over 1820 px" \
	    --y-name "RMS error of w$(comma) px" --title "Fig. 15: errors of w by gradient$(comma) Cases B1 to B4")

# ---- Figure 17: light along z of noisy frames -----------------------------------------------------------------------
# The ready scene `tank` without its water: the experiment's lens, uneven particles, noise and background of the sensor,
# a sheet from -3 to 3 mm. The minimum of each pixel over the frames is subtracted. Voxels lie within 5 mm.

fig17: $(OUT)/fig17/ours.jsonl
$(OUT)/fig17/ours.jsonl:
	$(begin)
	sets=()
	render tank camera.medium=null 'volume.z_mm=[-5,5]' 'light={"profile":"top-hat","centre_mm":0,"thickness_mm":6}' \
	    frames=$(FIG17_FRAMES) truth=null seed=1
	$(BIN)lf-calib background "$$d"/frame-*.exr -o "$$d/background.exr" --quiet
	for n in $$(seq -f %04g 0 $$(($(FIG17_FRAMES) - 1))); do
	    box=(--depth -5,5 --bounds=-2.4,2.4,-2.4,2.4)
	    prune ours $$n --pvr 2,2,10 -b "$$d/background.exr"
	    solve ours $$n --iterations 60 --until stall -b "$$d/background.exr"
	done
	$(BIN)lf-validate depth "$$d"/volume-*.lfv --slab=-3,3 --plot "$$d/depth.svg" > "$$d/depth.json"
	$(BIN)lf-validate depth "$$d"/volume-*.lfv --slab=-3.2,3.2 > "$$d/beyond.json"
	line figure=17 method=ours "$$d/depth.json" beyond:"$$d/beyond.json"
	mv "$$d/depth.svg" $(OUT)/fig17.svg
	done_ line.jsonl

# ---- The trade: time, memory and error of the whole chain -----------------------------------------------------------
# Errors are those of the field, interpolated to the true particles that fields of every setting reach: more than 0.57
# mm from the volume's sides and 0.55 mm from its ends. The flow is an ABC flow of 8 px and 3640 px of wavelength, whose
# components all vary along all axes. Windows of the last pass are 0.88 mm a side at any voxel size. The base is the
# default, which is the preset `balanced` too. Each setting changes something of it. Those below `front` change more at
# once; among them are the presets `fast` and `accurate` and the paper's DRT-MART.

base = pvr=1,1,10 weights=exact basis=point blob=0.65 method=subsets iterations=20 threshold=auto score=geometric sections=14 \
    overlap=0.5 passes=2 deform=auto repeats=3
set.default =
set.iterations3 = iterations=3
set.iterations5 = iterations=5
set.iterations60 = iterations=60
set.pvr2x10 = pvr=2,2,10
set.pvr3x10 = pvr=3,3,10
set.pvr1x20 = pvr=1,1,20
set.pvr2x20 = pvr=2,2,20
set.weightsDrt = weights=drt
set.weightsSphere = weights=sphere
set.basisBlob = basis=blob
set.basisBox = basis=box
set.smart = method=smart
set.mlem = method=mlem
set.threshold03 = threshold=0.03
set.threshold1 = threshold=0.1
set.minimum = score=minimum
set.quantile = score=quantile
set.sections7 = sections=7
set.sections10 = sections=10
set.overlap75 = overlap=0.75
set.passes1 = passes=1
set.passes3 = passes=3
set.deformNever = deform=never
set.repeats1 = repeats=1
set.repeats6 = repeats=6
# front
set.fast = iterations=10
set.quick0 = pvr=2,2,20 iterations=3
set.quick1 = pvr=4,4,20 iterations=3 deform=never repeats=1
set.quick2 = pvr=3,3,20 iterations=3 deform=never repeats=1
set.quick3 = pvr=3,3,20 iterations=3
set.quick4 = pvr=2,2,20 iterations=3 deform=never repeats=1
set.quick5 = pvr=2,2,10 iterations=3
set.middle1 = pvr=1,1,20 iterations=3
set.middle2 = iterations=10 overlap=0.75
set.slow1 = iterations=60 overlap=0.75 repeats=6
set.slow2 = iterations=60 overlap=0.75 repeats=6 basis=blob blob=0.4
set.slow3 = pvr=1,1,5 iterations=60 overlap=0.75 repeats=6
set.slow6 = pvr=1,1,5 iterations=60 overlap=0.75 repeats=6 basis=blob blob=0.4
set.slow4 = pvr=1,1,5 iterations=10
set.slow5 = pvr=1,1,5 iterations=10 basis=box
set.accurate = pvr=1,1,5
set.paper = overlap=0.75 pvr=2,2,10 weights=drt method=mart iterations=30
trade_names := $(patsubst set.%,%,$(filter set.%,$(.VARIABLES)))
trade_runs := $(foreach s,$(TRADE_SEEDS),$(foreach n,$(trade_names),$(OUT)/trade/$n-$s.jsonl))
# The paper's method takes minutes a pair: one seed.
trade_runs := $(filter-out $(foreach s,$(wordlist 2,99,$(TRADE_SEEDS)),$(OUT)/trade/paper-$s.jsonl),$(trade_runs))
trade: $(OUT)/trade.md

$(trade_runs):
	$(begin)
	for words in $(base) $(set.$(call part,1)); do declare "$$words"; done
	cube $(TRADE_SIDE) $(TRADE_DEPTH)
	render core particles.per_lenslet=0.5 particles.rays=null frames=2 truth.pixels_per_voxel=[$$pvr] seed=$(call part,2) \
	    'flow={"kind":"abc","wavelength_mm":20.02,"displacement_mm":[0.044,0.044,0.044]}'
	prune=(--pvr "$$pvr" --threshold "$$threshold" --score "$$score" --sections "$$sections")
	solve=(--weights "$$weights" --method "$$method" --iterations "$$iterations")
	[ "$$method" != mart ] || solve+=(--relaxation 2.5)
	[ "$$weights" = sphere ] || solve+=(--basis "$$basis" --blob "$$blob")
	window=$$(awk -v p="$$pvr" 'BEGIN { split(p, v, ","); printf "%.0f,%.0f,%.0f", 160 / v[1], 160 / v[2], 160 / v[3] }')
	double=$$(awk -v p="$$pvr" 'BEGIN { split(p, v, ","); printf "%.0f,%.0f,%.0f", 320 / v[1], 320 / v[2], 320 / v[3] }')
	case $$passes in
	1) passing=(--pass "$$window:$$overlap") ;;
	2) passing=(--pass "$$double:$$overlap" --pass "$$window:$$overlap") ;;
	3) passing=(--pass "$$double:$$overlap" --pass "$$window:$$overlap" --pass "$$window:$$overlap") ;;
	esac
	passing+=(--deform "$$deform")
	[ "$$deform" = never ] || passing+=(--repeats "$$repeats")
	seconds=0 peak=0
	add() {
	    seconds=$$(awk -v a="$$seconds" -v b="$$(seconds_of "$$1")" 'BEGIN { print a + b }')
	    peak=$$(awk -v a="$$peak" -v b="$$(sed -n 's/^ *"peak_bytes": \([0-9]*\).*/\1/p' "$$1")" 'BEGIN { print (b > a ? b : a) }')
	}
	for n in 0000 0001; do
	    "$$bin"lf-prune "$$d/frame-$$n.exr" -c "$$d/camera.json" "$${box[@]}" "$${prune[@]}" "$${quiet[@]}" \
	        -o "$$d/support-$$n.lfv" --stats "$$d/prune.json"
	    "$$bin"lf-mart "$$d/support-$$n.lfv" -i "$$d/frame-$$n.exr" -c "$$d/camera.json" "$${solve[@]}" --max-memory 20 \
	        "$${quiet[@]}" -o "$$d/volume-$$n.lfv" --stats "$$d/mart.json"
	    add "$$d/prune.json"
	    add "$$d/mart.json"
	done
	"$$bin"lf-xcorr "$$d/volume-0000.lfv" "$$d/volume-0001.lfv" "$${passing[@]}" "$${quiet[@]}" -o "$$d/field.exr" --stats "$$d/xcorr.json"
	add "$$d/xcorr.json"
	awk -F, -v a=$$(awk 'BEGIN { print 0.0385 * $(TRADE_SIDE) - 0.572 }') -v z=$$(awk 'BEGIN { print $(TRADE_DEPTH) - 0.55 }') '
	    !/^[0-9]/ { print; next }
	    $$1 == 0 && $$3^2 < a^2 && $$4^2 < a^2 && $$5^2 < z^2 { print; kept[$$2] }
	    $$1 == 1 && $$2 in kept' "$$d/particles.csv" > "$$d/inner.csv"
	"$$bin"lf-validate displacement "$$d/inner.csv" "$$d/field.exr" -c "$$d/camera.json" --quiet > "$$d/error.json"
	quality
	factors=()
	for words in $(base); do key=$${words%%=*}; factors+=("set.$$key=$${!key}"); done
	line name=$(call part,1) set.seed=$(call part,2) "$${factors[@]}" seconds=$$seconds peak_bytes=$$peak "$$d/error.json" \
	    quality:"$$d/quality.json"
	done_ line.jsonl

$(OUT)/trade.md: $(trade_runs)
	$(begin)
	scripts/paper/curves trade $^ --base default --show fast,accurate,paper --cost "seconds:seconds of a pair" \
	    --error "rms_w_px:RMS error of w, px" --error "rms_u_px:RMS error of u, px" --plot "$$d/trade.svg" \
	    --title "Time and error of the chain, one thread" > "$$d/trade.md"
	keep trade.svg $(OUT)/trade.svg
	done_ trade.md

# ---- Claims, pictures, tables ---------------------------------------------------------------------------------------

claims: $(OUT)/claims.jsonl
$(OUT)/claims.jsonl: $(filter-out fig4,$(figures))
	$(begin)
	scripts/paper/claims $(OUT) > "$$d/claims.jsonl"
	done_ claims.jsonl

view:
	ls $(OUT)/*.svg $(OUT)/fig4/*.svg
	scripts/paper/claims $(OUT) table

# Replaces what stands between the marks of scripts/measured/paper-*.md by what `burn` has measured. Without runs of the
# trade its tables stay.
measured:
	target=$(OUT)/measured bin=$(BIN) threads=$(THREADS); eval "$$steps"
	scripts/paper/claims $(OUT) table > "$$d/claims.md"
	[ ! -e $(OUT)/trade.md ] || cp $(OUT)/trade.md "$$d"
	for part in claims trade; do
	    [ -e "$$d/$$part.md" ] || continue
	    page=scripts/measured/paper-$$part.md
	    awk -v part="$$part" -v file="$$d/$$part.md" '
	        $$0 == "<!-- end of " part " -->" { inside = 0 }
	        !inside { print }
	        $$0 ~ "^<!-- " part ":" { inside = found = 1; while ((getline line < file) > 0) print line }
	        END { if (inside || !found) exit 1 }' "$$page" > "$$d/next.md"
	    cat "$$d/next.md" > "$$page"
	done

clean:
	rm -rf $(OUT)
