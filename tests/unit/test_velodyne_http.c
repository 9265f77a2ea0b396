/* The settings of a VLP-16 over HTTP, from bytes to bytes: what known clients send, and what others do. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "core/rng.h"
#include "tests/common/protocol_rig.h"

static struct protocol_rig rig;
static struct protocol_rig_reply replies[6];

#define END "\r\n"

static int setup(void **state)
{
    (void)state;
    protocol_rig_open(&rig, PROTOCOL_VELODYNE_HTTP, "Velodyne", "VLP-16");
    replies[0] = (struct protocol_rig_reply){"HEAD:STATE?", "scanning", 0};
    replies[1] = (struct protocol_rig_reply){"HEAD:LINES?", "10", 0};
    replies[2] = (struct protocol_rig_reply){"SCAN:ECHOES?", "STRongest", 0};
    replies[3] = (struct protocol_rig_reply){NULL, NULL, 0};
    rig.replies = replies;
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    protocol_rig_close(&rig);
    return 0;
}

/* Another session. The rig itself is 4 MB, and stays. */
static void renew(void)
{
    struct sh_err err;
    rig.ops->destroy(rig.protocol);
    assert_int_equal(rig.ops->create(&rig.spec, &rig.protocol, &err), SH_OK);
    rig.ops->open(rig.protocol, 0);
    protocol_rig_clear(&rig);
    rig.hung_up = 0;
    memset(rig.count, 0, sizeof rig.count);
}

/* All bytes that came back, as text. */
static const char *answer(void)
{
    assert_true(rig.len < RIG_BYTES);
    rig.bytes[rig.len] = '\0';
    return (const char *)rig.bytes;
}

static void send_text(const char *text)
{
    protocol_rig_clear(&rig);
    protocol_rig_input(&rig, text);
}

/* As curl 7.88 does with --data. */
static void post(const char *path, const char *form)
{
    char text[2008];
    snprintf(text, sizeof text,
             "POST %s HTTP/1.1\r\nHost: 127.0.0.1:8080\r\nUser-Agent: curl/7.88.1\r\nAccept: */*\r\n"
             "Content-Length: %zu\r\nContent-Type: application/x-www-form-urlencoded\r\n\r\n%s",
             path, strlen(form), form);
    send_text(text);
}

static void get(const char *path)
{
    char text[256];
    snprintf(text, sizeof text, "GET %s HTTP/1.1\r\nHost: x\r\n\r\n", path);
    send_text(text);
}

static int status(void)
{
    int number = 0;
    assert_int_equal(sscanf(answer(), "HTTP/1.1 %d ", &number), 1);
    return number;
}

static const char *body(void)
{
    const char *end = strstr(answer(), "\r\n\r\n");
    assert_non_null(end);
    return end + 4;
}

/* A command that changes something, the only one; NULL: none. */
static void assert_command(const char *line)
{
    const char *found = NULL;
    for (uint32_t i = 0; i < rig.n_lines; i++) {
        if (strchr(rig.line[i], '?') != NULL) continue;
        assert_null(found);
        found = rig.line[i];
    }
    if (line == NULL)
        assert_null(found);
    else
        assert_string_equal(found, line);
}

/* 200 where the device answers 204: MRPT takes that alone. */
#define DONE(connection)                                                              \
    "HTTP/1.1 200 OK" END "Connection: " connection END "Cache-Control: no-store" END \
    "Content-Type: text/plain; charset=us-ascii" END "X-Content-Type-Options: nosniff" END "Content-Length: 0" END END
static const char done[] = DONE("keep-alive");
static const char done_close[] = DONE("close");

/* Byte for byte what clients send, and get. */
static void test_curl(void **state)
{
    (void)state;
    send_text("POST /cgi/setting HTTP/1.1\r\nHost: 192.168.1.201\r\nUser-Agent: curl/7.88.1\r\nAccept: */*\r\n"
              "Content-Length: 7\r\nContent-Type: application/x-www-form-urlencoded\r\n\r\nrpm=600");
    assert_string_equal(answer(), done);
    assert_command("HEAD:LINES 10.000000");
    assert_int_equal(rig.hung_up, 0);
}

