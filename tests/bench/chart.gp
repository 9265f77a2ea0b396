# Speed against accuracy: gnuplot -e "csv='FILE.csv'; base='OUT'" chart.gp draws OUT.svg and OUT.png.
#
# One plot for each panel and scene of the table, two in a row; one for all scenes of georef, two for those of beam. A method's name is its family, which has a symbol, and as the last
# word what is varied in it, which stands beside the symbol. Errors of 0 are drawn at 1e-17 m.
set datafile separator ","
set datafile missing "nan"

rows(condition, print_what) = system("awk -F, 'NR > 1 && " . condition . " { " . print_what . " }' '" . csv . "'")
family = "f = $2; sub(/ [^ ]*$/, \"\", f); "
panel_of(i) = word(plots, 2 * i - 1)
scene_of(i) = word(plots, 2 * i)
here(i) = "$1 == \"" . panel_of(i) . "\" && $3 == \"" . scene_of(i) . "\""
plots = rows("$1 !~ /^(georef|beam)/", "if (!seen[$1, $3]++) print \"\\042\" $1 \"\\042\", \"\\042\" $3 \"\\042\"")
families(i) = rows(here(i), family . "if (!seen[f]++) print \"\\042\" f \"\\042\"")
# "< awk" makes a table of one family: ns, p99.9, max, what is varied
part(i, f) = "< awk -F, 'NR > 1 && " . here(i) . " { " . family . "n = split($2, w, \" \"); if (f ~ /^" . f . \
    "$/) print $4 \",\" ($5 > 0 ? $5 : 1e-17) \",\" ($6 > 0 ? $6 : 1e-17) \",\" (n > 1 ? w[n] : \"\") }' '" . csv . "'"
# Labels of a family that would stand in each other become one.
labels(i, f) = part(i, f) . " | sort -t, -g | awk -F, 'NR > 1 && $1 < 1.06 * x { text = text \" \" $4; x = $1; next } " . \
    "NR > 1 { print first \",\" text } { first = x = $1; text = $4 } END { print first \",\" text }'"
marked(i, column) = "< awk -F, 'NR > 1 && " . here(i) . " && $" . column . " == 1 { print $4 \",\" ($5 > 0 ? $5 : 1e-17) }' '" . \
    csv . "' | sort -t, -g"

n_plots = words(plots) / 2
# georef: the same few methods in every scene, so that a scene is what has a symbol, and the method stands beside it
radii = rows("$1 == \"georef\"", "if (!seen[$3]++) print \"\\042\" $3 \"\\042\"")
within(r) = "< awk -F, 'NR > 1 && $1 == \"georef\" && $3 == \"" . r . "\" { print $4 \",\" ($5 > 0 ? $5 : 1e-17) \",\" " . \
    "($6 > 0 ? $6 : 1e-17) \",\" $2 \",\" $7 \",\" $8 }' '" . csv . "' | sort -t, -g"
method(r, is) = within(r) . " | awk -F, '$4 " . is . " \"flat earth\"' | sed 's/order //'"
only(r, column) = within(r) . " | awk -F, '$" . column . " == 1'"
# beam: likewise, once the ranges (column 9), once the counts (10); what is 0 there is left out. The last field tells
# whether the label stands below (0), above (1) or beside (2) the symbol: rings of different scenes lie close to each other.
scenes = rows("$1 == \"beam\"", "if (!seen[$3]++) print \"\\042\" $3 \"\\042\"")
of(k, y) = "< awk -F, 'NR > 1 && $1 == \"beam\" && $3 == \"" . word(scenes, k) . "\" && $" . y . " > 0 { m = $2; ring = sub(/rings /, \"\", m); " . \
    "print $4 \",\" $" . y . " \",\" m \",\" $8 \",\" (" . k . " > 2 ? (m == \"adaptive\" ? 0 : ring && " . y . " == 10 ? 2 : 1) : ring && " . y . " == 10 ? " . k . " == 2 : " . k . \
    " == 1) }' '" . csv . "' | sort -t, -g"
