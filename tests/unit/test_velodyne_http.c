/* SPDX-License-Identifier: MIT */
/* The settings of a VLP-16 over HTTP, from bytes to bytes: requests of known clients, and their answers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "tests/unit/velodyne_http_rig.h"

static const char done[] = DONE("keep-alive");
static const char done_close[] = DONE("close");

/* Requests and answers are those of real clients, byte for byte. */
static void test_curl(void **state)
{
    (void)state;
    http_send("POST /cgi/setting HTTP/1.1\r\nHost: 192.168.1.201\r\nUser-Agent: curl/7.88.1\r\nAccept: */*\r\n"
              "Content-Length: 7\r\nContent-Type: application/x-www-form-urlencoded\r\n\r\nrpm=600");
    assert_string_equal(http_answer(), done);
    http_assert_command("HEAD:LINES 10.000000");
    assert_int_equal(http_rig.hung_up, 0);
}

/* CVelodyneScanner of MRPT 2.5.8, captured. The request's Origin is the device's own address. */
static void test_mrpt(void **state)
{
    (void)state;
    http_send("POST /cgi/setting HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nContent-Length: 12\r\n"
              "Content-Type: application/x-www-form-urlencoded\r\nOrigin: http://127.0.0.1\r\n"
              "Referer: http://127.0.0.1\r\nUpgrade-Insecure-Requests: 1\r\nUser-Agent: MRPT Library\r\n\r\n"
              "returns=Dual");
    assert_string_equal(http_answer(), done_close);
    http_assert_command("SCAN:ECHOES ALL");
    assert_int_equal(http_rig.hung_up, 1);
}

/* Python's urllib: lower-case second words, HTTP/1.1, close. */
static void test_urllib(void **state)
{
    (void)state;
    http_send("POST /cgi/setting HTTP/1.1\r\nAccept-Encoding: identity\r\n"
              "Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 25\r\nHost: 127.0.0.1:8080\r\n"
              "User-Agent: Python-urllib/3.11\r\nConnection: close\r\n\r\nrpm=900&returns=strongest");
    assert_string_equal(http_answer(), done_close);
    assert_int_equal(http_rig.n_lines, 2);
    assert_string_equal(http_rig.line[0], "HEAD:LINES 15.000000");
    assert_string_equal(http_rig.line[1], "SCAN:ECHOES STRONGEST");
}