/* CVelodyneScanner of MRPT 2.5.8, captured: an Origin that is the device's own address. */
static void test_mrpt(void **state)
{
    (void)state;
    send_text("POST /cgi/setting HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nContent-Length: 12\r\n"
              "Content-Type: application/x-www-form-urlencoded\r\nOrigin: http://127.0.0.1\r\n"
              "Referer: http://127.0.0.1\r\nUpgrade-Insecure-Requests: 1\r\nUser-Agent: MRPT Library\r\n\r\n"
              "returns=Dual");
    assert_string_equal(answer(), done_close);
    assert_command("SCAN:ECHOES ALL");
    assert_int_equal(rig.hung_up, 1);
}

/* Python's urllib: lower-case second words, HTTP/1.1, close. */
static void test_urllib(void **state)
{
    (void)state;
    send_text("POST /cgi/setting HTTP/1.1\r\nAccept-Encoding: identity\r\n"
              "Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 25\r\nHost: 127.0.0.1:8080\r\n"
              "User-Agent: Python-urllib/3.11\r\nConnection: close\r\n\r\nrpm=900&returns=strongest");
    assert_string_equal(answer(), done_close);
    assert_int_equal(rig.n_lines, 2);
    assert_string_equal(rig.line[0], "HEAD:LINES 15.000000");
    assert_string_equal(rig.line[1], "SCAN:ECHOES STRONGEST");
}

/* Each key: what the head is told, or that nothing is. */
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
        {"/cgi/setting/phaselock", "enabled=off&offset=0&offsetInput=0.0", 200, NULL},
        {"/cgi/setting/phaselock", "enabled=on&offset=0", 409, NULL},
        {"/cgi/setting/phaselock", "offset=36000", 400, NULL},
        {"/cgi/setting/phaselock", "offset=nan", 400, NULL},
        {"/cgi/save", "data=submit", 200, NULL},
        {"/cgi/save", "data=x", 400, NULL},
        {"/cgi/reset", "data=x", 400, NULL},
    };
    uint64_t wrong = 0;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        post(cases[i].path, cases[i].form);
        if (status() != cases[i].status) fail_msg("%s %s: %s", cases[i].path, cases[i].form, answer());
        assert_command(cases[i].command);
        wrong += cases[i].status >= 400;
        assert_int_equal(rig.count[PROTOCOL_WRONG], wrong);
    }
    assert_int_equal(rig.hung_up, 0);
}

/* laser and rpm of a head that stands. A rate alone does not set it going. */
static void test_head_at_rest(void **state)
{
    (void)state;
    replies[0].reply = "idle";
    post("/cgi/setting", "laser=off");
    assert_command(NULL);
    post("/cgi/setting", "rpm=0");
    assert_command(NULL);
    post("/cgi/setting", "rpm=600");
    assert_command("HEAD:LINES 10.000000");
    post("/cgi/setting", "laser=on");
    assert_command("SCAN:START");
    get("/cgi/status.json");
    assert_non_null(strstr(body(), "\"motor\":{\"state\":\"Off\",\"rpm\":0,"));
    assert_non_null(strstr(body(), "\"laser\":{\"state\":\"Off\"}"));
}

static void test_reset(void **state)
{
    (void)state;
    post("/cgi/reset", "data=reset_system");
    assert_int_equal(status(), 200);
    assert_string_equal(rig.line[0], "HEAD:LINES DEF");
    assert_string_equal(rig.line[1], "SCAN:ECHOES DEF");
    assert_string_equal(rig.line[2], "HEAD:STATE?");
    assert_int_equal(rig.n_lines, 3);
    replies[0].reply = "idle";
    post("/cgi/reset", "data=reset_system");
    assert_string_equal(rig.line[3], "SCAN:START");
}

