/* SPDX-License-Identifier: MIT */
/* Requests of CoLa-B have the numbers of CoLa-A in the widths of COLA.md. Each request is sent in both forms, and both
 * answers must say the same. */
#include "tests/unit/cola_rig.h"

static struct protocol_rig_reply replies[] = {
    {"TIME:SERVer? STATe", "SET,18000000000000,-5,500000000,3,1,0", 0},
    {"TIME:SERVer?", "NONE,192.168.0.11,66051,-3,CAN", 0}, /* 0x010203 s */
    {"TIME:SERVer", "OK", 0},
    {NULL, NULL, 0},
};

/* Writes a telegram of CoLa-A as the payload of CoLa-B. A width is that of a number; t is a text after its length. */
static size_t to_b(uint8_t *to, const char *a, const char *widths)
{
    const char *at = strchr(strchr(a, ' ') + 1, ' ');
    size_t n = at == NULL ? strlen(a) : (size_t)(at - a);
    memcpy(to, a, n);
    if (at != NULL || a[1] != 'R') to[n++] = ' '; /* a blank follows each name, but not in a question */
    for (; *widths != '\0'; widths++) {
        char *end;
        assert_non_null(at);
        const int is_decimal = at[1] == '+' || at[1] == '-';
        const uint32_t v = (uint32_t)strtol(at + 1, &end, is_decimal ? 10 : 16);
        assert_true(end > at + 1);
        for (int i = *widths == 't' ? 2 : *widths - '0'; i > 0; i--)
            to[n++] = (uint8_t)(v >> (8 * (i - 1)));
        at = end;
        if (*widths != 't') continue;
        memcpy(to + n, at + 1, v);
        n += v;
        at += 1 + v;
    }
    assert_true(at == NULL || *at == '\0');
    return n;
}

static void expect_both(const char *request, const char *widths, const char *answer, const char *answer_widths)
{
    uint8_t asked[256], said[256];
    cola_expect(request, answer);
    const size_t len = to_b(asked, request, widths), said_len = to_b(said, answer, answer_widths);
    cola_expect_b(asked, len, said, said_len);
}

static void open_head(void)
{
    cola_open_lms();
    cola.replies = replies;
    cola.utc0_ns = INT64_C(1709210096) * 1000000000; /* 2024-02-29T12:34:56Z */
    cola_authorise();
}

static void variables_are_read(void **state)
{
    (void)state;
    static const struct {
        const char *name, *widths;
    } rows[] = {
        {"DeviceIdent", "tt"},
        {"SerialNumber", "t"},
        {"FirmwareVersion", "t"},
        {"LocationName", "t"},
        {"SCdevicestate", "1"},
        {"STlms", "21tt222"},
        {"LCMstate", "1"},
        {"ODoprh", "4"},
        {"ODpwrc", "4"},
        {"EIHstCola", "1"},
        {"LMPoutputRange", "2444"},
        {"LMPscancfg", "42444"},
        {"LMDscandatascalefactor", "4"},
        {"FREchoFilter", "1"},
        {"TSCRole", "1"},
        {"TSCTCInterface", "1"},
        {"TSCTCSrvAddr", "1111"},
        {"TSCTCtimezone", "1"},
        {"TSCTCupdatetime", "4"},
        {"TSCTCmaxoffset", "4"},
        {"TSCTCdelay", "4"},
        {"LMDscandatacfg", "111111111112"},
    };
    open_head();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char request[64], answer[256];
        snprintf(request, sizeof request, "sRN %s", rows[i].name);
        snprintf(answer, sizeof answer, "%s", cola_ask(request));
        expect_both(request, "", answer, rows[i].widths);
    }
}

/* The value is written in CoLa-B, and read in CoLa-A. */
static void variables_are_written(void **state)
{
    (void)state;
    static const struct {
        const char *name, *widths, *value;
    } rows[] = {
        {"LocationName", "t", " 3 a b"},
        {"LMPoutputRange", "2444", " 1 9C4 0 1B7740"},
        {"LMDscandatascalefactor", "4", " 40000000"},
        {"FREchoFilter", "1", " 2"},
        {"LMDscandatacfg", "111111111112", " 3 0 1 1 0 1 0 1 0 0 1 102"},
    };
    open_head();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char request[128], answer[128];
        uint8_t asked[128], said[128];
        snprintf(request, sizeof request, "sWN %s%s", rows[i].name, rows[i].value);
        snprintf(answer, sizeof answer, "sWA %s", rows[i].name);
        const size_t len = to_b(asked, request, rows[i].widths), said_len = to_b(said, answer, "");
        cola_expect_b(asked, len, said, said_len);
        snprintf(request, sizeof request, "sRN %s", rows[i].name);
        snprintf(answer, sizeof answer, "sRA %s%s", rows[i].name, rows[i].value);
        cola_expect(request, answer);
    }
}

static void methods_are_called(void **state)
{
    (void)state;
#define CFG " 9C4 1 9C4 FFF92230 225510"
    open_head();
    expect_both("sMN GetAccessMode", "", "sAN GetAccessMode 3", "1");
    expect_both("sMN CheckPassword 3 F4724744", "14", "sAN CheckPassword 1", "1");
    expect_both("sMN mLMPsetscancfg" CFG, "42444", "sAN mLMPsetscancfg 0" CFG, "142444");
    expect_both("sMN mEEwriteall", "", "sAN mEEwriteall 1", "1");
    expect_both("sMN mSCloadappdef", "", "sAN mSCloadappdef", "");
    expect_both("sMN LSPsetdatetime 7CF C 1F 17 3B 3A F423F", "2111114", "sAN LSPsetdatetime 1", "1");
    assert_non_null(strstr(cola_ask("sRN STlms"), " 8 23:59:58 A 31.12.1999 "));
    expect_both("sMN LMCstopmeas", "", "sAN LMCstopmeas 0", "1");
    expect_both("sMN LMCstartmeas", "", "sAN LMCstartmeas 1", "1");
    expect_both("sEN LMDscandata 0", "1", "sEA LMDscandata 0", "1");
    expect_both("sMN SetAccessMode 3 F4724744", "14", "sAN SetAccessMode 1", "1");
    expect_both("sMN Run", "", "sAN Run 1", "1");
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(variables_are_read),
        CASE(variables_are_written),
        CASE(methods_are_called),
    };
    return cmocka_run_group_tests_name("cola binary", tests, NULL, NULL);
}
