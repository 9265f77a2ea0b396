/* SPDX-License-Identifier: MIT */
/* libscanhead waits at a source without a head. A signal interrupts the wait, or a script says what writes take. */
#include <errno.h>
#include <poll.h>

#include "drivers/host/source.h"
#include "tests/unit/host_rig.h"

static ssize_t read_nothing(struct host_source *source, void *to, size_t len)
{
    (void)source, (void)to, (void)len;
    errno = EAGAIN;
    return -1;
}

static ssize_t write_all(struct host_source *source, const void *data, size_t len)
{
    (void)source, (void)data;
    return (ssize_t)len;
}

enum { MOST_WAITS = 1000 }; /* more would be a wait without end */
static int n_waits;

static int interrupted_wait(struct host_source *source, short events, int64_t deadline_ns, short *revents)
{
    (void)source, (void)events, (void)revents;
    errno = ++n_waits < MOST_WAITS ? EINTR : EIO;
    return deadline_ns < host_deadline_ns(0) ? 0 : -1;
}

static void close_nothing(struct host_source *source)
{
    (void)source;
}

static void test_signal(void **state)
{
    (void)state;
    static const struct host_source_ops ops = {
        .read = read_nothing, .write = write_all, .wait = interrupted_wait, .close = close_nothing};
    for (int unsettled = 0; unsettled < 2; unsettled++) { /* 1: the wait is for the library's own question */
        const struct host_source source = {.ops = &ops, .fd = -1, .unsettled = unsettled, .name = "tcp:test:1"};
        struct scanhead *sh = host_open(&source);
        char reply[64];
        assert_non_null(sh);
        n_waits = 0;
        assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, -1), SCANHEAD_ETIMEOUT);
        assert_string_equal(scanhead_error(sh), "tcp:test:1: a signal interrupted the wait");
        scanhead_close(sh);
    }
}

/* Writes take so many bytes each, or fail with -errno. After the last one they take all. The head answers a whole line.
 */
static struct {
    int write[8];
    int n_writes;
    char got[64];
    size_t n_got, n_read;
} scripted;

static ssize_t scripted_write(struct host_source *source, const void *data, size_t len)
{
    const int most = scripted.write[scripted.n_writes++];
    (void)source;
    if (most < 0) {
        errno = -most;
        return -1;
    }
    const size_t n = most == 0 || (size_t)most > len ? len : (size_t)most;
    assert_true(len != 0 && scripted.n_got + n < sizeof scripted.got);
    memcpy(scripted.got + scripted.n_got, data, n);
    scripted.n_got += n;
    return (ssize_t)n;
}

static ssize_t scripted_read(struct host_source *source, void *to, size_t len)
{
    (void)source, (void)len;
    if (scripted.n_read == scripted.n_got || scripted.got[scripted.n_got - 1] != '\n') {
        errno = EAGAIN;
        return -1;
    }
    scripted.n_read = scripted.n_got;
    memcpy(to, "done\r\n", 6);
    return 6;
}

static int scripted_wait(struct host_source *source, short events, int64_t deadline_ns, short *revents)
{
    (void)source, (void)deadline_ns;
    *revents = events & POLLOUT;
    return *revents != 0; /* data that is not there at once never comes */
}

/* A command is sent whole, whatever pieces the system takes. After an error within it no other command may follow. */
static void test_sent_in_pieces(void **state)
{
    (void)state;
    static const struct host_source_ops ops = {
        .read = scripted_read, .write = scripted_write, .wait = scripted_wait, .close = close_nothing};
    static const struct {
        int write[8];
        int rc, is_stuck;
        const char *error;
    } rows[] = {
        {{0}, 0, 0, ""},
        {{5, 0}, 0, 0, ""}, /* all but the line's end */
        {{1, 1, 1, 1, 1, 1}, 0, 0, ""},
        {{-EINTR, 2, -EINTR, 0}, 0, 0, ""},
        {{-EAGAIN, 2, -EAGAIN, 0}, 0, 0, ""},
        {{-ENOSPC, 0}, SCANHEAD_EIO, 0, "tcp:test:1: cannot write: No space left on device"},
        {{1, -ENOSPC}, SCANHEAD_EIO, 1, "tcp:test:1: cannot write: No space left on device"},
        {{5, -ENOSPC}, SCANHEAD_EIO, 1, "tcp:test:1: cannot write: No space left on device"},
        {{-EPIPE}, SCANHEAD_ECLOSED, 0, NULL},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct host_source source = {.ops = &ops, .fd = -1, .name = "tcp:test:1"};
        struct scanhead *sh = host_open(&source);
        char reply[64] = "";
        memset(&scripted, 0, sizeof scripted);
        memcpy(scripted.write, rows[i].write, sizeof scripted.write);
        assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, WAIT_MS), rows[i].rc);
        if (rows[i].rc == 0) assert_string_equal(scripted.got, "TIME?\n");
        if (rows[i].rc == 0) assert_string_equal(reply, "done");
        if (i == 0) assert_int_equal(scanhead_command(sh, "A", reply, 4, WAIT_MS), SCANHEAD_EINPUT);
        if (i == 0) assert_int_equal(scanhead_command(sh, "A", reply, 3, WAIT_MS), SCANHEAD_EINPUT);
        if (i == 0) assert_string_equal(scanhead_error(sh), "a reply of 4 characters does not fit into 3");
        if (i == 0) assert_int_equal(scanhead_command(sh, "A", reply, 5, WAIT_MS), 0);
        if (rows[i].error != NULL && rows[i].rc != 0) assert_string_equal(scanhead_error(sh), rows[i].error);
        if (rows[i].rc == SCANHEAD_EIO) {
            const int rc = scanhead_command(sh, "TIME?", reply, sizeof reply, WAIT_MS);
            assert_int_equal(rc, rows[i].is_stuck ? SCANHEAD_ESTATE : 0);
            if (rc != 0)
                assert_string_equal(scanhead_error(sh),
                                    "tcp:test:1: an earlier command was sent only in part; open the "
                                    "head again");
        }
        scanhead_close(sh);
    }
}

static int silent_error;

static ssize_t silent_read(struct host_source *source, void *to, size_t len)
{
    (void)source, (void)to, (void)len;
    errno = silent_error;
    return -1;
}

/* The errors say which command, how long, and what the system says. */
static void test_no_reply(void **state)
{
    (void)state;
    static const struct host_source_ops ops = {
        .read = silent_read, .write = write_all, .wait = scripted_wait, .close = close_nothing};
    static const struct {
        int error, limit_ms, rc;
        const char *text;
    } rows[] = {{EAGAIN, 7, SCANHEAD_ETIMEOUT, "tcp:test:1: no reply to 'TIME?' within 7 ms"},
                {EAGAIN, 0, SCANHEAD_ETIMEOUT, "tcp:test:1: no reply to 'TIME?' within 0 ms"},
                {EINVAL, 7, SCANHEAD_EIO, "tcp:test:1: cannot read: Invalid argument"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct scanhead *sh = host_open(&(struct host_source){.ops = &ops, .fd = -1, .name = "tcp:test:1"});
        char reply[8];
        silent_error = rows[i].error;
        assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, rows[i].limit_ms), rows[i].rc);
        assert_string_equal(scanhead_error(sh), rows[i].text);
        scanhead_close(sh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_signal),
        cmocka_unit_test(test_sent_in_pieces),
        cmocka_unit_test(test_no_reply),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
