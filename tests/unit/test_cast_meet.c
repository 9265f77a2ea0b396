/* SPDX-License-Identifier: MIT */
/* Pulses and the triangles that they meet. Pulses and ranges are those of casting, in a room with a sheet of glass and
 * a mirror, with and without a model of the signal. */
#include "tests/unit/site_rig.h"

#include "core/cast.h"
#include "core/line.h"
#include "core/vec3.h"

enum { LINES = 40, MOST = 4096, ROOM = MOST * (1 + CAST_MAX_DEPTH) };

struct meet_rig {
    struct site *site;
    struct cast_setup setup;
    struct cast_detect detect;
    uint32_t n_real; /* labels of real surfaces */
    struct schedule_segment segment;
    struct caster *caster;
    struct line_block block;
    struct cast_hit hit[ROOM];
};

static struct meet_rig *open_rig(const char *const *sets, int n)
{
    struct meet_rig *r = calloc(1, sizeof *r);
    assert_non_null(r);
    if (config_load("config/glass.yaml", sets, n, cfg, &err) != 0 || site_load(cfg, &report, &r->site, &err) != 0 ||
        caster_create(&r->caster, &err) != 0 || line_block_alloc(&r->block, ROOM, &err) != 0)
        fail_msg("%s", err.text);
    struct schedule_spec spec;
    site_fill_spec(r->site, &cfg->head.settings, &spec);
    schedule_start(&r->segment, &spec);
    site_cast_setup(r->site, 0, &r->setup);
    r->setup.layout = LINE_POLAR;
    r->n_real = r->site->scene->n_surfaces;
    if (r->setup.detect == NULL) return r;
    r->detect = *r->setup.detect; /* returns near each other shall stay separate, as hits do */
    r->detect.separation_m = 0.0;
    r->setup.detect = &r->detect;
    return r;
}

static void close_rig(struct meet_rig *r)
{
    line_block_free(&r->block);
    caster_free(r->caster);
    site_free(r->site);
    free(r);
}

static void get_run(const struct meet_rig *r, uint64_t n, struct schedule_run *run)
{
    struct schedule_line line;
    schedule_get_line(&r->segment, n, &line);
    const uint64_t pulses = line.cast_end - line.cast0;
    schedule_get_run(&r->segment, &line, line.cast0, (uint32_t)(pulses < MOST ? pulses : MOST), run);
}

/* The point lies on its triangle's plane: 1 um for ranges of some metres. */
static void check_plane(const struct meet_rig *r, const struct cast_hit *hit)
{
    const struct scene *s = r->site->scene;
    const double *n = bvh_plane(r->setup.bvh, hit->triangle)->n;
    double to[3];
    vec3_sub(hit->p_m, s->vertex_m[s->triangle[hit->triangle][0]], to);
    assert_true(fabs(vec3_dot(to, n)) <= 1e-6 * vec3_length(n));
}

/* Each echo of a real surface has its hit, and each hit its echo: same pulse and label. Ranges agree to half a count,
 * and the error of setting out behind a pane. Returns how many there are. */
static uint32_t check_line(struct meet_rig *r, uint64_t line)
{
    struct schedule_run run;
    uint32_t at = 0, pulse = 0, echoes = 0;
    get_run(r, line, &run);
    caster_cast(r->caster, &r->setup, &run, &r->block);
    const uint32_t n = caster_meet(r->caster, &r->setup, &run, r->hit);
    for (uint32_t i = 0; i < r->block.n_points; i++) {
        const uint8_t number = r->block.echo[i] & 15, count = r->block.echo[i] >> 4;
        if (number != 0 && r->block.label[i] < r->n_real) {
            assert_true(at < n);
            const struct cast_hit *h = &r->hit[at++];
            const double range_m = r->block.a[i] * r->setup.range_scale_m;
            if (h->pulse != pulse || !(fabs(h->range_m - range_m) <= 0.5 * r->setup.range_scale_m + 2e-5))
                fail_msg("line %u: an echo of pulse %u at %.6f m, a hit of pulse %u at %.6f m", (unsigned)line, pulse,
                         range_m, h->pulse, h->range_m);
            assert_int_equal(r->site->scene->label[h->triangle], r->block.label[i]);
            check_plane(r, h);
            echoes++;
        }
        pulse += number == count; /* also of a shot without echo: 0 of 0 */
    }
    assert_int_equal(at, n);
    return echoes;
}

static void check_scan(const char *const *sets, int n_sets, uint32_t least, uint32_t most)
{
    struct meet_rig *r = open_rig(sets, n_sets);
    uint32_t echoes = 0;
    for (uint64_t i = 0; i < LINES; i++)
        echoes += check_line(r, 15 * i);
    print_message("%u echoes\n", echoes);
    if (echoes < least || echoes > most) fail_msg("%u echoes, and there should be %u to %u", echoes, least, most);
    close_rig(r);
}

#define PLAIN                                                                                                 \
    "beam.mode=single", "noise.range=off", "noise.angle=off", "signal.detection=sharp", "head.prr_hz=300000", \
        "head.lines_hz=200"

/* 1500 pulses a sweep of 240 degrees, of which 100 are cast: 625 or 626 in each of 40 lines. Panes add echoes, and the
 * mirror takes some away. */
static void test_glass_and_mirror(void **state)
{
    (void)state;
    static const char *const sets[] = {PLAIN};
    check_scan(sets, 6, LINES * 626 + 1, LINES * 2 * 626);
}

static void test_ranges(void **state)
{
    (void)state;
    static const char *const sets[] = {PLAIN, "head.range_min_m=2.5", "head.range_max_m=4"};
    check_scan(sets, 8, 1000, 15000);
}

static void test_without_a_model(void **state)
{
    (void)state;
    static const char *const sets[] = {PLAIN, "signal.model=off", "optics.depth=0"};
    check_scan(sets, 8, LINES * 625, LINES * 626);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_glass_and_mirror, site_rig_setup, site_rig_teardown),
        cmocka_unit_test_setup_teardown(test_ranges, site_rig_setup, site_rig_teardown),
        cmocka_unit_test_setup_teardown(test_without_a_model, site_rig_setup, site_rig_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
