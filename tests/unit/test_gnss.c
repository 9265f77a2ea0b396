/* SPDX-License-Identifier: MIT */
/* The receiver's positions and times against closed forms of WGS 84. */
#include "tests/unit/device_rig.h"

#include <math.h>

#include "core/rng.h"
#include "drivers/protocol/nmea.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/device/gnss.h"
#include "firmware_sim/device/head_clock.h"
#include "tests/common/nmea_reader.h"

struct receiver {
    struct config *cfg;
    struct site *site;
    struct head_clock clock;
    struct gnss gnss;
};

enum { MAX_SETS = 24 };

static struct receiver load_receiver(const char *const *sets, int n)
{
    struct receiver r = {.cfg = calloc(1, sizeof *r.cfg)};
    char path[96];
    struct sh_err err;
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    need(config_load(path, sets, n, r.cfg, &err), &err);
    need(site_load(r.cfg, NULL, &r.site, &err), &err);
    return r;
}

/* sets: further ones, ends with NULL. */
static struct receiver open_receiver(const char *lat, const char *lon, const char *const *more)
{
    char sets[8][64];
    const char *list[MAX_SETS];
    int n = 0;
    snprintf(sets[0], sizeof sets[0], "stations[0].lat_deg=%s", lat);
    snprintf(sets[1], sizeof sets[1], "stations[0].lon_deg=%s", lon);
    snprintf(sets[2], sizeof sets[2], "stations[0].height_m=123.4567");
    snprintf(sets[3], sizeof sets[3], "stations[1].lat_deg=1");
    snprintf(sets[4], sizeof sets[4], "stations[1].lon_deg=2");
    snprintf(sets[5], sizeof sets[5], "stations[1].height_m=3");
    snprintf(sets[6], sizeof sets[6], "links[0].type=null");
    snprintf(sets[7], sizeof sets[7], "links[0].protocol=nmea");
    for (; n < 8; n++)
        list[n] = sets[n];
    list[n++] = "time.epoch=2026-01-01T00:00:00.375Z";
    for (; more != NULL && *more != NULL; n++)
        list[n] = *more++;
    return load_receiver(list, n);
}

/* The receiver keeps addresses of its members, so it can't start in open_receiver. */
static void start_receiver(struct receiver *r)
{
    struct sh_err err;
    need(head_clock_create(&r->cfg->time, &r->clock, &err), &err);
    gnss_init(&r->gnss, r->site, &r->clock);
}

static void close_receiver(struct receiver *r)
{
    site_free(r->site);
    free(r->cfg);
}

struct fix {
    double lat_deg, lon_deg, height_m, separation_m;
    char time[16];
    int quality;
};

/* The sentence has the fix: minutes of 6 decimals or more, and heights of 3. */
static void check_sentence(const struct nmea_line *line, const struct nmea_fix *known)
{
    const double half_step_deg = 0.5e-6 / 60 + 1e-13, half_step_m = 0.5e-3 + 1e-9;
    if (known->quality == 0) return;
    assert_true(fabs(read_angle(line->field[2], line->field[3], 2, "NS") - known->lat_deg) <= half_step_deg);
    assert_true(fabs(read_angle(line->field[4], line->field[5], 3, "EW") - known->lon_deg) <= half_step_deg);
    assert_true(fabs(atof(line->field[9]) - known->altitude_m) <= half_step_m);
    assert_true(fabs(atof(line->field[11]) - known->geoid_separation_m) <= half_step_m);
}

/* Returns the fix without the rounding of its sentence, which is checked, too. */
static struct fix get_fix(const struct receiver *r, uint64_t index, uint32_t station)
{
    char text[NMEA_MAX_ALL];
    struct nmea_line line;
    struct nmea_fix known;
    gnss_fix(&r->gnss, index, station, NULL, &known);
    size_t len = nmea_encode_all(text, sizeof text, &known);
    const char *at = strstr(text, "GGA") - 3, *end = strchr(at, '\n') + 1;
    assert_true(len > 0 && at > text);
    read_line(at, (size_t)(end - at), "GNGGA", 15, &line);
    check_sentence(&line, &known);
    struct fix fix = {.lat_deg = known.lat_deg,
                      .lon_deg = known.lon_deg,
                      .height_m = known.altitude_m + known.geoid_separation_m,
                      .separation_m = known.geoid_separation_m,
                      .quality = atoi(line.field[6])};
    snprintf(fix.time, sizeof fix.time, "%s", line.field[1]);
    return fix;
}

/* The ellipsoid is WGS 84, NIMA TR8350.2. */
static void to_ecef(double lat_deg, double lon_deg, double height_m, double p[3])
{
    const double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f);
    double lat = lat_deg * M_PI / 180, lon = lon_deg * M_PI / 180, n = a / sqrt(1 - e2 * sin(lat) * sin(lat));
    p[0] = (n + height_m) * cos(lat) * cos(lon);
    p[1] = (n + height_m) * cos(lat) * sin(lon);
    p[2] = (n * (1 - e2) + height_m) * sin(lat);
}

