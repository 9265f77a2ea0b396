/* SPDX-License-Identifier: MIT */
/* What a link reports, and what its owner does then: clients that come, go and send, clients that are turned away,
 * messages, and failures. A client in memory lets the owner work turn by turn; the reports are those of the test. */
#include "tests/unit/session_rig.h"

#include <errno.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "drivers/link/memory.h"

static struct link_memory memory;
static struct link_event event; /* of the next turn, if it has one */
static int has_event, poll_fails, asked_ms, unread;
static uint32_t asked_write;
static const char *sent; /* by the client */

static int own_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *events, int max)
{
    (void)link, (void)wake_fd;
    assert_true(max > 0);
    asked_ms = timeout_ms;
    asked_write = want_write;
    if (poll_fails != 0) {
        errno = poll_fails;
        return SH_EIO;
    }
    events[0] = event;
    const int n = has_event;
    has_event = 0;
    return n;
}

static ssize_t own_read(void *link, int session, void *buf, size_t len)
{
    (void)link;
    assert_int_equal(session, 2);
    assert_true(strlen(sent) <= len);
    memcpy(buf, sent, strlen(sent));
    return (ssize_t)strlen(sent);
}

static int count_unread(void *link, int session)
{
    (void)link;
    return session == 2 ? unread : 0;
}

static uint64_t count_refused(const void *link)
{
    (void)link;
    return 4;
}

static void turn(void)
{
    memory.turn(memory.owner, 70);
}

/* Lets the link report something of session 2. */
static void turn_with(enum link_event_kind kind, const char *text)
{
    event = (struct link_event){.kind = kind, .session = 2};
    snprintf(event.peer, sizeof event.peer, "%s", text);
    has_event = 1;
    turn();
}

static int setup(void **state)
{
    struct sh_err err;
    const int rc = session_setup(state);
    memset(&memory, 0, sizeof memory);
    has_event = poll_fails = unread = 0;
    own_link.poll = own_poll;
    own_link.read = own_read;
    pump.client = &memory;
    pump.wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    pump.listener = stream_listen(&stream, pump.wake_fd, 1);
    links.pump[0] = &pump;
    links.n = 1;
    return rc == 0 ? pump_start(&pump, &err) : rc;
}

static int teardown(void **state)
{
    own_link.poll = NULL;
    own_link.read = NULL;
    own_link.unread = NULL;
    own_link.refused = NULL;
    close(pump.wake_fd);
    return session_teardown(state);
}

static void open_client(void)
{
    turn_with(LINK_OPENED, "1.2.3.4:5");
    expect_log("create |open 0|session 3 own 1.2.3.4:5|");
    assert_true(s->open && !s->shut);
    assert_string_equal(s->peer, "1.2.3.4:5");
}

static void clients_come_and_go(void **state)
{
    (void)state;
    open_client();
    turn_with(LINK_CLOSED, "");
    expect_log("destroy|");
    assert_true(!s->open && n_warned == 0);
    turn_with(LINK_CLOSED, ""); /* it is gone already */
    expect_log("");
    pump.is_off = 1;
    turn_with(LINK_OPENED, "1.2.3.4:5"); /* nobody is there without power */
    expect_log("end 2|");
    assert_int_equal(s->open, 0);
}

static void bytes_of_a_client_are_read(void **state)
{
    (void)state;
    open_client();
    sent = "hello";
    does.n_answers = 1;
    turn_with(LINK_READABLE, "");
    expect_log("heard 3 hello|in 5 h|out answer|");
    turn_with(LINK_CLOSED, "");
    logged[0] = '\0';
    turn_with(LINK_READABLE, ""); /* of a session that is over */
    expect_log("");
}

/* A client that sends nothing more gets what is due to it. Then its session ends. */
static void a_client_is_shut(void **state)
{
    (void)state;
    open_client();
    does.owes = 1;
    turn_with(LINK_SHUT, "");
    assert_int_equal(s->shut, 1);
    expect_log("");
    does.owes = 0;
    turn();
    expect_log("end 2|");
}

static void what_a_link_says_is_passed_on(void **state)
{
    (void)state;
    turn_with(LINK_REFUSED, "all places are taken");
    expect_log("report all places are taken|");
    assert_int_equal(n_warned, 0);
    turn_with(LINK_NOTICE, "something to know");
    assert_string_equal(warned, "link here: something to know");
    turn_with(LINK_WOKEN, "");
    turn_with(LINK_WRITABLE, "");
    turn_with(LINK_PLUGGED, "");
    expect_log("");
    assert_int_equal(n_warned, 1);
}