those(k, y, what) = of(k, y) . " | awk -F, '" . what . "'"
best = "NR == 1 || $2 < least { least = $2; print }"
array beam_title[2] = ["beam: range of echoes, by sub-rays a pulse", "beam: number of echoes, by sub-rays a pulse"]
array beam_y[2] = ["RMS error in m, where the number of echoes is right", "wrong numbers, as a part of the mixed pulses"]
n_rows = (n_plots + (words(radii) > 0) + 1) / 2 + (words(scenes) > 0)

array colour[8] = ["#d55e00", "#e69f00", "#0072b2", "#56b4e9", "#009e73", "#cc79a7", "#666666", "#000000"]
array symbol[8] = [8, 9, 6, 7, 5, 11, 13, 3]
# Labels in lanes below the symbols: families that lie within two decades of each other have lanes of their own, below
# the lowest of them.
array lane[8]
array level[8]
array lowest[8]
lane_offset(k) = 0.1 - 1.05 * lane[k]

set style line 20 lc rgb "#dddddd" lw 1
set logscale xy
set format y "10^{%T}"
set grid xtics ytics ls 20
set xlabel "ns per pulse, one thread" offset 0, 0.4
set ylabel "error of the range in m" offset 1, 0
set key bmargin center horizontal maxrows 2 samplen 1 width -2 font ",10"
set bmargin 6.6
how_to_read = "Symbol: 99.9th percentile of the error; bar: up to the largest error; number: what varies in a family (cast: rays per packet)\n" \
    . "Dashed: front, nothing is faster and as exact; circle: default; an error of 0 is drawn at 10^{-17} m; a miss counts as the whole range"

