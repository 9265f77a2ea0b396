# gnuplot -e "csv='FILE.csv'; base='OUT'" chart_waveform.gp draws OUT.svg and OUT.png, two plots of waveforms: the error
# of the samples against cost, for shapes that have a method without sub-rays, and others. README.md says how to read
# them.
load "tests/bench/chart_style.gp"

array like[6] = [1, 3, 2, 6, 7, 5]
scenes = rows("$1 == \"waveform\"", distinct("$3"))
rings(s) = table(in_panel("waveform", s) . " && $2 ~ /rings/", "m = $2; sub(/rings /, \"\", m); print $4 \",\" $9 \",\" m")
marked(s, column) = table(in_panel("waveform", s) . " && $" . column . " == 1", "print $4 \",\" $9 \",\" $2")
n_rows = 1

do for [out in "svg png"] {
    eval terminal(out, n_rows)
    set output base . "." . out
    set multiplot
    eval place(0, n_rows)
    eval legend_on
    set key at graph 0.5, graph 0.95 center top horizontal maxrows 2 samplen 1.6 spacing 1.35 width 1
    set label 1 "Against 100,000 sub-rays. Dashed: front, nothing is faster and as exact. Circle: default.\n" \
        . "Along a line, from the left: 7, 19, 61, 127 and 1027 sub-rays for each pulse." \
        at screen 0.5, screen 1 - 150.0 / (head + n_rows * high) center font ",17"
    plot for [k = 1:words(scenes)] NaN with linespoints lw 2 pt symbol[like[k]] ps 2.6 lc rgb colour[like[k]] \
        title word(scenes, k), \
        NaN with lines lc rgb "#000000" lw 3 dt 2 title "front", \
        NaN with points pt 6 ps 5 lw 3.5 lc rgb "#000000" title "default"
    unset label 1
    eval legend_off
    set ylabel "RMS error of a sample, counts of 12 bits"
    do for [p = 1:2] {
        first = p == 1 ? 1 : 5
        last = p == 1 ? 4 : words(scenes)
        eval place(p, n_rows)
        set title (p == 1 ? "One plane, or two along a line" : "Sub-rays alone") offset 0, -0.4
        set xrange [80:60000]
        set yrange [1e-4:3e3]
        plot 1 with lines lc rgb "#7a7a7a" lw 2 dt 3, \
            for [k = first:last] marked(word(scenes, k), 7) using 1:2 with lines lc rgb colour[like[k]] lw 3 dt 2, \
            for [k = first:last] rings(word(scenes, k)) using 1:2 with linespoints lw 1.5 pt symbol[like[k]] ps 2.2 \
            lc rgb colour[like[k]], \
            for [k = first:last] marked(word(scenes, k), 8) using 1:2 with points pt symbol[like[k]] ps 2.2 lw 1.5 \
            lc rgb colour[like[k]], \
            for [k = first:last] marked(word(scenes, k), 8) using 1:2 with points pt 6 ps 5 lw 3.5 lc rgb "#000000"
    }
    unset multiplot
    unset output
}
