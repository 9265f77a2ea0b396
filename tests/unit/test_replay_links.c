/* SPDX-License-Identifier: MIT */
/* Which devices a recording can be: links of other protocols need what the recorded head may not have. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"

enum { NO_EMITTER = 99, SECOND_NS = 1000000000 };

struct recorded {
    enum protocol_id protocol;
    uint32_t emitter, n_beams, layout, echoes, moving;
    int64_t utc0_ns;
    double lat_deg, lon_deg, height_m, speed;
    const char *says; /* NULL: it can be that device */
};

/* The link in question is the second one; the first speaks the native protocol, which any recording can. */
static void expect_answer(const struct recorded *row, size_t i)
{
    struct config *cfg = calloc(1, sizeof *cfg);
    struct replay *r = calloc(1, sizeof *r);
    struct sh_err err = {0};
    assert_true(cfg != NULL && r != NULL);
    strcpy(cfg->file, "run.yaml");
    cfg->n_links = 2;
    cfg->link[1].protocol = (int)row->protocol;
    r->cfg = cfg;
    r->options.path = "a.shs";
    r->options.speed = row->speed;
    replay_clock_begin(&r->clock, 0, row->utc0_ns);
    r->anchor.lat_deg = row->lat_deg;
    r->anchor.lon_deg = row->lon_deg;
    r->anchor.height_m = row->height_m;
    r->anchor.moving = row->moving;
    const struct native_descriptor d = {.layout = (uint8_t)row->layout};
    const struct native_emitter e = {.kind = row->emitter, .n_beams = row->n_beams, .echoes = row->echoes};
    const int rc = replay_check_links(r, &d, row->emitter != NO_EMITTER ? &e : NULL, NULL, &err);
    if (rc != (row->says != NULL ? SH_EINPUT : SH_OK)) fail_msg("row %zu: %d, %s", i, rc, err.text);
    if (row->says != NULL && strstr(err.text, row->says) == NULL) fail_msg("row %zu: %s", i, err.text);
    if (row->says != NULL) assert_int_equal(strncmp(err.text, "run.yaml: links[1].protocol ", 28), 0);
    free(r);
    free(cfg);
}

