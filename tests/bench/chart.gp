# gnuplot -e "csv='FILE.csv'; base='OUT'" chart.gp draws OUT.svg and OUT.png, six plots: speed against accuracy of the
# ways to cast, and from how many pulses on a sight pays. README.md says how to read them.
load "tests/bench/chart_style.gp"

array title[4] = ["Near ground, to 100 m", "Flat ground, to 1.5 km", "Every ray at an edge or corner", \
    "Cost of a normal scan, worst error of all"]
scenes = rows("$1 == \"cast\"", distinct("$3"))
families = rows("$1 == \"cast\"", family . distinct("f"))
grounds = rows("$1 == \"pulses\"", distinct("$3"))
n = words(families)
of(s, f) = table(in_panel("cast", s), family . "if (f == \"" . f . "\") " . ns_error)
marked(s, column) = table(in_panel("cast", s) . " && $" . column . " == 1", ns_error)
pulses(s, f) = table(in_panel("pulses", s), family . last_word . "if (f == \"" . f . "\") print w[n] \",\" $4")
planned(s) = table(in_panel("pulses", s) . " && $8 == 1", last_word . "print w[n] \",\" $4")
array line[3] = ["float", "decided", "sight"]
array line_like[3] = [2, 5, 6]
named(f) = f eq "decided" ? "BVH, decided" : f
n_rows = 3

do for [out in "svg png"] {
    eval terminal(out, n_rows)
    set output base . "." . out
    set multiplot
    eval place(0, n_rows)
    eval legend_on
    set key at graph 0.5, graph 0.95 center top horizontal maxrows 2 samplen 1.6 spacing 1.35 width 1
    set label 1 "Symbol: 99.9 % of the errors are smaller. Bar: up to the largest one; a miss is wrong by its whole range.\n" \
        . "Along a line, from the left: 16, 8, 4 and 1 rays in a packet. Further left is faster, further down more exact." \
        at screen 0.5, screen 1 - 158.0 / (head + n_rows * high) center font ",17"
    plot for [k = 1:n] NaN with linespoints lw 2 pt symbol[k] ps 2.6 lc rgb colour[k] title named(word(families, k)), \
        NaN with lines lc rgb "#000000" lw 3 dt 2 title "front", \
        NaN with points pt 6 ps 5 lw 3.5 lc rgb "#000000" title "default"
    unset label 1
    eval legend_off
    set xtics (2, 3, 5, 10, 20, 30, 50, 100, 200, 300, 500, 1000)
    set ylabel "error of the range, m"
    set ytics 1e-18, 1e3, 1e6
    do for [i = 1:words(scenes)] {
        s = word(scenes, i)
        eval place(i, n_rows)
        set title title[i] offset 0, -0.4
        set xrange [*:*]
        set yrange [*:*]
        stats table(in_panel("cast", s), ns_error) using 1:2 nooutput name "low"
        stats table(in_panel("cast", s), ns_error) using 1:3 nooutput name "high"
        set xrange [low_min_x / 1.3 : low_max_x * 1.2]
        set yrange [low_min_y / 20 : high_max_y * 10]
        plot marked(s, 7) using 1:2 with lines lc rgb "#000000" lw 3 dt 2, \
            for [k = 1:n] of(s, word(families, k)) using 1:2 with lines lw 1.5 lc rgb colour[k], \
            for [k = 1:n] of(s, word(families, k)) using 1:2:2:3 with yerrorbars pt symbol[k] ps 2.2 lw 1.5 lc rgb colour[k], \
            marked(s, 8) using 1:2 with points pt 6 ps 5 lw 3.5 lc rgb "#000000"
    }
    set xlabel "pulses of a scan" offset 0, 0.5
    set ylabel "ns per pulse"
    set format x "10^{%T}"
    set format y "%g"
    set xtics 1e5, 10, 1e8
    set ytics (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)
    do for [i = 1:words(grounds)] {
        s = word(grounds, i)
        eval place(4 + i, n_rows)
        set title (s eq "house" ? "House" : "Terrain of 100,000 triangles") . ", sight with its building" offset 0, -0.4
        set xrange [7e4:1.5e8]
        set yrange [*:*]
        plot for [k = 1:3] pulses(s, line[k]) using 1:2 with linespoints lw 2.5 pt symbol[line_like[k]] ps 2.2 \
            lc rgb colour[line_like[k]], \
            planned(s) using 1:2 with points pt 6 ps 5 lw 3.5 lc rgb "#000000"
    }
    unset multiplot
    unset output
    set format x "%h"
    set format y "10^{%T}"
}
