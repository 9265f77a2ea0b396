/* SPDX-License-Identifier: MIT */
/* How messages of a captured protocol are told apart: telegrams of CoLa as SICK's telegram listing and COLA.md have
 * them, lines of SCIP as Hokuyo's descriptions have them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/talk.h"

/* Bytes of a literal, which may have a NUL inside. */
#define BYTES(text) ((const uint8_t *)(text)), sizeof(text) - 1
#define COLA_MARKS  "\2\2\2\2"

static const struct talk_kind *cola, *scip, *lines;

static int setup(void **state)
{
    (void)state;
    cola = talk_kind_of(BYTES("\2sRN A\3"));
    scip = talk_kind_of(BYTES("BM\n"));
    lines = talk_kind_of(BYTES("a\n"));
    return 0;
}

static void kinds_by_the_first_bytes(void **state)
{
    (void)state;
    assert_string_equal(talk_kind_of(BYTES("\2s"))->name, "CoLa");
    assert_string_equal(talk_kind_of(BYTES("\2\2"))->name, "CoLa");
    assert_string_equal(talk_kind_of(BYTES("\2"))->name, "bytes");
    assert_string_equal(talk_kind_of(BYTES("\2x\n"))->name, "bytes");
    assert_string_equal(talk_kind_of(BYTES("a"))->name, "bytes"); /* no line has come */
    assert_string_equal(talk_kind_of(BYTES("BM"))->name, "bytes");
    assert_string_equal(talk_kind_of(BYTES("\t ~\r\n"))->name, "lines");
    assert_string_equal(talk_kind_of(BYTES("\x7f\n"))->name, "bytes");
    assert_string_equal(talk_kind_of(BYTES("\x1f\n"))->name, "bytes");
    assert_string_equal(talk_kind_of(BYTES("a\n\xff"))->name, "lines"); /* the first line decides */
    assert_string_equal(talk_kind_of(BYTES("G HTTP/1."))->name, "bytes");
    assert_string_equal(talk_kind_of(BYTES("G HTTP/1.1\n"))->name, "bytes");
    assert_string_equal(talk_kind_of(BYTES("a\n HTTP/1.1\n"))->name, "lines"); /* HTTP is in the first line, or none */
}

static void commands_of_scip(void **state)
{
    (void)state;
    static const char *const bare[] = {"VV", "PP", "II", "BM", "QT", "RS", "RT", "RB", "%SL", "%ST", "SCIP2.0"};
    static const char *const counted[] = {"TM", "SS", "CR", "HS", "DB", "GD", "GS", "GE",
                                          "MD", "MS", "ME", "HD", "HE", "ND", "NE"};
    char line[20];
    for (size_t i = 0; i < sizeof bare / sizeof *bare; i++) {
        for (const char *end = "\n\r;"; *end != '\0'; end++) {
            const int n = snprintf(line, sizeof line, "%s%c\n", bare[i], *end);
            assert_ptr_equal(talk_kind_of((const uint8_t *)line, (size_t)n), scip);
        }
        const int n = snprintf(line, sizeof line, "%s0\n", bare[i]);
        assert_ptr_equal(talk_kind_of((const uint8_t *)line, (size_t)n), lines);
    }
    for (size_t i = 0; i < sizeof counted / sizeof *counted; i++)
        for (const char *next = "/09:\n"; *next != '\0'; next++) {
            const int n = snprintf(line, sizeof line, "%s%c\n", counted[i], *next);
            assert_ptr_equal(talk_kind_of((const uint8_t *)line, (size_t)n),
                             *next == '0' || *next == '9' ? scip : lines);
        }
}