/* What the head refuses, with its words; the rest of the form is left alone. */
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
        replies[3] = (struct protocol_rig_reply){"HEAD:LINES", cases[i].reply, cases[i].error};
        post("/cgi/setting", "rpm=600&returns=Last");
        assert_int_equal(status(), cases[i].status);
        assert_command("HEAD:LINES 10.000000");
        snprintf(text, sizeof text, "the head refuses HEAD:LINES 10.000000: %s\n", cases[i].reply);
        assert_string_equal(body(), text);
    }
    assert_int_equal(rig.hung_up, 0);
}

/* Documents: the fields that clients read. */
static void test_documents(void **state)
{
    (void)state;
    get("/cgi/info.json");
    assert_string_equal(answer(), "HTTP/1.1 200 OK" END "Connection: keep-alive" END "Cache-Control: no-store" END
                                  "Content-Type: application/json" END "X-Content-Type-Options: nosniff" END
                                  "Content-Length: 88" END END "{\"model\":\"VLP-16\",\"serial\":\"17210001\","
                                  "\"firmware\":\"1.2.3\",\"mac_addr\":\"02-00-00-00-00-00\"}");
    get("/cgi/status.json?x=y");
    assert_string_equal(body(), "{\"gps\":{\"pps_state\":\"Absent\",\"position\":\"\"},\"motor\":{\"state\":\"On\","
                                "\"rpm\":600,\"lock\":\"Off\",\"phase\":0},\"laser\":{\"state\":\"On\"}}");
    rig.utc0_ns = 0;
    rig.fix.quality = 4;
    rig.fix.lat_deg = -48.1;
    rig.fix.lon_deg = 11.999999;
    get("/cgi/status.json");
    assert_non_null(strstr(body(), "{\"pps_state\":\"Locked\",\"position\":\"48 06.00S 12 00.00E\"}"));
    get("/cgi/settings.json");
    assert_string_equal(body(),
                        "{\"laser\":\"On\",\"returns\":\"Strongest\",\"rpm\":600,\"fov\":{\"start\":0,\"end\":359},"
                        "\"phaselock\":{\"enabled\":\"Off\",\"offset\":0,\"offsetInput\":0},"
                        "\"host\":{\"addr\":\"255.255.255.255\",\"dport\":2368,\"tport\":8308},"
                        "\"net\":{\"addr\":\"\",\"mask\":\"\",\"gateway\":\"\",\"dhcp\":\"Off\","
                        "\"mac_addr\":\"02-00-00-00-00-00\"}}");
    replies[2].reply = "ALL";
    replies[1].reply = "10.166667";
    get("/cgi/settings.json");
    assert_non_null(strstr(body(), "\"returns\":\"Dual\",\"rpm\":610,"));
    get("/cgi/diag.json");
    assert_non_null(strstr(body(), "\"lm20_temp\":1126"));
    get("/cgi/snapshot.hdl");
    assert_non_null(strstr(body(), "\"config\":{\"laser\":\"On\""));
    for (uint32_t i = 0; i < rig.n_lines; i++)
        assert_non_null(strchr(rig.line[i], '?')); /* reading changes nothing */
}

/* A name from a profile stays a string of JSON, and no part of a page. */
static void test_names_are_escaped(void **state)
{
    (void)state;
    snprintf(rig.identity.serial, sizeof rig.identity.serial, "\"},\\<b>&\n\xc3\xa9");
    get("/cgi/info.json");
    assert_non_null(strstr(body(), "\"serial\":\"\\u0022},\\u005c\\u003cb\\u003e\\u0026\\u000a\\u00c3\\u00a9\""));
}

/* One after the other on one connection, in one piece, and byte by byte. */
static void test_pieces(void **state)
{
    (void)state;
    static const char two[] = "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 8\r\n\r\nlaser=on"
                              "\r\nGET /cgi/none HTTP/1.1\r\nhost:x\r\n\r\n"
                              "POST /cgi/setting HTTP/1.1\nHost: x\ncontent-length:7\n\nrpm=600";
    static char whole[1024];
    send_text(two);
    snprintf(whole, sizeof whole, "%s", answer());
    assert_int_equal(strncmp(whole, done, sizeof done - 1), 0);
    assert_non_null(strstr(whole, "HTTP/1.1 404 Not Found"));
    assert_string_equal(whole + strlen(whole) - (sizeof done - 1), done);
    protocol_rig_clear(&rig);
    for (size_t i = 0; i < sizeof two - 1; i++)
        rig.ops->input(rig.protocol, (const uint8_t *)two + i, 1);
    assert_string_equal(answer(), whole);
}

