# gnuplot -e "csv='FILE.csv'; base='OUT'" chart_moving.gp draws OUT.svg and OUT.png, two plots: speed against accuracy
# where the head moves, or a body. README.md says how to read them.
load "tests/bench/chart_style.gp"

movers = rows("$1 == \"moving\"", distinct("$3"))
moves(s, f) = table(in_panel("moving", s), family . "if (f == \"" . f . "\") " . ns_error)
marked(s, column) = table(in_panel("moving", s) . " && $" . column . " == 1", ns_error)
array way[3] = ["plain float", "robust float", "decided"]
array named[3] = ["Embree, plain", "Embree, robust", "BVH, decided"]
array like[3] = [1, 2, 5]
n_rows = 1

do for [out in "svg png"] {
    eval terminal(out, n_rows)
    set output base . "." . out
    set multiplot
    eval place(0, n_rows)
    eval legend_on
    set key at graph 0.5, graph 0.95 center top horizontal maxrows 1 samplen 1.6 spacing 1.35 width 1
    set label 1 "Symbol: 99.9 % of the errors are smaller. Bar: up to the largest one.\n" \
        . "Along a line, from the left: 16, 8, 4 and 1 rays in a packet. Further left is faster, further down more exact." \
        at screen 0.5, screen 1 - 130.0 / (head + n_rows * high) center font ",17"
    plot for [k = 1:3] NaN with linespoints lw 2 pt symbol[like[k]] ps 2.6 lc rgb colour[like[k]] title named[k], \
        NaN with lines lc rgb "#000000" lw 3 dt 2 title "front", \
        NaN with points pt 6 ps 5 lw 3.5 lc rgb "#000000" title "default"
    unset label 1
    eval legend_off
    set xtics (10, 20, 30, 50, 100, 200, 300, 500)
    set ylabel "error of the range, m"
    set ytics 1e-18, 1e3, 1e6
    do for [i = 1:words(movers)] {
        s = word(movers, i)
        eval place(i, n_rows)
        set title (s eq "head" ? "A head that moves" : "A body that moves; float: an instance of it") offset 0, -0.4
        set xrange [*:*]
        set yrange [*:*]
        stats table(in_panel("moving", s), ns_error) using 1:2 nooutput name "low"
        stats table(in_panel("moving", s), ns_error) using 1:3 nooutput name "high"
        set xrange [low_min_x / 1.3 : low_max_x * 1.2]
        set yrange [low_min_y / 20 : high_max_y * 100]
        plot marked(s, 7) using 1:2 with lines lc rgb "#000000" lw 3 dt 2, \
            for [k = 1:3] moves(s, way[k]) using 1:2 with lines lw 1.5 lc rgb colour[like[k]], \
            for [k = 1:3] moves(s, way[k]) using 1:2:2:3 with yerrorbars pt symbol[like[k]] ps 2.2 lw 1.5 \
            lc rgb colour[like[k]], \
            marked(s, 8) using 1:2 with points pt 6 ps 5 lw 3.5 lc rgb "#000000"
    }
    unset multiplot
    unset output
}
