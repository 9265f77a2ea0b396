/* SPDX-License-Identifier: MIT */
/* The head's own stream as a verdict reads it: when the head is up, when points come, and which points are kept. The
 * library is the test's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/app/studio/verdict/own_stream.h"
#include "firmware_sim/command/head.h"

static struct own_stream stream;
static const struct scanhead_frame *frames; /* a type of 0 ends them; a type of -1: nothing came */
static int n_next, info_rc, connect_rc;
static struct scanhead_info infos[4]; /* by the frame's number */
static uint64_t reader_lost;
static int n_closed;

static struct scanhead *handle(void)
{
    return (struct scanhead *)(void *)&stream;
}

int offline_connect(const char *who, struct link_spec *link, struct scanhead **sh, struct sh_err *err)
{
    assert_true(strcmp(who, "the head's own stream") == 0 && link == &stream.link);
    *sh = handle();
    return connect_rc < 0 ? sh_fail(err, connect_rc, "no pair") : connect_rc;
}

int scanhead_next(struct scanhead *sh, struct scanhead_frame *frame, int timeout_ms)
{
    if (sh != handle() || timeout_ms != 200) return SCANHEAD_EINPUT;
    *frame = frames[n_next];
    if (frame->type == 0) return SCANHEAD_ECLOSED;
    return frames[n_next++].type == -1 ? SCANHEAD_ETIMEOUT : SCANHEAD_OK;
}

void scanhead_get_stats(const struct scanhead *sh, struct scanhead_stats *stats)
{
    *stats = (struct scanhead_stats){.reader_lost = sh == handle() ? reader_lost : 9};
}

int scanhead_get_info(const struct scanhead *sh, struct scanhead_info *info)
{
    *info = infos[frames[n_next - 1].seq & 3];
    return sh == handle() ? info_rc : SCANHEAD_EINPUT;
}

/* Point i of a frame is at (i, its frame's number, 7); each fifth shot has no echo. */
int scanhead_points(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, struct scanhead_point *out,
                    uint32_t max)
{
    const uint32_t left = frame->n_points - first, n = left < max ? left : max;
    if (sh != handle() || max != 512 || frame->flags == 99) return SCANHEAD_EFORMAT;
    for (uint32_t i = 0; i < n; i++) {
        const double x = (first + i) % 5 == 4 ? (double)NAN : (double)(first + i);
        out[i] = (struct scanhead_point){.x = x, .y = frame->seq, .z = 7};
    }
    return (int)n;
}

int scanhead_to_scene(struct scanhead *sh, struct scanhead_point *point, uint32_t n, double *frame)
{
    for (uint32_t i = 0; i < n && sh == handle() && frame == NULL; i++)
        point[i].z = 70;
    return SCANHEAD_OK;
}

void scanhead_close(struct scanhead *sh)
{
    n_closed += sh == handle();
}

/* Reads all frames. */
static void read_all(const struct scanhead_frame *all, int keeps)
{
    struct sh_err err;
    memset(&stream, 0, sizeof stream);
    stream.keeps = keeps;
    frames = all;
    n_next = n_closed = 0;
    connect_rc = 5;
    assert_int_equal(own_stream_open(&stream, &err), SH_OK);
    assert_int_equal(stream.link.waits, LINK_WAITS_YES);
    assert_int_equal(own_stream_start(&stream, &err), SH_OK);
    assert_int_equal(stream.running, 1);
    own_stream_join(&stream);
}

static int make(void **state)
{
    (void)state;
    memset(infos, 0, sizeof infos);
    info_rc = SCANHEAD_OK;
    reader_lost = 0;
    return 0;
}

static void close_it(void)
{
    own_stream_close(&stream);
    assert_int_equal(n_closed, 1);
}

/* Each state but off and boot means that the head is up; an event says it, or telemetry does. Other frames do not,
 * and neither does telemetry that is cut short. */
static void the_head_is_up(void **state)
{
    (void)state;
    for (uint32_t to = 0; to < HEAD_N_STATES; to++) {
        uint8_t payload[8] = {0};
        const int is_up = to != HEAD_OFF && to != HEAD_BOOT;
        le_put32(payload, to);
        const struct scanhead_frame event[] = {
            {.type = -1},
            {.type = SCANHEAD_EVENT, .event = SCANHEAD_EV_TIME, .event_value = {HEAD_IDLE}},
            {.type = SCANHEAD_EVENT, .event = SCANHEAD_EV_STATE, .event_value = {to, HEAD_IDLE}},
            {0}};
        const struct scanhead_frame none[] = {{.type = SCANHEAD_TELEMETRY, .payload = payload, .payload_len = 3},
                                              {.type = SCANHEAD_LINE_END, .payload = payload, .payload_len = 8},
                                              {.type = SCANHEAD_EVENT, .payload = payload, .payload_len = 8},
                                              {0}};
        const struct scanhead_frame telemetry[] = {{.type = SCANHEAD_TELEMETRY, .payload = payload, .payload_len = 4},
                                                   {0}};
        read_all(event, 0);
        assert_int_equal(atomic_load(&stream.is_up), is_up);
        assert_int_equal(n_next, 3); /* a wait without a frame ends nothing */
        close_it();
        read_all(none, 0);
        assert_int_equal(atomic_load(&stream.is_up), 0);
        close_it();
        read_all(telemetry, 0);
        assert_int_equal(atomic_load(&stream.is_up), is_up);
        close_it();
    }
}

