/* SPDX-License-Identifier: MIT */
/* CoLa: monitored fields by telegram, their evaluation, and the events of results and outputs. Records of fields are
 * those of real scanners, as the test server and the files of sick_scan_xd quote them. */
#include <math.h>

#include "tests/unit/cola_fields_rig.h"

static void open_tim(void)
{
    cola_open_tim("TiM781");
    fields_open(NULL);
    cola_authorise();
}

/* ---- records */

#define RECORD_OF_TIM(number, rest) "\x3f\x80\0\0\0\0\0\0\0\0\x0d\x05\xff\xf9\x22\x30\2" number "\0\1" rest
#define ENDING(name)                "\0\0\0\0\0\0\0\1\0\x8" name "\0\0"

static void a_record_is_read_back_as_it_was_written(void **state)
{
    (void)state;
    static const char two[] = RECORD_OF_TIM("\2", "\0\2\0\xf6\xff\xff\0\xfa\1\x95\xff\xff\1\x2c" ENDING("Field002"));
    uint8_t request[128] = "sWN field001 ", answer[128] = "sRA field001 ";
    open_tim();
    memcpy(request + 13, two, sizeof two - 1);
    memcpy(answer + 13, two, sizeof two - 1);
    cola_expect_b(request, 13 + sizeof two - 1, "sWA field001 ", 13);
    cola_expect_b("sRN field001", 12, answer, 13 + sizeof two - 1);
    cola_expect("sRN field001",
                "sRA field001 3F800000 00000000 D05 FFF92230 2 2 1 2 F6 FFFF FA 195 FFFF 12C 0 0 0 1 8 Field002 0");
    cola_expect("sWN field002 3F800000 00000000 D05 FFF92230 2 2 1 2 F6 FFFF FA 195 FFFF 12C 0 0 0 1 8 Field002 0",
                "sWA field002");
    /* another grid and a scale of 2 mm, as an LMS5xx has them; a rectangle */
    cola_expect("sWN field003 40000000 00000000 683 FFFF3CB0 2 1 1 3 12C FFFF 162 1D2 FFFF 1A3 1E6 FFFF CE 0 0 0 1 B "
                "segmented_1 0",
                "sWA field003");
    cola_expect("sWN field004 40000000 00000000 683 FFFF3CB0 1 3 0 1 F756B 7F 6DDD0 C8 C8 0 0 1 10 rectfield_45_deg 0",
                "sWA field004");
    cola_expect("sRN field004",
                "sRA field004 40000000 00000000 683 FFFF3CB0 1 3 0 1 F756B 7F 6DDD0 C8 C8 0 0 1 10 rectfield_45_deg 0");
#define WIDE " 40000000 00000000 683 FFFF3CB0 1 3 0 1 F756B 1F4 6DDD0 12C 1F40 0 0 1 1 A 0" /* all more than a byte */
    cola_expect("sWN field004" WIDE, "sWA field004");
    cola_expect("sRN field004", "sRA field004" WIDE);
}

static void records_that_say_nothing_are_refused(void **state)
{
    (void)state;
    open_tim();
#define HEAD "sWN field001 3F800000 00000000 D05 FFF92230 2 2 "
    cola_expect(HEAD "1 2 F6 FFFF FA F6 FFFF 12C 0 0 0 1 8 Field002 0", "sFA 5");    /* twice one direction */
    cola_expect(HEAD "1 1 F6 FB FA 0 0 0 1 8 Field002 0", "sFA 5");                  /* start beyond stop */
    cola_expect(HEAD "0 0 1 0 1 8 Field002 0", "sFA 5");                             /* radial */
    cola_expect(HEAD "0 0 0 1 1B7740 FA 0 3E8 12C 960 5DC 1 8 Field002 0", "sFA 5"); /* dynamic */
    cola_expect(HEAD "2 0 0 0 1 8 Field002 0", "sFA 5");
    cola_expect(HEAD "1 41", "sFA 5");                     /* 65 points */
    cola_expect(HEAD "0 0 0 0 1 8 Field002 1 0", "sFA 5"); /* a comment */
    cola_expect(HEAD "0 0 0 0 1 8 Field002", "sFA 8");
    cola_expect(HEAD "0 0 0 0 1 8 Field002 0 0", "sFA 7");
    fields_expect("000");
    cola_expect("sMN Run", "sAN Run 1");
    cola_expect(HEAD "0 0 0 0 1 8 Field002 0", "sFA A");
}