/* Each key gives its command to the head, or none. */
static void test_settings(void **state)
{
    (void)state;
    static const struct {
        const char *path, *form;
        int status;
        const char *command;
    } cases[] = {
        {"/cgi/setting", "rpm=300", 200, "HEAD:LINES 5.000000"},
        {"/cgi/setting", "rpm=1200", 200, "HEAD:LINES 20.000000"},
        {"/cgi/setting", "rpm=610", 200, "HEAD:LINES 10.166667"}, /* 10 1/6: to the nearest 1e-6 Hz */
        {"/cgi/setting", "rpm=620", 200, "HEAD:LINES 10.333333"},
        {"/cgi/setting", "rpm=603", 200, "HEAD:LINES 10.050000"},
        {"/cgi/setting", "rpm=299", 400, NULL},
        {"/cgi/setting", "rpm=1201", 400, NULL},
        {"/cgi/setting", "rpm=600.0", 400, NULL},
        {"/cgi/setting", "rpm=-600", 400, NULL},
        {"/cgi/setting", "rpm=", 400, NULL},
        {"/cgi/setting", "rpm=6000000000", 400, NULL},
        {"/cgi/setting", "rpm=0", 200, "SCAN:STOP"},
        {"/cgi/setting", "returns=Strongest", 200, "SCAN:ECHOES STRONGEST"},
        {"/cgi/setting", "returns=Last", 200, "SCAN:ECHOES LAST"},
        {"/cgi/setting", "returns=Dual", 200, "SCAN:ECHOES ALL"},
        {"/cgi/setting", "returns=D%75al", 200, "SCAN:ECHOES ALL"},
        {"/cgi/setting", "returns=First", 400, NULL},
        {"/cgi/setting", "returns=Dual+", 400, NULL},
        {"/cgi/setting", "laser=off", 200, "SCAN:STOP"},
        {"/cgi/setting", "laser=Off", 200, "SCAN:STOP"},
        {"/cgi/setting", "laser=on", 200, NULL}, /* it is */
        {"/cgi/setting", "laser=1", 400, NULL},
        {"/cgi/setting", "colour=red", 400, NULL},
        {"/cgi/setting", "rpm=600&rpm=600", 400, NULL},
        {"/cgi/setting", "rpm=600&laser=maybe", 400, NULL}, /* nothing of it is done */
        {"/cgi/setting", "laser=on&rpm=0", 400, NULL},
        {"/cgi/setting", "rpm=0&laser=on", 400, NULL}, /* the laser needs the motor; nothing of it is done */
        {"/cgi/setting", "laser=ON&rpm=00", 400, NULL},
        {"/cgi/setting", "rpm", 400, NULL},
        {"/cgi/setting", "", 400, NULL},
        {"/cgi/setting", "rpm=%", 400, NULL},
        {"/cgi/setting", "rpm=%6", 400, NULL},
        {"/cgi/setting", "rpm=%zz", 400, NULL},
        {"/cgi/setting", "rpm=600%00", 400, NULL},
        {"/cgi/setting/fov", "start=0&end=359", 200, NULL},
        {"/cgi/setting/fov", "start=90", 409, NULL},
        {"/cgi/setting/fov", "end=360", 400, NULL},
        {"/cgi/setting/host", "addr=255.255.255.255", 200, NULL},
        {"/cgi/setting/host", "addr=10.0.0.1", 409, NULL},
        {"/cgi/setting/host", "dport=2368&tport=8308", 200, NULL},
        {"/cgi/setting/host", "dport=2369", 409, NULL},
        {"/cgi/setting/host", "tport=0", 400, NULL},
        {"/cgi/setting/net", "dhcp=on", 409, NULL},
        {"/cgi/setting/phaselock", "enabled=off&offsetInput=0.0", 200, "HEAD:PHASE:LOCK OFF"},
        {"/cgi/setting/phaselock", "enabled=on&offsetInput=90", 200, "HEAD:PHASE:LOCK ON"},
        {"/cgi/setting/phaselock", "offset=18005&offsetInput=180.05", 200, "HEAD:PHASE 180.05"},
        {"/cgi/setting/phaselock", "offset=110.00000000000001&offsetInput=1.1", 200, "HEAD:PHASE 1.10"}, /* 100 * 1.1 */
        {"/cgi/setting/phaselock", "enabled=1", 400, NULL},
        {"/cgi/setting/phaselock", "offset=0&offsetInput=360", 400, NULL},
        {"/cgi/setting/phaselock", "offset=35999&offsetInput=359.99", 200, "HEAD:PHASE 359.99"},
        {"/cgi/setting/phaselock", "offset=35999.00000000001", 200, "HEAD:PHASE 359.99"},
        {"/cgi/setting/phaselock", "offset=35999.5", 400, NULL}, /* nearer to 36000, which is not allowed */
        {"/cgi/setting/phaselock", "offset=35999.99", 400, NULL},
        {"/cgi/setting/phaselock", "offset=0&offsetInput=359.995", 400, NULL},
        {"/cgi/setting/phaselock", "offset=36000", 400, NULL},
        {"/cgi/setting/phaselock", "offset=nan", 400, NULL},
        {"/cgi/save", "data=submit", 200, NULL},
        {"/cgi/save", "data=SUBMIT", 200, NULL},
        {"/cgi/save", "", 200, NULL},
        {"/cgi/save", "submit", 200, NULL}, /* Nebula */
        {"/cgi/save", "submit=submit", 200, NULL},
        {"/cgi/save", "data=x", 400, NULL},
        {"/cgi/save", "submit=x", 400, NULL},
        {"/cgi/save", "reset_system", 400, NULL},
        {"/cgi/save", "submit&data=submit", 400, NULL},
        {"/cgi/reset", "data=x", 400, NULL},
        {"/cgi/reset", "reset_system=1", 400, NULL},
        {"/cgi/reset", "submit", 400, NULL},
        {"/cgi/setting", "submit", 400, NULL},
    };
    uint64_t wrong = 0;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        http_post(cases[i].path, cases[i].form);
        if (http_status() != cases[i].status) fail_msg("%s %s: %s", cases[i].path, cases[i].form, http_answer());
        http_assert_command(cases[i].command);
        wrong += cases[i].status >= 400;
        assert_int_equal(http_rig.count[PROTOCOL_WRONG], wrong);
    }
    assert_int_equal(http_rig.hung_up, 0);
}

