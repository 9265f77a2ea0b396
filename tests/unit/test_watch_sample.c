/* SPDX-License-Identifier: MIT */
/* The points of a scan that a page's figures are made of: where there are too many, those of every second pulse stay,
 * whole and in their order. */
#include "firmware_sim/app/studio/watch/inside.h"
#include "tests/unit/site_rig.h"

static struct watch w;

/* The scene is a quad. Of the watch only the sample is opened, with its index of distances. */
static void open_sample(void)
{
    write_in("quad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    write_in("test.yaml", "head: {profile: full-sweep}\nscene: {meshes: [{file: quad.obj, up: z, scale: 1}]}\n"
                          "stations: [{position_m: [0.5, 0.5, 1]}]\n");
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    struct site *site;
    if (site_load_for(cfg, SITE_WRITTEN_OUT, NULL, NULL, &site, &err) != SH_OK) fail_msg("%s", err.text);
    memset(&w, 0, sizeof w);
    w.site = site;
    if (watch_sample_open(&w, &err) != SH_OK) fail_msg("%s", err.text);
    watch_sample_begin(&w);
}

static void close_sample(void)
{
    watch_sample_close(&w);
    site_free((struct site *)w.site);
}

/* Adds the point of a pulse; all that is known of it is made of the pulse's number. */
static void add(uint32_t pulse)
{
    struct watch_sample *s = &w.sample;
    watch_sample_add(&w, (const double[3]){pulse, pulse + 0.25, pulse + 0.5}, pulse);
    const size_t at = s->n - 1;
    if (s->hash[at] != pulse) return;
    s->distance_m[at] = pulse + 1.0;
    s->triangle[at] = pulse + 2;
    s->points.met[at] = pulse + 3;
    s->points.along_m[at] = (float)pulse + 4;
    s->points.sigma_m[at] = (float)pulse + 5;
    s->points.counts_m[at] = (float)pulse + 6;
    s->points.cosine[at] = (float)pulse + 7;
    s->points.range_m[at] = (float)pulse + 8;
}

static void expect_pulses(size_t n, uint32_t every)
{
    const struct watch_sample *s = &w.sample;
    assert_int_equal(s->every, every);
    assert_int_equal(s->n, n);
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t pulse = i * every;
        const struct deviation_points *p = &s->points;
        const int whole = s->hash[i] == pulse && s->xyz_m[i][0] == pulse && s->xyz_m[i][1] == pulse + 0.25 &&
                          s->xyz_m[i][2] == pulse + 0.5 && s->distance_m[i] == pulse + 1.0 &&
                          s->triangle[i] == pulse + 2 && p->met[i] == pulse + 3 && p->along_m[i] == (float)pulse + 4 &&
                          p->sigma_m[i] == (float)pulse + 5 && p->counts_m[i] == (float)pulse + 6 &&
                          p->cosine[i] == (float)pulse + 7 && p->range_m[i] == (float)pulse + 8;
        if (!whole) fail_msg("point %u is not whole that of pulse %u", i, pulse);
    }
}

static void half_of_the_pulses_stay(void **state)
{
    (void)state;
    open_sample();
    for (uint32_t pulse = 0; pulse < WATCH_MOST_POINTS; pulse++)
        add(pulse);
    expect_pulses(WATCH_MOST_POINTS, 1); /* this many fit */
    w.sample.done = 1001;
    add(WATCH_MOST_POINTS + 1); /* its pulse is odd, so it makes room for none of its own */
    expect_pulses(WATCH_MOST_POINTS / 2, 2);
    assert_int_equal(w.sample.done, 501); /* pulses 0, 2 ... 1000 */
    add(WATCH_MOST_POINTS + 3);
    assert_int_equal(w.sample.n, WATCH_MOST_POINTS / 2);
    for (uint32_t pulse = WATCH_MOST_POINTS; pulse <= 2 * WATCH_MOST_POINTS; pulse += 2)
        add(pulse);
    expect_pulses(WATCH_MOST_POINTS / 2 + 1, 4); /* the last one made room, and stays */
    assert_int_equal(w.sample.done, 251);        /* 0, 4 ... 1000 */
    watch_sample_begin(&w);
    assert_true(w.sample.n == 0 && w.sample.done == 0 && w.sample.every == 1);
    close_sample();
}

/* Beyond the largest share points are passed over. */
static void a_full_sample_takes_no_more(void **state)
{
    (void)state;
    open_sample();
    for (uint32_t i = 0; i < WATCH_MOST_POINTS; i++)
        watch_sample_add(&w, (const double[3]){0, 0, 0}, 0);
    watch_sample_add(&w, (const double[3]){1, 1, 1}, 0);
    assert_int_equal(w.sample.n, WATCH_MOST_POINTS);
    assert_int_equal(w.sample.every, WATCH_LEAST_SHARE);
    close_sample();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(half_of_the_pulses_stay),
                                       cmocka_unit_test(a_full_sample_takes_no_more)};
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
