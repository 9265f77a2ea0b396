/* SPDX-License-Identifier: MIT */
/* CoLa: fields, inputs and outputs, in the forms of real scanners (an LMS111 V1.80.2 and a TiM781S V3.13). */
#include "drivers/protocol/cola_model.h"
#include "tests/unit/cola_rig.h"

/* "sRN field012" is answered by "sRA field012 " and these bytes. */
static void expect_field(int number, const void *values, size_t len)
{
    char request[32];
    uint8_t answer[128];
    snprintf(request, sizeof request, "sRN field%03d", number);
    snprintf((char *)answer, sizeof answer, "sRA field%03d ", number);
    memcpy(answer + 13, values, len);
    cola_expect_b(request, 12, answer, 13 + len);
}

/* sick_scan_xd asks for 30 fields of an LMS1xx. If one of them is refused, it starts over for ever. */
static void an_lms_has_ten_empty_fields(void **state)
{
    (void)state;
    static const char empty[] = "\x3f\x80\0\0\0\0\0\0\0\0\x09\xc4\xff\xf9\x22\x30\2\0\0\0\0\0\0\0\0\0\0\1\0\0\0\0";
    cola_open_lms();
    for (int i = 0; i < 48; i++)
        if (i < 10)
            expect_field(i, empty, sizeof empty - 1);
        else
            expect_field(i, "\0", 1);
    cola_expect("sRN field009", "sRA field009 3F800000 00000000 9C4 FFF92230 2 0 0 0 0 0 1 0 0");
    cola_expect("sRN field010", "sRA field010 0");
    cola_expect("sRN field048", "sFA 3");
    cola_expect("sWN field001 0", "sFA A"); /* without a log-in */
    cola_expect("sWN field010 0", "sFA 3");
}

static void a_tim7_has_48_named_fields(void **state)
{
    (void)state;
    char values[] = "\x3f\x80\0\0\0\0\0\0\0\0\x0d\x05\xff\xf9\x22\x30\2#\0\1\0\0\0\0\0\0\0\0\0\1\0\x8"
                    "Field000\0\0";
    cola_open_tim("TiM781");
    for (int i = 0; i < 48; i++) {
        values[17] = (char)(i + 1);
        snprintf(values + 32, 9, "Field%03d", i + 1);
        values[40] = 0;
        expect_field(i, values, sizeof values - 1);
    }
    cola_expect("sRN field048", "sFA 3");
    cola_expect("sRN field+12", "sFA 3");
    cola_expect("sRN field0012", "sFA 3");
}

/* The records have the head's step and first angle, so they wait for it. */
static void fields_wait_for_the_head(void **state)
{
    (void)state;
    cola_open("TiM781");
    cola_expect("sRN field000", "sFA 4");
    cola_expect("sRN LFErec", "sFA 4");
}

/* There are three records of 43 bytes. sick_scan_xd reports an error where there is none, or where bytes are left. */
static void a_tim7_has_three_results(void **state)
{
    (void)state;
    static const char result[] = "\0\1#\0\0\0\0\x3f\x80\0\0\0\0\0\0\0\0\x0d\x05\xff\xf9\x22\x30\0\0\0\0\0\0\0\0\1"
                                 "\7\xb2\1\1\1\2\3\0\0\1\xf4"; /* 1970-01-01 01:02:03.000500 */
    uint8_t answer[11 + 2 + 3 * 43] = "sRA LFErec \0\3";
    cola_open_tim("TiM781");
    cola.ops->time(cola.protocol, INT64_C(3723000500000));
    for (int i = 0; i < 3; i++) {
        memcpy(answer + 13 + 43 * i, result, 43);
        answer[13 + 43 * i + 2] = (uint8_t)(i + 1);
    }
    EXPECT_B("sEN LFErec \1", "sEA LFErec \1");
    cola_expect_b("sRN LFErec", 10, answer, sizeof answer);
}

