/* SPDX-License-Identifier: MIT */
/* Blender and scanhead scan the same scene, from the same stations, with the same step. In Blender
 * tests/readers/blender_scan.py scans with geometry nodes, in single precision and with no code of ours. Each shot of
 * scanhead is compared with Blender's ray of that direction. Both meet something, at the same place, or neither does.
 *
 * Their distance has a bound. e is 2^-23, r the range, C the largest coordinate, i the angle of incidence. Directions
 * come from float angles. An azimuth of up to 2 pi is rounded twice (12.6 e/2), an elevation of up to pi once
 * (6.3 e/2). Sines, cosines, their product and the turn by a matrix of floats add 6 e/2. Together that is less than
 * 13 e. At the surface vertices and the station are rounded (e/2 of C on each axis), and the intersection has about ten
 * roundings of differences of up to 2 C. Together that is less than 8 e C. On a slanted surface an error across the ray
 * grows by up to 1 / cos i: e (13 r + 8 C) / cos i. scanhead adds half a count of 1e-6 m.
 *
 * Where a ray passes an edge within that bound, Blender may take the surface beside or behind it. Such rays are
 * counted, and each has to be that near to an edge of the mesh. */
#include <math.h>

#include "tests/wire/wire.h"

static const char BLENDER[] = "/usr/bin/blender";

enum { STEP_DEG = 2, SEGMENTS = 360 / STEP_DEG, GAPS = 180 / STEP_DEG, RAYS = (GAPS - 1) * SEGMENTS + 2, STATIONS = 2 };

/* ---- the scene: rolling ground, and three posts on it, one of them leaning over the first station */

enum { CELLS = 40, POSTS = 3, N_VERTICES = (CELLS + 1) * (CELLS + 1) + 8 * POSTS, N_QUADS = CELLS * CELLS + 6 * POSTS };
static const double CELL_M = 0.61, FIRST_M = -12.3; /* of the ground's first corner, x and y */
static const double FAR_M = 25;                     /* no point of the scene is farther from a station */
static const double post_at[POSTS][2] = {{3.17, 1.93}, {-2.71, -4.39}, {-6.13, 5.57}};
static const double post_lean[POSTS] = {-0.61, 0.0, 0.37};

static double vertex_m[N_VERTICES][3];
static int quad[N_QUADS][4];

static double height_m(double x, double y)
{
    return 0.4 * sin(0.9 * x) * cos(0.7 * y);
}

static void set_vertex(int i, double x, double y, double z)
{
    vertex_m[i][0] = x;
    vertex_m[i][1] = y;
    vertex_m[i][2] = z;
}

static void set_quad(int i, int a, int b, int c, int d)
{
    const int corner[4] = {a, b, c, d};
    memcpy(quad[i], corner, sizeof corner);
}

static void make_post(int k)
{
    static const int face[6][4] = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
    const int v = (CELLS + 1) * (CELLS + 1) + 8 * k, q = CELLS * CELLS + 6 * k;
    for (int i = 0; i < 8; i++) {
        const double top = i >= 4, x = i % 4 == 1 || i % 4 == 2 ? 0.41 : -0.41, y = i % 4 >= 2 ? 0.33 : -0.33;
        set_vertex(v + i, post_at[k][0] + x + top * post_lean[k], post_at[k][1] + y, -0.7 + 4.3 * top);
    }
    for (int i = 0; i < 6; i++)
        set_quad(q + i, v + face[i][0], v + face[i][1], v + face[i][2], v + face[i][3]);
}

/* The cells of the ground are not flat, so they are written as two triangles each. */
static void write_scene(const struct wire *wire)
{
    static char text[64 * N_VERTICES + 64 * N_QUADS];
    size_t n = 0;
    for (int j = 0; j <= CELLS; j++)
        for (int i = 0; i <= CELLS; i++) {
            const double x = FIRST_M + CELL_M * i, y = FIRST_M + CELL_M * j;
            set_vertex(j * (CELLS + 1) + i, x, y, height_m(x, y));
            if (i < CELLS && j < CELLS)
                set_quad(j * CELLS + i, j * (CELLS + 1) + i, j * (CELLS + 1) + i + 1, (j + 1) * (CELLS + 1) + i + 1,
                         (j + 1) * (CELLS + 1) + i);
        }
    for (int k = 0; k < POSTS; k++)
        make_post(k);
    for (int i = 0; i < N_VERTICES; i++)
        n += (size_t)snprintf(text + n, sizeof text - n, "v %.17g %.17g %.17g\n", vertex_m[i][0], vertex_m[i][1],
                              vertex_m[i][2]);
    for (int i = 0; i < N_QUADS; i++) {
        const int *q = quad[i];
        n += (size_t)snprintf(text + n, sizeof text - n, "f %d %d %d\nf %d %d %d\n", q[0] + 1, q[1] + 1, q[2] + 1,
                              q[0] + 1, q[2] + 1, q[3] + 1);
    }
    assert_true(n < sizeof text - 1);
    wire_write_text(wire, "scene.obj", text);
}

