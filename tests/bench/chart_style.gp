# All chart*.gp share this: how the table is read, and how a picture looks that is shown at half its size. A method's
# name is its family and, as the last word, the value that is varied. Errors of 0 are drawn at 1e-17 m.
set datafile separator ","
set datafile missing "nan"

rows(condition, print_what) = system("awk -F, 'NR > 1 && " . condition . " { " . print_what . " }' '" . csv . "'")
table(condition, print_what) = "< awk -F, 'NR > 1 && " . condition . " { " . print_what . " }' '" . csv . "' | sort -t, -g"
distinct(column) = "if (!seen[" . column . "]++) print \"\\042\" " . column . " \"\\042\""
family = "f = $2; sub(/ [^ ]*$/, \"\", f); "
last_word = "n = split($2, w, \" \"); "
ns_error = "print $4 \",\" ($5 > 0 ? $5 : 1e-17) \",\" ($6 > 0 ? $6 : 1e-17)"
in_panel(panel, scene) = "$1 == \"" . panel . "\" && $3 == \"" . scene . "\""

array colour[8] = ["#d55e00", "#e69f00", "#0072b2", "#56b4e9", "#7a7a7a", "#009e73", "#cc79a7", "#000000"]
array symbol[8] = [8, 9, 6, 7, 13, 5, 11, 3]

set style line 20 lc rgb "#dddddd" lw 1
set border lw 1.5
set tics scale 0.8
set logscale xy
set format y "10^{%T}"
set grid xtics ytics ls 20
unset key

# A picture has a legend on top, and below it n_rows rows of two plots. These sizes are pixels.
wide = 1800.0
head = 215.0
high = 620.0
size_of(n_rows) = sprintf("%d, %d", wide, head + n_rows * high)
terminal(out, n_rows) = out eq "svg" ? \
    "set terminal svg size " . size_of(n_rows) . " font \"DejaVu Sans,25\" background \"#ffffff\"" : \
    "set terminal pngcairo size " . size_of(n_rows) . " font \"DejaVu Sans,19\""
# This places plot p of n_rows rows; plot 1 is on the left, and 0 is the legend.
place(p, n_rows) = p == 0 ? \
    sprintf("set origin 0, %f; set size 1, %f", n_rows * high / (head + n_rows * high), head / (head + n_rows * high)) : \
    sprintf("set origin %f, %f; set size 0.5, %f", 0.5 * ((p - 1) % 2), \
        (n_rows - 1 - (p - 1) / 2) * high / (head + n_rows * high), high / (head + n_rows * high))
legend_on = "unset border; unset tics; unset xlabel; unset ylabel; unset grid; unset logscale; " \
    . "set xrange [0:1]; set yrange [0:1]; set lmargin 0; set rmargin 0; set tmargin 0; set bmargin 0"
legend_off = "set border 31 lw 1.5; set tics scale 0.8; set grid xtics ytics ls 20; set logscale xy; unset key; " \
    . "set lmargin 9; set rmargin 1.5; set tmargin 2.2; set bmargin 3.4; " \
    . "set xlabel 'ns per pulse, one thread' offset 0, 0.5"