/* Writes east, north and up from a place to a fix. */
static void offset_enu(double lat_deg, double lon_deg, double height_m, const struct fix *fix, double d[3])
{
    double p[3], q[3], lat = lat_deg * M_PI / 180, lon = lon_deg * M_PI / 180;
    to_ecef(lat_deg, lon_deg, height_m, p);
    to_ecef(fix->lat_deg, fix->lon_deg, fix->height_m, q);
    double x = q[0] - p[0], y = q[1] - p[1], z = q[2] - p[2];
    d[0] = -sin(lon) * x + cos(lon) * y;
    d[1] = -sin(lat) * cos(lon) * x - sin(lat) * sin(lon) * y + cos(lat) * z;
    d[2] = cos(lat) * cos(lon) * x + cos(lat) * sin(lon) * y + sin(lat) * z;
}

/* The coordinates are good to 1e-9 m. A double's step of 180 degrees is 3e-14 degrees, or 3e-9 m. */
#define STEP_M 1e-7

static void check_antenna(const char *lat, const char *lon, const char *heading, const char *arm, const double enu[3])
{
    char set[3][64];
    snprintf(set[0], sizeof set[0], "stations[0].heading_deg=%s", heading);
    snprintf(set[1], sizeof set[1], "gnss.lever_arm_m=%s", arm);
    const char *const more[] = {set[0], set[1], "gnss.geoid_separation_m=-17.25", NULL};
    struct receiver r = open_receiver(lat, lon, more);
    start_receiver(&r);
    struct fix fix = get_fix(&r, 0, 0);
    double d[3];
    offset_enu(atof(lat), atof(lon), 123.4567, &fix, d);
    for (int i = 0; i < 3; i++)
        if (fabs(d[i] - enu[i]) > STEP_M)
            fail_msg("%s %s, heading %s, arm %s: axis %d off by %.6f m", lat, lon, heading, arm, i, d[i] - enu[i]);
    assert_true(fix.separation_m == -17.25);
    close_receiver(&r);
}

static void the_antenna_is_where_the_arm_puts_it(void **state)
{
    (void)state;
    static const double none[3] = {0, 0, 0}, forward_east[3] = {3, 0, 0}, mixed[3] = {2, -1, 0.5};
    check_antenna("52.51667664", "13.40008838", "0", "[0, 0, 0]", none);
    check_antenna("52.51667664", "13.40008838", "90", "[0, 3, 0]", forward_east);
    check_antenna("-33.8568", "-151.2153", "90", "[1, 2, 0.5]", mixed); /* right of east is south */
    check_antenna("0", "180", "90", "[0, 3, 0]", forward_east);         /* over the antimeridian */
    check_antenna("0.00000001", "-180", "270", "[0, -3, 0]", forward_east);
    check_antenna("89.9999", "0", "90", "[1, 2, 0.5]", mixed);
    static const double past[3] = {0, 20, 0}; /* 11 m from the pole */
    check_antenna("89.9999", "45", "0", "[0, 20, 0]", past);
}

static void at_the_poles(void **state)
{
    (void)state;
    for (int south = 0; south < 2; south++) {
        struct receiver r = open_receiver(south ? "-90" : "90", "0", NULL);
        start_receiver(&r);
        struct fix fix = get_fix(&r, 0, 0);
        assert_true(fabs(fix.lat_deg) > 90 - 1e-9 && (fix.lat_deg < 0) == south);
        assert_true(fabs(fix.height_m - 123.4567) < STEP_M);
        close_receiver(&r);
    }
}

