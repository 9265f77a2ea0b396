/* SPDX-License-Identifier: MIT */
/* drivers/record/scan_count.h: which frames and points begin a scan. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "drivers/record/scan_count.h"

enum { DESCRIPTOR, REPEATED, POINTS, EVENT, START };

struct step {
    int what;
    uint32_t scan;
    int64_t t_ns;
    uint64_t n; /* of scans, with this frame. t_ns of POINTS and START: their scan's start */
};

static void take(struct scan_count *count, const struct step *s)
{
    static uint8_t frame[1024] = {[1] = NATIVE_POINTS};
    const struct native_descriptor d = {.scan = s->scan, .frames = 1};
    const struct native_event e = {0}, start = {.code = NATIVE_EV_SCAN_START, .a = s->scan, .b = (uint64_t)s->t_ns};
    static uint32_t word[1];
    static int16_t refl_cdb[1];
    static uint16_t label[1];
    static uint8_t echo[1];
    const struct line_block block = {.t0_ns = 700,
                                     .a = word,
                                     .b = word,
                                     .c = word,
                                     .dt_ns = word,
                                     .refl_cdb = refl_cdb,
                                     .label = label,
                                     .echo = echo};
    if (s->what == DESCRIPTOR || s->what == REPEATED)
        assert_true(
            native_encode_descriptor(frame, sizeof frame, &d, s->t_ns, s->what == REPEATED ? NATIVE_REPEAT : 0) > 0);
    else if (s->what == EVENT)
        assert_true(native_encode_event(frame, sizeof frame, &e, s->t_ns, 0) > 0);
    else if (s->what == START)
        assert_true(native_encode_event(frame, sizeof frame, &start, s->t_ns + 900, 0) > 0);
    else
        assert_true(native_encode_points(frame, sizeof frame, &block, s->t_ns) > 0);
    scan_count_frame(count, frame);
}

static void tell(const struct step *step, int n)
{
    struct scan_count count = {0};
    for (int i = 0; i < n; i++) {
        take(&count, &step[i]);
        if (count.n_scans != step[i].n) fail_msg("frame %d: %d scans", i, (int)count.n_scans);
    }
}

/* DESCRIPTOR.md: a scan begins with a descriptor of another number, and settings that change repeat the number. Between
 * scans a head repeats the last descriptor. */
static void test_frames(void **state)
{
    (void)state;
    static const struct step plain[] = {{REPEATED, 0, 1, 0},   {DESCRIPTOR, 1, 2, 1}, {POINTS, 0, 0, 1},
                                        {REPEATED, 1, 3, 1},   {DESCRIPTOR, 1, 4, 1}, {POINTS, 0, 0, 1},
                                        {DESCRIPTOR, 2, 5, 2}, {EVENT, 0, 6, 2},      {POINTS, 0, 0, 2}},
                             joined[] = {{EVENT, 0, 1, 0},    {POINTS, 0, 0, 1}, {POINTS, 0, 0, 1},
                                         {REPEATED, 4, 2, 1}, {POINTS, 0, 0, 1}, {DESCRIPTOR, 5, 3, 2}},
                             lost[] = {{DESCRIPTOR, 1, 1, 1},
                                       {REPEATED, 2, 2, 2},
                                       {REPEATED, 2, 3, 2},
                                       {POINTS, 0, 0, 2},
                                       {REPEATED, 0, 4, 2}},
                             again[] = {{DESCRIPTOR, 1, 9, 1},
                                        {POINTS, 0, 0, 1},
                                        {DESCRIPTOR, 1, 9, 1},
                                        {DESCRIPTOR, 1, 8, 2}},
                             number[] = {{START, 3, 100, 0},       {DESCRIPTOR, 3, 101, 1}, {POINTS, 0, 100, 1},
                                         {START, 3, 100, 1},       {POINTS, 0, 100, 1},     {START, 3, 5000, 2},
                                         {DESCRIPTOR, 3, 6000, 2}, {POINTS, 0, 5000, 2},    {START, 4, 9000, 2},
                                         {DESCRIPTOR, 4, 9900, 3}},
                             late[] = {{DESCRIPTOR, 1, 100, 1}, {POINTS, 0, 100, 1},  {DESCRIPTOR, 2, 4990, 2},
                                       {START, 2, 5000, 2},     {POINTS, 0, 5000, 2}, {REPEATED, 3, 7990, 3},
                                       {START, 3, 8000, 3},     {POINTS, 0, 8000, 3}},
                             idle[] = {{REPEATED, 7, 1, 0}, {REPEATED, 8, 1, 0}, {DESCRIPTOR, 8, 2, 1}};
#define TELL(steps) tell(steps, (int)(sizeof(steps) / sizeof *(steps)))
    TELL(plain);
    TELL(joined); /* its descriptor was lost, and a repeated one names it */
    TELL(lost);   /* the first descriptor of scan 2 was lost */
    TELL(again);  /* the head was started again: its time begins anew */
    TELL(number); /* a SCAN_START of the same number, late for the scan at hand, then with another start */
    TELL(late);   /* a SCAN_START after the descriptor of its scan, and before the points */
    TELL(idle);   /* repeated ones between scans */
}

static void test_points(void **state)
{
    (void)state;
    struct point_scans scans = {0};
    static const struct {
        long station;
        double time_s;
        uint64_t n;
    } point[] = {{0, 5, 1}, {0, 5, 1}, {0, 6, 1}, {0, 5.5, 2}, {1, 7, 3}, {0, 8, 4}, {0, -1, 5}};
    for (size_t i = 0; i < sizeof point / sizeof *point; i++) {
        point_scans_take(&scans, point[i].station, point[i].time_s);
        assert_int_equal(scans.n, point[i].n);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_frames), cmocka_unit_test(test_points)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
