# SPDX-License-Identifier: MIT
# Lines of `set, figure, value` become medians, beside the aims. speed.sh calls this.
function median(of, n, i, j, t, x) {
    for (i = 1; i <= n; i++) x[i] = value[of, i]
    for (i = 2; i <= n; i++)
        for (j = i; j > 1 && x[j] < x[j - 1]; j--) { t = x[j]; x[j] = x[j - 1]; x[j - 1] = t }
    return n % 2 ? x[(n + 1) / 2] : (x[n / 2] + x[n / 2 + 1]) / 2
}
# most: the largest figure that is aimed at, with the best instruction set; "": there is no aim. AVX2 may take 1.6 times as long.
function row(text, figure, unit, most, a, b, said) {
    if (!n["native", figure]) return
    a = median("native" SUBSEP figure, n["native", figure])
    said = most == "" ? "" : (a <= most) ? "reached" : "missed"
    printf "%-48s %8.3f %-12s %6s %-8s", text, a, unit, most, said
    if (n["avx2", figure]) {
        b = median("avx2" SUBSEP figure, n["avx2", figure])
        printf " %8.3f", b
        if (unit != "x") printf " %6.2f %s", b / a, unit == "ns a point" && most == "" ? "" : b <= 1.6 * a ? "reached" : "missed"
    }
    print ""
}
# Nanoseconds become points a second.
function rate(text, figure, least, a, b) {
    if (!n["native", figure]) return
    a = 1000 / median("native" SUBSEP figure, n["native", figure])
    printf "%-48s %8.1f %-12s %6s %-8s", text, a, "M points/s", least, (a >= least) ? "reached" : "missed"
    if (n["avx2", figure]) {
        b = 1000 / median("avx2" SUBSEP figure, n["avx2", figure])
        printf " %8.1f %6.2f %s", b, a / b, (a <= 1.6 * b) ? "reached" : "missed"
    }
    print ""
}
{ value[$1, $2, ++n[$1, $2]] = $3 }
END {
    printf "%-48s %8s %-12s %6s %-8s %8s %6s\n", "", "median", "", "aim", "", "AVX2", "by it"
    row("panorama of 1M triangles: bare Embree", "embree_ns", "ns a ray", "")
    row("  no file", "none_ns", "ns a ray", "")
    row("  .las", ".las_ns", "ns a ray", "")
    row("  .ply", ".ply_ns", "ns a ray", "")
    row("  .e57", ".e57_ns", "ns a ray", "")
    row("  no file, by bare Embree", "none:embree", "x", 1.0)
    row("  .las, by no file", ".las:none", "x", 1.25)
    row("  .ply, by no file", ".ply:none", "x", 1.25)
    row("  .e57, by no file", ".e57:none", "x", 1.5)
    row("upright lines, the same: bare Embree", "lines_embree_ns", "ns a ray", "")
    row("  no file", "lines_none_ns", "ns a ray", "")
    row("  no file, by bare Embree", "lines_none:embree", "x", 1.0)
    row("  .las, by no file", "lines_.las:none", "x", 1.25)
    row("loop, house, null link, no hash, with sight", "fast0_ns", "ns a pulse", 22)
    row("  without sight", "fast1_ns", "ns a pulse", 30)
    row("  with the hash", "fast2_ns", "ns a pulse", "")
    row("2.2 M pulses/s in real time, null link, no hash", "null0_core", "% of a core", 7)
    row("  with the hash, pty, TCP and file read", "read0_core", "% of a core", 9)
    row("decoder: scanhead_points, polar", "points:polar_ns", "ns a point", 12)
    row("  scanhead_columns, polar", "columns:polar_ns", "ns a point", "")
    row("  scanhead_points, UTM", "points:utm_ns", "ns a point", 12)
    row("  scanhead_columns, UTM", "columns:utm_ns", "ns a point", "")
    row("  scanhead_points, geodetic", "points:geodetic_ns", "ns a point", 12)
    row("  scanhead_columns as a recorder, geodetic", "recorded:geodetic_ns", "ns a point", "")
    rate("live client on one core: TCP on loopback", "tcp:columns_ns", 20)
    rate("  Unix socket", "unix:columns_ns", 20)
    rate("  USB's transfers, without a bus", "usb:columns_ns", 20)
}