static const struct scanhead_frame TWO[] = {{.type = SCANHEAD_POINTS, .seq = 1, .t_ns = 100, .n_points = 1300},
                                            {.type = SCANHEAD_LINE_END, .seq = 2, .t_ns = 150, .n_points = 9},
                                            {.type = SCANHEAD_POINTS, .seq = 3, .t_ns = 200, .n_points = 6},
                                            {0}};

/* Shots without echo are left out: 1040 of 1300, and 5 of 6. */
static void points_are_kept(void **state)
{
    (void)state;
    infos[1].station = 1;
    infos[3].station = 3;
    read_all(TWO, 1);
    assert_int_equal(atomic_load(&stream.points_ns), 200);
    assert_true(stream.n == 1045 && stream.n_frames == 2);
    assert_true(stream.frame[0].seq == 1 && stream.frame[0].t_ns == 100 && stream.frame[0].end == 1040);
    assert_true(stream.frame[1].seq == 3 && stream.frame[1].t_ns == 200 && stream.frame[1].end == 1045);
    for (size_t i = 0; i < 1045; i++) {
        const size_t of = i < 1040 ? i : i - 1040;
        const double *p = stream.xyz_m[i];
        assert_true(p[0] == (double)(of / 4 * 5 + of % 4) && p[1] == (i < 1040 ? 1 : 3) && p[2] == 7);
    }
    assert_true(stream.have_info == 1 && stream.info.station == 1 && !stream.is_moved);
    assert_string_equal(stream.short_of, "");
    close_it();
    read_all(TWO, 0);
    assert_true(stream.n == 0 && stream.n_frames == 0 && atomic_load(&stream.points_ns) == 200);
    close_it();
}

/* A head that stood in another place, or was turned, has moved. One that moves all the time has not: its polar points
 * are in the scene's frame. */
static void heads_that_move(void **state)
{
    static const struct {
        int moving, geo, where, is_moved, in_scene;
    } rows[] = {{0, 0, 0, 0, 0}, {0, 0, 1, 1, 0}, {0, 0, 2, 1, 0}, {1, 0, 1, 0, 1}, {1, 1, 2, 0, 0}, {0, 1, 1, 1, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        make(NULL);
        for (int k = 0; k < 4; k++) {
            infos[k].moving = rows[i].moving;
            infos[k].geo = rows[i].geo;
        }
        if (rows[i].where == 1) infos[3].station_m[2] = 1e-9;
        if (rows[i].where == 2) infos[3].rotation[8] = 1e-9;
        read_all(TWO, 1);
        assert_int_equal(stream.is_moved, rows[i].is_moved);
        assert_true(stream.xyz_m[0][2] == (rows[i].in_scene ? 70 : 7));
        close_it();
    }
}

/* The first reason for missing points is kept. */
static void points_that_are_missing(void **state)
{
    (void)state;
    info_rc = SCANHEAD_ESTATE;
    reader_lost = 1;
    read_all(TWO, 1);
    assert_string_equal(stream.short_of, "points came before their descriptor, or memory was short");
    assert_true(stream.n_frames == 0 && stream.have_info == 0);
    close_it();
    info_rc = SCANHEAD_OK;
    read_all(TWO, 1);
    assert_string_equal(stream.short_of, "this machine was too slow to keep the head's points");
    close_it();
    static const struct scanhead_frame broken[] = {
        {.type = SCANHEAD_POINTS, .seq = 1, .t_ns = 100, .n_points = 9, .flags = 99}, {0}};
    reader_lost = 0;
    read_all(broken, 1);
    assert_true(stream.n == 0 && stream.n_frames == 1 && stream.frame[0].end == 0);
    close_it();
}

static void no_connection(void **state)
{
    struct sh_err err;
    (void)state;
    memset(&stream, 0, sizeof stream);
    connect_rc = SH_EIO;
    assert_int_equal(own_stream_open(&stream, &err), SH_EIO);
    own_stream_join(&stream); /* there is no thread */
    connect_rc = 0;
    assert_int_equal(own_stream_open(&stream, &err), SH_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_head_is_up, make),  cmocka_unit_test_setup(points_are_kept, make),
        cmocka_unit_test_setup(heads_that_move, make), cmocka_unit_test_setup(points_that_are_missing, make),
        cmocka_unit_test_setup(no_connection, make),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
