/* SPDX-License-Identifier: MIT */
/* Lines on their way into a file are whole, in order, and never waited for. Lines that a file does not take are
 * counted, in it and beside it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "firmware_sim/base/line_writer.h"

enum { ROOM = 8192, MOST_BYTES = 4 << 20 };

static _Atomic uint64_t lost;

static void say_gap(char text[LINE_GAP_BYTES], const uint64_t n[LINE_KINDS])
{
    snprintf(text, LINE_GAP_BYTES, "gap %llu %llu\n", (unsigned long long)n[LINE_PLAIN],
             (unsigned long long)n[LINE_REMARK]);
}

static struct line_writer *open_writer(int fd)
{
    const struct line_writer_spec spec = {
        .fd = fd, .what = "test", .path = "the file", .room = ROOM, .lost = &lost, .gap = say_gap};
    struct line_writer *writer;
    struct sh_err err = {0};
    lost = 0;
    assert_int_equal(line_writer_open(&spec, &writer, &err), SH_OK);
    return writer;
}

/* The line is "line 17 ...", of 100 bytes. */
static int put(struct line_writer *writer, enum line_kind kind, unsigned number)
{
    char text[101];
    const int n = snprintf(text, sizeof text, "line %u ", number);
    memset(text + n, '.', sizeof text - (size_t)n);
    text[99] = '\n';
    return line_writer_put(writer, kind, text, 100);
}

struct found {
    uint64_t lines, missing; /* the latter as gaps say */
};

/* Each line has the number after the one before it. A gap counts as all lines that it stands for. */
static struct found check_lines(const char *text)
{
    struct found found = {0, 0};
    for (const char *at = text; *at != '\0'; at = strchr(at, '\n') + 1) {
        unsigned long long plain, remarks;
        unsigned number;
        assert_non_null(strchr(at, '\n'));
        if (sscanf(at, "gap %llu %llu\n", &plain, &remarks) == 2) {
            found.missing += plain + remarks;
            continue;
        }
        assert_int_equal(sscanf(at, "line %u ", &number), 1);
        assert_int_equal(number, found.lines + found.missing);
        assert_int_equal(strchr(at, '\n') - at, 99);
        found.lines++;
    }
    return found;
}

static char *read_all(int fd)
{
    char *text = malloc(MOST_BYTES);
    size_t len = 0;
    ssize_t n;
    assert_non_null(text);
    while ((n = read(fd, text + len, MOST_BYTES - 1 - len)) > 0)
        len += (size_t)n;
    text[len] = '\0';
    return text;
}

static void *read_thread(void *fd)
{
    return read_all(*(int *)fd);
}

/* Puts lines, numbered from 0, until neither the pipe nor the queue has room. Returns how many. */
static unsigned fill(struct line_writer *writer, int fd)
{
    struct pollfd slot = {.fd = fd, .events = POLLOUT};
    unsigned n = 0;
    int rc;
    do {
        while ((rc = put(writer, LINE_PLAIN, n++)) == SH_OK)
            continue;
        assert_int_equal(rc, SH_ELOST);
        sched_yield(); /* to the thread that writes */
    } while (poll(&slot, 1, 0) != 0 || !line_writer_is_filling(writer));
    return n;
}

/* Lines come faster than any disk takes them, through a queue that is used round and round. */
static void all_lines_are_in_the_file_or_counted_there(void **state)
{
    (void)state;
    enum { N = 20000 };
    FILE *file = tmpfile();
    assert_non_null(file);
    struct line_writer *writer = open_writer(dup(fileno(file)));
    uint64_t dropped = 0;
    for (unsigned i = 0; i < N; i++)
        dropped += put(writer, LINE_PLAIN, i) != SH_OK;
    assert_int_equal(line_writer_close(writer, NULL, NULL), SH_OK);
    rewind(file);
    char *text = read_all(fileno(file));
    const struct found found = check_lines(text);
    assert_int_equal(found.lines + found.missing, N);
    assert_int_equal(found.missing, dropped);
    assert_int_equal(lost, dropped);
    free(text);
    fclose(file);
}

/* No one reads the pipe. Putting a line returns all the same, and the file goes on once it is read. */
static void check_pipe_that_stands_still(int flags)
{
    int fd[2];
    pthread_t reader;
    void *text;
    struct sh_err err = {0};
    assert_int_equal(pipe(fd), 0);
    assert_int_equal(fcntl(fd[1], F_SETFL, flags), 0);
    struct line_writer *writer = open_writer(fd[1]);
    const unsigned n = fill(writer, fd[1]);
    const uint64_t dropped = lost;
    assert_true(dropped > 0);
    assert_int_equal(pthread_create(&reader, NULL, read_thread, &fd[0]), 0);
    assert_int_equal(line_writer_close(writer, "end\n", &err), SH_OK);
    assert_int_equal(pthread_join(reader, &text), 0);
    char *end = strstr(text, "end\n");
    assert_non_null(end);
    *end = '\0';
    const struct found found = check_lines(text);
    assert_int_equal(found.lines + found.missing, n);
    assert_int_equal(found.missing, dropped);
    assert_int_equal(lost, dropped);
    free(text);
    close(fd[0]);
}

static void a_file_that_stands_still_holds_up_nobody(void **state)
{
    (void)state;
    check_pipe_that_stands_still(0);
}