/* Lengths of the first message in some bytes; 0: it is not whole. */
static void lengths(void **state)
{
    (void)state;
    static const struct {
        const uint8_t *bytes;
        size_t len, first;
    } rows[] = {
        {BYTES("\2sRN A\3"), 7},
        {BYTES("\2sRN A\3\2sRN B\3"), 7},
        {BYTES("\2sRN A"), 0},
        {BYTES("\2"), 0},
        {BYTES("ab\2sRN A\3"), 2}, /* bytes of no telegram end where one begins */
        {BYTES("abc"), 3},
        {BYTES("\2\2\2"), 0},
        {BYTES("\2\2\3"), 3}, /* these are no four marks */
        {BYTES(COLA_MARKS "\0\0\0"), 0},
        {BYTES(COLA_MARKS "\0\0\0\0"), 0}, /* the check byte is missing */
        {BYTES(COLA_MARKS "\0\0\0\0x"), 9},
        {BYTES(COLA_MARKS "\0\0\0\5sRN A"), 0},
        {BYTES(COLA_MARKS "\0\0\0\5sRN A\3"), 14},
        {BYTES(COLA_MARKS "\0\0\0\5sRN A\3\2"), 14},
        {BYTES(COLA_MARKS "\0\x10\0\0s"), 0}, /* 1 MiB is the longest */
        {BYTES(COLA_MARKS "\0\x10\0\1s"), 1},
        {BYTES(COLA_MARKS "\0\x10\0\1"), 1}, /* the length alone says so */
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_equal(cola->request_len(rows[i].bytes, rows[i].len), rows[i].first);
        assert_int_equal(cola->answer_len(rows[i].bytes, rows[i].len), rows[i].first);
    }
    assert_int_equal(lines->request_len(BYTES("ab\ncd\n")), 3);
    assert_int_equal(lines->request_len(BYTES("ab")), 0);
    assert_int_equal(scip->request_len(BYTES("BM\nQT\n")), 3);
    assert_int_equal(scip->request_len(BYTES("BM\rQT\n")), 3);
    assert_int_equal(scip->request_len(BYTES("BM")), 0);
    assert_int_equal(scip->request_len(BYTES("\nBM\n")), 1); /* an empty line is a line by itself */
    assert_int_equal(scip->answer_len(BYTES("BM\n00P\n\nQ")), 8);
    assert_int_equal(scip->answer_len(BYTES("BM\n00P\n")), 0);
    assert_int_equal(scip->answer_len(BYTES("\n\n")), 2);
}

/* One request and one message: does it answer the request, or is it of the stream that the request began? */
static void answers_and_streams(void **state)
{
    (void)state;
    enum { NEITHER, ANSWER, STREAM };
    static const struct {
        const uint8_t *request;
        size_t request_len;
        const uint8_t *message;
        size_t len;
        int is;
    } rows[] = {
        {BYTES("\2sRN A\3"), BYTES("\2sRA A 1\3"), ANSWER},
        {BYTES("\2sRN A\3"), BYTES("\2sRA A\3"), ANSWER},
        {BYTES("\2sRN A\3"), BYTES("\2sRA B\3"), NEITHER},
        {BYTES("\2sRN A\3"), BYTES("\2sRA AA\3"), NEITHER},
        {BYTES("\2sRN AB\3"), BYTES("\2sRA A 1\3"), NEITHER},
        {BYTES("\2sRN A\3"), BYTES("\2sWA A\3"), NEITHER},
        {BYTES("\2sRN A\3"), BYTES("\2sFA 3\3"), ANSWER},
        {BYTES("\2sRN A\3"), BYTES("\2sFA\3"), ANSWER},
        {BYTES("\2sRI 7\3"), BYTES("\2sRA LocationName 1 x\3"), ANSWER}, /* variables by number */
        {BYTES("\2sWN A 2\3"), BYTES("\2sWA A\3"), ANSWER},
        {BYTES("\2sWN A 2\3"), BYTES("\2sRA A\3"), NEITHER},
        {BYTES("\2sMN A 2\3"), BYTES("\2sAN A 1\3"), ANSWER},
        {BYTES("\2sMN A 2\3"), BYTES("\2sSN A 1\3"), NEITHER},
        {BYTES("\2sEN A 1\3"), BYTES("\2sEA A 1\3"), ANSWER},
        {BYTES("\2sEN A 1\3"), BYTES("\2sSN A 1\3"), STREAM},
        {BYTES("\2sEN A 0\3"), BYTES("\2sSN A 1\3"), NEITHER},
        {BYTES("\2sEN A 1\3"), BYTES("\2sSN B 1\3"), NEITHER},
        {BYTES("\2sEN A 1\3"), BYTES("\2sSN AB 1\3"), NEITHER},
        {BYTES("\2sEN A 1 2\3"), BYTES("\2sSN A 1\3"), NEITHER},
        {BYTES("\2sRN A 1\3"), BYTES("\2sSN A 1\3"), NEITHER},
        {BYTES("\2sMN LMCstartmeas\3"), BYTES("\2sSN LMDscandata 1\3"), STREAM},
        {BYTES("\2sMN LMCstartmeas\3"), BYTES("\2sSN LIDoutputstate 1\3"), NEITHER},
        {BYTES("\2sMN LMCstopmeas\3"), BYTES("\2sSN LMDscandata 1\3"), NEITHER},
        {BYTES(COLA_MARKS "\0\0\0\5sRN A\3"), BYTES(COLA_MARKS "\0\0\0\7sRA A \1\3"), ANSWER},
        {BYTES(COLA_MARKS "\0\0\0\7sEN A \1\3"), BYTES(COLA_MARKS "\0\0\0\7sSN A \1\3"), STREAM},
        {BYTES("\2sR\3"), BYTES("\2sFA 3\3"), NEITHER}, /* no request */
        {BYTES("\2sRN A\3"), BYTES("\2sR\3"), NEITHER},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const uint8_t *r = rows[i].request, *m = rows[i].message;
        assert_int_equal(cola->answers(r, rows[i].request_len, m, rows[i].len) != 0, rows[i].is == ANSWER);
        assert_int_equal(cola->streams(r, rows[i].request_len, m, rows[i].len) != 0, rows[i].is == STREAM);
    }
}