/* A record has only the part of its type. An LMS1xx gives empty fields without any part, so these are taken, too. */
static void a_record_has_the_part_of_its_type(void **state)
{
    (void)state;
    static const char *const part[] = {"1 1 F6 FFFF FA 0", "0 1 0 FA 0 64 64", "1 1 F6 FFFF FA 1 0 FA 0 64 64", "0 0"};
    static const char *const takes[] = {"....", ".x.x", "x..x", "...."}; /* by type, for each part */
    open_tim();
    for (int type = 0; type < 4; type++)
        for (int k = 0; k < 4; k++) {
            char request[128];
            snprintf(request, sizeof request, "sWN field001 3F800000 00000000 D05 FFF92230 %d 2 %s 0 0 0 0", type,
                     part[k]);
            cola_expect(request, takes[type][k] == 'x' ? "sWA field001" : "sFA 5");
        }
}

/* The beams of a TiM look from -45 to 225 degrees, 1/3 degree apart: 90 to 105 degrees are 405 to 450. */
static void directions_are_taken_modulo_a_turn(void **state)
{
    (void)state;
    static const char *const first[] = {"DBBA0" /* 90 */, "44AA20" /* 450 */, "FFD6CD20" /* -270 degrees */};
    open_tim();
    for (size_t i = 0; i < sizeof first / sizeof first[0]; i++) {
        char request[128];
        snprintf(request, sizeof request,
                 "sWN field000 3F800000 00000000 C350 %s 2 1 1 2 0 FFFF 7D0 3 FFFF 7D0 0 0 0 0 0", first[i]);
        cola_expect(request, "sWA field000");
        static const struct {
            int beam;
            const char *results;
        } cases[] = {{404, "100"}, {405, "200"}, {450, "200"}, {451, "100"}, {0, "100"}, {810, "100"}};
        for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
            fields_object(cases[k].beam, 1, 1.0);
            fields_turn();
            fields_expect(cases[k].results);
        }
    }
#define TURN(last) "sWN field000 3F800000 00000000 2710 0 2 1 1 2 0 FFFF 7D0 " last " FFFF 7D0 0 0 0 0 0"
    cola_expect(TURN("168"), "sWA field000");
    cola_expect(TURN("169"), "sFA 5"); /* 361 degrees */
    cola_expect(TURN("FFFF"), "sFA 5");
}

static struct cola_fields *a_sector(int32_t start_e4, int32_t span_e4, int32_t outer_um)
{
    static struct cola_fields fields;
    memset(&fields, 0, sizeof fields);
    fields.field[0].shape = (struct cola_shape){
        .kind = COLA_SHAPE_SECTOR, .sector = {.start_e4 = start_e4, .span_e4 = span_e4, .outer_um = outer_um}};
    return &fields;
}

/* A segment of a turn has the first and the last beam, 0 and 810, in its record. */
static void a_record_reaches_to_the_ends_of_the_view(void **state)
{
    (void)state;
    open_tim();
    fields_open(a_sector(0, COLA_TURN_E4, 1500000));
    const char *record = cola_ask("sRN field000");
    assert_non_null(strstr(record, "sRA field000 3F800000 00000000 D05 FFF92230 2 1 1 "));
    assert_non_null(strstr(record, " 0 FFFF 5DC "));
    assert_non_null(strstr(record, " 32A FFFF 5DC 0 0 0 1 "));
}

/* 62 directions from 0 to 90 degrees, evenly: each at the beam next to it. Beam 135 is at 0, and three are a degree. */
static void a_record_of_a_sector_spreads_its_points(void **state)
{
    (void)state;
    char want[1024];
    int n = snprintf(want, sizeof want, "sRA field000 3F800000 00000000 D05 FFF92230 2 1 1 3E");
    for (int i = 0; i < 62; i++)
        n += snprintf(want + n, sizeof want - (size_t)n, " %lX FFFF 5DC", 135 + lround(270 * i / 61.0));
    snprintf(want + n, sizeof want - (size_t)n, " 0 0 0 1 0 0");
    open_tim();
    fields_open(a_sector(0, 900000, 1500000));
    cola_expect("sRN field000", want);
}

/* The corner of a rectangle is 500 m away, at 0 degrees or at the first beam. A ten-thousandth of a degree is 0.9 mm.
 */
