/* SPDX-License-Identifier: MIT */
/* The packets of a link with faults beside those of the clean one: which is found to be which, and when. Real sockets,
 * at addresses that no other process uses; the clock and the ledger are the test's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/link/link.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "tests/unit/clock_rig.h"

#define MS INT64_C(1000000)

enum { PORT = 2368, WAIT_MS = 300 };

static struct link_spec spec, clean;
static struct soak_link link_at;
static int out = -1;

/* The units that the ledger got, by their numbers from 1 on. */
static unsigned units[32];
static uint64_t digests[32];
static uint32_t lens[32];
static int n_units;

void soak_saw_unit(struct soak_link *link, soak_seq seq, uint64_t digest, uint32_t len)
{
    assert_ptr_equal(link, &link_at);
    assert_true(pthread_mutex_trylock(&link->lock) != 0); /* the caller has it */
    assert_true(n_units < 32);
    units[n_units] = (unsigned)(seq - soak_unit(0));
    digests[n_units] = digest;
    lens[n_units++] = len;
    link->begun = 1;
    link->last = seq;
}

static void name_own_address(char *to, size_t len)
{
    const unsigned pid = (unsigned)getpid();
    snprintf(to, len, "127.%u.%u.%u", 16 + (pid >> 16 & 63), pid >> 8 & 255, pid & 255);
}

static int begin(void **state)
{
    (void)state;
    memset(&spec, 0, sizeof spec);
    memset(&link_at, 0, sizeof link_at);
    spec.type = LINK_UDP;
    spec.port = PORT;
    name_own_address(spec.address, sizeof spec.address);
    pthread_mutex_init(&link_at.lock, NULL);
    link_at.datagrams = soak_datagrams_open(&spec, &clean);
    out = socket(AF_INET, SOCK_DGRAM, 0);
    n_units = 0;
    clock_rig_ns = 1000 * MS;
    clock_rig_each_ns = 0;
    return link_at.datagrams != NULL && out >= 0 ? 0 : -1;
}

static int end(void **state)
{
    (void)state;
    soak_datagrams_close(link_at.datagrams);
    close(out);
    return 0;
}

static void send_to(const struct link_spec *to, const void *bytes, size_t len)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)to->port)};
    assert_int_equal(inet_pton(AF_INET, to->address, &at.sin_addr), 1);
    assert_int_equal(sendto(out, bytes, len, 0, (struct sockaddr *)&at, sizeof at), len);
}

/* One packet for each letter: it has four bytes, of which the last is the letter. */
static void send_letters(const struct link_spec *to, const char *letters)
{
    for (const char *at = letters; *at != '\0'; at++)
        send_to(to, (const char[]){'h', 'e', 'a', *at}, 4);
}

static void step(void)
{
    soak_datagrams_step(&link_at);
    assert_int_equal(pthread_mutex_trylock(&link_at.lock), 0);
    pthread_mutex_unlock(&link_at.lock);
}

/* Packets wait for 300 ms, so that the clean ones are there first. */
static void judge_all(void)
{
    step();
    clock_rig_ns += WAIT_MS * MS;
    step();
}

static void expect_units(const unsigned *expected, int n)
{
    assert_int_equal(n_units, n);
    for (int i = 0; i < n; i++)
        assert_int_equal(units[i], expected[i]);
}

static void the_clean_link_is_local(void **state)
{
    struct link_spec given = spec;
    (void)state;
    soak_datagrams_close(link_at.datagrams);
    strcpy(given.interface, "eth0");
    strcpy(given.source, "10.0.0.1");
    given.source_port = 7;
    given.ttl = 3;
    given.protocol = 2;
    given.max_sessions = 5;
    link_at.datagrams = soak_datagrams_open(&given, &clean);
    assert_non_null(link_at.datagrams);
    assert_true(clean.port > 0 && clean.port != given.port);
    assert_true(clean.clean && strcmp(clean.address, "127.0.0.1") == 0);
    assert_true(clean.interface[0] == '\0' && clean.source[0] == '\0' && clean.source_port == 0 && clean.ttl == 0);
    assert_true(clean.protocol == 2 && clean.max_sessions == 5 && clean.type == LINK_UDP);
}

