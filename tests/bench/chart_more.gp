# The chart's other stages, georeferencing and beams: gnuplot -e "csv='FILE.csv'; base='OUT'" chart_more.gp draws OUT.svg
# and OUT.png. There, scenes have a symbol, and the method stands beside it.
load "tests/bench/chart_style.gp"

radii = rows("$1 == \"georef\"", distinct("$3"))
scenes = rows("$1 == \"beam\"", distinct("$3"))
within(r, what) = table(in_panel("georef", r) . what, "m = $2; sub(/order /, \"\", m); " . \
    "print $4 \",\" ($5 > 0 ? $5 : 1e-17) \",\" $6 \",\" m")
# Ranges are column 9, counts column 10; what is 0 is left out.
of(k, y, what) = table(in_panel("beam", word(scenes, k)) . " && $" . y . " > 0" . what, \
    "m = $2; sub(/rings /, \"\", m); print $4 \",\" $" . y . " \",\" m")
best = " | awk -F, 'NR == 1 || $2 < least { least = $2; print }'"
array title[2] = ["Beam: ranges, by sub-rays a pulse", "Beam: echoes, by sub-rays a pulse"]
array label[2] = ["RMS error of the range, m", "pulses with a wrong number, of mixed"]
n_rows = 2

# Symbols and their scenes in the corner of plot 2, which is empty.
do for [out in "svg png"] {
    eval terminal(out, n_rows)
    set output base . "." . out
    set multiplot
    eval place(0, n_rows)
    eval legend_on
    set label 1 "Dashed: front, nothing is faster and as exact. Circle: default. Bar: up to the largest error." \
        at screen 0.5, screen 1 - 60.0 / (head + n_rows * high) center font ",17"
    plot NaN notitle
    unset label 1
    eval legend_off
}
