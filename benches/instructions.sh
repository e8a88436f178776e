#!/usr/bin/env bash
# Instructions per directed bond of a force evaluation of every model, counted by valgrind, beside those of instructions.txt: more than 3 % more fails,
# and so does more than 3 % less, until the file says so. Valgrind has no AVX-512: lanes of AVX2 are counted.
#
#   benches/instructions.sh            compare
#   benches/instructions.sh --write    write instructions.txt anew
set -euo pipefail
cd "$(dirname "$0")/.."
file=benches/instructions.txt
if ! command -v valgrind >/dev/null; then
    echo "instructions: not counted, because valgrind is not installed (apt-get install valgrind)"
    exit 0
fi
cargo build --release -q -p peridyne-benches --bin count
count="${CARGO_TARGET_DIR:-target}/release/count"

# instructions of a run with so many evaluations
run() { valgrind --tool=cachegrind --cache-sim=no --cachegrind-out-file=/dev/null "$count" "$1" "$2" 2>&1 >"$work/bonds" | awk '/I *refs/ { gsub(",", "", $NF); print $NF }'; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$count" >"$work/models"
: >"$work/now"
while IFS=$'\t' read -r number name; do
    # what both runs do alike, set-up above all, cancels
    few=$(run "$number" 2 </dev/null)
    many=$(run "$number" 6 </dev/null)
    awk -v few="$few" -v many="$many" -v bonds="$(cat "$work/bonds")" -v name="$name" 'BEGIN { printf "%s\t%.2f\n", name, (many - few) / 4 / bonds }' >>"$work/now"
done <"$work/models"

if [ "${1:-}" = --write ]; then
    { echo "# instructions per directed bond of a force evaluation, lanes of AVX2; written by benches/instructions.sh --write"; cat "$work/now"; } >"$file"
    cat "$file"
    exit 0
fi
awk -F'\t' '
    /^#/ { next }
    NR == FNR { baseline[$1] = $2; next }
    !($1 in baseline) { printf "%-34s %10.2f   not in the file\n", $1, $2; failed = 1; next }
    {
        change = 100 * ($2 / baseline[$1] - 1)
        verdict = change > 3 ? "SLOWER" : change < -3 ? "faster: write the file anew" : "ok"
        if (verdict != "ok") failed = 1
        printf "%-34s %10.2f %10.2f %+7.2f %%  %s\n", $1, $2, baseline[$1], change, verdict
    }
    END { exit failed }
' "$file" "$work/now"
