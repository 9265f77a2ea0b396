/* SPDX-License-Identifier: MIT */
/* CoLa: monitored fields by telegram, their evaluation, and the events of results and outputs. Records of fields are
 * those of real scanners, as the test server and the files of sick_scan_xd quote them. */
#include "drivers/protocol/cola_field.h"
#include "tests/unit/cola_rig.h"

enum { N = 811 }; /* beams of a TiM */

static struct protocol_rig_shot shots[N];

static int close_rig(void **state)
{
    (void)state;
    cola_close();
    return 0;
}

static void set_all(double range_m)
{
    for (int i = 0; i < N; i++)
        shots[i] = (struct protocol_rig_shot){.n = range_m > 0.0, .range_m = {range_m}};
}

/* An object from beam `from` on. */
static void put_object(int from, int n, double range_m)
{
    set_all(10.0);
    for (int i = from; i < from + n; i++)
        shots[i].range_m[0] = range_m;
}

static uint32_t line;

static void turn(void)
{
    protocol_rig_turn(&cola, line++, shots, 100);
}

static void open_tim(void)
{
    cola_open_tim("TiM781");
    cola_authorise();
    line = 0;
    set_all(10.0);
}

/* The number of the answer's or the event's result of field k (from 0): three records of 43 bytes, as a TiM781S has. */
static int result_of(const uint8_t *payload, int k)
{
    assert_memory_equal(payload + 4, "LFErec \0\3", 9);
    assert_int_equal(payload[13 + 43 * k + 2], k + 1);
    return payload[13 + 43 * k + 2 + 1 + 4 + 16];
}

/* Reads LFErec, as "012" for the results invalid, free and infringed. */
static void expect_results(const char *results)
{
    uint8_t frame[64];
    protocol_rig_clear(&cola);
    cola_input(frame, cola_frame_b(frame, "sRN LFErec", 10));
    assert_int_equal(cola.n_units, 1);
    for (int k = 0; k < 3; k++)
        assert_int_equal('0' + result_of(cola.bytes + 8, k), results[k]);
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
    expect_results("000");
    cola_expect("sMN Run", "sAN Run 1");
    cola_expect(HEAD "0 0 0 0 1 8 Field002 0", "sFA A");
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
    expect_results("000");
    turn();
    expect_results("100");
    put_object(300, 1, 2.0); /* the limits belong to the field */
    turn();
    expect_results("200");
    static const struct {
        int beam;
        double range_m;
        char result;
    } cases[] = {{299, 1.0, '1'}, {300, 1.0, '2'},    {500, 1.0, '2'}, {501, 1.0, '1'},
                 {300, 0.5, '2'}, {300, 0.4999, '1'}, {500, 2.0, '2'}, {500, 2.001, '1'},
                 {400, 0.0, '1'}, {400, 0.3, '1'},    {400, 1.0, '2'}, {400, 0.02, '1'}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        put_object(cases[i].beam, 1, cases[i].range_m);
        shots[cases[i].beam].n = cases[i].range_m > 0.0;
        turn();
        const char results[] = {cases[i].result, '0', '0', 0};
        expect_results(results);
    }
}

/* Between the beams 300 and 500, which are 200 / 3 degrees apart, the far limit is the chord: at beam 400 it is 2 m times
 * cos(100 / 3 degrees), 1.670976 m, and the near one is 0.417744 m. */
static void chords(void **state)
{
    (void)state;
    open_tim();
    write_field_1();
    static const struct {
        double range_m;
        char result;
    } cases[] = {{1.67097, '2'}, {1.67098, '1'}, {0.41774, '1'}, {0.41775, '2'}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        put_object(400, 1, cases[i].range_m);
        turn();
        const char results[] = {cases[i].result, '0', '0', 0};
        expect_results(results);
    }
}

/* The event has the time of the scan in which the result changed, and comes once. */
static void changes_are_sent(void **state)
{
    (void)state;
    uint8_t frame[256];
    open_tim();
    write_field_1();
    turn();
    EXPECT_B("sEN LFErec \1", "sEA LFErec \1");
    EXPECT_B("sEN LIDoutputstate \1", "sEA LIDoutputstate \1");
    protocol_rig_clear(&cola);
    turn();
    assert_int_equal(cola.n_units, 0);
    for (int i = 0; i < 2; i++) {
        protocol_rig_clear(&cola);
        put_object(350, 5, 1.0);
        turn();
        turn();
        assert_int_equal(cola.n_units, 2);
        assert_memory_equal(cola.bytes + 8, "sSN", 3);
        assert_int_equal(result_of(cola.bytes + 8, 0), 2);
        uint8_t outputs[19 + 33] = "sSN LIDoutputstate ";
        outputs[19 + 6] = 1;
        outputs[19 + 6 + 4] = (uint8_t)(i + 1); /* how often it became active */
        cola_frame_b(frame, outputs, sizeof outputs);
        const uint8_t *sent = cola.bytes + cola.end[0];
        assert_int_equal(cola.len - cola.end[0], sizeof outputs + 9);
        assert_memory_equal(sent, frame, 8 + 19 + 2);                            /* to the version */
        assert_memory_equal(sent + 8 + 25, frame + 8 + 25, sizeof outputs - 25); /* from the outputs on */
        protocol_rig_clear(&cola);
        set_all(10.0);
        turn();
        assert_int_equal(cola.n_units, 2);
        assert_int_equal(result_of(cola.bytes + 8, 0), 1);
    }
    EXPECT_B("sEN LFErec \0", "sEA LFErec \0");
    EXPECT_B("sEN LIDoutputstate \0", "sEA LIDoutputstate \0");
    protocol_rig_clear(&cola);
    put_object(350, 5, 1.0);
    turn();
    assert_int_equal(cola.n_units, 0);
    expect_results("200");
}