/* Power-up is at .375 s. The first time is the first multiple of 1/rate after it. */
static void times_are_those_of_the_rate(void **state)
{
    (void)state;
    static const struct {
        const char *set, *first, *second, *later;
        int64_t first_ns, period_ns;
    } rate[] = {{"gnss.rate_hz=1", "000001.00", "000002.00", "000101.00", 625000000, 1000000000},
                {"gnss.rate_hz=2", "000000.50", "000001.00", "000030.50", 125000000, 500000000},
                {"gnss.rate_hz=4", "000000.50", "000000.75", "000015.50", 125000000, 250000000},
                {"gnss.rate_hz=5", "000000.40", "000000.60", "000012.40", 25000000, 200000000},
                {"gnss.rate_hz=10", "000000.40", "000000.50", "000006.40", 25000000, 100000000},
                {"gnss.rate_hz=20", "000000.40", "000000.45", "000003.40", 25000000, 50000000}};
    for (size_t i = 0; i < sizeof rate / sizeof *rate; i++) {
        const char *const more[] = {rate[i].set, "time.offset_s=77", NULL}; /* the head's error is not the receiver's */
        struct receiver r = open_receiver("1", "2", more);
        start_receiver(&r);
        assert_string_equal(get_fix(&r, 0, 0).time, rate[i].first);
        assert_string_equal(get_fix(&r, 1, 0).time, rate[i].second);
        assert_string_equal(get_fix(&r, 60, 0).time, rate[i].later);
        assert_true(gnss_time_ns(&r.gnss, 0) == rate[i].first_ns);
        assert_int_equal(gnss_count(&r.gnss, 0), 0);
        for (uint64_t k = 0; k < 100; k++) { /* no fix counts before its time; each does from a nanosecond later */
            int64_t t_ns = rate[i].first_ns + (int64_t)k * rate[i].period_ns;
            assert_true(gnss_time_ns(&r.gnss, k) == t_ns);
            assert_int_equal(gnss_count(&r.gnss, t_ns), k);
            assert_int_equal(gnss_count(&r.gnss, t_ns + 1), k + 1);
        }
        close_receiver(&r);
    }
}

static void it_stands_where_the_head_stands(void **state)
{
    (void)state;
    struct receiver r = open_receiver("10", "20", NULL);
    start_receiver(&r);
    const struct fix here = get_fix(&r, 0, 0), there = get_fix(&r, 0, 1);
    const double step_deg = STEP_M / 111000;
    assert_true(fabs(here.lat_deg - 10) < step_deg && fabs(here.lon_deg - 20) < step_deg);
    assert_true(fabs(there.lat_deg - 1) < step_deg && fabs(there.lon_deg - 2) < step_deg);
    assert_true(fabs(there.height_m - 3) < STEP_M);
    close_receiver(&r);
}

/* 2000 positions. The mean of n is within 5 sigma / sqrt(n), and the standard deviation within 5 / sqrt(2 n) of sigma,
 * but once in 1.7 million each. The seed is fixed, so the result is, too. */
static void noise_is_what_was_asked_for(void **state)
{
    (void)state;
    enum { N = 2000 };
    static const char *const more[] = {"gnss.accuracy_m=0.5", "gnss.quality=5", NULL};
    struct receiver r = open_receiver("48", "11", more);
    start_receiver(&r);
    double sum[3] = {0}, square[3] = {0}, product[3] = {0};
    for (uint64_t k = 0; k < N; k++) {
        struct fix fix = get_fix(&r, k, 0), again = get_fix(&r, k, 0);
        double d[3];
        assert_true(fix.lat_deg == again.lat_deg && fix.lon_deg == again.lon_deg && fix.height_m == again.height_m);
        assert_int_equal(fix.quality, 5);
        offset_enu(48, 11, 123.4567, &fix, d);
        for (int i = 0; i < 3; i++) {
            sum[i] += d[i];
            square[i] += d[i] * d[i];
            product[i] += d[i] * d[(i + 1) % 3];
        }
    }
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(sum[i] / N) < 5 * 0.5 / sqrt(N));
        assert_true(fabs(sqrt(square[i] / N) / 0.5 - 1) < 5 / sqrt(2.0 * N));
        assert_true(fabs(product[i] / N) < 5 * 0.25 / sqrt(N)); /* axes are independent */
    }
    static const char *const other[] = {"gnss.accuracy_m=0.5", "noise.seed=2", NULL};
    struct receiver q = open_receiver("48", "11", other);
    start_receiver(&q);
    assert_true(get_fix(&q, 0, 0).lat_deg != get_fix(&r, 0, 0).lat_deg);
    close_receiver(&q);
    close_receiver(&r);
}

/* The noise is keyed by seed and purpose, and position k has the numbers 3 k to 3 k + 2. So other builds send the same
 * positions. */
static void noise_has_its_key(void **state)
{
    (void)state;
    static const char *const more[] = {"gnss.accuracy_m=0.5", "noise.seed=7", NULL};
    const uint64_t key = rng_key(7, RNG_GNSS);
    struct receiver r = open_receiver("48", "11", more);
    start_receiver(&r);
    for (uint64_t k = 0; k < 4; k++) {
        struct fix fix = get_fix(&r, k, 0);
        double d[3];
        offset_enu(48, 11, 123.4567, &fix, d);
        for (uint64_t i = 0; i < 3; i++)
            assert_true(fabs(d[i] - 0.5 * rng_normal(key, 3 * k + i)) < STEP_M);
    }
    close_receiver(&r);
}

/* An error is independent of later ones, on its own axis and on others. The mean product of two errors of N positions
 * is within 5 sigma^2 / sqrt(N) but once in 1.7 million. There are 36 of them: once in 48,000. The seed is fixed. */