/* Clients post the host that they have read. The links have other ports than the device. */
static void test_host_of_the_links(void **state)
{
    (void)state;
    strcpy(http_rig.spec.address, "127.0.0.1");
    http_rig.spec.port = 40368;
    http_rig.spec.position_port = 41308;
    http_renew();
    http_get("/cgi/settings.json");
    assert_non_null(strstr(http_body(), "\"host\":{\"addr\":\"127.0.0.1\",\"dport\":40368,\"tport\":41308},"));
    http_post("/cgi/setting/host", "addr=127.0.0.1&dport=40368&tport=41308");
    assert_int_equal(http_status(), 200);
    http_post("/cgi/setting/host", "tport=8308");
    assert_int_equal(http_status(), 409);
}

/* Where the head keeps settings, /cgi/save has it do so; a head that another session controls can't. */
static void test_save(void **state)
{
    (void)state;
    http_rig.spec.keeps = 1;
    http_renew();
    http_post("/cgi/save", "data=submit");
    assert_int_equal(http_status(), 200);
    http_assert_command("HEAD:STORE");
    http_post("/cgi/save", ""); /* a published client sends no body */
    assert_int_equal(http_status(), 200);
    http_assert_command("HEAD:STORE");
    http_post("/cgi/save", "data=x");
    assert_int_equal(http_status(), 400);
    http_assert_command(NULL);
    http_replies[3] = (struct protocol_rig_reply){"HEAD:STORE", "ERR -203,\"Command protected\"", -203};
    http_post("/cgi/save", "data=submit");
    assert_int_equal(http_status(), 409);
}

/* A client that sends nothing, or half a request, is cut off 30 s after the last whole request: others wait. */
static void test_idle_clients(void **state)
{
    (void)state;
    const int64_t s = 1000000000;
    http_rig.ops->time(http_rig.protocol, 29 * s);
    assert_int_equal(http_rig.hung_up, 0);
    http_post("/cgi/setting", "rpm=600");
    assert_int_equal(http_rig.ops->next_ns(http_rig.protocol), 59 * s);
    http_rig.ops->time(http_rig.protocol, 59 * s - 1);
    assert_int_equal(http_rig.hung_up, 0);
    http_send("GET /cgi");
    http_rig.ops->time(http_rig.protocol, 59 * s);
    assert_int_equal(http_status(), 408);
    assert_int_equal(http_rig.hung_up, 1);
    http_renew();
    http_rig.ops->time(http_rig.protocol, 30 * s);
    assert_int_equal(http_rig.hung_up, 1);
    assert_int_equal(http_rig.n_units, 0);
    http_rig.spec.waits = 1; /* device time may run ahead */
    http_renew();
    http_rig.ops->time(http_rig.protocol, 3600 * s);
    assert_int_equal(http_rig.hung_up, 0);
}

/* A client posts laser and rpm to a head that stands. A rate alone does not start it. */
static void test_head_at_rest(void **state)
{
    (void)state;
    http_replies[0].reply = "idle";
    http_post("/cgi/setting", "laser=off");
    http_assert_command(NULL);
    http_post("/cgi/setting", "rpm=0");
    http_assert_command(NULL);
    http_post("/cgi/setting", "rpm=600");
    http_assert_command("HEAD:LINES 10.000000");
    http_post("/cgi/setting", "laser=on");
    http_assert_command("SCAN:START");
    http_get("/cgi/status.json");
    assert_non_null(strstr(http_body(), "\"motor\":{\"state\":\"Off\",\"rpm\":0,"));
    assert_non_null(strstr(http_body(), "\"laser\":{\"state\":\"Off\"}"));
}

/* A head that spins down can't start. It says so before anything of the form is done. */
static void test_start_during_spin_down(void **state)
{
    (void)state;
    static const struct {
        const char *path, *form;
    } cases[] = {{"/cgi/reset", "data=reset_system"}, {"/cgi/setting", "rpm=900&laser=on"}};
    static const char *const states[] = {"boot", "spin-down", "fault"};
    for (size_t i = 0; i < 6; i++) {
        http_replies[0].reply = states[i / 2];
        http_post(cases[i % 2].path, cases[i % 2].form);
        assert_int_equal(http_status(), 503);
        http_assert_command(NULL);
    }
}

