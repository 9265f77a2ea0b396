/* SPDX-License-Identifier: MIT */
/* CoLa: line rate and step of a head that has several, by mLMPsetscancfg. */
#include "tests/unit/cola_rig.h"

#include "drivers/protocol/native_encode.h"

/* The head answers with the first row that fits. Tests change rows. */
enum { STATE, LINES, STEP, STOP, SET_LINES, SET_STEP, END };
static struct protocol_rig_reply head[END + 1];

static void is_set(const char *state, const char *lines, const char *step)
{
    head[STATE].reply = state;
    head[LINES].reply = lines;
    head[STEP].reply = step;
}

static void open_lms(void)
{
    static const struct protocol_rig_reply all[END + 1] = {[STATE] = {"HEAD:STATE?", "idle", 0},
                                                           [LINES] = {"HEAD:LINes?", "50", 0},
                                                           [STEP] = {"SCAN:STEP?", "0.5", 0},
                                                           [STOP] = {"SCAN:STOP", "OK", 0},
                                                           [SET_LINES] = {"HEAD:LINes ", "OK", 0},
                                                           [SET_STEP] = {"SCAN:STEP ", "OK", 0},
                                                           [END] = {NULL, NULL, 0}};
    memcpy(head, all, sizeof head);
    cola_open_lms(); /* its stream says 25 Hz and 0.25 deg */
    cola.replies = head;
    cola.identity.n_geometries = 3;
    cola.identity.geometry[0] = (struct protocol_geometry){50000000, 720};
    cola.identity.geometry[1] = (struct protocol_geometry){25000000, 1440};
    cola.identity.geometry[2] = (struct protocol_geometry){25000000, 720};
    cola_authorise();
}

/* The stream says that the head's state is another: frames of the state before have all come. */
static void state_event(enum protocol_head_state state)
{
    uint8_t frame[256];
    const struct native_event event = {.code = NATIVE_EV_STATE, .a = (uint64_t)state};
    const size_t len = native_encode_event(frame, sizeof frame, &event, 0, 0);
    cola.ops->frame(cola.protocol, frame, len);
}

#define FAST   " 1388 1 1388 FFF92230 225510" /* 50 Hz, 0.5 deg */
#define FINE   " 9C4 1 9C4 FFF92230 225510"   /* 25 Hz, 0.25 deg */
#define SPARSE " 9C4 1 1388 FFF92230 225510"  /* 25 Hz, 0.5 deg */

/* Checks the lines that set something, in their order. */
static void expect_set(const char *first, const char *second, const char *third)
{
    const char *const wanted[] = {first, second, third};
    uint32_t n = 0;
    for (uint32_t i = 0; i < cola.n_lines; i++) {
        if (strchr(cola.line[i], '?') != NULL) continue;
        assert_true(n < 3 && wanted[n] != NULL);
        assert_string_equal(cola.line[i], wanted[n++]);
    }
    assert_true(n == 3 || wanted[n] == NULL);
}

/* The head reports its settings before a scan has shown them. */
static void a_resting_head_says_how_it_is_set(void **state)
{
    (void)state;
    open_lms();
    cola_expect("sRN LMPscancfg", "sRA LMPscancfg" FAST);
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 1388 FFF92230 225510");
    cola_expect("sRN field001", "sRA field001 3F800000 00000000 1388 FFF92230 2 0 0 0 0 0 1 0 0");
    is_set("idle", "25", "0.25");
    cola_expect("sRN LMPscancfg", "sRA LMPscancfg" FINE);
    is_set("scanning", "50", "0.5"); /* then its stream says it */
    cola_expect("sRN LMPscancfg", "sRA LMPscancfg" FINE);
}