/* Standard error may be such a pipe: another program that has it may have set O_NONBLOCK. */
static void a_pipe_that_never_blocks_is_waited_for(void **state)
{
    (void)state;
    check_pipe_that_stands_still(O_NONBLOCK);
}

/* The end waits 2 s and then reports what is missing. */
static void the_end_does_not_wait_for_ever(void **state)
{
    (void)state;
    int fd[2];
    struct sh_err err = {0};
    assert_int_equal(pipe(fd), 0);
    struct line_writer *writer = open_writer(fd[1]);
    const unsigned n_put = fill(writer, fd[1]);
    assert_int_equal(line_writer_close(writer, "end\n", &err), SH_EIO);
    char want[100];
    snprintf(want, sizeof want, "test: the file: its reader took no data for 2 s; %llu lines are missing",
             (unsigned long long)lost);
    assert_string_equal(err.text, want);
    assert_int_equal(fcntl(fd[0], F_SETFL, O_NONBLOCK), 0);
    char text[65537]; /* fills the pipe: its writer goes on as soon as there is room again */
    const ssize_t n = read(fd[0], text, sizeof text - 1);
    assert_true(n > 0);
    text[n] = '\0';
    const struct found found = check_lines(text);
    assert_true(found.missing < lost);               /* no gap has the last of them */
    assert_int_equal(found.lines + lost, n_put + 1); /* with the end */
    close(fd[0]);
}

/* No byte more goes into the pipe. poll() does not say so much: its last page may have room for a few lines. */
static void fill_pipe(int fd)
{
    const int flags = fcntl(fd, F_GETFL);
    assert_int_equal(fcntl(fd, F_SETFL, flags | O_NONBLOCK), 0);
    while (write(fd, "\n", 1) == 1)
        continue;
    assert_int_equal(errno, EAGAIN);
    assert_int_equal(fcntl(fd, F_SETFL, flags), 0);
}

static void remarks_leave_room_for_the_others(void **state)
{
    (void)state;
    int fd[2];
    assert_int_equal(pipe(fd), 0);
    struct line_writer *writer = open_writer(fd[1]);
    fill_pipe(fd[1]);
    /* Once the queue has accepted more than it holds, the thread has a piece of it, with which it stands still. */
    for (unsigned n = 0; n <= ROOM / 2 / (100 + 4); sched_yield())
        n += put(writer, LINE_REMARK, 0) == SH_OK;
    while (put(writer, LINE_REMARK, 0) == SH_OK)
        continue;
    const unsigned free_lines = ROOM / 2 / (LINE_GAP_BYTES + 100 + 8);
    for (unsigned i = 0; i < free_lines; i++)
        assert_int_equal(put(writer, LINE_PLAIN, i), SH_OK);
    assert_int_equal(put(writer, LINE_REMARK, 0), SH_ELOST);
    pthread_t reader;
    void *text;
    assert_int_equal(pthread_create(&reader, NULL, read_thread, &fd[0]), 0);
    assert_int_equal(line_writer_close(writer, NULL, NULL), SH_OK);
    assert_int_equal(pthread_join(reader, &text), 0);
    assert_non_null(strstr(text, "gap 0 "));
    free(text);
    close(fd[0]);
}

static void a_full_disk_is_said_once_and_counted(void **state)
{
    (void)state;
    struct sh_err err = {0};
    const int fd = open("/dev/full", O_WRONLY);
    assert_true(fd >= 0);
    struct line_writer *writer = open_writer(fd);
    for (unsigned i = 0; i < 500; i++)
        put(writer, LINE_PLAIN, i);
    assert_int_equal(line_writer_close(writer, "end\n", &err), SH_EIO);
    assert_string_equal(err.text, "test: the file: No space left on device; 501 lines are missing");
    assert_int_equal(lost, 501);
}

/* Once the file has refused a line, each further one is refused at once. */
static void after_an_error_no_line_is_taken(void **state)
{
    (void)state;
    struct line_writer *writer = open_writer(open("/dev/full", O_WRONLY));
    int rc = SH_OK;
    uint64_t n = 0;
    while (rc != SH_EIO) {
        rc = put(writer, LINE_PLAIN, 0);
        n++;
        sched_yield();
    }
    for (int i = 0; i < 3; i++)
        assert_int_equal(put(writer, i == 0 ? LINE_REMARK : LINE_PLAIN, 0), SH_EIO);
    assert_int_equal(line_writer_is_filling(writer), 0);
    assert_int_equal(line_writer_close(writer, NULL, NULL), SH_EIO);
    assert_int_equal(lost, n + 3);
}

static int ignore_pipe(void **state)
{
    (void)state;
    return signal(SIGPIPE, SIG_IGN) == SIG_ERR ? -1 : 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_lines_are_in_the_file_or_counted_there),
        cmocka_unit_test(a_file_that_stands_still_holds_up_nobody),
        cmocka_unit_test(a_pipe_that_never_blocks_is_waited_for),
        cmocka_unit_test(the_end_does_not_wait_for_ever),
        cmocka_unit_test(remarks_leave_room_for_the_others),
        cmocka_unit_test(a_full_disk_is_said_once_and_counted),
        cmocka_unit_test(after_an_error_no_line_is_taken),
    };
    return cmocka_run_group_tests_name("line_writer", tests, ignore_pipe, NULL);
}
