/* SPDX-License-Identifier: MIT */
/* CoLa: fields and inputs of a configuration: response time, blanking, echoes, records of shapes; and the window. */
#include "tests/unit/cola_fields_rig.h"

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
    fields_open(&fields);
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
    fields_open(NULL);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        fields_loss_db = cases[i].db;
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
    fields_open(&fields);
    fields_object(100, 10, 1.0);
    fields_turn();
    fields_expect("100");
    fields_object(110, 10, 1.0); /* it has moved on: no beam has seen it twice */
    fields_turn();
    fields_expect("100");
    fields_object(119, 10, 1.0);
    fields_turn();
    fields_expect("200");
    fields_object(200, 10, 1.0);
    fields_turn();
    fields_expect("100");
    fields_wall(0.0);
    fields_turn();
    fields_object(200, 10, 1.0);
    fields_turn();
    fields_expect("100");
    fields_turn();
    fields_expect("200");
}

/* A field without an outer edge ends at 1000 m (cola_watch.h). */
static void a_field_ends_at_a_kilometre(void **state)
{
    (void)state;
    memset(&fields, 0, sizeof fields);
    fields.field[0].shape = (struct cola_shape){
        .kind = COLA_SHAPE_SECTOR, .sector = {.span_e4 = COLA_TURN_E4, .inner_um = 0, .outer_um = INT32_MAX}};
    cola_open_tim("TiM781");
    fields_open(&fields);
    static const struct {
        double range_m;
        const char *results;
    } rows[] = {{999.0, "200"}, {1001.0, "100"}, {1000.0, "200"}, {1000.001, "100"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        fields_wall(rows[i].range_m);
        fields_turn();
        fields_expect(rows[i].results);
    }
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
    fields_open(&fields);
    fields_object(100, 10, 1.0);
    fields_turn();
    fields_expect("210");
    fields_object(100, 10, 1.0);
    fields_shot[50].range_m[0] = 0.5; /* a narrow object that is nearer, and before it in the turn */
    fields_turn();
    fields_expect("210");
    fields_object(801, 10, 1.0); /* to the last beam */
    fields_turn();
    fields_expect("210");
    fields_object(100, 11, 1.0);
    fields_turn();
    fields_expect("220");
    fields_wall(10.0);
    for (int i = 0; i < FIELDS_BEAMS; i += 2)
        fields_shot[i].range_m[0] = 1.0;
    fields_turn();
    fields_expect("110");
    fields_object(100, 10, 1.0);
    fields_shot[105].range_m[0] = 0.9; /* the nearest range counts */
    fields_turn();
    fields_expect("110");
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
    fields_open(&fields);
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
    fields_open(&fields);
    cola_expect("sRN field000",
                "sRA field000 3F800000 00000000 D05 FFF92230 1 1 0 1 1B7740 586 0 7D0 3E8 0 0 1 4 gate 0");
    cola_open_lms();
    fields_open(&fields);
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
    fields_open(&fields);
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

/* A record may have 64 points. Point k is at beam 3 k, and ends k mm before 2 m. */
static void a_record_has_64_points_at_most(void **state)
{
    (void)state;
    for (int n = 63; n <= 65; n++) {
        char record[1200], request[1300], answer[1300];
        int at = snprintf(record, sizeof record, "3F800000 00000000 D05 FFF92230 2 1 1 %X", (unsigned)n);
        for (int k = 0; k < n; k++)
            at +=
                snprintf(record + at, sizeof record - (size_t)at, " %X FFFF %X", 3U * (unsigned)k, 2000U - (unsigned)k);
        snprintf(record + at, sizeof record - (size_t)at, " 0 0 0 1 0 0");
        snprintf(request, sizeof request, "sWN field000 %s", record);
        snprintf(answer, sizeof answer, "sRA field000 %s", record);
        cola_open_tim("TiM781");
        fields_open(NULL);
        cola_authorise();
        cola_expect(request, n <= 64 ? "sWA field000" : "sFA 5");
        if (n > 64) continue;
        cola_expect("sRN field000", answer);
        fields_object(3 * (n - 1), 1, 1.9); /* at the last point, which reaches to 1.937 m */
        fields_turn();
        fields_expect("200");
    }
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(inputs_choose_the_set),
        CASE(a_soiled_window_shows),
        CASE(an_object_must_stay),
        CASE(a_field_ends_at_a_kilometre),
        CASE(small_objects_are_blanked),
        CASE(an_lms_looks_at_the_echo_that_is_chosen),
        CASE(a_rectangle_has_a_record),
        CASE(a_polygon_has_a_record),
        CASE(a_record_has_64_points_at_most),
    };
    return cmocka_run_group_tests_name("cola watch", tests, NULL, NULL);
}