/* Scan k begins at k / 15 s; the clock counts from 1970 without UTC. */
static void a_result_has_the_time_of_its_change(void **state)
{
    (void)state;
    uint8_t frame[64];
    open_tim();
    write_field_1();
    for (int i = 0; i < 30; i++)
        turn();
    put_object(350, 5, 1.0);
    for (int i = 0; i < 20; i++)
        turn();
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
    put_object(350, 5, 1.0);
    protocol_rig_clear(&cola);
    turn();
    assert_memory_equal(cola.bytes + 46, "\0\0\0\1", 4);
}

/* ---- sets of fields */

static void telegrams_choose_the_set(void **state)
{
    (void)state;
    open_tim();
    write_field_1();
    put_object(350, 5, 1.0);
    turn();
    expect_results("200");
    cola_expect("sRN FieldSetSelectionMethod", "sRA FieldSetSelectionMethod 0");
    cola_expect("sRN ActiveFieldSet", "sRA ActiveFieldSet 1");
    cola_expect("sWN ActiveFieldSet 2", "sFA 4");
    cola_expect("sWN FieldSetSelectionMethod 1", "sWA FieldSetSelectionMethod");
    cola_expect("sWN ActiveFieldSet 0", "sFA 5");
    cola_expect("sWN ActiveFieldSet 17", "sFA 5");
    cola_expect("sWN ActiveFieldSet 02", "sWA ActiveFieldSet");
    expect_results("000");
    turn();
    expect_results("000");
    cola_expect("sWN field005 3F800000 00000000 D05 FFF92230 2 6 1 2 12C FFFF 7D0 1F4 FFFF 7D0 0 0 0 1 1 A 0",
                "sWA field005");
    turn();
    expect_results("002"); /* the third field of the second set */
    cola_expect("sWN ActiveFieldSet 1", "sWA ActiveFieldSet");
    turn();
    expect_results("200");
}

/* Opens the session anew, with the window's loss and the configuration's fields. */
static double loss_db;
static double read_loss(void *ctx)
{
    (void)ctx;
    return loss_db;
}

static void open_again(const struct cola_fields *fields)
{
    struct sh_err err;
    cola.ops->destroy(cola.protocol);
    cola.identity.fields = fields;
    cola.spec.host.window_loss_db = read_loss;
    loss_db = 0.0;
    assert_int_equal(cola.ops->create(&cola.spec, &cola.protocol, &err), 0);
    cola.ops->open(cola.protocol, 0);
    protocol_rig_describe(&cola, 0);
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
    put_object(350, 5, 1.0);
    turn();
    EXPECT_B("sWN ActiveFieldSet \0\2", "sWA ActiveFieldSet ");
    protocol_rig_clear(&cola);
    turn();
    turn();
    assert_int_equal(cola.n_units, 2);
    assert_int_equal(result_of(cola.bytes + 8, 0), 0);
    assert_memory_equal(cola.bytes + cola.end[0] + 8, "sSN LIDoutputstate ", 19);
    assert_memory_equal(cola.bytes + cola.end[0] + 8 + 25, "\0\0\0\0\1", 5); /* off; it was active once */
}

static struct cola_fields fields;

/* sick_scan_xd: the set is one more than the inputs as a number, the first input being the lowest bit. Inputs 1 and 3
 * are active from 1 ms to 3 ms. */