static void a_rectangle_begins_at_zero_or_at_the_first_beam(void **state)
{
    (void)state;
    const struct planar_head head = {.known = 1, .steps = 1080, .n = 811, .last = 810, .front = 405};
    const struct cola_record r = {.scale = 8.0f,
                                  .step_e4 = 3333,
                                  .first_e4 = 900000,
                                  .type = COLA_FIELD_RECTANGLE,
                                  .is_rectangle = 1,
                                  .distance = 62500,
                                  .width_mm = 1000,
                                  .length_mm = 2000};
    struct cola_shape shape;
    for (int from_first = 0; from_first < 2; from_first++) {
        assert_int_equal(cola_record_shape(&r, &head, from_first, &shape), COLA_OK);
        assert_int_equal(shape.kind, COLA_SHAPE_POLYGON);
        assert_int_equal(shape.n, 4);
        assert_int_equal(shape.corner[0].x_um, from_first ? 0 : 500000000);
        assert_int_equal(shape.corner[0].y_um, from_first ? 500000000 : 0);
        assert_int_equal(shape.corner[2].x_um - shape.corner[0].x_um, 1000000);
        assert_int_equal(shape.corner[2].y_um - shape.corner[0].y_um, 2000000);
    }
}

/* Two corners at one beam, 0.1 degrees apart, are one point: the nearest and the farthest of both, whichever comes
 * first. 90 degrees are beam 405, and 100 degrees beam 435. */
static void corners_at_one_beam_are_one_point(void **state)
{
    (void)state;
    static const double corner[3][2] = {{90, 1e6}, {90.1, 3e6}, {100, 2e6}}; /* degrees, um */
    for (int first = 0; first < 3; first++) {
        static struct cola_fields f;
        memset(&f, 0, sizeof f);
        f.field[0].shape.kind = COLA_SHAPE_POLYGON;
        for (int k = 0; k < 3; k++) {
            const double *c = corner[(first + k) % 3], rad = c[0] / 180 * M_PI;
            assert_int_equal(cola_shape_add(&f.field[0].shape, c[1] * cos(rad), c[1] * sin(rad)), 0);
        }
        open_tim();
        fields_open(&f);
        cola_expect("sRN field000",
                    "sRA field000 3F800000 00000000 D05 FFF92230 2 1 1 2 195 3E8 BB8 1B3 7D0 7D0 0 0 0 1 0 0");
    }
}

/* 500 m are 62500 counts of 8 mm; with 7 mm they would be more than 65534. */
static void far_fields_have_a_scale_for_it(void **state)
{
    (void)state;
    open_tim();
    fields_open(a_sector(900000, 0, 500000000));
    cola_expect("sRN field000", "sRA field000 41000000 00000000 D05 FFF92230 2 1 1 1 195 FFFF F424 0 0 0 1 0 0");
    fields_open(a_sector(900000, 0, 65534000));
    cola_expect("sRN field000", "sRA field000 3F800000 00000000 D05 FFF92230 2 1 1 1 195 FFFF FFFE 0 0 0 1 0 0");
}

/* A polygon's farthest corner, at 500 m, gives the scale of 8 mm. The corners are as above, at the beams 405 and 435,
 * where they are 125, 62500 and 250 counts away. */
static void far_polygons_have_a_scale_for_it(void **state)
{
    (void)state;
    static const double corner[3][2] = {{90, 1e6}, {90.1, 500e6}, {100, 2e6}}; /* degrees, um */
    static struct cola_fields f;
    f.field[0].shape.kind = COLA_SHAPE_POLYGON;
    for (int k = 0; k < 3; k++) {
        const double rad = corner[k][0] / 180 * M_PI;
        assert_int_equal(cola_shape_add(&f.field[0].shape, corner[k][1] * cos(rad), corner[k][1] * sin(rad)), 0);
    }
    open_tim();
    fields_open(&f);
    cola_expect("sRN field000",
                "sRA field000 41000000 00000000 D05 FFF92230 2 1 1 2 195 7D F424 1B3 FA FA 0 0 0 1 0 0");
}

/* ---- evaluation */

/* Field 1: 0.5 to 2 m between the beams 300 and 500. */
static void write_field_1(void)
{
    cola_expect("sWN field000 3F800000 00000000 D05 FFF92230 2 1 1 2 12C 1F4 7D0 1F4 1F4 7D0 0 0 0 1 1 A 0",
                "sWA field000");
}