/* ---- the stations */

struct station {
    double at_m[3], heading_deg, pitch_deg, roll_deg;
    double leg_m, opening_min_deg; /* leg 0: no tripod */
};
static const struct station stations[STATIONS] = {
    {{0.83, -0.37, 1.71}, 25.3, 4.1, -3.3, 2.07, 17.0},
    {{-4.19, 3.31, 1.13}, -140.7, 0, 0, 0, 0},
};

static const char *write_config(const struct wire *wire)
{
    char text[1024];
    size_t n = (size_t)snprintf(text, sizeof text,
                                "head: {profile: sphere, step_deg: %d}\nscene: {meshes: [{file: scene.obj, up: z, "
                                "scale: 1}]}\noutput: {layout: polar, scale_m: 1e-6}\nstations:\n",
                                (int)STEP_DEG);
    for (int i = 0; i < STATIONS; i++) {
        const struct station *s = &stations[i];
        n += (size_t)snprintf(text + n, sizeof text - n,
                              "  - {position_m: [%.17g, %.17g, %.17g], heading_deg: %.17g, pitch_deg: %.17g, roll_deg: "
                              "%.17g",
                              s->at_m[0], s->at_m[1], s->at_m[2], s->heading_deg, s->pitch_deg, s->roll_deg);
        if (s->leg_m > 0)
            n += (size_t)snprintf(text + n, sizeof text - n, ", tripod: {leg_m: %.17g, opening_min_deg: %.17g}",
                                  s->leg_m, s->opening_min_deg);
        n += (size_t)snprintf(text + n, sizeof text - n, "}\n");
    }
    return wire_write_text(wire, "config.yaml", text);
}

/* The head's frame in the scene's, by rows: heading clockwise about z, then pitch about x, then roll about y. */
static void attitude(const struct station *s, double m[3][3])
{
    const double h = s->heading_deg * M_PI / 180, p = s->pitch_deg * M_PI / 180, r = s->roll_deg * M_PI / 180;
    const double sh = sin(h), ch = cos(h), sp = sin(p), cp = cos(p), sr = sin(r), cr = cos(r);
    const double rows[3][3] = {{ch * cr + sh * sp * sr, sh * cp, ch * sr - sh * sp * cr},
                               {-sh * cr + ch * sp * sr, ch * cp, -sh * sr - ch * sp * cr},
                               {-cp * sr, sp, cp * cr}};
    memcpy(m, rows, sizeof rows);
}

/* ---- the hits of both */

struct ray {
    float hit, hidden, position_m[3], normal[3];
};
static struct ray rays[STATIONS][RAYS];

struct sums {
    int both, neither, hidden, edges, border;
    double most;    /* of the allowed distance */
    double opening; /* cosine of the tripod's opening; 2 without a tripod */
};

static void run_blender(struct wire *wire)
{
    static char text[STATIONS][256];
    const char *args[16] = {"-b",    "--factory-startup",
                            "-P",    "tests/readers/blender_scan.py",
                            "--",    wire_path(wire, "scene.obj"),
                            "2",     wire_path(wire, "blender.bin"),
                            text[0], text[1],
                            NULL};
    size_t len;
    for (int i = 0; i < STATIONS; i++) {
        const struct station *s = &stations[i];
        snprintf(text[i], sizeof text[i], "%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g", s->at_m[0], s->at_m[1],
                 s->at_m[2], s->heading_deg, s->pitch_deg, s->roll_deg, s->leg_m, s->opening_min_deg);
    }
    const int status = wire_wait(wire, wire_spawn_program(wire, BLENDER, args, "blender.out", "blender.err", -1));
    if (status == 77) {
        print_message("# this Blender is newer than tests/readers/blender_scan.py knows: 3.4 to 3.6\n");
        skip();
    }
    if (status != 0) wire_show(wire, "blender.err");
    assert_int_equal(status, 0);
    char *bytes = wire_read(wire_path(wire, "blender.bin"), &len);
    assert_int_equal(len, sizeof rays);
    memcpy(rays, bytes, sizeof rays);
    free(bytes);
}