static void inputs_choose_the_set(void **state)
{
    (void)state;
    memset(&fields, 0, sizeof fields);
    fields.n_windows = 2;
    fields.window[0] = (struct cola_input_window){0, 1000000, 3000000};
    fields.window[1] = (struct cola_input_window){2, 1000000, 3000000};
    cola_open_tim("TiM781");
    open_again(&fields);
    EXPECT_B("sRN ActiveFieldSet", "sRA ActiveFieldSet \0\1");
    EXPECT_B("sEN LIDinputstate \1", "sEA LIDinputstate \1");
    protocol_rig_clear(&cola);
    assert_int_equal(cola.ops->next_ns(cola.protocol), 1000000);
    cola.ops->time(cola.protocol, 999999);
    assert_int_equal(cola.n_units, 0);
    cola.ops->time(cola.protocol, 1000000);
    uint8_t frame[64];
    cola_frame_b(frame, "sSN LIDinputstate \0\0\0\0\3\xe8\1\0\1\0\0\0", 18 + 12);
    assert_int_equal(cola.n_units, 1);
    assert_memory_equal(cola.bytes, frame, 18 + 12 + 9);
    cola.ops->time(cola.protocol, 2000000);
    assert_int_equal(cola.n_units, 1);
    EXPECT_B("sRN ActiveFieldSet", "sRA ActiveFieldSet \0\6");
    EXPECT_B("sRN LIDinputstate", "sRA LIDinputstate \0\0\0\0\3\xe8\1\0\1\0\0\0");
    cola.ops->time(cola.protocol, 3000000);
    EXPECT_B("sRN ActiveFieldSet", "sRA ActiveFieldSet \0\1");
    assert_true(cola.ops->next_ns(cola.protocol) == INT64_MAX);
}

/* ---- the configuration's fields */

/* The window's loss, and levels 0 to 3 of LMS manuals. */
static void a_soiled_window_shows(void **state)
{
    (void)state;
    static const struct {
        double db;
        const char *answer;
    } cases[] = {{0.99, "sRA LCMstate 0"}, {1.0, "sRA LCMstate 1"},  {3.0, "sRA LCMstate 2"},
                 {9.9, "sRA LCMstate 2"},  {10.0, "sRA LCMstate 3"}, {60.0, "sRA LCMstate 3"}};
    cola_open_lms();
    open_again(NULL);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        loss_db = cases[i].db;
        cola_expect("sRN LCMstate", cases[i].answer);
    }
}

/* 134 ms at 15 Hz are two scans, as a TiM's data sheet says. The object must be seen at one place for so long. */
static void an_object_must_stay(void **state)
{
    (void)state;
    memset(&fields, 0, sizeof fields);
    fields.field[0].shape = (struct cola_shape){
        .kind = COLA_SHAPE_SECTOR, .sector = {.span_e4 = COLA_TURN_E4, .inner_um = 0, .outer_um = 2000000}};
    fields.field[0].response_ms = 134;
    cola_open_tim("TiM781");
    open_again(&fields);
    line = 0;
    put_object(100, 10, 1.0);
    turn();
    expect_results("100");
    put_object(110, 10, 1.0); /* it has moved on: no beam has seen it twice */
    turn();
    expect_results("100");
    put_object(119, 10, 1.0);
    turn();
    expect_results("200");
    put_object(200, 10, 1.0);
    turn();
    expect_results("100");
    set_all(0.0);
    turn();
    put_object(200, 10, 1.0);
    turn();
    expect_results("100");
    turn();
    expect_results("200");
}

/* Ten beams of 1/3 degree at 1 m are 58.18 mm wide; a wall of single beams is none. */
static void small_objects_are_blanked(void **state)
{
    (void)state;
    memset(&fields, 0, sizeof fields);
    for (int i = 0; i < 2; i++) {
        fields.field[i].shape = (struct cola_shape){
            .kind = COLA_SHAPE_SECTOR, .sector = {.span_e4 = COLA_TURN_E4, .inner_um = 0, .outer_um = 2000000}};
        fields.field[i].blanking_um = i == 0 ? 58170 : 58190;
    }
    cola_open_tim("TiM781");
    open_again(&fields);
    line = 0;
    put_object(100, 10, 1.0);
    turn();
    expect_results("210");
    put_object(801, 10, 1.0); /* to the last beam */
    turn();
    expect_results("210");
    put_object(100, 11, 1.0);
    turn();
    expect_results("220");
    set_all(10.0);
    for (int i = 0; i < N; i += 2)
        shots[i].range_m[0] = 1.0;
    turn();
    expect_results("110");
    put_object(100, 10, 1.0);
    shots[105].range_m[0] = 0.9; /* the nearest range counts */
    turn();
    expect_results("110");
}

/* An LMS reports the fields that it has, by number, and switches the output that the field is given. FREchoFilter says
 * which echo is looked at. */
