/* SPDX-License-Identifier: MIT */
/* CoLa: settings that mEEwriteall keeps, and the one dialect of a link. */
#include <stdatomic.h>

#include "drivers/protocol/cola_field.h"
#include "tests/unit/cola_rig.h"

/* Opens another session of the same head, with the rig's spec as it is now. Returns the result of create. */
static int open_again(struct sh_err *err)
{
    protocol_destroy(cola.ops, cola.protocol);
    cola.protocol = NULL;
    const int rc = protocol_create(cola.ops, &cola.spec, &cola.protocol, err);
    if (rc == 0) protocol_rig_describe(&cola, 0);
    return rc;
}

/* The lines are written out here as a user finds them in the file. */
static const char lines[] = "LMDscandatacfg 3 0 1 1 0 1 0 0 1 0 1 7\n"
                            "FREchoFilter 1\n"
                            "LMDscandatascalefactor 2\n"
                            "EIHstCola 1\n"
                            "LMPoutputRange 0 900000\n"
                            "LocationName north gate\n";

static void settings_are_kept(void **state)
{
    (void)state;
    struct sh_err err;
    cola_open_lms();
    cola.spec.keeps = 1;
    cola.spec.stored = "";
    assert_int_equal(open_again(&err), 0);
    cola_authorise();
    cola_expect("sWN LMDscandatacfg 3 0 1 1 0 1 0 0 1 0 1 7", "sWA LMDscandatacfg");
    cola_expect("sWN FREchoFilter 1", "sWA FREchoFilter");
    cola_expect("sWN LMDscandatascalefactor 40000000", "sWA LMDscandatascalefactor");
    cola_expect("sWN LMPoutputRange 1 9C4 0 +900000", "sWA LMPoutputRange");
    cola_expect("sWN LocationName A north gate", "sWA LocationName");
    cola_expect("sWN EIHstCola 1", "sWA EIHstCola");
    cola_expect("sMN mEEwriteall", "sAN mEEwriteall 1");
    assert_string_equal(cola.stored, lines);
    assert_string_equal(cola.line[cola.n_lines - 1], "HEAD:STORe"); /* rates and time server are the head's */
    cola_expect("sWN FREchoFilter 0", "sWA FREchoFilter");
    cola_expect("sMN mSCreboot", "sAN mSCreboot"); /* the same session has them after a power cycle, too */
    cola_expect("sRN FREchoFilter", "sRA FREchoFilter 1");

    cola.spec.stored = lines;
    assert_int_equal(open_again(&err), 0);
    cola_expect("sRN LMDscandatacfg", "sRA LMDscandatacfg 3 0 1 1 0 1 0 0 1 0 1 7");
    cola_expect("sRN FREchoFilter", "sRA FREchoFilter 1");
    cola_expect("sRN LMDscandatascalefactor", "sRA LMDscandatascalefactor 40000000");
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 9C4 0 DBBA0");
    cola_expect("sRN LocationName", "sRA LocationName A north gate");
    cola_expect("sRN EIHstCola", "sRA EIHstCola 1");
}

/* Without a file nothing lasts, though the scanner says that it has stored. */
static void without_a_file_nothing_is_kept(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
    cola_expect("sMN mEEwriteall", "sAN mEEwriteall 1");
    assert_string_equal(cola.stored, "");
    assert_int_equal(cola.n_lines, 0);
}

/* Another session has control, or the store refuses. */
static void what_is_refused_is_not_kept(void **state)
{
    (void)state;
    static const struct protocol_rig_reply refuses[] = {{"HEAD:STORe", "ERR", -203}, {NULL, NULL, 0}};
    struct sh_err err;
    cola_open_lms();
    cola.spec.keeps = 1;
    assert_int_equal(open_again(&err), 0);
    cola.replies = refuses;
    cola_authorise();
    cola_expect("sWN FREchoFilter 1", "sWA FREchoFilter");
    cola_expect("sMN mEEwriteall", "sAN mEEwriteall 0");
    assert_string_equal(cola.stored, "");
    cola_expect("sMN mSCreboot", "sAN mSCreboot");
    cola_expect("sRN FREchoFilter", "sRA FREchoFilter 0"); /* as it was at power-up */
}

