/* SPDX-License-Identifier: MIT */
/* libscanhead: attributes, deviations and colours of points, for all values on the wire, bit for bit, and from any
 * index on. */
#include <math.h>

#include "core/line.h"
#include "tests/unit/host_rig.h"

enum { N = 3001, VALUES = 65536 };

static int16_t amplitude_cdb[N];
static uint16_t width_cns[N], deviation_1000[N];
static uint8_t rgb[N][3];
/* The last element is one more than is asked for, and stays 0. */
static struct scanhead_attribute attribute[N + 1];
static struct scanhead_colour colour[N + 1];
static double deviation[N + 1];

static void put_values(int head, uint32_t from)
{
    struct line_block block = make_block(N, 0);
    block.amplitude_cdb = amplitude_cdb;
    block.width_cns = width_cns;
    block.deviation = deviation_1000;
    block.rgb = rgb;
    for (uint32_t i = 0; i < N; i++) {
        amplitude_cdb[i] = (int16_t)(uint16_t)(from + i);
        width_cns[i] = (uint16_t)(from + i);
        deviation_1000[i] = (uint16_t) ~(from + i);
        for (uint32_t k = 0; k < 3; k++)
            rgb[i][k] = (uint8_t)((from + i) >> 4 * k);
    }
    const size_t len = native_encode_points(out, sizeof out, &block, 500);
    for (size_t at = 0; at < len;)
        at += native_finish_frame(out + at, rig_next_seq());
    put_all(head, out, len);
}

static void expect_same(double x, double want)
{
    if (memcmp(&x, &want, sizeof x) != 0) fail_msg("%.17g came in place of %.17g", x, want);
}

static void expect_values(uint32_t first, uint32_t n)
{
    for (uint32_t i = 0, k = first; i < n; i++, k++) {
        const int16_t db = amplitude_cdb[k];
        expect_same(attribute[i].amplitude_db, db == INT16_MIN ? (double)NAN : db / 100.0);
        expect_same(attribute[i].width_ns, width_cns[k] == 0 ? (double)NAN : width_cns[k] / 100.0);
        expect_same(deviation[i], deviation_1000[k] / 1000.0);
        assert_true(colour[i].red == rgb[k][0] && colour[i].green == rgb[k][1] && colour[i].blue == rgb[k][2]);
    }
}

/* Returns a client that has the descriptor of a head with all of these. */
static struct scanhead *open_described(int *head)
{
    struct scanhead *sh = open_pair(head);
    struct native_descriptor d = make_descriptor(0, 1);
    struct scanhead_frame frame;
    d.content = NATIVE_HAS_ATTRIBUTES | NATIVE_HAS_COLOURS | NATIVE_HAS_DEVIATIONS;
    native_encode_descriptor(out, sizeof out, &d, 1, 0);
    put_all(*head, out, native_finish_frame(out, rig_next_seq()));
    expect_frame(sh, SCANHEAD_DESCRIPTOR, &frame);
    return sh;
}

static void test_all_values(void **state)
{
    (void)state;
    int head;
    struct scanhead_frame frame;
    struct scanhead *sh = open_described(&head);
    for (uint32_t from = 0; from < VALUES; from += N) {
        const uint32_t first = from % 7, n = N - first;
        put_values(head, from);
        expect_frame(sh, SCANHEAD_POINTS, &frame);
        expect_frame(sh, SCANHEAD_ATTRIBUTES, &frame);
        assert_int_equal(scanhead_attributes(sh, &frame, first, attribute, N), n);
        assert_int_equal(scanhead_deviations(sh, &frame, first, deviation, N), n);
        expect_frame(sh, SCANHEAD_COLOURS, &frame);
        assert_int_equal(scanhead_colours(sh, &frame, first, colour, N), n);
        expect_values(first, n);
    }
    assert_true(attribute[N].width_ns == 0 && deviation[N] == 0 && colour[N].red == 0);
    close(head);
    scanhead_close(sh);
}

/* A client asks for some of the values, or for none. */
static void test_parts(void **state)
{
    (void)state;
    int head;
    struct scanhead_frame frame;
    struct scanhead *sh = open_described(&head);
    put_values(head, 0);
    expect_frame(sh, SCANHEAD_POINTS, &frame);
    expect_frame(sh, SCANHEAD_ATTRIBUTES, &frame);
    memset(attribute, 0, sizeof attribute);
    assert_int_equal(scanhead_attributes(sh, &frame, N - 3, attribute, 2), 2);
    expect_same(attribute[1].width_ns, width_cns[N - 2] / 100.0);
    expect_same(attribute[2].width_ns, 0);
    assert_int_equal(scanhead_attributes(sh, &frame, N, attribute, 2), 0);
    assert_int_equal(scanhead_deviations(sh, &frame, N + 1, deviation, 2), 0);
    deviation[0] = deviation[1] = -1; /* which is no deviation */
    assert_int_equal(scanhead_deviations(sh, &frame, N - 1, deviation, 2), 1);
    assert_true(!(deviation[0] < 0) && deviation[1] < 0);
    expect_frame(sh, SCANHEAD_COLOURS, &frame);
    assert_int_equal(scanhead_attributes(sh, &frame, 0, attribute, 2), SCANHEAD_EINPUT);
    assert_int_equal(scanhead_colours(sh, &frame, N, colour, 2), 0);
    close(head);
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_all_values), cmocka_unit_test(test_parts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