static void an_lms_looks_at_the_echo_that_is_chosen(void **state)
{
    (void)state;
    static struct protocol_rig_shot two[1081];
    memset(&fields, 0, sizeof fields);
    assert_int_equal(
        cola_shape_rectangle(&fields.field[6].shape, (const double[2]){-1e6, 1e6}, (const double[2]){2e6, 1e6}, 0.0),
        0);
    fields.field[6].output = 2;
    cola_open_lms();
    open_again(&fields);
    cola_authorise();
    for (int i = 0; i < 1081; i++)
        two[i] = (struct protocol_rig_shot){.n = 2, .range_m = {0.5, 9.0}};
    two[540].range_m[1] = 2.0; /* straight ahead, on the far edge */
    static const char *const results[] = {"1", "2", "2"};
    for (uint32_t filter = 0; filter < 3; filter++) {
        char text[200];
        snprintf(text, sizeof text, "sWN FREchoFilter %u", filter);
        cola_expect(text, "sWA FREchoFilter");
        protocol_rig_turn(&cola, filter, two, 100);
        const char *answer = cola_ask("sRN LFErec");
        snprintf(text, sizeof text, "sRA LFErec 1 1 7 0 3F800000 00000000 9C4 FFF92230 %s 0 0 0 1 7B2 1 1 ",
                 results[filter]);
        assert_memory_equal(answer, text, strlen(text));
        const char *outputs = cola_ask("sRN LIDoutputstate") + strlen("sRA LIDoutputstate 1 ");
        assert_memory_equal(strchr(outputs, ' '), filter == 0 ? " 0 0 0 0 0 0 2 0" : " 0 0 1 1 0 0 2 0", 16);
    }
}

/* A rectangle ahead of the head as corner, size and turn; a TiM counts the corner's direction from its first beam, -45
 * degrees, an LMS1xx from 0. The corner is at 135 degrees and sqrt(2) m. */
static void a_rectangle_has_a_record(void **state)
{
    (void)state;
    memset(&fields, 0, sizeof fields);
    struct cola_field *f = &fields.field[0];
    *f = (struct cola_field){.is_rectangle = 1, .corner_um = {-1e6, 1e6}, .size_um = {2e6, 1e6}, .name = "gate"};
    assert_int_equal(cola_shape_rectangle(&f->shape, f->corner_um, f->size_um, 0.0), 0);
    cola_open_tim("TiM781");
    open_again(&fields);
    cola_expect("sRN field000",
                "sRA field000 3F800000 00000000 D05 FFF92230 1 1 0 1 1B7740 586 0 7D0 3E8 0 0 1 4 gate 0");
    cola_close();
    cola_open_lms();
    open_again(&fields);
    cola_expect("sRN field000",
                "sRA field000 3F800000 00000000 9C4 FFF92230 1 1 0 1 149970 586 0 7D0 3E8 0 0 1 4 gate 0");
}

/* A triangle with the head at a corner: directions 45 and 135 degrees, that is beams 270 and 540. */
static void a_polygon_has_a_record(void **state)
{
    (void)state;
    memset(&fields, 0, sizeof fields);
    struct cola_shape *s = &fields.field[2].shape;
    cola_shape_add(s, 0, 0);
    cola_shape_add(s, 1e6, 1e6);
    cola_shape_add(s, -2e6, 2e6);
    cola_open_tim("TiM781");
    open_again(&fields);
    cola_expect("sRN field002",
                "sRA field002 3F800000 00000000 D05 FFF92230 2 3 1 2 10E FFFF 586 21C FFFF B0C 0 0 0 1 0 0");
    /* a square about the head: its view is 270 degrees */
    s->n = 0;
    for (int i = 0; i < 4; i++)
        cola_shape_add(s, i == 1 || i == 2 ? 1e6 : -1e6, i >= 2 ? 1e6 : -1e6);
    cola_expect("sRN field000", "sRA field000 3F800000 00000000 D05 FFF92230 2 1 1 0 0 0 0 1 8 Field001 0");
    cola_authorise();
    cola_expect("sMN mSCloadappdef", "sAN mSCloadappdef"); /* takes the configuration's fields again */
    cola_expect("sRN field002",
                "sRA field002 3F800000 00000000 D05 FFF92230 2 3 1 4 0 FFFF 586 10E FFFF 586 21C FFFF 586 "
                "32A FFFF 586 0 0 0 1 0 0");
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, close_rig)
    const struct CMUnitTest tests[] = {
        CASE(a_record_is_read_back_as_it_was_written),
        CASE(records_that_say_nothing_are_refused),
        CASE(results_follow_the_scan),
        CASE(chords),
        CASE(changes_are_sent),
        CASE(a_result_has_the_time_of_its_change),
        CASE(scans_carry_the_outputs),
        CASE(telegrams_choose_the_set),
        CASE(another_set_is_news),
        CASE(inputs_choose_the_set),
        CASE(a_soiled_window_shows),
        CASE(an_object_must_stay),
        CASE(small_objects_are_blanked),
        CASE(an_lms_looks_at_the_echo_that_is_chosen),
        CASE(a_rectangle_has_a_record),
        CASE(a_polygon_has_a_record),
    };
    return cmocka_run_group_tests_name("cola fields", tests, NULL, NULL);
}
