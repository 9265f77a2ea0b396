/* SPDX-License-Identifier: MIT */
/* A SICK scanner asks a time server, which this test plays, and its scans have the server's time. The expected times
 * are computed here from the request that came and the delay that the scanner reports. */
#include <endian.h>
#include <math.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "drivers/protocol/cola_clock.h"
#include "tests/wire/cola_client.h"
#include "tests/wire/room.h"

#define SECOND_US INT64_C(1000000)

/* ---- the server */

static struct server {
    int fd, port;
    uint8_t request[48];
    struct sockaddr_in from;
} server;

/* Returns T1 of the next request, in s since 1900. */
static double server_wait(void)
{
    struct pollfd slot = {.fd = server.fd, .events = POLLIN};
    socklen_t len = sizeof server.from;
    uint32_t words[2];
    assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
    assert_int_equal(
        recvfrom(server.fd, server.request, sizeof server.request, MSG_TRUNC, (struct sockaddr *)&server.from, &len),
        48);
    memcpy(words, server.request + 40, sizeof words);
    return be32toh(words[0]) + 0x1p-32 * be32toh(words[1]);
}

/* Answers with times T2 = T3, s since 1900, a leap indicator and a stratum. kiss: 4 characters of the reference. */
static void server_answer(double t_s, int leap, int stratum, const char *kiss)
{
    uint8_t packet[48] = {(uint8_t)(leap << 6 | 4 << 3 | 4), (uint8_t)stratum, 0, 0xec};
    const uint32_t words[2] = {htobe32((uint32_t)t_s), htobe32((uint32_t)((t_s - floor(t_s)) * 0x1p32))};
    memcpy(packet + 12, kiss, 4);
    memcpy(packet + 24, server.request + 40, 8);
    memcpy(packet + 32, words, 8);
    memcpy(packet + 40, words, 8);
    assert_int_equal(
        sendto(server.fd, packet, sizeof packet, 0, (const struct sockaddr *)&server.from, sizeof server.from), 48);
}

/* ---- the scanner */

static const double SECONDS_1900 = 2208988800.0; /* until 1970 */
static const double SERVER_S = 1767323045.25;    /* 2026-01-02T03:04:05.25Z; exact in binary */

static struct head head;
static struct cola_client scanner;

/* Returns the number of seconds that a variable has, a float as hexadecimal. */
static double read_s(const char *name)
{
    char request[40];
    uint32_t bits;
    float s;
    snprintf(request, sizeof request, "sRN %s", name);
    const char *answer = cola_client_ask(&scanner, request);
    assert_non_null(answer);
    assert_int_equal(sscanf(answer, "sRA %*s %" SCNx32, &bits), 1);
    memcpy(&s, &bits, sizeof s);
    return s;
}

/* Reads the next scan's start by the counter since power-up, and by the date behind its data, both in us. */
static void read_times(int64_t *start_us, int64_t *date_us)
{
    struct cola_date d;
    unsigned us;
    int64_t ns;
    const char *scan = cola_client_ask(&scanner, "sRN LMDscandata");
    assert_non_null(scan);
    assert_int_equal(sscanf(scan, "sRA LMDscandata 1 1 %*s 0 0 %*X %*X %X", &us), 1);
    const char *at = scan + strlen(scan);
    for (int blanks = 0; blanks < 9; blanks += *at == ' ') /* 1, seven numbers of the time, and 0 */
        at--;
    assert_int_equal(
        sscanf(at, " 1 %X %X %X %X %X %X %X 0", &d.year, &d.month, &d.day, &d.hour, &d.minute, &d.second, &d.us), 7);
    assert_true(cola_date_ns(&d, &ns));
    *start_us = us;
    *date_us = ns / 1000;
}

/* Date less counter, which only a set clock changes. */
static int64_t read_shift_us(void)
{
    int64_t start_us, date_us;
    read_times(&start_us, &date_us);
    return date_us - start_us;
}

