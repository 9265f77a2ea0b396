# gnuplot -e "csv='FILE.csv'; base='OUT'" chart_more.gp draws OUT.svg and OUT.png: georeferencing and beams. Here a
# scene has a symbol, and the method stands beside it.
load "tests/bench/chart_style.gp"

radii = rows("$1 == \"georef\"", distinct("$3"))
scenes = rows("$1 == \"beam\"", distinct("$3"))
within(r, what) = table(in_panel("georef", r) . what, "m = $2; sub(/order /, \"\", m); " . \
    "print $4 \",\" ($5 > 0 ? $5 : 1e-17) \",\" $6 \",\" m")
# Ranges are column 9, counts column 10; what is 0 is left out.
of(k, y, what) = table(in_panel("beam", word(scenes, k)) . " && $" . y . " > 0" . what, \
    "m = $2; sub(/rings /, \"\", m); print $4 \",\" $" . y . " \",\" m")
best = " | awk -F, 'NR == 1 || $2 < least { least = $2; print }'"
array title[2] = ["Beam: ranges of echoes", "Beam: number of echoes"]
array label[2] = ["RMS error, m", "wrong, of the mixed pulses"]
n_rows = 2
head = 120.0

do for [out in "svg png"] {
    eval terminal(out, n_rows)
    set output base . "." . out
    set multiplot
    eval place(0, n_rows)
    eval legend_on
    set label 1 "Dashed: front, nothing is faster and as exact. Circle: default. Bar: up to the largest error.\n" \
        . "Along a thin line, from the left: 7, 19, 37, 61 and 127 sub-rays for each pulse." \
        at screen 0.5, screen 1 - 40.0 / (head + n_rows * high) center font ",17"
    plot NaN notitle
    unset label 1
    eval legend_off

    eval place(1, n_rows)
    set size 1, high / (head + n_rows * high)
    n = words(radii)
    set key at graph 0.985, graph 0.8 right top horizontal maxrows 1 samplen 1 width 1 title "points within" left
    set title "Georeferencing to UTM, by the order of the polynomial" offset 0, -0.4
    set ylabel "error of the position, m"
    set format y "10^{%T}"
    set ytics 1e-18, 1e3, 1e6
    set xtics (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
    set xrange [0.25:900]
    set yrange [2e-11:3e2]
    set label 2 "tolerance" at 5, 4e-6 font ",17" tc rgb "#7a7a7a"
    plot 1e-6 with lines lc rgb "#7a7a7a" lw 2 dt 3 notitle, \
        for [k = 1:n] within(word(radii, k), " && $7 == 1") using 1:2 with lines lc rgb colour[k] lw 2 dt 2 notitle, \
        for [k = 1:n] within(word(radii, k), "") using 1:2:2:3 with yerrorbars pt symbol[k] ps 2.2 lw 1.5 lc rgb colour[k] \
        notitle, \
        for [k = 1:n] NaN with points pt symbol[k] ps 2.6 lc rgb colour[k] title word(radii, k), \
        within(word(radii, n), " && $2 != \"flat earth\"") using 1:(5e1):4 with labels font ",17" notitle, \
        within(word(radii, n), " && $2 == \"flat earth\"") using 1:(5e1):4 with labels right font ",17" notitle, \
        for [k = 1:n] within(word(radii, k), " && $8 == 1") using 1:2 with points pt 6 ps 5 lw 3.5 lc rgb "#000000" notitle
    unset label 2

    n = words(scenes)
    set xtics (20, 50, 100, 200, 500, "1000" 1000, 2000, 5000, "10^4" 10000)
    do for [p = 1:2] {
        y = 8 + p
        eval place(2 + p, n_rows)
        set title title[p] offset 0, -0.4
        if (p == 1) {
            set key at graph 0.985, graph 0.965 right top horizontal maxrows 1 samplen 1 width 0 title ""
        } else {
            set key at graph 0.985, graph 0.4 right top vertical maxrows 3 samplen 1 width 0 title ""
        }
        set ylabel label[p]
        if (p == 1) {
            set ytics 1e-6, 10, 10
        } else {
            set format y "%g"
            set ytics (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1)
        }
        set xrange [*:*]
        set yrange [*:*]
        stats table("$1 == \"beam\" && $" . y . " > 0", "print $4 \",\" $" . y) using 1:2 nooutput name "low"
        set xrange [low_min_x / 1.8 : low_max_x * 1.8]
        set yrange [low_min_y / (p == 1 ? 4.0 : 2.0) : low_max_y * (p == 1 ? 12.0 : 2.5)]
        plot for [k = 1:n] of(k, y, " && $2 ~ /rings/") using 1:2 with lines lw 1.5 lc rgb colour[k] notitle, \
            for [k = 1:n] of(k, y, "") . best using 1:2 with lines lc rgb colour[k] lw 2.5 dt 2 notitle, \
            for [k = 1:n] of(k, y, "") using 1:2 with points pt symbol[k] ps 2.2 lw 1.5 lc rgb colour[k] notitle, \
            for [k = 1:n:2] of(k, y, " && $2 == \"single\"") using 1:2:3 with labels offset 0, 0.9 font ",17" notitle, \
            for [k = 1:n] of(k, y, " && $2 == \"adaptive\"") using 1:2:3 with labels left offset 0.5, -0.8 \
            font ",17" tc rgb colour[k] notitle, \
            for [k = 1:n] NaN with points pt symbol[k] ps 2.6 lc rgb colour[k] title word(scenes, k), \
            for [k = 1:n] of(k, y, " && $8 == 1") using 1:2 with points pt 6 ps 5 lw 3.5 lc rgb "#000000" notitle
    }
    unset multiplot
    unset output
    set format y "10^{%T}"
}
