/* SPDX-License-Identifier: MIT */
/* This fuzzes trajectories: samples and way-points as CSV. The input is a byte, then the file. A trajectory that is
 * read must give finite poses over its span, and knots that rise in time. */
#include <math.h>
#include <stdlib.h>

#include "core/pose.h"
#include "tests/fuzz/rig.h"

static void check_at(const struct trajectory *t, double t_s)
{
    struct pose pose;
    double frame;
    trajectory_at(t, t_s, &pose, &frame);
    for (int c = 0; c < 3; c++)
        fuzz_must(isfinite(pose.position_m[c]), "positions are finite");
    for (int c = 0; c < 4; c++)
        fuzz_must(isfinite(pose.quat[c]), "attitudes are finite");
}

static void check_knots(const struct trajectory *t, double first_s, double last_s)
{
    static const struct pose mount = {.quat = {1, 0, 0, 0}};
    /* The span is short to have few knots, because a file of two lines may be 4e9 s long. */
    const double end_s = last_s < first_s + 10 ? last_s : first_s + 10;
    const struct pose_knot_rules rules = {first_s, end_s, 1e-3, 100000000, 1.0};
    struct pose_path path = {0};
    struct sh_err err = {0};
    if (trajectory_knots(t, &mount, &rules, &fuzz_report, &path, &err) != SH_OK) {
        fuzz_must_be_line(&err);
        return;
    }
    fuzz_must(path.n >= 1 && path.knot[0].t_ns == 0, "the first knot is at 0");
    for (size_t i = 1; i < path.n; i++)
        fuzz_must(path.knot[i].t_ns > path.knot[i - 1].t_ns, "knots rise in time");
    free(path.knot);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    struct trajectory *t = NULL;
    struct sh_err err = {0};
    double first_s, last_s;
    if (in.n > 8192) return 0;
    const char *path = fuzz_file(".csv", in.p, in.n);
    const int rc = (how & 1) != 0 ? trajectory_read_csv(path, &fuzz_report, &t, &err)
                                  : trajectory_read_waypoints(path, NULL, &fuzz_report, &t, &err);
    if (rc != SH_OK) {
        fuzz_must_be_line(&err);
        return 0;
    }
    trajectory_span(t, &first_s, &last_s);
    fuzz_must(first_s <= last_s, "the span has a length");
    for (int i = -1; i <= 9; i++)
        check_at(t, first_s + (last_s - first_s) * i / 8.0);
    check_knots(t, first_s, last_s);
    trajectory_free(t);
    return 0;
}
