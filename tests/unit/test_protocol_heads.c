/* SPDX-License-Identifier: MIT */
/* Which heads a protocol can speak for, at each limit, and what it says to others. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/protocol.h"

/* Beams as a head sends them (POINTS.md, emitter): elevation and azimuth in i32 micro-degrees, u32 ns. */
static struct native_emitter emitter;
static struct native_beam beam[16];

static const char *refusal_of(enum protocol_id id, double pan_counts)
{
    static struct sh_err err;
    uint8_t frame[4096];
    const struct native_descriptor d = {.pan_counts_per_turn = pan_counts};
    assert_true(native_encode_emitter(frame, sizeof frame, &emitter, beam, 0, 0) != 0);
    err = (struct sh_err){0};
    const int rc = protocol_ops_get(id)->check_head(&d, &emitter, frame + NATIVE_HEADER_LEN, &err);
    assert_int_equal(rc, err.text[0] == '\0' ? SH_OK : SH_EINPUT);
    return err.text;
}

/* The published table of the VLP-16, in the order of firing; that of the Puck Hi-Res is 2/3 of it. */
static void vlp16(int is_hi_res)
{
    static const int elevation_deg[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
    emitter = (struct native_emitter){
        .kind = NATIVE_EMIT_BEAMS, .n_beams = 16, .turn = 1, .sequence_ns_num = 55296, .sequence_ns_den = 1};
    for (uint32_t i = 0; i < 16; i++)
        beam[i] =
            (struct native_beam){elevation_deg[i] * 1000000 / (is_hi_res ? 3 : 1) * (is_hi_res ? 2 : 1), 0, 2304 * i};
}

static const char TIMES[] = "another firing sequence; allowed is that of a VLP-16: clockwise, 55.296 us, with a beam "
                            "each 2.304 us, all at azimuth 0";

/* Clients read elevations from a calibration file, so a head may have any (VELODYNE.md). Times of firing are those of
 * the page's formula. */
static void heads_of_velodyne(void **state)
{
    (void)state;
    for (int is_hi_res = 0; is_hi_res < 2; is_hi_res++) {
        vlp16(is_hi_res);
        assert_string_equal(refusal_of(PROTOCOL_VELODYNE, 36000), "");
        for (int i = 0; i < 16; i++) {
            beam[i].elevation_udeg = 25000000 - 1000000 * i;
            assert_string_equal(refusal_of(PROTOCOL_VELODYNE, 36000), "");
        }
    }
    for (int i = 0; i < 16; i++) {
        vlp16(0);
        beam[i].offset_ns++;
        assert_string_equal(refusal_of(PROTOCOL_VELODYNE, 36000), TIMES);
        vlp16(0);
        beam[i].azimuth_udeg = 1;
        assert_string_equal(refusal_of(PROTOCOL_VELODYNE, 36000), TIMES);
    }
    vlp16(0);
    emitter.sequence_ns_num *= 3;
    emitter.sequence_ns_den *= 3;
    assert_string_equal(refusal_of(PROTOCOL_VELODYNE, 36000), "");
    emitter.sequence_ns_num++;
    assert_string_equal(refusal_of(PROTOCOL_VELODYNE, 36000), TIMES);
    vlp16(0);
    emitter.turn = 0;
    assert_string_equal(refusal_of(PROTOCOL_VELODYNE, 36000), TIMES);
    emitter.turn = -1;
    assert_string_equal(refusal_of(PROTOCOL_VELODYNE, 36000), TIMES);
}

/* Steps of a turn: SCIP has 2880 of them at most (SCIP.md). CoLa's angle of a step, u16 in 1/10000 degree, needs 55. */
static void planar_heads(void **state)
{
    (void)state;
    static const struct {
        enum protocol_id id;
        uint32_t steps;
        int first, last, front;
        double pan_counts;
        const char *refusal;
    } rows[] = {
        {PROTOCOL_SCIP, 1440, 0, 1080, 540, 1, ""},
        {PROTOCOL_SCIP, 1440, 0, 1439, 1439, 1, ""},
        {PROTOCOL_SCIP, 1440, 1080, 1080, 0, 1, ""},
        {PROTOCOL_SCIP, 1440, 0, 1440, 540, 1, "steps up to 1440 of 1440 a turn; allowed are 2880 a turn at most"},
        {PROTOCOL_SCIP, 2880, 0, 2879, 540, 1, ""},
        {PROTOCOL_SCIP, 2881, 0, 100, 540, 1, "steps up to 100 of 2881 a turn; allowed are 2880 a turn at most"},
        {PROTOCOL_SCIP, 0, 0, -1, 0, 1, "steps up to -1 of 0 a turn; allowed are 2880 a turn at most"},
        {PROTOCOL_SCIP, 1440, -1, 10, 5, 1, "a field of view of steps -1 to 10; allowed are 1 to 3000 steps of a turn"},
        {PROTOCOL_SCIP, 1440, 11, 10, 5, 1, "a field of view of steps 11 to 10; allowed are 1 to 3000 steps of a turn"},
        {PROTOCOL_SCIP, 1440, 0, 10, -1, 1,
         "step -1 in front, and 1 encoder counts a turn; allowed are a step of the turn, and 1 count and more"},
        {PROTOCOL_SCIP, 1440, 0, 10, 1440, 65536,
         "step 1440 in front, and 65536 encoder counts a turn; allowed are a step of the turn, and 1 count and more"},
        {PROTOCOL_SCIP, 1440, 0, 10, 5, 0.5,
         "step 5 in front, and 0.5 encoder counts a turn; allowed are a step of the turn, and 1 count and more"},
        {PROTOCOL_COLA, 55, 0, 54, 0, 1, ""},
        {PROTOCOL_COLA, 54, 0, 53, 0, 1, "54 steps a turn; allowed are 55 and more, of 6.5535 degrees at most"},
        {PROTOCOL_COLA, 14400, 0, 2999, 0, 1, ""},
        {PROTOCOL_COLA, 14400, 0, 3000, 0, 1,
         "a field of view of steps 0 to 3000; allowed are 1 to 3000 steps of a turn"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        emitter = (struct native_emitter){.kind = NATIVE_EMIT_PLANAR,
                                          .steps = rows[i].steps,
                                          .first_step = rows[i].first,
                                          .last_step = rows[i].last,
                                          .front_step = rows[i].front,
                                          .turn = -1};
        assert_string_equal(refusal_of(rows[i].id, rows[i].pan_counts), rows[i].refusal);
    }
}

/* The heads that each protocol speaks for, and what it needs: config/links.md. 0: any head. */
static void kinds_of_heads(void **state)
{
    (void)state;
    enum { PLANAR = 1u << NATIVE_EMIT_PLANAR, BEAMS = 1u << NATIVE_EMIT_BEAMS };
    static const struct {
        const char *name;
        uint32_t emitters, n_beams;
        int needs_polar, needs_clock;
    } rows[PROTOCOL_N] = {
        [PROTOCOL_NATIVE] = {"native", 0, 0, 0, 0},
        [PROTOCOL_NMEA] = {"nmea", 0, 0, 0, 1},
        [PROTOCOL_SCIP] = {"scip", PLANAR, 0, 1, 0},
        [PROTOCOL_COLA] = {"cola", PLANAR, 0, 1, 0},
        [PROTOCOL_VELODYNE] = {"velodyne", BEAMS, 16, 1, 0},
        [PROTOCOL_VELODYNE_POSITION] = {"velodyne-position", BEAMS, 16, 0, 0},
        [PROTOCOL_VELODYNE_HTTP] = {"velodyne-http", BEAMS, 16, 0, 0},
    };
    for (int id = 0; id < PROTOCOL_N; id++) {
        const struct protocol_ops *ops = protocol_ops_get((enum protocol_id)id);
        if (id == PROTOCOL_CAPTURE) continue; /* it speaks for no head */
        assert_string_equal(ops->name, rows[id].name);
        assert_int_equal(ops->emitters, rows[id].emitters);
        assert_int_equal(ops->n_beams, rows[id].n_beams);
        assert_int_equal((ops->needs & PROTOCOL_NEEDS_POLAR) != 0, rows[id].needs_polar);
        assert_int_equal((ops->needs & PROTOCOL_NEEDS_TIME) != 0, rows[id].needs_clock);
        assert_int_equal((ops->needs & PROTOCOL_NEEDS_PLACE) != 0, rows[id].needs_clock);
        assert_int_equal((ops->needs & PROTOCOL_NEEDS_LAST) != 0, id == PROTOCOL_VELODYNE);
    }
    for (uint32_t kind = 0; kind < 31; kind++)
        assert_int_equal(protocol_ops_get(PROTOCOL_CAPTURE)->emitters >> kind & 1, 0);
    assert_true(protocol_ops_get(PROTOCOL_CAPTURE)->emitters != 0);
    assert_null(protocol_ops_get(PROTOCOL_N));
    assert_null(protocol_ops_get((enum protocol_id) - 1));
}

/* Bytes of the longest unit, as COLA.md, SCIP.md and Velodyne's manual have them. */
static void longest_units(void **state)
{
    (void)state;
    assert_int_equal(protocol_ops_get(PROTOCOL_SCIP)->max_unit, 59483);
    assert_int_equal(protocol_ops_get(PROTOCOL_VELODYNE)->max_unit, 1206);
    assert_int_equal(protocol_ops_get(PROTOCOL_VELODYNE)->n_beams, 16);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(heads_of_velodyne), cmocka_unit_test(planar_heads),
                                       cmocka_unit_test(longest_units), cmocka_unit_test(kinds_of_heads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