static void results_follow_the_scan(void **state)
{
    (void)state;
    open_tim();
    write_field_1();
    fields_expect("000");
    fields_turn();
    fields_expect("100");
    fields_object(300, 1, 2.0); /* the limits belong to the field */
    fields_turn();
    fields_expect("200");
    static const struct {
        int beam;
        double range_m;
        const char *results;
    } cases[] = {{299, 1.0, "100"}, {300, 1.0, "200"},    {500, 1.0, "200"}, {501, 1.0, "100"},
                 {300, 0.5, "200"}, {300, 0.4999, "100"}, {500, 2.0, "200"}, {500, 2.001, "100"},
                 {400, 0.0, "100"}, {400, 0.3, "100"},    {400, 1.0, "200"}, {400, 0.02, "100"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        fields_object(cases[i].beam, 1, cases[i].range_m);
        fields_shot[cases[i].beam].n = cases[i].range_m > 0.0;
        fields_turn();
        fields_expect(cases[i].results);
    }
}

/* Between the beams 300 and 500, which are 200 / 3 degrees apart, the far limit is the chord: at beam 400 it is 2 m
 * times cos(100 / 3 degrees), 1.670976 m, and the near one is 0.417744 m. */
static void chords(void **state)
{
    (void)state;
    open_tim();
    write_field_1();
    static const struct {
        double range_m;
        const char *results;
    } cases[] = {{1.67097, "200"}, {1.67098, "100"}, {0.41774, "100"}, {0.41775, "200"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        fields_object(400, 1, cases[i].range_m);
        fields_turn();
        fields_expect(cases[i].results);
    }
}

/* The event has the time of the scan in which the result changed, and comes once. */
static void changes_are_sent(void **state)
{
    (void)state;
    uint8_t frame[256];
    open_tim();
    write_field_1();
    fields_turn();
    EXPECT_B("sEN LFErec \1", "sEA LFErec \1");
    EXPECT_B("sEN LIDoutputstate \1", "sEA LIDoutputstate \1");
    protocol_rig_clear(&cola);
    fields_turn();
    assert_int_equal(cola.n_units, 0);
    for (int i = 0; i < 2; i++) {
        protocol_rig_clear(&cola);
        fields_object(350, 5, 1.0);
        fields_turn();
        fields_turn();
        assert_int_equal(cola.n_units, 2);
        assert_memory_equal(cola.bytes + 8, "sSN", 3);
        assert_int_equal(fields_result(cola.bytes + 8, 0), 2);
        uint8_t outputs[19 + 33] = "sSN LIDoutputstate ";
        outputs[19 + 6] = 1;
        outputs[19 + 6 + 4] = (uint8_t)(i + 1); /* how often it became active */
        cola_frame_b(frame, outputs, sizeof outputs);
        const uint8_t *sent = cola.bytes + cola.end[0];
        assert_int_equal(cola.len - cola.end[0], sizeof outputs + 9);
        assert_memory_equal(sent, frame, 8 + 19 + 2);                            /* to the version */
        assert_memory_equal(sent + 8 + 25, frame + 8 + 25, sizeof outputs - 25); /* from the outputs on */
        protocol_rig_clear(&cola);
        fields_wall(10.0);
        fields_turn();
        assert_int_equal(cola.n_units, 2);
        assert_int_equal(fields_result(cola.bytes + 8, 0), 1);
    }
    EXPECT_B("sEN LFErec \0", "sEA LFErec \0");
    EXPECT_B("sEN LIDoutputstate \0", "sEA LIDoutputstate \0");
    protocol_rig_clear(&cola);
    fields_object(350, 5, 1.0);
    fields_turn();
    assert_int_equal(cola.n_units, 0);
    fields_expect("200");
}

/* Fields are evaluated while the session measures. What was seen before is not valid afterwards. */
static void a_stopped_session_evaluates_nothing(void **state)
{
    (void)state;
    open_tim();
    write_field_1();
    EXPECT_B("sEN LFErec \1", "sEA LFErec \1");
    fields_object(350, 5, 1.0);
    fields_turn();
    fields_expect("200");
    cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0");
    protocol_rig_clear(&cola);
    fields_turn();
    assert_int_equal(cola.n_units, 0);
    fields_expect("000");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    fields_turn();
    fields_expect("200");
}

/* Scan k begins at k / 15 s; the clock counts from 1970 without UTC. */
static void a_result_has_the_time_of_its_change(void **state)
{
    (void)state;
    uint8_t frame[64];
    open_tim();
    write_field_1();
    for (int i = 0; i < 30; i++)
        fields_turn();
    fields_object(350, 5, 1.0);
    for (int i = 0; i < 20; i++)
        fields_turn();
    protocol_rig_clear(&cola);
    cola_input(frame, cola_frame_b(frame, "sRN LFErec", 10));
    const uint8_t *time = cola.bytes + 8 + 13 + 43 - 11;               /* year, month, day, hour, minute, second, us */
    assert_memory_equal(time - 2, "\0\1\7\xb2\1\1\0\0\2\0\0\0\0", 13); /* scan 30: 2 s */
}

/* LMDscandata has the outputs in the second of its two bytes, field 14. */
static void scans_carry_the_outputs(void **state)
{
    (void)state;
    open_tim();
    write_field_1();
    cola_stream(1);
    fields_object(350, 5, 1.0);
    protocol_rig_clear(&cola);
    fields_turn();
    assert_memory_equal(cola.bytes + 46, "\0\0\0\1", 4);
}

/* ---- sets of fields */

static void telegrams_choose_the_set(void **state)
{
    (void)state;
    open_tim();
    write_field_1();
    fields_object(350, 5, 1.0);
    fields_turn();
    fields_expect("200");
    cola_expect("sRN FieldSetSelectionMethod", "sRA FieldSetSelectionMethod 0");
    EXPECT_B("sRN FieldSetSelectionMethod", "sRA FieldSetSelectionMethod \0");
    cola_expect("sRN ActiveFieldSet", "sRA ActiveFieldSet 1");
    cola_expect("sWN ActiveFieldSet 2", "sFA 4");
    cola_expect("sWN FieldSetSelectionMethod 1", "sWA FieldSetSelectionMethod");
    cola_expect("sRN FieldSetSelectionMethod", "sRA FieldSetSelectionMethod 1");
    cola_expect("sWN ActiveFieldSet 0", "sFA 5");
    cola_expect("sWN ActiveFieldSet 17", "sFA 5");
    cola_expect("sWN ActiveFieldSet 02", "sWA ActiveFieldSet");
    fields_expect("000");
    fields_turn();
    fields_expect("000");
    cola_expect("sWN field005 3F800000 00000000 D05 FFF92230 2 6 1 2 12C FFFF 7D0 1F4 FFFF 7D0 0 0 0 1 1 A 0",
                "sWA field005");
    fields_turn();
    fields_expect("002"); /* the third field of the second set */
    cola_expect("sWN ActiveFieldSet 1", "sWA ActiveFieldSet");
    fields_turn();
    fields_expect("200");
}

/* Fields that are no longer watched are invalid, and their output is off; the next scan says so once. */
static void another_set_is_news(void **state)
{
    (void)state;
    open_tim();
    write_field_1();
    cola_expect("sWN FieldSetSelectionMethod 1", "sWA FieldSetSelectionMethod");
    EXPECT_B("sEN LFErec \1", "sEA LFErec \1");
    EXPECT_B("sEN LIDoutputstate \1", "sEA LIDoutputstate \1");
    fields_object(350, 5, 1.0);
    fields_turn();
    EXPECT_B("sWN ActiveFieldSet \0\2", "sWA ActiveFieldSet ");
    protocol_rig_clear(&cola);
    fields_turn();
    fields_turn();
    assert_int_equal(cola.n_units, 2);
    assert_int_equal(fields_result(cola.bytes + 8, 0), 0);
    assert_memory_equal(cola.bytes + cola.end[0] + 8, "sSN LIDoutputstate ", 19);
    assert_memory_equal(cola.bytes + cola.end[0] + 8 + 25, "\0\0\0\0\1", 5); /* off; it was active once */
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(a_record_is_read_back_as_it_was_written),
        CASE(records_that_say_nothing_are_refused),
        CASE(a_record_has_the_part_of_its_type),
        CASE(directions_are_taken_modulo_a_turn),
        CASE(a_record_reaches_to_the_ends_of_the_view),
        CASE(far_fields_have_a_scale_for_it),
        CASE(far_polygons_have_a_scale_for_it),
        CASE(corners_at_one_beam_are_one_point),
        CASE(a_record_of_a_sector_spreads_its_points),
        CASE(a_rectangle_begins_at_zero_or_at_the_first_beam),
        CASE(results_follow_the_scan),
        CASE(chords),
        CASE(changes_are_sent),
        CASE(a_stopped_session_evaluates_nothing),
        CASE(a_result_has_the_time_of_its_change),
        CASE(scans_carry_the_outputs),
        CASE(telegrams_choose_the_set),
        CASE(another_set_is_news),
    };
    return cmocka_run_group_tests_name("cola fields", tests, NULL, NULL);
}