/* What is wrong with a request, and that the connection ends where its end can't be known. */
static void test_broken_requests(void **state)
{
    (void)state;
    static char long_line[700], long_head[4200];
    static const struct {
        const char *text;
        int status, ends;
    } cases[] = {
        {"\x16\x03\x01\x02\x01\x01\r\n\r\n", 400, 1}, /* TLS */
        {"GET\r\n\r\n", 400, 1},
        {"GET  HTTP/1.1\r\n\r\n", 400, 1},
        {"GET / HTTP/1.1 \r\n\r\n", 400, 1},
        {"GET / FTP/1.1\r\n\r\n", 400, 1},
        {"GET / HTTP/2.0\r\n\r\n", 505, 1},
        {"PROPFIND / HTTP/1.1\r\nHost: x\r\n\r\n", 501, 1},
        {"GET /cgi/info.json HTTP/1.1\r\n\r\n", 400, 1}, /* no Host */
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nnonsense\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost : x\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\n folded\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\x01\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nExpect: tea\r\n\r\n", 417, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\n\r\nrpm=600", 411, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n7\r\nrpm=600\r\n0\r\n\r\n", 411,
         1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 7\r\nTransfer-Encoding: x\r\n\r\nrpm=600", 411, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: -7\r\n\r\n", 400, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 7\r\nContent-Length: 7\r\n\r\nrpm=600", 400, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 1025\r\n\r\n", 413, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 18446744073709551623\r\n\r\nrpm=600", 413, 1},
        {long_line, 414, 1},
        {long_head, 431, 1},
        {"GET /cgi/setting HTTP/1.1\r\nHost: x\r\n\r\n", 405, 0},
        {"POST /cgi/info.json HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n", 405, 0},
        {"OPTIONS /cgi/setting HTTP/1.1\r\nHost: x\r\n\r\n", 405, 0},
        {"GET / HTTP/1.1\r\nHost: x\r\n\r\n", 404, 0},
        {"GET /cgi/info.json HTTP/1.0\r\n\r\n", 200, 1},
        {"GET /cgi/info.json HTTP/1.0\r\nConnection: keep-alive\r\n\r\n", 200, 0},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nConnection: TE, close\r\n\r\n", 200, 1},
    };
    memset(long_line, 'a', sizeof long_line - 1);
    memset(long_head, 'a', sizeof long_head - 1);
    memcpy(long_head, "GET / HTTP/1.1\r\nHost: ", 22);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        renew();
        send_text(cases[i].text);
        if (status() != cases[i].status) fail_msg("%s: %s", cases[i].text, answer());
        assert_int_equal(rig.hung_up, cases[i].ends);
        assert_non_null(strstr(answer(), cases[i].ends ? "Connection: close\r\n" : "Connection: keep-alive\r\n"));
        assert_command(NULL);
        assert_int_equal(rig.count[PROTOCOL_WRONG], cases[i].status >= 400);
        if (cases[i].status >= 400 && cases[i].ends)
            assert_int_equal(rig.count[PROTOCOL_INPUT_LOST], strlen(cases[i].text));
        if (!cases[i].ends) continue;
        const size_t len = rig.len;
        get("/cgi/info.json"); /* after the last answer nothing more is answered */
        assert_int_equal(rig.len, 0);
        assert_true(len > 0);
    }
}

/* HEAD: as GET, without the body. */
static void test_head_method(void **state)
{
    (void)state;
    send_text("HEAD /cgi/info.json HTTP/1.1\r\nHost: x\r\n\r\nHEAD /cgi/none HTTP/1.1\r\nHost: x\r\n\r\n");
    assert_int_equal(status(), 200);
    assert_non_null(strstr(answer(), "Content-Length: 88\r\n\r\nHTTP/1.1 404 Not Found"));
    assert_int_equal(strcmp(answer() + strlen(answer()) - 4, "\r\n\r\n"), 0);
}