static void other_pairs_are_refused(void **state)
{
    (void)state;
    open_lms();
    cola_expect("sMN mLMPsetscancfg 1388 1 9C4 FFF92230 225510", "sAN mLMPsetscancfg 2" FAST);
    cola_expect("sMN mLMPsetscancfg BB8 1 1388 FFF92230 225510", "sAN mLMPsetscancfg 1" FAST);
    cola_expect("sMN mLMPsetscancfg 9C4 1 9C4 FFF92230 +2248700", "sAN mLMPsetscancfg 4" FAST);
    cola_expect("sMN mLMPsetscancfg 9C4 1 9C4 0 225510", "sAN mLMPsetscancfg 4" FAST);
    cola_expect("sMN mLMPsetscancfg 9C4 1 D05 0 225510", "sAN mLMPsetscancfg 3" FAST);
    cola_expect("sMN mLMPsetscancfg 9C4 2 9C4 FFF92230 225510", "sAN mLMPsetscancfg 5" FAST);
    expect_set(NULL, NULL, NULL);
    cola_expect("sMN mLMPsetscancfg" FAST, "sAN mLMPsetscancfg 0" FAST); /* this changes nothing */
    cola_expect("sMN mLMPsetscancfg 1388 1 1388 -449997 +2249997", "sAN mLMPsetscancfg 0" FAST);
    expect_set(NULL, NULL, NULL);
}

static void a_resting_head_is_set(void **state)
{
    (void)state;
    open_lms();
    cola_ask("sMN mLMPsetscancfg" FINE);
    expect_set("HEAD:LINes 25.000000", "SCAN:STEP 0.250000000", NULL);
    is_set("idle", "25", "0.25");
    head[SET_LINES].error = -222; /* not with this step */
    protocol_rig_clear(&cola);
    cola_ask("sMN mLMPsetscancfg" FAST);
    expect_set("HEAD:LINes 50.000000", "SCAN:STEP 0.500000000", "HEAD:LINes 50.000000");
    head[SET_LINES].error = 0;
    head[SET_STEP].error = -221; /* another session has control */
    cola_expect("sMN mLMPsetscancfg" FAST, "sFA 4");
}

/* The scanner measures for another session, or was stopped by this one. The answer comes once the scan has ended. */
static void a_scan_is_stopped_first(void **state)
{
    (void)state;
    open_lms();
    is_set("scanning", "25", "0.25");
    for (int stopped = 0; stopped < 2; stopped++) {
        if (stopped) {
            cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
            cola_expect("sMN mLMPsetscancfg" FAST, "sAN mLMPsetscancfg 5" FINE); /* it measures */
            cola_expect("sEN LMDscandata 0", "sEA LMDscandata 0");
            cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
            cola_expect("sMN mLMPsetscancfg" FAST, "sAN mLMPsetscancfg 5" FINE);
            expect_set(NULL, NULL, NULL);
            cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0");
        }
        protocol_rig_clear(&cola);
        cola_input("\2sMN mLMPsetscancfg" FAST "\3", strlen("\2sMN mLMPsetscancfg" FAST "\3"));
        assert_int_equal(cola.n_units, 0);
        expect_set("SCAN:STOP", NULL, NULL);
        is_set("spin-down", "25", "0.25"); /* at once, though scans that were made before still come */
        cola.ops->time(cola.protocol, 1000000);
        assert_int_equal(cola.n_units, 0);
        expect_set("SCAN:STOP", NULL, NULL);
        is_set("spin-down", "50", "0.5");
        state_event(PROTOCOL_HEAD_SPIN_DOWN);
        cola.ops->time(cola.protocol, 2000000);
        expect_set("SCAN:STOP", "HEAD:LINes 50.000000", "SCAN:STEP 0.500000000");
        assert_int_equal(cola.n_units, 1);
        static const char answer[] = "\2sAN mLMPsetscancfg 0" FAST "\3";
        assert_int_equal(cola.len, sizeof answer - 1);
        assert_memory_equal(cola.bytes, answer, cola.len);
        is_set("scanning", "25", "0.25");
        state_event(PROTOCOL_HEAD_SCANNING);
    }
    head[STOP].error = -221;
    cola_expect("sMN mLMPsetscancfg" FAST, "sFA 4");
}