/* In SCIP an answer repeats the line. Scans of M and N have the status 99, and count down in two digits. */
static void answers_and_streams_of_scip(void **state)
{
    (void)state;
    enum { NEITHER, ANSWER, STREAM };
    static const struct {
        const char *request, *message;
        int is;
    } rows[] = {
        {"BM\n", "BM\n00P\n\n", ANSWER},
        {"BM\n", "QT\n00P\n\n", NEITHER},
        {"BM\n", "BMX\n00P\n\n", NEITHER},
        {"MD0000001000002\n", "MD0000001000002\n00P\n\n", ANSWER},
        {"MD0000001000002\n", "MD0000001000001\n99b\nx\n\n", STREAM},
        {"MD0000001000002\n", "MD0000001000002\n99b\nx\n\n", STREAM},
        {"MD0000001000002\n", "MD0000001000001\n99", STREAM},
        {"MD0000001000002\n", "MD0000001000001\n9", NEITHER},
        {"MD0000001000002\n", "MD0000001000001\n00P\n\n", NEITHER},
        {"MD0000001000002\n", "MD0000001010001\n99b\nx\n\n", NEITHER}, /* of another request */
        {"MD0000001000002;a\n", "MD0000001000001;a\n99b\nx\n\n", STREAM},
        {"MD0000001000002;a\n", "MD0000001000001;b\n99b\nx\n\n", NEITHER},
        {"%MD0000001000002\n", "%MD0000001000001\n99b\nx\n\n", STREAM},
        {"MS0000001000002\n", "MS0000001000001\n99b\nx\n\n", STREAM},
        {"ME0000001000002\n", "ME0000001000001\n99b\nx\n\n", STREAM},
        {"ND0000001000002\n", "ND0000001000001\n99b\nx\n\n", STREAM},
        {"NE0000001000002\n", "NE0000001000001\n99b\nx\n\n", STREAM},
        {"GD0000001000002\n", "GD0000001000001\n99b\nx\n\n", NEITHER},
        {"MX0000001000002\n", "MX0000001000001\n99b\nx\n\n", NEITHER},
        {"MD00000010000\n", "MD00000010001\n99b\nx\n\n", NEITHER},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const uint8_t *r = (const uint8_t *)rows[i].request, *m = (const uint8_t *)rows[i].message;
        const size_t r_len = strlen(rows[i].request), len = strlen(rows[i].message);
        assert_int_equal(scip->answers(r, r_len, m, len) != 0, rows[i].is == ANSWER);
        assert_int_equal(scip->streams(r, r_len, m, len) != 0, rows[i].is == STREAM);
    }
}