/* Starts both. `more` is YAML. The session is logged in, and its scans have the time. */
static void scanner_start(void **state, const char *more)
{
    struct wire *wire = *state;
    char ntp[256];
    server.fd = wire_bind(SOCK_DGRAM, &server.port);
    snprintf(ntp, sizeof ntp, "ntp: {port: %d}\n%s", server.port, more);
    const struct room_config config = {.profile = "sick-lms111",
                                       .prr_hz = 36000,
                                       .lines_hz = 50,
                                       .links =
                                           "links: [{type: tcp, port: 0, protocol: cola}, {type: pty, path: native}]\n",
                                       .more = ntp};
    room_write(wire);
    head = head_start(wire, room_config_write(wire, &config), NULL);
    scanner = (struct cola_client){.fd = raw_connect(head_endpoint(&head, "tcp"))};
    cola_client_expect(&scanner, "sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
    cola_client_expect(&scanner, "sWN LMDscandatacfg 1 0 0 0 0 0 0 0 0 0 1 1", "sWA LMDscandatacfg");
}

static void scanner_end(void)
{
    close(scanner.fd);
    close(server.fd);
    head_end(&head, SIGTERM);
}

/* Lets the scanner ask the server. Returns T1 of its first request. */
static double ask_first(void)
{
    cola_client_expect(&scanner, "sWN TSCRole 1", "sWA TSCRole");
    return server_wait();
}

static int has_state(const char *reply, const char *state)
{
    return strncmp(reply, state, strlen(state)) == 0 && reply[strlen(state)] == ',';
}

/* Asks until the state is one of two words. Returns the reply. */
static const char *until_states(struct scanhead *sh, const char *state, const char *other)
{
    int64_t since_ns = 0;
    for (;;) {
        const char *reply = client_ask(sh, "TIME:SERVer? STATe");
        if (has_state(reply, state) || has_state(reply, other)) return reply;
        wire_soon(&since_ns, client_time_ns(sh), state);
    }
}

static const char *until_state(struct scanhead *sh, const char *state)
{
    return until_states(sh, state, state);
}

/* Lets it ask again, at most a second after the last request: any change of its settings begins anew with the
 * server. */
static double ask_again(void)
{
    static int update_s = 60;
    char request[40];
    snprintf(request, sizeof request, "sWN TSCTCupdatetime +%d", ++update_s);
    cola_client_expect(&scanner, request, "sWA TSCTCupdatetime");
    return server_wait();
}

/* An answer of the server. */
struct reply {
    double t_s; /* since 1970, or after T1 */
    int after_t1, leap, stratum;
    const char *kiss;
};

/* Answers the request of T1, and waits for the state that follows from it. The head waits a second for an answer. On a
 * busy machine an answer may come later. Then the head asks again. Returns T1 of the request that was answered in
 * time. */
static double serve(struct scanhead *sh, double t1_s, struct reply r, const char *state)
{
    for (;;) {
        server_answer(r.t_s + (r.after_t1 ? t1_s : SECONDS_1900), r.leap, r.stratum, r.kiss);
        if (has_state(until_states(sh, state, "SILENT"), state)) return t1_s;
        t1_s = ask_again();
    }
}

static struct reply at(double t_s)
{
    return (struct reply){t_s, 0, 0, 1, "TEST"};
}

static struct reply after_t1(double t_s)
{
    return (struct reply){t_s, 1, 0, 1, "TEST"};
}

/* ---- the tests */

/* The scanner is set up as sick_scan_xd does. Scans have dates before the answer, after it, and with no further answer.
 * The head's clock gains 500 us a second. */
static void scans_have_the_servers_time(void **state)
{
    int64_t start_us, date_us, later_us, later_date_us;
    scanner_start(state, "time: {drift_ppm: 500}\n");
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    read_times(&start_us, &date_us); /* 1970, and the clock's gain. Both times are rounded down to 1 us */
    assert_true(llabs(date_us - start_us - start_us / 2000) <= 2);

    cola_client_expect(&scanner, "sWN TSCTCInterface 0", "sWA TSCTCInterface");
    cola_client_expect(&scanner, "sWN TSCTCSrvAddr 7F 00 00 01", "sWA TSCTCSrvAddr");
    cola_client_expect(&scanner, "sWN TSCTCupdatetime 5", "sWA TSCTCupdatetime");
    double t1_s = ask_first();
    static const uint8_t rest[39] = {0};
    assert_int_equal(server.request[0], 0x23); /* version 4, client */
    assert_memory_equal(server.request + 1, rest, sizeof rest);
    t1_s = serve(sh, t1_s, at(SERVER_S), "SET") - SECONDS_1900;

    /* T4 = T1 + delay, since T2 = T3. The time is a double of 0.25 us near 2^32 s; delay is a float of 24 bits */
    const double delay_s = read_s("TSCTCdelay");
    assert_true(delay_s > 0.0 && delay_s <= 1.0);
    const double offset_us = 1e6 * (SERVER_S - t1_s - delay_s / 2);
    read_times(&start_us, &date_us);
    assert_true(fabs((double)(date_us - start_us - start_us / 2000) - offset_us) <= 4.0);
    for (int i = 0; i < 20; i++) /* 0.4 s, in which it gains 200 us */
        read_times(&later_us, &later_date_us);
    const int64_t passed_us = later_us - start_us;
    assert_true(llabs(later_date_us - date_us - passed_us - passed_us / 2000) <= 3);
    cola_client_expect(&scanner, "sMN LSPsetdatetime 7E8 1 1 0 0 0 0", "sAN LSPsetdatetime 0"); /* the server sets it */
    assert_true(read_s("TSCTCmaxoffset") == 18000.0);
    scanhead_close(sh);
    scanner_end();
}

/* Takes errors up to this report of the server. On a busy machine there are more, of answers that came late. */
static void expect_report(struct scanhead *sh, const char *text)
{
    struct scanhead_frame frame;
    do
        client_until_soon(sh, SCANHEAD_EV_ERROR, &frame);
    while (strstr(frame.event_text, text) == NULL);
}

/* A wrong, a silent and a refusing server set nothing; a time zone adds hours. Refused answers leave the clock as it
 * is. */
static void wrong_servers(void **state)
{
    int64_t start_us, date_us;
    scanner_start(state, "");
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    cola_client_expect(&scanner, "sWN TSCTCupdatetime +60", "sWA TSCTCupdatetime");
    cola_client_expect(&scanner, "sWN TSCTCtimezone D", "sWA TSCTCtimezone"); /* an hour ahead */
    ask_first();
    server.request[47] ^= 1; /* an answer to another request is passed over */
    server_answer(SERVER_S + SECONDS_1900, 0, 1, "TEST");
    server.request[47] ^= 1;
    serve(sh, 0.0, (struct reply){SERVER_S, 0, 3, 1, "TEST"}, "UNSYNCHRONISED");
    expect_report(sh, "127.0.0.1: is not synchronised");
    assert_true(llabs(read_shift_us()) <= 1); /* still 1970 */
    serve(sh, ask_again(), at(SERVER_S), "SET");
    read_times(&start_us, &date_us);
    const int64_t shift_us = date_us - start_us, since_us = date_us - (int64_t)(1e6 * SERVER_S) - 3600 * SECOND_US;
    assert_true(since_us > -SECOND_US && since_us < SOON_MS * 1000); /* the zone, and not the moment, is tested here */

    const double t1_s = ask_again(); /* by UTC; the clock shows local time */
    assert_true(fabs(t1_s - SECONDS_1900 - SERVER_S) < 1e-3 * SOON_MS);
    serve(sh, t1_s, after_t1(18001.0), "OFFSET");
    serve(sh, ask_again(), (struct reply){3.0, 1, 0, 0, "DENY"}, "KISS");
    expect_report(sh, "127.0.0.1: kiss-o'-death DENY, it is asked no more");
    assert_true(llabs(read_shift_us() - shift_us) <= 2);

    serve(sh, ask_again(), after_t1(17999.0), "SET"); /* a step within the limit is taken */
    const int64_t step_us = read_shift_us() - shift_us;
    assert_true(step_us <= 17999 * SECOND_US + 2 &&
                step_us > 17998 * SECOND_US); /* less half of the delay, below 1 s */
    /* The limit is for a clock that this role has set. Switched off and at once on again, the role has set none. */
    static const char both[] = "\2sWN TSCRole 0\3\2sWN TSCRole 1\3";
    raw_send(scanner.fd, both, sizeof both - 1);
    for (int i = 0; i < 2; i++)
        assert_string_equal(cola_client_next(&scanner), "sWA TSCRole");
    serve(sh, server_wait(), after_t1(20000.0), "SET");
    ask_again();
    unsigned good, refused, none;
    assert_int_equal(sscanf(until_state(sh, "SILENT"), "SILENT,%*d,%*d,%*d,%u,%u,%u", &good, &refused, &none), 3);
    assert_int_equal(good, 3);
    assert_int_equal(refused, 3);
    assert_true(none >= 1);                                                        /* more where answers came late */
    cola_client_expect(&scanner, "sWN TSCTCSrvAddr C0 0 2 1", "sWA TSCTCSrvAddr"); /* 192.0.2.1: not this machine */
    until_state(sh, "REFUSED");
    expect_report(sh, "192.0.2.1: is not asked, since it is not on this machine; see ntp.anywhere");
    cola_client_reboot(&scanner, &head);
    cola_client_expect(&scanner, "sRN TSCRole", "sRA TSCRole 0");
    cola_client_expect(&scanner, "sRN TSCTCdelay", "sRA TSCTCdelay 00000000");
    scanhead_close(sh);
    scanner_end();
}

/* RATE: from then on it asks half as often. T1 of the requests tells their times by the scanner's own clock, which no
 * answer sets. A request is late by what its thread waits for the processor. */
static void a_kiss_slows_it_down(void **state)
{
    scanner_start(state, "");
    cola_client_expect(&scanner, "sWN TSCTCupdatetime 1", "sWA TSCTCupdatetime");
    const double first_s = ask_first();
    server_answer(first_s, 0, 0, "RATE");
    const double late_s = server_wait() - first_s - 2.0;
    assert_true(late_s > -0.5 &&
                late_s < 1e-3 * SOON_MS); /* below 0 where the first one was late; -1 without the kiss */
    scanner_end();
}

/* A client that writes again and again makes it ask no more often than once a second, by its own clock. */
static void it_never_floods_a_server(void **state)
{
    scanner_start(state, "");
    const double t1_s = ask_first();
    assert_true(ask_again() - t1_s > 0.5); /* a second, less the delay of the first T1 */
    scanner_end();
}

/* Leaves the head without a free descriptor. Returns its limit as it was. */
static struct rlimit take_descriptors(void)
{
    char path[64];
    struct rlimit before, none;
    struct stat st;
    int next = 0;
    do
        snprintf(path, sizeof path, "/proc/%d/fd/%d", (int)head.pid, next++);
    while (lstat(path, &st) == 0);
    assert_int_equal(prlimit(head.pid, RLIMIT_NOFILE, NULL, &before), 0);
    none = (struct rlimit){.rlim_cur = (rlim_t)next - 1, .rlim_max = before.rlim_max};
    assert_int_equal(prlimit(head.pid, RLIMIT_NOFILE, &none, NULL), 0);
    return before;
}

/* The head has no socket for its requests. The head says so, and tries again after the time between two requests. */
static void it_tries_again_without_a_way(void **state)
{
    struct scanhead_frame frame;
    scanner_start(state, "");
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    cola_client_expect(&scanner, "sWN TSCTCupdatetime 1", "sWA TSCTCupdatetime");
    const struct rlimit before = take_descriptors();
    cola_client_expect(&scanner, "sWN TSCRole 1", "sWA TSCRole");
    until_state(sh, "SILENT");
    client_until_soon(sh, SCANHEAD_EV_ERROR, &frame);
    assert_non_null(strstr(frame.event_text, "127.0.0.1: there is no way to this server"));
    assert_int_equal(prlimit(head.pid, RLIMIT_NOFILE, &before, NULL), 0);
    serve(sh, server_wait(), at(SERVER_S), "SET");
    scanhead_close(sh);
    scanner_end();
}

/* Adds a fault, and waits until the command has taken effect: 100 ms of the head's time. */
static void inject(struct scanhead *sh, const char *fault)
{
    char line[80];
    snprintf(line, sizeof line, "FAUL:ADD %s", fault);
    client_ask(sh, line);
    const int64_t from_ns = client_time_ns(sh);
    while (client_time_ns(sh) < from_ns + 100000000)
        continue;
}

/* The same by injected faults, which a client adds and takes out: the server itself answers rightly. */
static void injected_faults(void **state)
{
    static const struct {
        const char *fault, *state;
    } cases[] = {{"{kind: ntp_unsync}", "UNSYNCHRONISED"},
                 {"{kind: ntp_kiss}", "KISS"},
                 {"{kind: ntp_silent}", "SILENT"},
                 {"{kind: ntp_step, jump_s: -18001}", "OFFSET"}};
    scanner_start(state, "");
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    serve(sh, ask_first(), at(SERVER_S), "SET");
    const int64_t shift_us = read_shift_us();
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        inject(sh, cases[i].fault);
        serve(sh, ask_again(), after_t1(0.0), cases[i].state);
        client_tell(sh, "FAUL:CLE ALL");
    }
    assert_true(llabs(read_shift_us() - shift_us) <= 2);
    inject(sh, "{kind: ntp_step, jump_s: 100}"); /* this one is believed */
    serve(sh, ask_again(), after_t1(0.0), "SET");
    const int64_t step_us = read_shift_us() - shift_us;
    assert_true(step_us <= 100 * SECOND_US + 2 && step_us > 99 * SECOND_US); /* less half of the delay, below 1 s */
    scanhead_close(sh);
    scanner_end();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(scans_have_the_servers_time, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(wrong_servers, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_kiss_slows_it_down, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(it_never_floods_a_server, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(it_tries_again_without_a_way, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(injected_faults, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("time server", tests, NULL, NULL);
}
