# Shared by the methods of the tools, which source it in the folder of a result (see `run` for the variables).
set -euo pipefail
export LF_HISTORY=off

seen() { # N: the words of frame N for a reconstruction
    echo "-i $ENTRANT/frame-$(printf %04d "$1").exr -c $CAMERA -b $ENTRANT/dark.exr --threads 1"
}

prune() { # N [OPTION...]: the voxels of frame N that may hold light, to standard output
    local frame
    frame=$ENTRANT/frame-$(printf %04d "$1").exr
    lf-prune "$frame" -c "$CAMERA" -b "$ENTRANT/dark.exr" --threads 1 "--depth=$DEPTH" "--bounds=$BOUNDS" "${@:2}"
}

centred() { # particles with the z of the dots, from standard input to standard output
    awk -F, -v OFS=, -v zero="$ZERO_Z" '/^[0-9]/ { $5 = sprintf("%.6f", $5 - zero) } { print }'
}

pairs() { # PREFIX ENDING: what lf-xcorr takes of the frames, pair after pair
    local n
    for ((n = 0; n < LAST; n++)); do
        [ "$2" = csv ] && echo "--particles" || { [ $n = 0 ] || echo "--and"; }
        echo "$1-$n.$2 $1-$((n + 1)).$2"
    done
}

table() { # all frames' particles in one table
    cat found-*.csv | awk '/^[0-9]/ || !seen[$0]++' > particles.csv
}

by_particles() { # the field and the tracks from the particles of all frames
    lf-xcorr $(pairs found csv) --tracks pairs.csv --threads 1 -o field.exr
    # Pair n has the frames 2 n and 2 n + 1.
    awk -F, -v OFS=, '/^[0-9]/ { $1 = int($1 / 2) + $1 % 2 } { print }' pairs.csv > tracks.csv
    rm found-*.csv pairs.csv
}