/* Does a request end what an earlier one began? */
static void stops(void **state)
{
    (void)state;
    static const struct {
        const char *began, *request;
        int stops;
    } rows[] = {
        {"\2sEN A 1\3", "\2sEN A 0\3", 1},
        {"\2sEN A 1\3", "\2sEN A 1\3", 1}, /* it begins again */
        {"\2sEN A 1\3", "\2sEN B 0\3", 0},
        {"\2sEN A 1\3", "\2sEN AB 0\3", 0},
        {"\2sEN A 1\3", "\2sRN A\3", 0},
        {"\2sEN A 1\3", "\2sMN LMCstopmeas\3", 0},
        {"\2sEN A 1\3", "\2sMN mSCreboot\3", 1},
        {"\2sEN A 0\3", "\2sMN mSCreboot\3", 0}, /* it has begun nothing */
        {"\2sRN A\3", "\2sMN mSCreboot\3", 0},
        {"\2sEN LMDscandata 1\3", "\2sMN LMCstopmeas\3", 1},
        {"\2sEN LMDscandata 1\3", "\2sMN LMCstandby\3", 1},
        {"\2sEN LMDscandata 1\3", "\2sMN LMCstartmeas\3", 0},
        {"\2sMN LMCstartmeas\3", "\2sMN LMCstopmeas\3", 1},
        {"\2sMN LMCstartmeas\3", "\2sMN LMCstandby\3", 1},
        {"\2sMN LMCstartmeas\3", "\2sMN mSCreboot\3", 1},
        {"\2sMN LMCstartmeas\3", "\2sEN LMDscandata 0\3", 1},
        {"\2sMN LMCstartmeas\3", "\2sEN LMDscandata 1\3", 1},
        {"\2sMN LMCstartmeas\3", "\2sEN A 0\3", 0},
        {"\2sMN LMCstartmeas\3", "\2sRN LMDscandata\3", 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        assert_int_equal(cola->stops((const uint8_t *)rows[i].request, strlen(rows[i].request),
                                     (const uint8_t *)rows[i].began, strlen(rows[i].began)) != 0,
                         rows[i].stops);
    static const char *const enders[] = {"QT\n", "RS\n", "RT\n", "RB\n", "TM0\n", "%SL\n", "ND0000001000000\n"},
                             *const others[] = {"TM1\n", "BM\n", "GD0000001000\n", "QT"};
    static const char stream[] = "MD0000001000002\n", single[] = "GD0000001000\n";
    for (size_t i = 0; i < sizeof enders / sizeof *enders; i++) {
        const uint8_t *ender = (const uint8_t *)enders[i];
        assert_true(scip->stops(ender, strlen(enders[i]), BYTES(stream)));
        assert_false(scip->stops(ender, strlen(enders[i]), BYTES(single)));
    }
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        assert_false(scip->stops((const uint8_t *)others[i], strlen(others[i]), BYTES(stream)));
    assert_null(lines->stops);
}

/* The device's own error: 2 no such method, 3 no such variable, 15 no such event (COLA.md). In CoLa-B the code is an
 * u16, and the last byte is the exclusive or of the telegram's bytes. */
static void errors(void **state)
{
    (void)state;
    static const struct {
        const char *verb;
        uint8_t code;
        const char *text;
    } rows[] = {{"sRN", 3, "\2sFA 3\3"}, {"sWN", 3, "\2sFA 3\3"}, {"sMN", 2, "\2sFA 2\3"}, {"sEN", 15, "\2sFA F\3"}};
    uint8_t to[64];
    char request[32];
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const int n = snprintf(request, sizeof request, "\2%s Z\3", rows[i].verb);
        assert_int_equal(cola->error((const uint8_t *)request, (size_t)n, to), strlen(rows[i].text));
        assert_memory_equal(to, rows[i].text, strlen(rows[i].text));

        uint8_t expected[] = {2, 2, 2, 2, 0, 0, 0, 5, 's', 'F', 'A', 0, rows[i].code, 's' ^ 'F' ^ 'A' ^ rows[i].code};
        memcpy(request, COLA_MARKS "\0\0\0\5sRN Zx", 14);
        memcpy(request + 8, rows[i].verb, 3);
        memset(to, 0xee, sizeof to);
        assert_int_equal(cola->error((const uint8_t *)request, 14, to), sizeof expected);
        assert_memory_equal(to, expected, sizeof expected);
    }
    static const char repeated[] = "ZZ;tag\n0Ee\n\n";
    assert_int_equal(scip->error(BYTES("ZZ;tag\r"), to), sizeof repeated - 1);
    assert_memory_equal(to, repeated, sizeof repeated - 1);
    /* Only so many characters are repeated as have room before the 7 of the status. */
    uint8_t longest[64];
    memset(longest, 'Z', sizeof longest);
    const size_t n = scip->error(longest, sizeof longest, to);
    assert_in_range(n, 8, sizeof to);
    assert_memory_equal(to, longest, n - 6);
    assert_memory_equal(to + n - 6, "\n0Ee\n\n", 6);
}

static void names(void **state)
{
    (void)state;
    char name[TALK_NAME_LEN];
    static const struct {
        const uint8_t *request;
        size_t len;
        const char *name;
    } rows[] = {
        {BYTES("\2sRN LMPscancfg\3"), "sRN LMPscancfg"},
        {BYTES("\2sMN SetAccessMode 3 F4724744\3"), "sMN SetAccessMode"},
        {BYTES(COLA_MARKS "\0\0\0\5sRN Zx"), "sRN Z"},
        {BYTES("\2s"), ""},
        {BYTES("MD0000001000002\n"), "MD"},
        {BYTES("%MD0000001000002\n"), "%MD"},
        {BYTES("VV;tag\r"), "VV"},
        {BYTES("MEAS:VOLT? 1\n"), "MEAS:VOLT?"},
        {BYTES("RST\r\n"), "RST"},
        {BYTES("\0\1\xfe"), "00 01 fe "},
        {BYTES("\0\1\2\3\4\5\6\7\x8"), "00 01 02 03 04 05 06 07 "}, /* 8 bytes at most */
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        talk_name(talk_kind_of(rows[i].request, rows[i].len), rows[i].request, rows[i].len, name);
        assert_string_equal(name, rows[i].name);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kinds_by_the_first_bytes),
        cmocka_unit_test(commands_of_scip),
        cmocka_unit_test(lengths),
        cmocka_unit_test(answers_and_streams),
        cmocka_unit_test(answers_and_streams_of_scip),
        cmocka_unit_test(stops),
        cmocka_unit_test(errors),
        cmocka_unit_test(names),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