/* Another session has stopped the head, and starts it again. Where the event has passed before, the answer comes when
 * the head is idle. */
static void a_head_that_is_started_again_is_stopped_again(void **state)
{
    (void)state;
    open_lms();
    is_set("spin-down", "25", "0.25");
    cola.ops->gap(cola.protocol, 1); /* before the request: no event was waited for */
    protocol_rig_clear(&cola);
    cola_input("\2sMN mLMPsetscancfg" FAST "\3", strlen("\2sMN mLMPsetscancfg" FAST "\3"));
    cola.ops->time(cola.protocol, 1000000);
    expect_set(NULL, NULL, NULL);
    is_set("spin-up", "25", "0.25");
    cola.ops->time(cola.protocol, 2000000);
    assert_int_equal(cola.n_units, 0);
    expect_set("SCAN:STOP", NULL, NULL);
    is_set("idle", "25", "0.25");
    cola.ops->time(cola.protocol, 3000000);
    assert_int_equal(cola.n_units, 1);
    expect_set("SCAN:STOP", "HEAD:LINes 50.000000", "SCAN:STEP 0.500000000");
}

/* The answer has the form of its request, CoLa-B too, though it comes later. So has a refusal. */
static void a_late_answer_has_the_form_of_its_request(void **state)
{
    (void)state;
#define FAST_B "\0\0\x13\x88\0\1\0\0\x13\x88\xff\xf9\x22\x30\0\x22\x55\x10"
    static const char request[] = "sMN mLMPsetscancfg " FAST_B, answer[] = "sAN mLMPsetscancfg \0" FAST_B;
    open_lms();
    for (int refused = 0; refused < 2; refused++) {
        uint8_t frame[64];
        is_set("scanning", "25", "0.25");
        head[SET_STEP].error = refused ? -221 : 0;
        protocol_rig_clear(&cola);
        cola_input(frame, cola_frame_b(frame, request, sizeof request - 1));
        assert_int_equal(cola.n_units, 0);
        is_set("spin-down", "50", "0.5");
        if (refused)
            cola.ops->gap(cola.protocol, 1); /* the event may have been lost */
        else
            state_event(PROTOCOL_HEAD_SPIN_DOWN);
        cola.ops->time(cola.protocol, 1000000);
        assert_int_equal(cola.n_units, 1);
        const size_t len = refused ? cola_frame_b(frame, "sFA\0\4", 5) : cola_frame_b(frame, answer, sizeof answer - 1);
        assert_int_equal(cola.len, len);
        assert_memory_equal(cola.bytes, frame, len);
        cola.ops->time(cola.protocol, 2000000); /* once */
        assert_int_equal(cola.n_units, 1);
    }
}

/* A range that was written with the old step stays valid on the new grid. */
static void the_range_stays_on_the_new_grid(void **state)
{
    (void)state;
    open_lms();
    is_set("idle", "25", "0.25");
    cola_expect("sWN LMPoutputRange 1 9C4 -447500 +900000", "sWA LMPoutputRange");
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 9C4 FFF92BF4 DBBA0");
    is_set("idle", "50", "0.5");
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 1388 FFF92230 DBBA0"); /* -44.75 is halfway */
    cola_expect("sWN LMPoutputRange 1 9C4 0 0", "sFA 5");
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(a_resting_head_says_how_it_is_set),
        CASE(other_pairs_are_refused),
        CASE(a_resting_head_is_set),
        CASE(a_scan_is_stopped_first),
        CASE(a_head_that_is_started_again_is_stopped_again),
        CASE(the_range_stays_on_the_new_grid),
        CASE(a_late_answer_has_the_form_of_its_request),
    };
    return cmocka_run_group_tests_name("cola geometry", tests, NULL, NULL);
}