/* Blender's sphere begins with the upper pole. The first vertex of a ring is one segment from x, counter-clockwise. */
static int ray_of(uint32_t ring, uint32_t step)
{
    if (ring == GAPS) return 0;
    if (ring == 0) return RAYS - 1;
    return 1 + ((int)GAPS - (int)ring - 1) * SEGMENTS + (int)((SEGMENTS / 4 + SEGMENTS - step - 1) % SEGMENTS);
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Returns the distance between a ray (unit direction) and the segment a..b, by Sunday's formulas for two lines. */
static double to_edge(const double from[3], const double d[3], const double a[3], const double b[3])
{
    double v[3], w[3], gap[3];
    for (int k = 0; k < 3; k++) {
        v[k] = b[k] - a[k];
        w[k] = from[k] - a[k];
    }
    const double dv = dot(d, v), vv = dot(v, v), dw = dot(d, w), vw = dot(v, w), den = vv - dv * dv;
    double along = den > 1e-12 ? (vw - dv * dw) / den : 0;
    along = fmin(1, fmax(0, along));
    const double t = fmax(0, along * dv - dw);
    for (int k = 0; k < 3; k++)
        gap[k] = w[k] + t * d[k] - along * v[k];
    return sqrt(dot(gap, gap));
}

static double to_nearest_edge(const double from[3], const double d[3])
{
    double least = INFINITY;
    for (int i = 0; i < N_QUADS; i++)
        for (int k = 0; k < 5; k++) { /* the fifth: the diagonal */
            const double *a = vertex_m[quad[i][k % 4]], *b = vertex_m[quad[i][k == 4 ? 2 : (k + 1) % 4]];
            least = fmin(least, to_edge(from, d, a, b));
        }
    return least;
}

static double allowed_m(double range_m)
{
    return 0x1p-23 * (13 * range_m + 8 * 12.3);
}

/* Returns the height of the station above the ground, on the triangle of a cell that it stands above. */
static double above_ground_m(const struct station *s)
{
    for (int i = 0; i < CELLS * CELLS; i++)
        for (int half = 0; half < 2; half++) {
            const double *a = vertex_m[quad[i][0]], *b = vertex_m[quad[i][1 + half]], *c = vertex_m[quad[i][2 + half]];
            const double x = s->at_m[0] - a[0], y = s->at_m[1] - a[1];
            const double bx = b[0] - a[0], by = b[1] - a[1], cx = c[0] - a[0], cy = c[1] - a[1],
                         det = bx * cy - by * cx;
            const double u = (x * cy - y * cx) / det, v = (bx * y - by * x) / det;
            if (u >= 0 && v >= 0 && u + v <= 1) return s->at_m[2] - a[2] - u * (b[2] - a[2]) - v * (c[2] - a[2]);
        }
    fail_msg("no ground below a station");
    return NAN;
}

/* Returns the cosine of the tripod's opening, or 2 without one. */
static double opening_of(const struct station *s)
{
    if (!(s->leg_m > 0)) return 2;
    return fmin(above_ground_m(s) / s->leg_m, cos(s->opening_min_deg * M_PI / 180));
}

/* In Blender direction and height are each good to 13 e only, and the comparison has both errors. */
static int at_border(double cosine, double opening)
{
    return fabs(cosine - opening) < 26 * 0x1p-23;
}

static void check_edge(const struct station *s, const double d[3], double range_m, const char *what)
{
    if (to_nearest_edge(s->at_m, d) > allowed_m(range_m))
        fail_msg("direction %.6f %.6f %.6f: %s", d[0], d[1], d[2], what);
}

static void compare_places(const struct station *s, double range_m, const double d[3], const struct ray *ray,
                           struct sums *sums)
{
    const double normal[3] = {(double)ray->normal[0], (double)ray->normal[1], (double)ray->normal[2]};
    double gap[3];
    for (int k = 0; k < 3; k++)
        gap[k] = s->at_m[k] + range_m * d[k] - (double)ray->position_m[k];
    const double share = sqrt(dot(gap, gap)) / (allowed_m(range_m) / fabs(dot(normal, d)) + 0.5e-6);
    if (share > 1) {
        check_edge(s, d, range_m, "the points lie apart");
        sums->edges++;
        return;
    }
    sums->both++;
    sums->most = fmax(sums->most, share);
}

/* Compares a shot with Blender's ray of its direction d. */
static void compare(const struct station *s, const struct scanhead_point *p, const double d[3], const struct ray *ray,
                    struct sums *sums)
{
    const double opening = sums->opening;
    const int hidden = ray->hidden > 0.5f, hit = ray->hit > 0.5f, echo = p->echo_count != 0;
    if (at_border(-d[2], opening)) {
        sums->border++;
        return;
    }
    assert_int_equal(hidden, -d[2] > opening);
    sums->hidden += hidden;
    if (hidden) {
        assert_false(echo);
    } else if (hit != echo) {
        check_edge(s, d, FAR_M, echo ? "scanhead alone has a point" : "Blender alone has a point");
        sums->edges++;
    } else if (echo) {
        compare_places(s, p->range_m, d, ray, sums);
    } else {
        sums->neither++;
    }
}

static void compare_shot(int station, uint32_t ring, uint32_t step, const struct scanhead_point *p, struct sums *sums)
{
    const struct station *s = &stations[station];
    const double e = M_PI * ((double)ring / GAPS - 0.5), a = 2 * M_PI * step / SEGMENTS;
    const double socs[3] = {sin(a) * cos(e), cos(a) * cos(e), sin(e)};
    double m[3][3], d[3];
    attitude(s, m);
    for (int k = 0; k < 3; k++)
        d[k] = dot(m[k], socs);
    compare(s, p, d, &rays[station][ray_of(ring, step)], sums);
}

static void compare_recording(const struct wire *wire, struct sums sums[STATIONS])
{
    static struct scanhead_point point[4096];
    struct scanhead *sh = client_open(wire_path(wire, "out.shs"));
    struct scanhead_frame frame;
    struct scanhead_info info;
    int shots[STATIONS] = {0};
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type != SCANHEAD_POINTS) continue;
        assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_OK);
        const int n = scanhead_points(sh, &frame, 0, point, 4096), station = (int)info.station - 1;
        assert_int_equal(n, frame.n_pulses); /* an echo a pulse at most */
        for (int i = 0; i < n; i++)
            compare_shot(station, frame.scan_line, (uint32_t)(frame.pulse0 - frame.scan_line * SEGMENTS) + (uint32_t)i,
                         &point[i], &sums[station]);
        shots[station] += n;
    }
    for (int i = 0; i < STATIONS; i++)
        assert_int_equal(shots[i], RAYS);
    scanhead_close(sh);
}

