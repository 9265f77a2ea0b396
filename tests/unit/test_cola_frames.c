/* SPDX-License-Identifier: MIT */
/* CoLa's frames: both forms on one connection, bytes that are no telegram, and telegrams that are broken at random. */
#include "drivers/protocol/cola_telegram.h"
#include "tests/unit/cola_rig.h"

/* ---- frames */

static void answers_have_the_form_of_the_request(void **state)
{
    (void)state;
    uint8_t bytes[128];
    cola_open_tim("TiM571");
    memcpy(bytes, "\2sRN ODpwrc\3", 12);
    size_t len = 12;
    len += cola_frame_b(bytes + len, "sRN ODpwrc", 10);
    memcpy(bytes + len, "\2sRN LCMstate\3", 14);
    len += 14;
    for (size_t piece = 1; piece <= len; piece++) { /* in pieces of any size */
        protocol_rig_clear(&cola);
        for (size_t at = 0; at < len; at += piece)
            cola_input(bytes + at, len - at < piece ? len - at : piece);
        assert_int_equal(cola.n_units, 3);
        assert_memory_equal(cola.bytes, "\2sRA ODpwrc 1\3", 14);
        assert_memory_equal(cola.bytes + cola.end[0], "\2\2\2\2\0\0\0\x0fsRA ODpwrc \0\0\0\1", 23);
        assert_memory_equal(cola.bytes + cola.end[1], "\2sRA LCMstate 0\3", 16);
    }
    assert_int_equal(cola.count[PROTOCOL_INPUT_LOST], 0);
}

/* A good request is answered before each of these, and after it. The garbage is counted. */
static void garbage_is_skipped_and_counted(void **state)
{
    (void)state;
    static const struct {
        size_t len, lost;
        char bytes[40];
    } cases[] = {
        {5, 5, "hello"},
        {4, 4, "\0\0\0\0"},
        {1, 1, "\3"},
        {6, 6, "\2sRN \1"},                           /* a character that no telegram has */
        {5, 5, "\2sRN "},                             /* half a telegram: the next one begins */
        {1, 1, "\2"},                                 /* the mark twice */
        {3, 3, "\2\2x"},                              /* twice before another byte */
        {12, 12, "\2\2\2\2\xff\xff\xff\xff\1\1\1\1"}, /* a length that can't be */
        {9, 9, "\2\2\2\2\0\0\0\0\0"},                 /* of nothing */
        {19, 19, "\2\2\2\2\0\0\0\x0asRN ODpwrc\1"},   /* a wrong check byte */
        {8, 8, "\2\2\2\2\0\0\0\x05"},                 /* half a telegram, and the next one inside what it claims */
    };
    cola_open_tim("TiM571");
    uint8_t good[64];
    const size_t good_len = cola_frame_b(good, "sRN LCMstate", 12);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        protocol_rig_clear(&cola);
        cola.count[PROTOCOL_INPUT_LOST] = 0;
        cola_input("\2sRN LCMstate\3", 14);
        cola_input(cases[i].bytes, cases[i].len);
        cola_input("\2sRN LCMstate\3", 14);
        cola_input(good, good_len);
        assert_int_equal(cola.n_units, 3);
        assert_int_equal(cola.count[PROTOCOL_INPUT_LOST], cases[i].lost);
    }
    for (size_t marks = 1; marks <= 6; marks++) { /* more marks than four: the last four count */
        protocol_rig_clear(&cola);
        cola.count[PROTOCOL_INPUT_LOST] = 0;
        cola_input("\2\2\2\2\2\2", marks);
        cola_input(good, good_len);
        assert_int_equal(cola.n_units, 1);
        assert_int_equal(cola.count[PROTOCOL_INPUT_LOST], marks);
    }
    assert_int_equal(cola.count[PROTOCOL_WRONG], 0);
}