/* A client that waits for leave to send its body. */
static void test_expect_continue(void **state)
{
    (void)state;
    send_text("POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 7\r\nExpect: 100-continue\r\n\r\n");
    assert_string_equal(answer(), "HTTP/1.1 100 Continue\r\n\r\n");
    protocol_rig_input(&rig, "rpm=");
    assert_string_equal(answer(), "HTTP/1.1 100 Continue\r\n\r\n");
    send_text("600");
    assert_string_equal(answer(), done);
    assert_command("HEAD:LINES 10.000000");
}

/* A browser sends a form of any page to any address, and says whose page it is. */
static void test_pages_from_elsewhere(void **state)
{
    (void)state;
    static const struct {
        const char *origin;
        int status;
    } cases[] = {
        {"http://evil.example", 403}, {"null", 403}, {"https://127.0.0.1:8080", 403}, {"http://127.0.0.1:8080", 200}};
    for (int i = 0; i < 4; i++) {
        char text[256];
        snprintf(text, sizeof text,
                 "POST /cgi/setting HTTP/1.1\r\nHost: 127.0.0.1:8080\r\nOrigin: %s\r\nContent-Length: 7\r\n\r\nrpm=600",
                 cases[i].origin);
        send_text(text);
        assert_int_equal(status(), cases[i].status);
        assert_command(cases[i].status == 200 ? "HEAD:LINES 10.000000" : NULL);
    }
}

/* Nothing that a client sent comes back. */
static void test_nothing_is_reflected(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "GET /<script> HTTP/1.1\r\nHost: <script>\r\n\r\n",
        "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 12\r\n\r\nrpm=<script>",
        "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 10\r\n\r\n<script>=1",
        "<script> / HTTP/1.1\r\nHost: x\r\n\r\n"};
    for (int i = 0; i < 4; i++) {
        send_text(texts[i]);
        assert_true(status() >= 400);
        assert_null(strstr(answer(), "script"));
    }
}

/* Garbage, and whole requests with some bytes wrong, in pieces of all sizes: every answer is one, nothing is
 * written past the buffers (sanitizers), and a new session works. */
static void test_garbage(void **state)
{
    (void)state;
    static const char good[] =
        "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\nContent-Length: 7\r\n\r\nrpm=600"
        "GET /cgi/status.json HTTP/1.1\r\nHost: x\r\n\r\n";
    uint64_t draw = 0;
    for (int round = 0; round < 3000; round++) {
        static uint8_t bytes[8192];
        const size_t len = round % 3 == 0 ? rng_mix(++draw) % sizeof bytes : sizeof good - 1;
        renew();
        for (size_t i = 0; i < len; i++)
            bytes[i] = round % 3 == 0 ? (uint8_t)(rng_mix(++draw) >> 8) : (uint8_t)good[i];
        for (uint64_t n = rng_mix(++draw) % 4; round % 3 != 0 && n > 0; n--) {
            const size_t at = rng_mix(++draw) % len;
            bytes[at] = (uint8_t)rng_mix(++draw);
        }
        for (size_t at = 0, n; at < len; at += n) {
            n = 1 + rng_mix(++draw) % 700;
            if (n > len - at) n = len - at;
            rig.ops->input(rig.protocol, bytes + at, n);
        }
        for (uint32_t i = 0, at = 0; i < rig.n_units; at = (uint32_t)rig.end[i++])
            assert_memory_equal(rig.bytes + at, "HTTP/1.1 ", 9);
    }
    get("/cgi/info.json");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_curl),
        TEST(test_mrpt),
        TEST(test_urllib),
        TEST(test_settings),
        TEST(test_head_at_rest),
        TEST(test_reset),
        TEST(test_refused_by_the_head),
        TEST(test_documents),
        TEST(test_names_are_escaped),
        TEST(test_pieces),
        TEST(test_broken_requests),
        TEST(test_head_method),
        TEST(test_expect_continue),
        TEST(test_pages_from_elsewhere),
        TEST(test_nothing_is_reflected),
        TEST(test_garbage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