static void the_same_points_in_blender(void **state)
{
    struct wire *wire = *state;
    struct sums sums[STATIONS] = {0};
    if (access(BLENDER, X_OK) != 0) {
        print_message("# %s is not there: package blender\n", BLENDER);
        skip();
    }
    write_scene(wire);
    const char *const args[] = {"record", write_config(wire),         "--station", "all",
                                "-o",     wire_path(wire, "out.shs"), "--quiet",   NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    run_blender(wire);
    for (int i = 0; i < STATIONS; i++)
        sums[i].opening = opening_of(&stations[i]);
    compare_recording(wire, sums);
    for (int i = 0; i < STATIONS; i++) {
        /* Rays are 35 mrad apart. Whether one is within 2e-5 m of an edge, or on the tripod's cone, is a matter of
         * chance, so a few are allowed. */
        assert_true(sums[i].both > 3000 && sums[i].neither > 1000 && sums[i].edges <= 4 && sums[i].border <= 4);
        print_message("# station %d: %d shots at the same place, up to %.2f of what is allowed; %d without echo, %d "
                      "hidden; %d at edges, %d at the border of the cone\n",
                      i + 1, sums[i].both, sums[i].most, sums[i].neither, sums[i].hidden, sums[i].edges,
                      sums[i].border);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_same_points_in_blender, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