static void an_overlong_telegram_is_refused_once(void **state)
{
    (void)state;
    static char bytes[100000];
    cola_open_tim("TiM571");
    memset(bytes, 'x', sizeof bytes);
    bytes[0] = 2;
    cola_input(bytes, sizeof bytes);
    cola_input("\3", 1);
    assert_int_equal(cola.n_units, 1);
    assert_memory_equal(cola.bytes, "\2sFA 7\3", 7);
    assert_int_equal(cola.count[PROTOCOL_INPUT_LOST], sizeof bytes + 1);
    cola_expect("sRN LCMstate", "sRA LCMstate 0");
    memset(bytes, 2, sizeof bytes); /* endless marks */
    cola_input(bytes, sizeof bytes);
    cola_expect("sRN LCMstate", "sRA LCMstate 0");
}

/* Requests of up to 1024 bytes are answered. */
static void long_requests_are_answered(void **state)
{
    (void)state;
    char bytes[1400];
    cola_open_tim("TiM571");
    for (int len = 1000; len <= 1024; len++) {
        memset(bytes, 'n', sizeof bytes);
        memcpy(bytes, "sRN ", 4);
        bytes[len] = 0;
        cola_expect(bytes, "sFA 3");
        cola_expect_b(bytes, (size_t)len, "sFA\0\3", 5);
    }
}

static uint32_t random_state;

static uint32_t draw(uint32_t below)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) % below;
}

/* Telegrams are broken at random, in random pieces, among scans. Lost bytes and wrong requests are counted, and a good
 * request is answered after them. */
static void broken_telegrams_do_no_harm(void **state)
{
    (void)state;
    static const char *const seeds[] = {"sMN SetAccessMode 3 F4724744",
                                        "sWN LMPoutputRange 1 D05 FFF92230 225510",
                                        "sWN LMDscandatacfg 1 0 1 1 0 1 0 0 1 0 1 1",
                                        "sEN LMDscandata 1",
                                        "sRN LMDscandata",
                                        "sWN LocationName 3 abc",
                                        "sMN mSCloadappdef",
                                        "sRI0"};
    static const uint8_t quiet[1100];
    uint8_t bytes[128];
    cola_open_tim("TiM571");
    random_state = 14;
    for (int round = 0; round < 20000; round++) {
        const char *seed = seeds[draw(8)];
        size_t len = strlen(seed);
        if (draw(2)) {
            len = cola_frame_b(bytes, seed, len);
        } else {
            memcpy(bytes + 1, seed, len);
            bytes[0] = 2;
            bytes[len + 1] = 3;
            len += 2;
        }
        for (uint32_t n = draw(3); n != 0; n--)
            bytes[draw((uint32_t)len)] = (uint8_t)draw(256);
        if (draw(8) == 0) len = draw((uint32_t)len) + 1;
        const size_t first = draw((uint32_t)len);
        protocol_rig_clear(&cola);
        cola_input(bytes, first);
        cola_input(bytes + first, len - first);
        if (round % 100 == 0) cola_turn((uint32_t)round / 100, 1.0);
    }
    cola_input(quiet, sizeof quiet);
    assert_true(cola.count[PROTOCOL_INPUT_LOST] > 1000 && cola.count[PROTOCOL_WRONG] > 1000);
    cola_expect("sRN LCMstate", "sRA LCMstate 0");
}

/* A telegram that fills its room to the byte is whole. With a byte less there is none. */
static void telegrams_without_room_are_none(void **state)
{
    (void)state;
    for (int form = COLA_A; form <= COLA_B; form++) {
        uint8_t bytes[64];
        const size_t len = form == COLA_A ? 1 + 10 + 2 + 1 : 8 + 11 + 4 + 1; /* marks, "sRA ODpwrc", value, end */
        for (size_t room = len + 1; room >= len - 2; room--) {
            struct cola_out out = {.buf = bytes, .cap = room};
            memset(bytes, 0xa5, sizeof bytes);
            cola_begin(&out, (enum cola_form)form, "sRA ODpwrc");
            cola_put_u(&out, 4, 7);
            assert_int_equal(cola_end(&out), room >= len ? len : 0);
            assert_int_equal(bytes[room], 0xa5);
        }
    }
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(answers_have_the_form_of_the_request), CASE(garbage_is_skipped_and_counted),
        CASE(an_overlong_telegram_is_refused_once), CASE(long_requests_are_answered),
        CASE(broken_telegrams_do_no_harm),          CASE(telegrams_without_room_are_none),
    };
    return cmocka_run_group_tests_name("cola frames", tests, NULL, NULL);
}