/* A name with a line's end would be two lines of the file, and one with other bytes could not be stored. */
static void names_are_printable(void **state)
{
    (void)state;
    cola_open_lms();
    EXPECT_B("sMN SetAccessMode \3\xf4\x72\x47\x44", "sAN SetAccessMode \1");
    EXPECT_B("sWN LocationName \0\4a\nbc", "sFA\0\5");
    EXPECT_B("sWN LocationName \0\4B\xfc"
             "ro",
             "sFA\0\5"); /* Latin-1 */
    EXPECT_B("sWN LocationName \0\4a\0bc", "sFA\0\5");
    EXPECT_B("sWN LocationName \0\4 ~bc", "sWA LocationName ");
    EXPECT_B("sRN LocationName", "sRA LocationName \0\4 ~bc");
}

static void wrong_lines_are_refused(void **state)
{
    (void)state;
    static const char *const wrong[] = {
        "FREchoFilter 3\n",
        "FREchoFilter 1 1\n",
        "FREchoFilter\n",
        "EIHstCola 2\n",
        "LMDscandatacfg 3 0 1 1 0 1 0 0 1 0 1\n",
        "LMDscandatacfg 4 0 1 1 0 1 0 0 1 0 1 7\n", /* no such channel */
        "LMDscandatacfg 3 0 1 1 0 256 0 0 1 0 1 7\n",
        "LMDscandatacfg 3 0 1 1 0 1 0 0 1 0 1 7 7\n",
        "LMPoutputRange 900000 0\n",
        "LocationName 012345678901234567890123456789012\n",
        "TSCRole 1\n",
        "FREchoFilter 1\nfoo\n",
    };
    cola_open_lms();
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct sh_err err = {0};
        cola.spec.stored = wrong[i];
        const int rc =
            cola.protocol != NULL ? open_again(&err) : protocol_create(cola.ops, &cola.spec, &cola.protocol, &err);
        if (rc != SH_EINPUT) fail_msg("%s", wrong[i]);
        assert_non_null(strstr(err.text, "head.settings_file"));
    }
    /* A line that is too long is named by its beginning. */
    char text[600] = "LocationName ";
    struct sh_err err = {0};
    memset(text + strlen(text), 'x', sizeof text - strlen(text) - 1);
    text[sizeof text - 2] = '\n';
    cola.spec.stored = text;
    assert_int_equal(protocol_create(cola.ops, &cola.spec, &cola.protocol, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "'LocationName xxx"));
    /* The TiM has one echo. */
    snprintf(cola.identity.model, sizeof cola.identity.model, "TiM571");
    cola.spec.stored = "FREchoFilter 1\n";
    assert_int_equal(protocol_create(cola.ops, &cola.spec, &cola.protocol, &err), SH_EINPUT);
    cola.spec.stored = "FREchoFilter 2\n";
    assert_int_equal(protocol_create(cola.ops, &cola.spec, &cola.protocol, NULL), 0);
}

/* ---- the dialect */

static _Atomic uint32_t word;

static void open_strict(int dialect)
{
    struct sh_err err;
    cola_open_lms();
    atomic_store(&word, 0);
    cola.spec.dialect = dialect;
    cola.spec.shared = &word;
    assert_int_equal(open_again(&err), 0);
}

/* The request gets no answer, and its bytes are counted. */
static void expect_silence(const void *bytes, size_t len)
{
    protocol_rig_clear(&cola);
    cola.count[PROTOCOL_INPUT_LOST] = 0;
    cola_input(bytes, len);
    assert_int_equal(cola.n_units, 0);
    assert_int_equal(cola.count[PROTOCOL_INPUT_LOST], len);
}

static void one_dialect_at_a_time(void **state)
{
    (void)state;
    struct sh_err err;
    uint8_t frame[64];
    const size_t len = cola_frame_b(frame, "sRN SCdevicestate", 17);
    open_strict(PROTOCOL_COLA_A);
    expect_silence(frame, len);
    cola_expect("sRN EIHstCola", "sRA EIHstCola 0");
    cola_authorise();
    cola_expect("sWN EIHstCola 1", "sWA EIHstCola"); /* still in A */
    expect_silence("\2sRN SCdevicestate\3", 19);
    EXPECT_B("sRN SCdevicestate", "sRA SCdevicestate \1");
    assert_int_equal(open_again(&err), 0); /* so it is for other sessions of the link */
    expect_silence("\2sRN SCdevicestate\3", 19);
    EXPECT_B("sRN EIHstCola", "sRA EIHstCola \1");

    cola.spec.power_ons = 2; /* without mEEwriteall it is forgotten with power */
    assert_int_equal(open_again(&err), 0);
    expect_silence(frame, len);
    cola_expect("sRN EIHstCola", "sRA EIHstCola 0");
    cola.spec.stored = "EIHstCola 1\n"; /* a stored dialect is the one of power-up */
    assert_int_equal(open_again(&err), 0);
    EXPECT_B("sRN EIHstCola", "sRA EIHstCola \1");
    open_strict(PROTOCOL_COLA_B);
    expect_silence("\2sRN SCdevicestate\3", 19);
    EXPECT_B("sRN EIHstCola", "sRA EIHstCola \1");
}

