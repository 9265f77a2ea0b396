/* SPDX-License-Identifier: MIT */
#include "tests/wire/readers.h"

#include <glob.h>

struct wire *wire;
double truth[MAX_POINTS][3], seen[MAX_POINTS][3];
size_t n_truth, n_first;

void keep_truth(const struct scanhead_point *point, uint32_t station)
{
    assert_true(n_truth < MAX_POINTS);
    memcpy(truth[n_truth++], &point->x, sizeof truth[0]);
    if (station == 1) n_first = n_truth;
}

/* Debian 13's CloudCompare looks for its plugins in a folder where they are not. One of the plugins reads PTX. */
static void say_where_plugins_are(void)
{
    glob_t found;
    if (glob("/usr/lib/*/cloudcompare/plugins", 0, NULL, &found) == 0) setenv("CC_PLUGIN_PATH", found.gl_pathv[0], 0);
    globfree(&found);
}

/* Runs argv (ends with NULL) in the test's folder. Returns its exit status, or 127 where there is no such program. */
static int run(const char *const *argv)
{
    char out[352], err[352];
    snprintf(out, sizeof out, "%s", wire_path(wire, "tool.out"));
    snprintf(err, sizeof err, "%s", wire_path(wire, "tool.err"));
    pid_t pid = wire_fork(wire);
    if (pid == 0) {
        int o = open(out, O_WRONLY | O_CREAT | O_TRUNC, 0600), e = open(err, O_WRONLY | O_CREAT | O_TRUNC, 0600);
        dup2(o, 1);
        dup2(e, 2);
        setenv("QT_QPA_PLATFORM", "offscreen", 1);
        say_where_plugins_are();
        if (chdir(wire->dir) == 0) execvp(argv[0], (char **)(uintptr_t)argv);
        _exit(127);
    }
    return wire_wait(wire, pid);
}

void run_well(const char *const *argv)
{
    int status = run(argv);
    if (status == 127) {
        print_message("# %s is not installed\n", argv[0]);
        skip();
    }
    if (status != 0) {
        wire_show(wire, "tool.out");
        wire_show(wire, "tool.err");
    }
    assert_int_equal(status, 0);
}

void run_reader(const char *script, const char *in, const char *out)
{
    const char *folder = getenv("READERS");
    char path[PATH_MAX];
    char full[PATH_MAX + 64];
    if (realpath(folder != NULL ? folder : "build/readers", path) == NULL) path[0] = 0;
    snprintf(full, sizeof full, "%s/installed", path);
    if (path[0] == 0 || access(full, F_OK) != 0) {
        print_message("# npm's readers are not installed: make deps says why\n");
        skip();
    }
    snprintf(full, sizeof full, "%s/%s", path, script);
    const char *const argv[] = {"node", "--experimental-wasm-modules", full, in, out, NULL};
    run_well(argv);
}

size_t compare(char *text, size_t first, const double tolerance_m[N_STATIONS])
{
    size_t n = first;
    for (char *at = text, *end; *at != 0; at = end + 1, n++) {
        end = at + strcspn(at, "\n");
        assert_true(n < n_truth);
        for (int i = 0; i < 3; i++) {
            char *next;
            double v = strtod(at, &next);
            assert_true(next > at && next <= end);
            if (!(fabs(v - truth[n][i]) <= tolerance_m[n >= n_first]))
                fail_msg("point %zu, axis %d: %.12g, not %.12g", n, i, v, truth[n][i]);
            seen[n][i] = v;
            at = next;
        }
        end = at + strcspn(at, "\n");
        if (*end == 0) break;
    }
    return n - first;
}

/* Solves the symmetric 3 x 3 system by Cramer's rule. */
static void solve3(const double m[3][3], const double v[3], double out[3])
{
    double c[3][3], det = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            c[i][j] = m[(i + 1) % 3][(j + 1) % 3] * m[(i + 2) % 3][(j + 2) % 3] -
                      m[(i + 1) % 3][(j + 2) % 3] * m[(i + 2) % 3][(j + 1) % 3];
    for (int j = 0; j < 3; j++)
        det += m[0][j] * c[0][j];
    for (int i = 0; i < 3; i++)
        out[i] = (c[0][i] * v[0] + c[1][i] * v[1] + c[2][i] * v[2]) / det;
}

/* Least squares for small motions. The shift is the mean difference d, and the turn w solves sum(|r|^2 - r r^T) w =
 * sum(r x d). */
static struct misfit misfit(size_t first, size_t end)
{
    struct misfit out = {0};
    double middle[3] = {0}, shift[3] = {0}, m[3][3] = {{0}}, v[3] = {0}, w[3], n = (double)(end - first);
    for (int k = 0; k < 3; k++) {
        double lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
        for (size_t i = first; i < end; i++) {
            lo[0] = fmin(lo[0], truth[i][k]), lo[1] = fmin(lo[1], seen[i][k]);
            hi[0] = fmax(hi[0], truth[i][k]), hi[1] = fmax(hi[1], seen[i][k]);
            middle[k] += (truth[i][k] - truth[first][k]) / n;
            shift[k] += (seen[i][k] - truth[i][k]) / n;
        }
        middle[k] += truth[first][k];
        out.bounds_m = fmax(out.bounds_m, fmax(fabs(lo[1] - lo[0]), fabs(hi[1] - hi[0])));
    }
    for (size_t i = first; i < end; i++) {
        double r[3], d[3];
        for (int k = 0; k < 3; k++) {
            r[k] = truth[i][k] - middle[k];
            d[k] = seen[i][k] - truth[i][k] - shift[k];
        }
        double r2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
        out.radius_m = fmax(out.radius_m, sqrt(r2));
        for (int k = 0; k < 3; k++) {
            v[k] += r[(k + 1) % 3] * d[(k + 2) % 3] - r[(k + 2) % 3] * d[(k + 1) % 3];
            for (int l = 0; l < 3; l++)
                m[k][l] += (k == l ? r2 : 0) - r[k] * r[l];
        }
    }
    solve3(m, v, w);
    out.shift_m = sqrt(shift[0] * shift[0] + shift[1] * shift[1] + shift[2] * shift[2]);
    out.turn_rad = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    return out;
}

void tell(const char *format, const char *reader, const double tolerance_m[N_STATIONS])
{
    struct misfit worst = {0};
    for (int s = 0; s < N_STATIONS; s++) {
        size_t first = s == 0 ? 0 : n_first, end = s == 0 ? n_first : n_truth;
        if (first == end) continue;
        struct misfit one = misfit(first, end);
        if (!(one.bounds_m <= tolerance_m[s] && one.shift_m <= sqrt(3) * tolerance_m[s] &&
              one.turn_rad * one.radius_m <= sqrt(3) * tolerance_m[s]))
            fail_msg("%s, station %d: bounds off by %g m, pose by %g m and %g rad", format, s + 1, one.bounds_m,
                     one.shift_m, one.turn_rad);
        worst.bounds_m = fmax(worst.bounds_m, one.bounds_m);
        worst.shift_m = fmax(worst.shift_m, one.shift_m);
        worst.turn_rad = fmax(worst.turn_rad, one.turn_rad);
    }
    print_message("# %-4s by %-16s %6zu points, bounds off by %.6f mm, pose by %.6f mm and %.6f urad\n", format, reader,
                  n_truth, 1e3 * worst.bounds_m, 1e3 * worst.shift_m, 1e6 * worst.turn_rad);
}