static void a_tim7_has_five_outputs(void **state)
{
    (void)state;
    uint8_t outputs[19 + 33] = "sRA LIDoutputstate "; /* 33 bytes, as a TiM781S gives them */
    cola_open_tim("TiM781");
    EXPECT_B("sRN LIDinputstate", "sRA LIDinputstate \0\0\0\0\0\0\0\0\0\0\0\0");
    EXPECT_B("sEN LIDoutputstate \1", "sEA LIDoutputstate \1");
    EXPECT_B("sEN LIDinputstate \1", "sEA LIDinputstate \1");
    cola_expect_b("sRN LIDoutputstate", 18, outputs, sizeof outputs);
}

/* An unused input has the value 2. Three of eleven outputs are used. Outputs come once when they are asked for. */
static void an_lms_says_what_is_not_used(void **state)
{
    (void)state;
    static const char outputs[] = "sSN LIDoutputstate \0\1\0\0\1\xf4\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"
                                  "\2\0\0\0\0\2\0\0\0\0\2\0\0\0\0\2\0\0\0\0\2\0\0\0\0\2\0\0\0\0\2\0\0\0\0\2\0\0\0\0"
                                  "\0\1\7\xb2\1\1\0\0\0\0\0\1\xf4";
    uint8_t frame[256];
    cola_open_lms();
    cola.ops->time(cola.protocol, 500000);
    EXPECT_B("sRN LIDinputstate", "sRA LIDinputstate \0\1\0\0\0\0\2\2\2\2\0\0");
    EXPECT_B("sEN LFErec \1", "sEA LFErec \1");
    EXPECT_B("sEN LIDinputstate \1", "sEA LIDinputstate \1");
    EXPECT_B("sEN LIDoutputstate \0", "sEA LIDoutputstate \0");
    protocol_rig_clear(&cola);
    cola_input(frame, cola_frame_b(frame, "sEN LIDoutputstate \1", 20));
    assert_int_equal(cola.n_units, 2);
    assert_int_equal(cola.len - cola.end[0], cola_frame_b(frame, outputs, sizeof outputs - 1));
    assert_int_equal(sizeof outputs - 1, 0x5d); /* bytes that the real one has */
    assert_memory_equal(cola.bytes + cola.end[0], frame, cola.len - cola.end[0]);
    cola_expect("sEN LIDoutputstate 2", "sFA 5");
}

/* The table of COLA.md, and the outputs of the telegrams above. RSSI has 8 bits at power-up in all models. */
static void models_are_those_of_the_document(void **state)
{
    (void)state;
    static const struct {
        const char *model, *version, *firmware;
        int echoes, rssi, n_fields, n_outputs;
    } rows[] = {{"TiM561", "V2.62-16.02.16", "V2.62-16", 1, 1, 0, 5},
                {"TiM571", "V2.62-16.02.16", "V2.62-16", 1, 1, 0, 5},
                {"TiM781", "V4.1.0", "V4.1.0", 1, 1, 48, 5},
                {"LMS111", "V1.50", "V1.50", 2, 0, 48, 11},
                {"LMS11", "V1.00", "V1.00", 1, 1, 48, 5}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct cola_model *m = cola_model_find(rows[i].model);
        assert_string_equal(m->version, rows[i].version);
        assert_string_equal(m->firmware, rows[i].firmware);
        assert_int_equal(m->echoes, rows[i].echoes);
        assert_int_equal(m->rssi, rows[i].rssi);
        assert_int_equal(m->rssi_16bit, 0);
        assert_int_equal(m->n_fields, rows[i].n_fields);
        assert_int_equal(m->n_outputs, rows[i].n_outputs);
        assert_int_equal(m->ports, i == 3 ? COLA_PORTS_LMS : COLA_PORTS_TIM);
    }
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(an_lms_has_ten_empty_fields),      CASE(a_tim7_has_48_named_fields), CASE(fields_wait_for_the_head),
        CASE(a_tim7_has_three_results),         CASE(a_tim7_has_five_outputs),    CASE(an_lms_says_what_is_not_used),
        CASE(models_are_those_of_the_document),
    };
    return cmocka_run_group_tests_name("cola ports", tests, NULL, NULL);
}