/* The run fails by the first link that could not be written, and each is warned of. */
static void a_link_that_fails_is_reported(void **state)
{
    (void)state;
    static const char *const why[] = {"it broke", "it broke again"};
    for (int i = 0; i < 2; i++) {
        char text[128];
        link_fails = 0;
        turn_with(LINK_OPENED, "1.2.3.4:5");
        spec.host.send(spec.host.ctx, "unit", 4);
        link_fails = SH_EIO;
        turn();
        assert_true(pump.failed && !s->open && n_warned == i);
        turn_with(LINK_CLOSED, why[i]);
        snprintf(text, sizeof text, "link here: %s; the rest of the stream is missing there", why[i]);
        assert_string_equal(warned, text);
        assert_true(!pump.failed && n_warned == i + 1);
        assert_true(atomic_load(&links.failed) == 1 && links.error.code == SH_EIO);
        assert_string_equal(links.error.text, "link here: it broke; it is cut short");
    }
}

static void a_poll_that_fails_ends_the_link(void **state)
{
    (void)state;
    assert_int_equal(atomic_load(&links.n_busy), 1);
    poll_fails = EMFILE;
    turn();
    assert_string_equal(warned,
                        "link here: the wait for its clients failed: Too many open files; the rest of the stream "
                        "is missing there");
    assert_true(atomic_load(&links.failed) == 1 && links.error.code == SH_EIO); /* the run fails, too */
    assert_string_equal(links.error.text,
                        "link here: the wait for its clients failed: Too many open files; it is cut short");
    assert_true(memory.over == 1 && pump.is_done && atomic_load(&links.n_busy) == 0);
    turn(); /* does nothing more */
    assert_int_equal(n_warned, 1);
}

/* The wait is as long as the client allows. It is short once the run is over, and none where work is left. */
static void waits_are_as_long_as_they_may(void **state)
{
    (void)state;
    turn();
    assert_int_equal(asked_ms, 0); /* the first one */
    turn();
    assert_int_equal(asked_ms, 70);
    open_client();
    link_room = 0;
    spec.host.send(spec.host.ctx, "unit", 4);
    turn();
    turn();
    assert_int_equal(asked_write, 1u << 2);
    atomic_store(&stream.over, 1);
    turn();
    assert_int_equal(asked_ms, 50);
    link_room = SIZE_MAX;
    turn();
    assert_int_equal(memory.over, 0);
    turn();
    assert_int_equal(memory.over, 1);
}

static void bytes_that_nobody_reads_are_warned_of(void **state)
{
    (void)state;
    open_client();
    own_link.unread = count_unread;
    unread = 7;
    atomic_store(&stream.over, 1);
    turn();
    assert_int_equal(memory.over, 0);
    pump_join(&pump);
    assert_string_equal(warned, "link own: its reader did not read 7 bytes or more from the system; they are lost");
    assert_int_equal(pump.is_done, 1);
    pump_join(&pump);
    assert_int_equal(n_warned, 1);
}

/* Units that the system refused were not sent. */
static void refused_units_are_lost(void **state)
{
    (void)state;
    struct link_counts counts;
    pump.counts.sent_units = 10;
    pump.counts.lost_units = 1;
    pump_get_counts(&pump, &counts);
    assert_true(counts.sent_units == 10 && counts.lost_units == 1);
    own_link.refused = count_refused;
    pump_get_counts(&pump, &counts);
    assert_true(counts.sent_units == 6 && counts.lost_units == 5);
    pump.counts.sent_units = 3; /* the system counts what other sessions sent before */
    pump_get_counts(&pump, &counts);
    assert_true(counts.sent_units == 0 && counts.lost_units == 4);
}

#define TURN_BY_TURN(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TURN_BY_TURN(clients_come_and_go),
        TURN_BY_TURN(bytes_of_a_client_are_read),
        TURN_BY_TURN(a_client_is_shut),
        TURN_BY_TURN(what_a_link_says_is_passed_on),
        TURN_BY_TURN(a_link_that_fails_is_reported),
        TURN_BY_TURN(a_poll_that_fails_ends_the_link),
        TURN_BY_TURN(waits_are_as_long_as_they_may),
        TURN_BY_TURN(bytes_that_nobody_reads_are_warned_of),
        TURN_BY_TURN(refused_units_are_lost),
    };
    return cmocka_run_group_tests_name("events of a link", tests, NULL, NULL);
}