/* Without an address the packets come to 127.0.0.1. */
static void a_port_may_be_taken(void **state)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof at;
    struct link_spec other;
    (void)state;
    assert_null(soak_datagrams_open(&spec, &other)); /* this test has the port */
    assert_int_equal(bind(out, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(getsockname(out, (struct sockaddr *)&at, &len), 0);
    soak_datagrams_close(link_at.datagrams);
    spec.port = ntohs(at.sin_port);
    link_at.datagrams = soak_datagrams_open(&spec, &clean); /* at the link's own address the port is free */
    assert_non_null(link_at.datagrams);
    spec.address[0] = '\0';
    assert_null(soak_datagrams_open(&spec, &other));
    strcpy(spec.address, "127.0.0.256");
    assert_null(soak_datagrams_open(&spec, &other));
    soak_datagrams_close(NULL);
}

static void packets_wait_for_the_clean_ones(void **state)
{
    struct soak_clean_frame frame;
    (void)state;
    assert_int_equal(soak_unit(5), (UINT64_C(1) << 32) + 5);
    assert_int_equal(soak_datagrams_top(&link_at), 0);
    send_letters(&spec, "ab");
    step();
    clock_rig_ns += WAIT_MS * MS - 1;
    send_letters(&clean, "ab");
    step();
    assert_int_equal(n_units, 0);
    assert_int_equal(soak_datagrams_top(&link_at), soak_unit(2));
    clock_rig_ns++;
    step();
    expect_units((const unsigned[]){1, 2}, 2);
    for (unsigned i = 0; i < 2; i++) {
        assert_int_equal(soak_datagrams_get(link_at.datagrams, soak_unit(i + 1), &frame), 1);
        assert_true(frame.digest == digests[i] && frame.len == 4 && lens[i] == 4);
    }
    assert_true(digests[0] != digests[1]);
    assert_int_equal(soak_datagrams_get(link_at.datagrams, soak_unit(0), &frame), 0);
    assert_int_equal(soak_datagrams_get(link_at.datagrams, soak_unit(3), &frame), 0);
    assert_int_equal(soak_datagrams_get(link_at.datagrams, soak_unit(1) + SOAK_RING, &frame), 0);
    assert_int_equal(soak_datagrams_top(&link_at), soak_unit(2));
    assert_true(link_at.bad_units == 0 && link_at.bad_bytes == 0);
}

/* The clean stream is a b a c a d. A packet is taken for the clean one of equal content that is nearest to the expected
 * place, before or after it. Of two that are equally near, the later one counts. */
static void equal_packets_are_told_by_their_place(void **state)
{
    static const struct {
        const char *letters;
        unsigned units[6];
    } rows[] = {{"abacad", {1, 2, 3, 4, 5, 6}},
                {"aa", {1, 3}}, /* b is lost */
                {"acbd", {1, 4, 2, 6}},
                {"da", {6, 5}}, /* place 7 is expected, which is not there */
                {"bca", {2, 4, 5}},
                {"caa", {4, 5, 5}},
                {"aab", {1, 3, 2}}};
    (void)state;
    send_letters(&clean, "abacad");
    step();
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        link_at.begun = n_units = 0;
        send_letters(&spec, rows[i].letters);
        judge_all();
        expect_units(rows[i].units, (int)strlen(rows[i].letters));
    }
    assert_int_equal(link_at.bad_units, 0);
}

/* A packet of unknown content takes the expected place if that one has the same length. Else it is no packet of the
 * stream. */
static void unknown_packets(void **state)
{
    (void)state;
    send_letters(&clean, "abc");
    send_to(&clean, "long", 5);
    send_letters(&spec, "axc");
    send_letters(&spec, "y"); /* place 4 has another length */
    send_to(&spec, "none", 5);
    send_to(&spec, "", 0);
    judge_all();
    expect_units((const unsigned[]){1, 2, 3, 4}, 4);
    struct soak_clean_frame frame;
    assert_int_equal(soak_datagrams_get(link_at.datagrams, soak_unit(2), &frame), 1);
    assert_true(frame.digest != digests[1] && lens[1] == 4 && lens[3] == 5);
    assert_int_equal(link_at.bad_units, 2);
    assert_int_equal(link_at.bad_bytes, 4);
}

/* A packet is sought among 4096 places, the expected one included. */
static void far_packets_are_not_sought(void **state)
{
    enum { FAR = 4096 };
    (void)state;
    for (uint32_t i = 1; i <= FAR + 1; i++) {
        send_to(&clean, &i, sizeof i);
        if (i % 100 == 0) step(); /* before the socket's buffer is full */
    }
    step();
    assert_int_equal(soak_datagrams_top(&link_at), soak_unit(FAR + 1));
    const uint32_t too_far = FAR + 1, near = FAR;
    send_to(&spec, &too_far, sizeof too_far);
    judge_all();
    expect_units((const unsigned[]){1}, 1); /* it counts as the expected one, changed */
    link_at.begun = n_units = 0;
    send_to(&spec, &near, sizeof near);
    judge_all();
    expect_units((const unsigned[]){FAR}, 1);
}

/* The end waits for twice as long as packets do, so those on their way are compared, too. */
static void the_last_packets_are_taken(void **state)
{
    (void)state;
    send_letters(&clean, "ab");
    send_letters(&spec, "ab");
    clock_rig_each_ns = 45 * MS;
    const int64_t from_ns = clock_rig_ns;
    soak_datagrams_finish(&link_at);
    expect_units((const unsigned[]){1, 2}, 2);
    assert_in_range(clock_rig_ns, from_ns + 2 * WAIT_MS * MS, from_ns + 4 * WAIT_MS * MS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_clean_link_is_local, begin, end),
        cmocka_unit_test_setup_teardown(a_port_may_be_taken, begin, end),
        cmocka_unit_test_setup_teardown(packets_wait_for_the_clean_ones, begin, end),
        cmocka_unit_test_setup_teardown(equal_packets_are_told_by_their_place, begin, end),
        cmocka_unit_test_setup_teardown(unknown_packets, begin, end),
        cmocka_unit_test_setup_teardown(far_packets_are_not_sought, begin, end),
        cmocka_unit_test_setup_teardown(the_last_packets_are_taken, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