/* mEEwriteall stores no dialect that nobody has set. mSCloadappdef leaves a link its dialect. */
static void storing_keeps_the_dialect(void **state)
{
    (void)state;
    struct sh_err err;
    open_strict(PROTOCOL_COLA_B);
    cola.spec.keeps = 1;
    assert_int_equal(open_again(&err), 0);
    EXPECT_B("sMN SetAccessMode \3\xf4\x72\x47\x44", "sAN SetAccessMode \1");
    EXPECT_B("sMN mEEwriteall", "sAN mEEwriteall \1");
    assert_null(strstr(cola.stored, "EIHstCola")); /* nobody has written it */
    EXPECT_B("sRN EIHstCola", "sRA EIHstCola \1");

    cola.spec.dialect = PROTOCOL_COLA_A;
    cola.spec.stored = "EIHstCola 1\n";
    assert_int_equal(open_again(&err), 0);
    EXPECT_B("sMN SetAccessMode \3\xf4\x72\x47\x44", "sAN SetAccessMode \1");
    EXPECT_B("sMN mSCloadappdef", "sAN mSCloadappdef ");
    EXPECT_B("sRN EIHstCola", "sRA EIHstCola \1");
}

/* Another session has changed it: the stream goes on in the new one. */
static void the_stream_follows(void **state)
{
    (void)state;
    open_strict(PROTOCOL_COLA_A);
    cola_stream(0);
    protocol_rig_clear(&cola);
    cola_turn(0, 1.0);
    assert_memory_equal(cola.bytes, "\2sSN", 4);
    atomic_store(&word, cola.spec.power_ons << 2 | 2); /* as cola_dialect.c draws it: B, since this power-up */
    protocol_rig_clear(&cola);
    cola_turn(1, 1.0);
    assert_memory_equal(cola.bytes, "\2\2\2\2", 4);
}

/* So do events that come without a scan: an input changes at 1 ms. */
static void events_follow(void **state)
{
    (void)state;
    static struct cola_fields fields = {.n_windows = 1, .window = {{0, 1000000, 2000000}}};
    struct sh_err err;
    open_strict(PROTOCOL_COLA_A);
    cola.identity.fields = &fields;
    assert_int_equal(open_again(&err), 0);
    cola_expect("sEN LIDinputstate 1", "sEA LIDinputstate 1");
    atomic_store(&word, cola.spec.power_ons << 2 | 2);
    protocol_rig_clear(&cola);
    cola.ops->time(cola.protocol, 1000000);
    assert_int_equal(cola.n_units, 1);
    assert_memory_equal(cola.bytes, "\2\2\2\2", 4);
}

/* Overlong telegrams of the other dialect get no answer either. */
static void garbage_of_the_other_dialect(void **state)
{
    (void)state;
    uint8_t frame[1200];
    open_strict(PROTOCOL_COLA_B);
    memset(frame, 'x', sizeof frame);
    frame[0] = 2;
    frame[sizeof frame - 1] = 3;
    expect_silence(frame, sizeof frame);
    EXPECT_B("sRN SCdevicestate", "sRA SCdevicestate \1");
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(settings_are_kept),
        CASE(without_a_file_nothing_is_kept),
        CASE(what_is_refused_is_not_kept),
        CASE(names_are_printable),
        CASE(wrong_lines_are_refused),
        CASE(one_dialect_at_a_time),
        CASE(storing_keeps_the_dialect),
        CASE(the_stream_follows),
        CASE(events_follow),
        CASE(garbage_of_the_other_dialect),
    };
    return cmocka_run_group_tests_name("cola stored", tests, NULL, NULL);
}
