/* SPDX-License-Identifier: MIT */
#include "tests/unit/pty_rig.h"

pid_t fork_child(void)
{
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) prctl(PR_SET_PDEATHSIG, SIGKILL);
    return child;
}

const struct link_spec plain = {.type = LINK_PTY};

const char *pty_path(const struct bench *bench)
{
    static char text[300];
    bench->ops->endpoint(bench->link, text, sizeof text);
    assert_int_equal(strncmp(text, "tty:/", 5), 0);
    return text + 4;
}

int client_open(const struct bench *bench)
{
    int fd = open(pty_path(bench), O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(fd >= 0);
    return fd;
}

int count_open(void)
{
    enum { MOST = 1024 };
    int n = 0;
    for (int fd = 0; fd < MOST; fd++)
        n += fcntl(fd, F_GETFD) >= 0;
    return n;
}

int is_calm(struct bench *bench, uint32_t want_write)
{
    const int64_t end_ms = now_ms() + 5000; /* a library that closes connections may wake up often for a while */
    while (now_ms() < end_ms) {
        const int64_t start_ms = now_ms();
        int n = bench_poll(bench, want_write, 30);
        if (n > 0) return 0;
        if (now_ms() - start_ms >= 29) return 1; /* the clock is rounded down to 1 ms */
    }
    return 0;
}

size_t read_to_end(struct bench *bench)
{
    char data[4096];
    size_t total = 0;
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; now_ms() < end_ms;) {
        ssize_t n = bench->ops->read(bench->link, 0, data, sizeof data);
        if (n > 0) total += (size_t)n;
        bench->n_queue = 0;
        bench_poll(bench, 0, n > 0 ? 0 : 1000);
        for (int i = 0; i < bench->n_queue; i++)
            if (bench->queue[i].kind == LINK_CLOSED) return total;
    }
    fail_msg("the session does not end");
    return 0;
}