static void noise_does_not_last(void **state)
{
    (void)state;
    enum { N = 2000, LAGS = 4 };
    static const char *const more[] = {"gnss.accuracy_m=0.5", NULL};
    static double d[N][3];
    struct receiver r = open_receiver("48", "11", more);
    start_receiver(&r);
    for (uint64_t k = 0; k < N; k++) {
        struct fix fix = get_fix(&r, k, 0);
        offset_enu(48, 11, 123.4567, &fix, d[k]);
    }
    for (int lag = 1; lag <= LAGS; lag++)
        for (int axes = 0; axes < 9; axes++) {
            double product = 0;
            for (int k = 0; k + lag < N; k++)
                product += d[k][axes / 3] * d[k + lag][axes % 3];
            if (fabs(product / (N - lag)) > 5 * 0.25 / sqrt(N - lag))
                fail_msg("axes %d and %d, %d apart: correlation %.3f", axes / 3, axes % 3, lag,
                         product / (N - lag) / 0.25);
        }
    close_receiver(&r);
}

/* The way is 3 m/s east and 4 north. Places are known to 1e-9 m each, which 10 ms turn into 2e-7 m/s. */
static void speed_and_course_are_those_of_the_way(void **state)
{
    (void)state;
    struct receiver r = open_receiver("48", "11", NULL);
    struct gnss_track track;
    struct nmea_fix fix;
    start_receiver(&r);
    const double *at_m = r.site->station[0].at.position_m, v_m_s[3] = {3, 4, 0};
    struct pose *const pose[] = {&track.before, &track.at, &track.after};
    for (int i = 0; i < 3; i++) {
        *pose[i] = (struct pose){.quat = {1, 0, 0, 0}};
        for (int k = 0; k < 3; k++)
            pose[i]->position_m[k] = at_m[k] + v_m_s[k] * 1e-9 * GNSS_STEP_NS * (i - 1);
    }
    track.span_ns = 2 * GNSS_STEP_NS;
    gnss_fix(&r.gnss, 0, 0, &track, &fix);
    assert_true(fabs(fix.speed_m_s - 5) < 1e-6);
    assert_true(fabs(fix.course_deg - atan2(3, 4) * 180 / M_PI) < 1e-5);
    gnss_fix(&r.gnss, 0, 0, NULL, &fix); /* one that stands has no course */
    assert_true(fix.speed_m_s == 0 && isnan(fix.course_deg));
    close_receiver(&r);
}

/* The scene's axes are east, north and up at its anchor. Station 2 is 0.5 m east of it, and the arm ahead of the head
 * points north. */
static void an_anchored_scene_has_places(void **state)
{
    static const char *const sets[] = {"scene.anchor.source=explicit", "scene.anchor.lat_deg=48",
                                       "scene.anchor.lon_deg=11",      "scene.anchor.height_m=123.4567",
                                       "links[0].type=null",           "links[0].protocol=nmea",
                                       "gnss.lever_arm_m=[0, 2, 0]",   "time.epoch=2026-01-01T00:00:00Z"};
    static const double enu[3] = {0.5, 2, 0};
    double d[3];
    (void)state;
    struct receiver r = load_receiver(sets, sizeof sets / sizeof sets[0]);
    start_receiver(&r);
    const struct fix fix = get_fix(&r, 0, 1);
    offset_enu(48, 11, 123.4567, &fix, d);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(d[i] - enu[i]) < STEP_M);
    close_receiver(&r);
}

/* Position packets of a VLP-16 and its settings need no place. The packets' sentence says V, and not 0 degrees north
 * and east. */
static void without_a_place_no_fix_is_valid(void **state)
{
    (void)state;
    struct receiver r = open_receiver("48", "11", NULL);
    char text[NMEA_MAX_SENTENCE + 1] = "";
    struct nmea_fix fix;
    start_receiver(&r);
    gnss_fix(&r.gnss, 0, 0, NULL, &fix);
    assert_int_equal(fix.quality, 1);
    r.site->station[0].at.on_earth = 0;
    gnss_fix(&r.gnss, 0, 0, NULL, &fix);
    assert_int_equal(fix.quality, 0);
    nmea_encode_rmc(text, sizeof text, &fix);
    assert_non_null(strstr(text, "RMC,000001.00,V,,,,,"));
    close_receiver(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_antenna_is_where_the_arm_puts_it),
        cmocka_unit_test(at_the_poles),
        cmocka_unit_test(times_are_those_of_the_rate),
        cmocka_unit_test(it_stands_where_the_head_stands),
        cmocka_unit_test(noise_is_what_was_asked_for),
        cmocka_unit_test(noise_does_not_last),
        cmocka_unit_test(noise_has_its_key),
        cmocka_unit_test(an_anchored_scene_has_places),
        cmocka_unit_test(speed_and_course_are_those_of_the_way),
        cmocka_unit_test(without_a_place_no_fix_is_valid),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