static void test_reset(void **state)
{
    (void)state;
    http_post("/cgi/reset", "data=reset_system");
    assert_int_equal(http_status(), 200);
    assert_string_equal(http_rig.line[0], "HEAD:STATE?");
    assert_string_equal(http_rig.line[1], "HEAD:LINES DEF");
    assert_string_equal(http_rig.line[2], "SCAN:ECHOES DEF");
    assert_string_equal(http_rig.line[3], "HEAD:PHASE DEF");
    assert_string_equal(http_rig.line[4], "HEAD:PHASE:LOCK DEF");
    assert_string_equal(http_rig.line[5], "HEAD:STATE?");
    assert_int_equal(http_rig.n_lines, 6);
    http_replies[0].reply = "idle";
    http_post("/cgi/reset", "data=Reset_System");
    assert_string_equal(http_rig.line[6], "SCAN:START");
}

/* Nebula posts the word alone, lv_velodyne nothing, and others the word as the value of itself. */
static void test_forms_of_reset(void **state)
{
    (void)state;
    static const char *const forms[] = {"", "reset_system", "reset_system=reset_system", "RESET_SYSTEM"};
    for (size_t i = 0; i < sizeof forms / sizeof forms[0]; i++) {
        http_post("/cgi/reset", forms[i]);
        assert_int_equal(http_status(), 200);
        assert_string_equal(http_rig.line[1], "HEAD:LINES DEF");
    }
}

/* The head's refusal is passed on with its words, and the rest of the form is not carried out. */
static void test_refused_by_the_head(void **state)
{
    (void)state;
    static const struct {
        int error, status;
        const char *reply;
    } cases[] = {{-203, 409, "ERR -203,\"Command protected; session 3 has control\""},
                 {-222, 400, "ERR -222,\"Data out of range; allowed 5 to 20\""},
                 {-221, 503, "ERR -221,\"Settings conflict; the head spins down\""}};
    for (int i = 0; i < 3; i++) {
        char text[256];
        http_replies[3] = (struct protocol_rig_reply){"HEAD:LINES", cases[i].reply, cases[i].error};
        http_post("/cgi/setting", "rpm=600&returns=Last");
        assert_int_equal(http_status(), cases[i].status);
        http_assert_command("HEAD:LINES 10.000000");
        snprintf(text, sizeof text, "the head refuses HEAD:LINES 10.000000: %s\n", cases[i].reply);
        assert_string_equal(http_body(), text);
    }
    assert_int_equal(http_rig.hung_up, 0);
}