static void a_recording_is_the_devices_that_it_can_be(void **state)
{
    (void)state;
    static const struct recorded rows[] = {
        {PROTOCOL_NATIVE, NO_EMITTER, .layout = NATIVE_GEO, .utc0_ns = INT64_MIN, .speed = 3.0},
        /* the GNSS receiver: any head that knows its time and place, and stands */
        {PROTOCOL_NMEA, NO_EMITTER, .utc0_ns = SECOND_NS, .lat_deg = 50.0, .speed = 1.0},
        {PROTOCOL_NMEA, NATIVE_EMIT_SPHERE, .utc0_ns = SECOND_NS, .lat_deg = -50.0, .speed = 1.0},
        {PROTOCOL_NMEA, NATIVE_EMIT_BEAMS, 16, .utc0_ns = SECOND_NS, .lat_deg = 50.0, .speed = 1.0},
        /* on the equator; where it meets the meridian of Greenwich, 20 m above the ellipsoid */
        {PROTOCOL_NMEA, NO_EMITTER, .utc0_ns = SECOND_NS, .lon_deg = -78.5, .speed = 1.0},
        {PROTOCOL_NMEA, NO_EMITTER, .utc0_ns = SECOND_NS, .height_m = 20.0, .speed = 1.0},
        {PROTOCOL_NMEA, NO_EMITTER, .utc0_ns = INT64_MIN, .lat_deg = 50.0, .speed = 1.0,
         .says = "nmea: a.shs has no time of day; required is a recording of a head with time.epoch"},
        {PROTOCOL_NMEA, NO_EMITTER, .utc0_ns = SECOND_NS, .speed = 1.0, .says = "has no place on the Earth"},
        {PROTOCOL_NMEA, NO_EMITTER, .utc0_ns = SECOND_NS, .lat_deg = 50.0, .moving = NATIVE_MOVING, .speed = 1.0,
         .says = "has no place on the Earth where it stands; required is a station with one"},
        {PROTOCOL_NMEA, NO_EMITTER, .utc0_ns = SECOND_NS, .lat_deg = 50.0, .speed = 2.0,
         .says = "nmea: its times are those of the device; allowed is --speed 1"},
        /* planar heads */
        {PROTOCOL_SCIP, NO_EMITTER, .speed = 1.0,
         .says = "scip: the device can't be the head of a.shs, which has emitter line; allowed is planar"},
        {PROTOCOL_SCIP, NATIVE_EMIT_BEAMS, 16, .speed = 1.0, .says = "emitter beams; allowed is planar"},
        {PROTOCOL_SCIP, NATIVE_EMIT_SPHERE, .speed = 1.0, .says = "emitter sphere; allowed is planar"},
        {PROTOCOL_COLA, NATIVE_EMIT_PLANAR, .layout = NATIVE_GEO, .speed = 1.0,
         .says = "cola: a.shs has positions instead of ranges (layout geo); required is layout polar"},
        /* a rotor with 16 rings */
        {PROTOCOL_VELODYNE_HTTP, NATIVE_EMIT_BEAMS, 16, .layout = NATIVE_GEO, .speed = 1.0},
        {PROTOCOL_VELODYNE_HTTP, NATIVE_EMIT_BEAMS, 32, .speed = 1.0, .says = "which has 32 rings; allowed are 16"},
        {PROTOCOL_VELODYNE_HTTP, NATIVE_EMIT_PLANAR, .speed = 1.0, .says = "emitter planar; allowed is beams"},
        {PROTOCOL_VELODYNE_HTTP, NATIVE_EMIT_DIRECTIONS, .speed = 1.0, .says = "emitter directions; allowed is beams"},
        {PROTOCOL_VELODYNE, NATIVE_EMIT_BEAMS, 16, .echoes = NATIVE_ECHOES_FIRST, .speed = 1.0,
         .says = "velodyne: a.shs has first echoes alone; required is all, last or strongest"},
        /* a conversation is no recording */
        {PROTOCOL_CAPTURE, NO_EMITTER, .speed = 1.0,
         .says = "capture: a.shs is a recording, no capture; allowed are the other protocols"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        expect_answer(&rows[i], i);
}

/* ---- the time of day, and the receiver */

/* At device time 0 it is 2026-03-01 12:00:00.25 UTC (date -u -d 2026-03-01T12:00:00 +%s). */
static const int64_t UTC0_NS = INT64_C(1772366400) * SECOND_NS + SECOND_NS / 4;

static struct replay *replay_with(int64_t utc0_ns, double lat_deg)
{
    struct replay *r = calloc(1, sizeof *r);
    assert_non_null(r);
    pthread_mutex_init(&r->lock, NULL);
    replay_clock_begin(&r->clock, 0, utc0_ns);
    r->anchor.lat_deg = lat_deg;
    r->anchor.lon_deg = 8.5;
    r->anchor.height_m = 110.0;
    return r;
}

static void replay_end_of(struct replay *r)
{
    pthread_mutex_destroy(&r->lock);
    free(r);
}

/* A fix comes with each full second, with the time of that second. */
static void fixes_are_at_full_seconds(void **state)
{
    (void)state;
    struct replay *r = replay_with(UTC0_NS, 49.0);
    struct nmea_fix fix;
    int64_t hour_ns;
    assert_int_equal(replay_date_ns(r, 5), UTC0_NS + 5);
    assert_int_equal(replay_next_fix_ns(r, 0), SECOND_NS / 4 * 3);
    assert_int_equal(replay_next_fix_ns(r, SECOND_NS / 4 * 3), SECOND_NS / 4 * 3);
    assert_int_equal(replay_next_fix_ns(r, SECOND_NS / 4 * 3 + 1), SECOND_NS / 4 * 7);
    assert_int_equal(replay_pps(r, 0, &hour_ns), PROTOCOL_PPS_LOCKED);
    assert_int_equal(hour_ns, SECOND_NS / 4);
    assert_int_equal(replay_fix(r, SECOND_NS / 4 * 3, &fix), 1);
    assert_true(fix.year == 2026 && fix.month == 3 && fix.day == 1 && fix.hour == 12 && fix.minute == 0);
    assert_true(fix.second == 1 && fix.quality == 1);
    assert_true(fix.lat_deg == 49.0 && fix.lon_deg == 8.5 && fix.altitude_m == 110.0);
    assert_true(fix.talker[0] == 'G' && fix.talker[1] == 'N' && fix.satellites == 12 && fix.hdop == 0.7);
    assert_true(isnan(fix.course_deg));
    r->anchor.lat_deg = 0.0; /* a place on the equator */
    assert_int_equal(replay_fix(r, 0, &fix), 1);
    assert_int_equal(fix.quality, 1);
    r->anchor.lon_deg = r->anchor.height_m = 0.0; /* no place */
    assert_int_equal(replay_fix(r, 0, &fix), 1);
    assert_int_equal(fix.quality, 0);
    r->anchor.lat_deg = 49.0;
    r->anchor.moving = NATIVE_MOVING; /* its way on the Earth is not known */
    assert_int_equal(replay_fix(r, SECOND_NS, &fix), 1);
    assert_int_equal(fix.quality, 0);
    replay_end_of(r);
}

/* A recording may have any number as its time. Dates begin after 1970-01-01 and end with 2199-12-31 (date -u -d
 * 2200-01-01 +%s). */
static void dates_are_within_what_a_calendar_has(void **state)
{
    (void)state;
    static const int64_t LAST_NS = INT64_C(7258118400) * SECOND_NS;
    struct replay *r = replay_with(2, 49.0);
    struct nmea_fix fix;
    int64_t hour_ns;
    assert_int_equal(replay_pps(r, -2, &hour_ns), PROTOCOL_PPS_ABSENT);
    assert_int_equal(replay_pps(r, -1, &hour_ns), PROTOCOL_PPS_LOCKED);
    assert_int_equal(hour_ns, 1);
    replay_clock_begin(&r->clock, 0, LAST_NS - 5);
    assert_int_equal(replay_date_ns(r, 4), LAST_NS - 1);
    assert_int_equal(replay_fix(r, 4, &fix), 1);
    assert_true(fix.year == 2199 && fix.month == 12 && fix.day == 31);
    assert_true(fix.hour == 23 && fix.minute == 59 && fix.second == 59);
    assert_int_equal(replay_date_ns(r, 5), 5);
    assert_int_equal(replay_fix(r, 5, &fix), 0);
    replay_end_of(r);
}

static void without_a_time_of_day_there_is_none(void **state)
{
    (void)state;
    struct replay *r = replay_with(INT64_MIN, 49.0);
    struct nmea_fix fix;
    int64_t hour_ns;
    assert_int_equal(replay_date_ns(r, 5), 5);
    assert_int_equal(replay_next_fix_ns(r, 5), INT64_MAX);
    assert_int_equal(replay_pps(r, 3601 * INT64_C(1000000000), &hour_ns), PROTOCOL_PPS_ABSENT);
    assert_int_equal(hour_ns, SECOND_NS);
    assert_int_equal(replay_fix(r, 5, &fix), 0);
    replay_end_of(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recording_is_the_devices_that_it_can_be),
        cmocka_unit_test(fixes_are_at_full_seconds),
        cmocka_unit_test(dates_are_within_what_a_calendar_has),
        cmocka_unit_test(without_a_time_of_day_there_is_none),
    };
    return cmocka_run_group_tests_name("replay links", tests, NULL, NULL);
}