do for [out in "svg png"] {
    if (out eq "svg") {
        set terminal svg size 1200, 620 * n_rows font "DejaVu Sans,13" background "#ffffff"
    } else {
        set terminal pngcairo size 1200, 620 * n_rows font "DejaVu Sans,11"
    }
    set output base . "." . out
    set xtics (15, 20, 30, 50, 70, 100, 150, 200, 300, 500, 700, 1000, 1500, 2000)
    set multiplot layout n_rows, 2 title how_to_read font ",12" offset 0, -0.3
    do for [i = 1:n_plots] {
        set title panel_of(i) . ": " . scene_of(i) font ",14" offset 0, -0.4
        names = families(i)
        n = words(names)
        set xrange [*:*]
        set yrange [*:*]
        stats part(i, ".*") using 1:2 nooutput name "low"
        stats part(i, ".*") using 1:3 nooutput name "high"
        decades = log10(high_max_y / low_min_y)
        do for [k = 1:n] {
            stats part(i, word(names, k)) using 2 nooutput name "own"
            level[k] = log10(own_min)
            lane[k] = 1
            do for [j = 1:k-1] { lane[k] = lane[k] + (abs(level[j] - level[k]) < 2) }
        }
        do for [k = 1:n] {
            lowest[k] = level[k]
            do for [j = 1:n] { if (abs(level[j] - level[k]) < 2 && level[j] < lowest[k]) { lowest[k] = level[j] } }
        }
        set xrange [low_min_x * 0.8 : low_max_x * 1.25]
        set yrange [low_min_y * 10 ** (-0.3 - 0.17 * decades) : high_max_y * 10 ** (0.3 + 0.03 * decades)]
        plot marked(i, 7) using 1:2 with lines lc rgb "#000000" lw 1.5 dt 2 title "front", \
            marked(i, 8) using 1:2 with points pt 6 ps 3 lw 2 lc rgb "#000000" title "default", \
            for [k = 1:n] part(i, word(names, k)) using 1:2:2:3 with yerrorbars pt symbol[k] ps 1.2 lw 1 lc rgb colour[k] \
            notitle, \
            for [k = 1:n] NaN with points pt symbol[k] ps 1.4 lc rgb colour[k] title word(names, k), \
            for [k = 1:n] labels(i, word(names, k)) using 1:(10 ** lowest[k]):2 with labels offset 0, lane_offset(k) font ",9" tc rgb colour[k] notitle
    }
    if (words(radii) > 0) {
        n = words(radii)
        set xtics (0.5, 1, 2, 3, 5, 10, 20, 50, 100, 200, 500, 1000)
        set title "georef: scene to UTM by order 1, 2, 3, within 10 m to 5 km" font ",14" offset 0, -0.4
        set ylabel "error of the position in m"
        set xrange [*:*]
        set yrange [*:*]
        stats "< awk -F, '$1 == \"georef\"' '" . csv . "'" using 4:5 nooutput name "low"
        stats "< awk -F, '$1 == \"georef\"' '" . csv . "'" using 4:6 nooutput name "high"
        set xrange [low_min_x * 0.6 : low_max_x * 1.7]
        set yrange [low_min_y / 5 : high_max_y * 6]
        plot 1e-6 with lines lc rgb "#d55e00" lw 1 dt 3 title "tolerance", \
            for [k = 1:n] only(word(radii, k), 5) using 1:2 with lines lc rgb colour[k] lw 1 dt 2 notitle, \
            NaN with lines lc rgb "#000000" lw 1.5 dt 2 title "front", \
            for [k = 1:n] only(word(radii, k), 6) using 1:2 with points pt 6 ps 3 lw 2 lc rgb "#000000" \
            title (k == 1 ? "default" : ""), \
            for [k = 1:n] within(word(radii, k)) using 1:2:2:3 with yerrorbars pt symbol[k] ps 1.2 lw 1 lc rgb colour[k] \
            notitle, \
            for [k = 1:n] NaN with points pt symbol[k] ps 1.4 lc rgb colour[k] title word(radii, k), \
            method(word(radii, n), "!=") using 1:(low_min_y / 2.5):4 with labels font ",10" tc rgb "#000000" notitle, \
            method(word(radii, n), "==") using 1:(high_max_y * 2.5):4 with labels font ",10" tc rgb "#000000" notitle
        set ylabel "error of the range in m" offset 1, 0
    }
    n = words(scenes)
    if ((n_plots + (words(radii) > 0)) % 2 == 1 && n > 0) { set multiplot next }
    set xtics (20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000)
    do for [p = 1:(n > 0 ? 2 : 0)] {
        y = 8 + p
        set title beam_title[p] font ",14" offset 0, -0.4
        set ylabel beam_y[p]
        set xrange [*:*]
        set yrange [*:*]
        stats "< awk -F, '$1 == \"beam\" && $" . y . " > 0' '" . csv . "'" using 4:y nooutput name "low"
        set xrange [low_min_x * 0.6 : low_max_x * 1.7]
        set yrange [low_min_y / 2.5 : low_max_y * 2.5]
        plot for [k = 1:n] those(k, y, best) using 1:2 with lines lc rgb colour[k] lw 1 dt 2 notitle, \
            NaN with lines lc rgb "#000000" lw 1.5 dt 2 title "front", \
            for [k = 1:n] those(k, y, "$4 == 1") using 1:2 with points pt 6 ps 3 lw 2 lc rgb "#000000" \
            title (k == 1 ? "default" : ""), \
            for [k = 1:n] of(k, y) using 1:2 with points pt symbol[k] ps 1.2 lc rgb colour[k] notitle, \
            for [k = 1:n] NaN with points pt symbol[k] ps 1.4 lc rgb colour[k] title word(scenes, k), \
            for [k = 1:n] those(k, y, "$5 == 1") using 1:2:3 with labels offset 0, 1.0 font ",9" tc rgb colour[k] notitle, \
            for [k = 1:n] those(k, y, "$5 == 2") using 1:2:3 with labels left offset 0.7, 0 font ",9" tc rgb colour[k] notitle, \
            for [k = 1:n] those(k, y, "$5 == 0") using 1:2:3 with labels offset 0, -1.0 font ",9" tc rgb colour[k] notitle
    }
    set ylabel "error of the range in m" offset 1, 0
    unset multiplot
    unset output
}
