/* SPDX-License-Identifier: MIT */
/* What the poll functions of all links share: events, the wait and the wake-up. poll(2) is the test's. */
#include "tests/common/cases.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include "drivers/link/link_poll.h"

static int poll_error, asked_ms;

int poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    static const struct timespec none = {0, 0};
    asked_ms = timeout_ms;
    if (poll_error != 0) return errno = poll_error, -1;
    return ppoll(fds, n, &none, NULL);
}

static void test_events(void **state)
{
    (void)state;
    struct link_event event[2];
    struct link_events events = {event, 0, 2};
    char longest[300];
    memset(longest, 'p', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    memset(event, 0x55, sizeof event);
    assert_int_equal(link_events_push(&events, LINK_CLOSED, 3, "127.0.0.1:5"), 1);
    assert_int_equal(event[0].kind, LINK_CLOSED);
    assert_int_equal(event[0].session, 3);
    assert_string_equal(event[0].peer, "127.0.0.1:5");
    assert_int_equal(link_events_push(&events, LINK_NOTICE, 0, longest), 1);
    assert_int_equal(strlen(event[1].peer), sizeof event[1].peer - 1);
    assert_int_equal(link_events_push(&events, LINK_OPENED, 0, "late"), 0); /* no room: it is for the next call */
    assert_int_equal(events.n, 2);
    assert_int_equal(event[1].kind, LINK_NOTICE);
    events.n = 0;
    assert_int_equal(link_events_push(&events, LINK_READABLE, 1, NULL), 1);
    assert_string_equal(event[0].peer, "");
}

/* A signal is no failure: nothing counts as come, whatever revents held before. */
static void test_waiting(void **state)
{
    (void)state;
    struct pollfd fds[2] = {{.fd = -1, .revents = POLLIN}, {.fd = -1, .revents = POLLHUP}};
    poll_error = EINTR;
    assert_int_equal(link_wait(fds, 2, 77), SH_OK);
    assert_int_equal(asked_ms, 77);
    assert_int_equal(fds[0].revents | fds[1].revents, 0);
    poll_error = EINVAL;
    assert_int_equal(link_wait(fds, 2, 0), SH_EIO);
    poll_error = 0;
    assert_int_equal(link_wait(fds, 2, 0), SH_OK);
}

static void wake(int fd, uint64_t times)
{
    assert_int_equal(write(fd, &times, sizeof times), sizeof times);
}

/* However often it was signalled, the owner is woken once, and the descriptor is empty then. */
static void test_waking(void **state)
{
    (void)state;
    struct link_event event[1];
    struct link_events events = {event, 0, 0};
    struct pollfd slot = {.fd = eventfd(0, EFD_NONBLOCK), .events = POLLIN};
    uint64_t count;
    link_take_wake(&slot, &events);
    assert_int_equal(events.n, 0);
    wake(slot.fd, 3);
    slot.revents = POLLIN;
    link_take_wake(&slot, &events); /* no room for the event, so it stays signalled */
    events.max = 1;
    link_take_wake(&slot, &events);
    assert_int_equal(events.n, 1);
    assert_int_equal(event[0].kind, LINK_WOKEN);
    assert_int_equal(read(slot.fd, &count, sizeof count), -1);
    const struct pollfd none = {.fd = -1, .revents = POLLIN};
    events.n = 0;
    link_take_wake(&none, &events);
    assert_int_equal(events.n, 0);
    close(slot.fd);
}

static void test_sinks(void **state)
{
    (void)state;
    struct link_event event[2];
    const int fd = eventfd(0, EFD_NONBLOCK);
    struct link_events events = {event, 0, 2};
    assert_int_equal(link_poll_sink(fd, 0, 500, &events), 0);
    assert_int_equal(asked_ms, 500); /* there is no event, so it waits */
    assert_int_equal(link_poll_sink(fd, 1, 500, &events), 1);
    assert_int_equal(asked_ms, 0);
    assert_int_equal(event[0].kind, LINK_WRITABLE);
    assert_int_equal(event[0].session, 0);
    wake(fd, 1);
    events.n = 0;
    assert_int_equal(link_poll_sink(fd, 1, -1, &events), 2);
    assert_int_equal(event[1].kind, LINK_WOKEN);
    events.n = 1; /* one that is there already */
    assert_int_equal(link_poll_sink(-1, 0, 500, &events), 1);
    assert_int_equal(asked_ms, 0);
    poll_error = EFAULT;
    assert_int_equal(link_poll_sink(fd, 1, 0, &events), SH_EIO);
    poll_error = 0;
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_events), cmocka_unit_test(test_waiting),
                                       cmocka_unit_test(test_waking), cmocka_unit_test(test_sinks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