/* The documents have the fields that clients read. */
static void test_documents(void **state)
{
    (void)state;
    http_get("/cgi/info.json");
    assert_string_equal(http_answer(), "HTTP/1.1 200 OK" END "Connection: keep-alive" END "Cache-Control: no-store" END
                                       "Content-Type: application/json" END "X-Content-Type-Options: nosniff" END
                                       "Content-Length: 88" END END "{\"model\":\"VLP-16\",\"serial\":\"17210001\","
                                       "\"firmware\":\"1.2.3\",\"mac_addr\":\"02-00-00-00-00-00\"}");
    http_get("/cgi/status.json?x=y");
    assert_string_equal(http_body(),
                        "{\"gps\":{\"pps_state\":\"Absent\",\"position\":\"\"},\"motor\":{\"state\":\"On\","
                        "\"rpm\":600,\"lock\":\"Off\",\"phase\":0},\"laser\":{\"state\":\"On\"}}");
    http_rig.utc0_ns = 0;
    http_rig.fix.quality = 4;
    http_rig.fix.lat_deg = -48.1;
    http_rig.fix.lon_deg = 11.999999;
    http_get("/cgi/status.json");
    assert_non_null(strstr(http_body(), "{\"pps_state\":\"Locked\",\"position\":\"48 06.00S 12 00.00E\"}"));
    http_rig.fix.lat_deg = 89.9999; /* the last 0.01 minutes before 90 degrees: 59.994 */
    http_rig.fix.lon_deg = -179.9999;
    http_get("/cgi/status.json");
    assert_non_null(strstr(http_body(), "\"position\":\"89 59.99N 179 59.99W\"}"));
    http_rig.fix.lat_deg = http_rig.fix.lon_deg = 0.0;
    http_get("/cgi/status.json");
    assert_non_null(strstr(http_body(), "\"position\":\"0 00.00N 0 00.00E\"}"));
    http_rig.pps = PROTOCOL_PPS_ERROR;
    http_get("/cgi/status.json");
    assert_non_null(strstr(http_body(), "{\"pps_state\":\"Error\","));
    http_get("/cgi/settings.json");
    assert_string_equal(http_body(),
                        "{\"laser\":\"On\",\"returns\":\"Strongest\",\"rpm\":600,\"fov\":{\"start\":0,\"end\":359},"
                        "\"phaselock\":{\"enabled\":\"Off\",\"offset\":0,\"offsetInput\":0},"
                        "\"host\":{\"addr\":\"255.255.255.255\",\"dport\":2368,\"tport\":8308},"
                        "\"net\":{\"addr\":\"\",\"mask\":\"\",\"gateway\":\"\",\"dhcp\":\"Off\","
                        "\"mac_addr\":\"02-00-00-00-00-00\"}}");
    http_replies[3] = (struct protocol_rig_reply){"HEAD:PHASE:LOCK?", "ON", 0};
    http_replies[4] = (struct protocol_rig_reply){"HEAD:PHASE:EDGE?", "LOCKED,90.004999", 0};
    http_replies[5] = (struct protocol_rig_reply){"HEAD:PHASE?", "90.01", 0};
    http_get("/cgi/settings.json");
    assert_non_null(strstr(http_body(), "\"phaselock\":{\"enabled\":\"On\",\"offset\":9001,\"offsetInput\":90.01},"));
    http_get("/cgi/status.json");
    assert_non_null(strstr(http_body(), "\"rpm\":600,\"lock\":\"On\",\"phase\":9000}"));
    http_replies[5].reply = "359.99"; /* the greatest offset; what rounds to a whole turn is 0 */
    http_get("/cgi/settings.json");
    assert_non_null(strstr(http_body(), "\"offset\":35999,\"offsetInput\":359.99},"));
    http_replies[5].reply = "359.996";
    http_get("/cgi/settings.json");
    assert_non_null(strstr(http_body(), "\"offset\":0,\"offsetInput\":0},"));
    http_replies[2].reply = "FIRSt"; /* the device has no such mode */
    http_get("/cgi/settings.json");
    assert_non_null(strstr(http_body(), "{\"laser\":\"On\",\"returns\":\"\",\"rpm\":600,"));
    http_replies[2].reply = "ALL";
    http_replies[1].reply = "10.166667";
    http_get("/cgi/settings.json");
    assert_non_null(strstr(http_body(), "\"returns\":\"Dual\",\"rpm\":610,"));
    http_get("/cgi/diag.json");
    assert_non_null(strstr(http_body(), "\"lm20_temp\":1126"));
    http_get("/cgi/snapshot.hdl");
    assert_non_null(strstr(http_body(), "\"config\":{\"laser\":\"On\""));
    int depth = 0; /* its brackets are in pairs, and the last one ends it */
    for (const char *at = http_body(); *at != '\0'; at++) {
        depth += (*at == '{') - (*at == '}');
        assert_true(depth > 0 || at[1] == '\0');
    }
    assert_int_equal(depth, 0);
    for (uint32_t i = 0; i < http_rig.n_lines; i++)
        assert_non_null(strchr(http_rig.line[i], '?')); /* reading changes nothing */
}

/* The snapshot has the four documents info, settings, status and diag. */
static void test_snapshot(void **state)
{
    (void)state;
    static const char *const parts[][2] = {{"{\"info\":", "/cgi/info.json"},
                                           {",\"config\":", "/cgi/settings.json"},
                                           {",\"status\":", "/cgi/status.json"},
                                           {",\"diag\":", "/cgi/diag.json"}};
    char want[4096] = "";
    for (int i = 0; i < 4; i++) {
        const size_t n = strlen(want);
        http_get(parts[i][1]);
        snprintf(want + n, sizeof want - n, "%s%s", parts[i][0], http_body());
    }
    strcat(want, "}");
    http_get("/cgi/snapshot.hdl");
    assert_string_equal(http_body(), want);
}

/* A name from a profile stays a string of JSON, and no part of a page. */
static void test_names_are_escaped(void **state)
{
    (void)state;
    snprintf(http_rig.identity.serial, sizeof http_rig.identity.serial, "\"},\\<b>&\n\xc3\xa9");
    http_get("/cgi/info.json");
    assert_non_null(strstr(http_body(), "\"serial\":\"\\u0022},\\u005c\\u003cb\\u003e\\u0026\\u000a\\u00c3\\u00a9\""));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, http_setup, http_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_curl),
        TEST(test_mrpt),
        TEST(test_urllib),
        TEST(test_settings),
        TEST(test_host_of_the_links),
        TEST(test_save),
        TEST(test_idle_clients),
        TEST(test_head_at_rest),
        TEST(test_start_during_spin_down),
        TEST(test_reset),
        TEST(test_forms_of_reset),
        TEST(test_refused_by_the_head),
        TEST(test_documents),
        TEST(test_snapshot),
        TEST(test_names_are_escaped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
