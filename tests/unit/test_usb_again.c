/* SPDX-License-Identifier: MIT */
/* Clients of a USB link attach again without a detach. The session before ends, and one of their own begins. Bytes for
 * the one session, or sent in it, do not reach the other. */
#include "tests/unit/usbip_client.h"

enum { STREAM = 1, STREAM_IN = 3, STREAM_OUT = 3 };

static struct reply r;

static void begin_stream(struct client *c, unsigned on)
{
    assert_int_equal(client_control(c, &r, 0x41, 0x22, on, 2, 0, NULL), 0);
}

static struct client configured(struct bench *bench)
{
    struct client c;
    client_import(&c, bench);
    client_configure(&c);
    return c;
}

static void expect(struct bench *bench, enum link_event_kind kind)
{
    assert_int_equal(bench_expect(bench, kind, 0).session, STREAM);
}

static void expect_text(struct client *c, const char *text)
{
    client_submit(c, 1, STREAM_IN, NULL, NULL, 512);
    bench_poll(c->bench, 0, 0);
    bench_write_all(c->bench, STREAM, text, strlen(text));
    assert_true(client_reply(c, &r, 1));
    assert_int_equal(r.status, 0);
    assert_int_equal(r.actual, strlen(text));
    assert_memory_equal(r.data, text, r.actual);
}

/* A stream is begun while it is open. The link reports the end of the old session and then the begin of the new one,
 * each time. */
static void test_stream_begun_again(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c = configured(&bench);
    char heard[8];
    begin_stream(&c, 1);
    expect(&bench, LINK_OPENED);
    for (int i = 0; i < 3; i++) {
        expect_text(&c, "frames");
        client_submit(&c, 0, STREAM_OUT, NULL, "old\n", 4); /* a command that the session before still reads */
        begin_stream(&c, 1);
        client_submit(&c, 0, STREAM_OUT, NULL, "new\n", 4);
        bench_read_all(&bench, STREAM, heard, 4);
        assert_memory_equal(heard, "old\n", 4);
        expect(&bench, LINK_CLOSED);
        expect(&bench, LINK_OPENED);
        bench_read_all(&bench, STREAM, heard, 4);
        assert_memory_equal(heard, "new\n", 4);
        for (int k = 0; k < 2; k++) { /* all sent bytes were taken */
            assert_true(client_reply(&c, &r, 0));
            assert_int_equal(r.status, 0);
        }
    }
    expect_text(&c, "frames");
    begin_stream(&c, 0);
    expect(&bench, LINK_CLOSED);
    begin_stream(&c, 0); /* that was its end */
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    begin_stream(&c, 1);
    expect(&bench, LINK_OPENED);
    expect_text(&c, "frames");
    begin_stream(&c, 1);
    expect(&bench, LINK_CLOSED);
    expect(&bench, LINK_OPENED);
    client_configure(&c); /* this ends it, and begins none */
    expect(&bench, LINK_CLOSED);
    bench_expect_notice(&bench, "configured the device again");
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    assert_int_equal(bench.ops->write(bench.link, STREAM, "x", 1), SH_ECLOSED);
    close(c.fd);
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_stream_begun_again)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
