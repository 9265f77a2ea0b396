/* SPDX-License-Identifier: MIT */
/* The limits of a connection's URBs, at the limit and one beyond, and the order of its replies. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/usb/usbip_private.h"

static void expect_empty(const struct usbip_conn *conn)
{
    assert_null(conn->out_first);
    assert_null(conn->out_last);
    assert_int_equal(conn->n_pending | conn->n_unsent, 0);
    assert_true(conn->pending_bytes == 0 && conn->unsent_bytes == 0);
}

/* An URB is pending until it is freed or queued. After that there is room for one more. */
static void pending_urbs_have_a_limit(void **state)
{
    (void)state;
    static struct usbip_urb *urb[MAX_PENDING];
    struct usbip_conn conn = {.fd = -1};
    for (int i = 0; i < MAX_PENDING; i++)
        assert_non_null(urb[i] = usbip_urb_new(&conn, 3, 0));
    assert_null(usbip_urb_new(&conn, 3, 0));
    usbip_urb_free(&conn, urb[0]);
    assert_non_null(urb[0] = usbip_urb_new(&conn, 3, 0));
    usbip_queue(&conn, urb[1], URB_HEADER);
    assert_non_null(urb[1] = usbip_urb_new(&conn, 3, 0));
    assert_null(usbip_urb_new(&conn, 3, 0));
    for (int i = 0; i < MAX_PENDING; i++)
        usbip_urb_free(&conn, urb[i]);
    usbip_queue_clear(&conn);
    expect_empty(&conn);
    urb[0] = usbip_urb_new(&conn, 3, MAX_PENDING_BYTES);
    assert_non_null(urb[0]);
    assert_null(usbip_urb_new(&conn, 3, 1));
    urb[1] = usbip_urb_new(&conn, 3, 0);
    assert_non_null(urb[1]);
    usbip_urb_free(&conn, urb[0]);
    usbip_urb_free(&conn, urb[1]);
    expect_empty(&conn);
}

/* With as many URBs pending as there may be, the host can still end and mend transfers: replies that are no URB's have
 * no limit, and requests on endpoint 0 have limits of their own. */
static void a_host_at_the_limit_keeps_control(void **state)
{
    (void)state;
    enum { ALL = MAX_PENDING + MORE_CONTROL };
    static struct usbip_urb *urb[ALL];
    struct usbip_conn conn = {.fd = -1};
    for (int i = 0; i < ALL; i++)
        assert_non_null(urb[i] = usbip_urb_new(&conn, i < MAX_PENDING ? 3 : 0,
                                               i == 0            ? MAX_PENDING_BYTES
                                               : i < MAX_PENDING ? 0
                                                                 : 4096));
    assert_null(usbip_urb_new(&conn, 0, 0));
    assert_int_equal(conn.broken, 1);
    conn.broken = 0;
    assert_non_null(usbip_queue_plain(&conn, 8));
    assert_non_null(usbip_queue_plain(&conn, 4096));
    assert_int_equal(conn.broken, 0);
    for (int i = 0; i < ALL; i++)
        usbip_urb_free(&conn, urb[i]);
    usbip_queue_clear(&conn);
    expect_empty(&conn);
    assert_null(usbip_urb_new(&conn, 0, MAX_PENDING_BYTES + MORE_CONTROL_BYTES + 1));
    expect_empty(&conn);
}

static void unsent_replies_have_a_limit(void **state)
{
    (void)state;
    struct usbip_conn conn = {.fd = -1};
    for (int i = 0; i < MAX_UNSENT; i++) {
        assert_int_equal(usbip_conn_is_full(&conn), 0);
        assert_non_null(usbip_queue_plain(&conn, URB_HEADER));
    }
    assert_int_equal(usbip_conn_is_full(&conn), 1);
    usbip_queue_clear(&conn);
    expect_empty(&conn);
    assert_non_null(usbip_queue_plain(&conn, URB_HEADER + MAX_UNSENT_BYTES - 1));
    assert_int_equal(usbip_conn_is_full(&conn), 0);
    assert_non_null(usbip_queue_plain(&conn, URB_HEADER + 1));
    assert_int_equal(usbip_conn_is_full(&conn), 1);
    usbip_queue_clear(&conn);
    expect_empty(&conn);
    assert_int_equal(conn.broken, 0);
}

/* The socket takes parts of replies, and many replies at once. */
static void replies_are_sent_in_their_order(void **state)
{
    (void)state;
    enum { N = 200, LARGEST = 900 };
    static uint8_t want[N * LARGEST], is[N * LARGEST];
    const int least = 1;
    int pair[2];
    size_t len = 0, got = 0;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair), 0);
    assert_int_equal(setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &least, sizeof least), 0);
    struct usbip_conn conn = {.fd = pair[0]};
    for (uint32_t i = 0; i < N; i++) {
        const uint32_t n = 1 + i * 37 % LARGEST;
        uint8_t *reply = usbip_queue_plain(&conn, n);
        assert_non_null(reply);
        for (uint32_t k = 0; k < n; k++) {
            assert_int_equal(reply[k], 0);
            reply[k] = want[len++] = (uint8_t)(i + k);
        }
    }
    while (conn.out_first != NULL) {
        usbip_conn_write(&conn);
        const ssize_t n = recv(pair[1], is + got, 333, 0); /* no multiple of anything here */
        assert_true(n > 0);
        got += (size_t)n;
    }
    for (ssize_t n; (n = recv(pair[1], is + got, sizeof is - got, 0)) > 0;)
        got += (size_t)n;
    assert_int_equal(got, len);
    assert_memory_equal(is, want, len);
    expect_empty(&conn);
    assert_int_equal(conn.broken, 0);
    close(pair[1]);
    assert_non_null(usbip_queue_plain(&conn, 1));
    usbip_conn_write(&conn); /* the host is gone: no signal, and no attempt without end */
    assert_int_equal(conn.broken, 1);
    usbip_queue_clear(&conn);
    close(pair[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pending_urbs_have_a_limit),
        cmocka_unit_test(a_host_at_the_limit_keeps_control),
        cmocka_unit_test(unsent_replies_have_a_limit),
        cmocka_unit_test(replies_are_sent_in_their_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
