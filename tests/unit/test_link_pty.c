/* The pty link against real opens and closes of its slave, in this process and in children. */
#include "tests/unit/link_test.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <termios.h>

enum { OUTSIDER_UID = 65534 };

/* A child that goes with us, should the test fail. */
static pid_t fork_child(void)
{
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) prctl(PR_SET_PDEATHSIG, SIGKILL);
    return child;
}

static const struct link_spec plain = {.type = LINK_PTY};

static const char *pty_path(const struct bench *bench)
{
    static char text[300];
    bench->ops->endpoint(bench->link, text, sizeof text);
    assert_int_equal(strncmp(text, "tty:/", 5), 0);
    return text + 4;
}

static int client_open(const struct bench *bench)
{
    int fd = open(pty_path(bench), O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(fd >= 0);
    return fd;
}

/* 1 when nothing happens for a while: no state that keeps poll awake. */
static int is_calm(struct bench *bench, uint32_t want_write)
{
    for (int tries = 0; tries < 10; tries++) {
        const int64_t start_ms = now_ms();
        int n = bench_poll(bench, want_write, 30);
        if (n > 0) return 0;
        if (now_ms() - start_ms >= 29) return 1; /* the clock is rounded down to 1 ms */
    }
    return 0;
}

/* Reads until the session ends and returns how many bytes came. */
static size_t read_to_end(struct bench *bench)
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

static void test_raw_both_ways(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    uint8_t out[4096], back[4096];
    for (size_t i = 0; i < sizeof out; i++) /* all values, at steps of 1, 2, .. 16 */
        out[i] = (uint8_t)(i * (1 + i / 256));
    assert_int_equal(bench.ops->write(bench.link, 0, out, 1), SH_ECLOSED); /* nobody there */
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_write_all(&bench, 0, out, sizeof out);
    fd_read_all(fd, back, sizeof back);
    assert_memory_equal(out, back, sizeof out);
    memset(back, 0, sizeof back);
    assert_int_equal(write(fd, out, sizeof out), sizeof out);
    bench_read_all(&bench, 0, back, sizeof back);
    assert_memory_equal(out, back, sizeof out);
    /* no echo: what went in either way does not come back */
    int waiting = -1;
    assert_int_equal(ioctl(fd, FIONREAD, &waiting), 0);
    assert_int_equal(waiting, 0);
    bench.n_queue = 0;
    assert_true(is_calm(&bench, 0));
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, out, 1), SH_ECLOSED);
    assert_int_equal(bench.ops->read(bench.link, 0, out, 1), SH_ECLOSED);
    assert_true(is_calm(&bench, 1)); /* the master hangs up now, and must not keep us awake */
    bench_close(&bench);
}

static void test_full(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    for (int round = 0; round < 3; round++) {
        size_t held = bench_fill(&bench, 0);
        assert_true(held >= 4096);
        fd_drain(fd, held);
        bench_expect(&bench, LINK_WRITABLE, 1);
    }
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 1);
    bench_close(&bench);
}

/* What one client did not read, and how it left the terminal, is not there for the next. */
static void test_fresh_for_next(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    struct termios cooked, seen;
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_fill(&bench, 0);
    assert_int_equal(tcgetattr(fd, &cooked), 0);
    cooked.c_lflag |= ICANON | ECHO | ISIG;
    cooked.c_iflag |= ICRNL | IXON;
    cooked.c_oflag |= OPOST | ONLCR;
    assert_int_equal(tcsetattr(fd, TCSANOW, &cooked), 0);
    assert_int_equal(tcflow(fd, TCOOFF), 0); /* and stopped */
    assert_int_equal(ioctl(fd, TIOCEXCL), 0);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(tcgetattr(fd, &seen), 0);
    assert_int_equal(seen.c_lflag & (tcflag_t)(ICANON | ECHO | ISIG), 0);
    assert_int_equal(seen.c_iflag & (tcflag_t)(ICRNL | IXON), 0);
    assert_int_equal(seen.c_oflag & (tcflag_t)OPOST, 0);
    bench_write_all(&bench, 0, "fresh", 5);
    char text[16];
    assert_int_equal(read(fd, text, sizeof text), 5); /* the first bytes, and no others before */
    assert_memory_equal(text, "fresh", 5);
    assert_int_equal(write(fd, "q", 1), 1);
    bench_read_all(&bench, 0, text, 1);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

/* echo '*RST' > /dev/pts/3: over before we look, and still heard. */
static void test_written_and_gone(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    for (int round = 0; round < 50; round++) {
        int fd = client_open(&bench);
        assert_int_equal(write(fd, "*RST\n", 5), 5);
        close(fd);
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(read_to_end(&bench), 5);
        bench.n_queue = 0;
    }
    assert_true(is_calm(&bench, 1));
    bench_close(&bench);
}

/* The next client comes before we look: there is never a hang-up to see. */
static void test_unseen_change(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    for (int round = 0; round < 50; round++) {
        bench_write_all(&bench, 0, "stale", 5);
        close(fd);
        fd = client_open(&bench);
        bench_expect(&bench, LINK_CLOSED, 0);
        bench_expect(&bench, LINK_OPENED, 0);
        char text[16];
        bench_write_all(&bench, 0, "new", 3);
        assert_int_equal(read(fd, text, sizeof text), 3);
        assert_memory_equal(text, "new", 3);
    }
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

static void test_many_at_once(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    int fd[20];
    for (int round = 0; round < 5; round++) {
        for (int i = 0; i < 20; i++)
            fd[i] = client_open(&bench); /* inotify tells one open for all of these */
        bench_expect(&bench, LINK_OPENED, 0);
        for (int i = 0; i < 19; i++) {
            close(fd[(i * 7) % 20]);
            if (i % 3 == 0) assert_true(is_calm(&bench, 0)); /* one is left: no end */
        }
        bench_write_all(&bench, 0, "x", 1);
        close(fd[(19 * 7) % 20]);
        bench_expect(&bench, LINK_CLOSED, 0);
        assert_true(is_calm(&bench, 1));
    }
    bench_close(&bench);
}

static pid_t spawn_cycles(const char *path, int cycles)
{
    pid_t child = fork_child();
    if (child != 0) return child;
    for (int i = 0; i < cycles; i++) {
        int fd = open(path, O_RDWR | O_NOCTTY);
        if (fd < 0) _exit(1);
        if (i % 3 == 0 && write(fd, "x", 1) != 1) _exit(1);
        close(fd);
    }
    _exit(0);
}

/* Follows the events while children open and close as fast as they can; order and balance must hold
 * throughout. */
static void follow(struct bench *bench, const pid_t *children, int n_children, size_t *bytes)
{
    char data[256];
    int open_now = 0, left = n_children;
    *bytes = 0;
    for (const int64_t end_ms = now_ms() + DEADLINE_MS;;) {
        assert_true(now_ms() < end_ms);
        int status;
        for (int i = 0; i < n_children && left > 0; i++)
            if (waitpid(children[i], &status, WNOHANG) == children[i]) {
                assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
                left--;
            }
        bench->n_queue = 0;
        bench_poll(bench, 0, left > 0 ? 5 : open_now ? 1000 : 0);
        for (int i = 0; i < bench->n_queue; i++) {
            const enum link_event_kind kind = bench->queue[i].kind;
            if (kind == LINK_OPENED) assert_int_equal(open_now++, 0);
            if (kind == LINK_CLOSED) assert_int_equal(open_now--, 1);
        }
        for (ssize_t n; open_now && (n = bench->ops->read(bench->link, 0, data, sizeof data)) > 0;)
            *bytes += (size_t)n;
        /* The children were gone before this look, and it found nothing: that was all. */
        if (left == 0 && !open_now && bench->n_queue == 0) break;
    }
    bench->n_queue = 0;
}

static void test_quick_cycles(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    const char *path = pty_path(&bench);
    for (int n_children = 1; n_children <= 3; n_children++) {
        pid_t children[3];
        size_t bytes;
        for (int i = 0; i < n_children; i++)
            children[i] = spawn_cycles(path, 200);
        follow(&bench, children, n_children, &bytes);
        assert_int_equal(bytes, 67 * n_children); /* of 200 cycles, 0, 3, .. 198 write: nothing is lost */
        bench.n_queue = 0;
        bench_poll(&bench, 0, 0); /* a last open and close that is still to be told */
        assert_true(bench.n_queue == 0 || bench.queue[0].kind == LINK_OPENED);
        if (bench.n_queue > 0) assert_int_equal(read_to_end(&bench), 0);
        bench.n_queue = 0;
        assert_true(is_calm(&bench, 1));
        int fd = client_open(&bench);
        bench_expect(&bench, LINK_OPENED, 0);
        close(fd);
        bench_expect(&bench, LINK_CLOSED, 0);
    }
    bench_close(&bench);
}

/* Opens, asks, waits for the answer, closes, and comes back at once: into whatever we do at the end of a
 * session. A client may ask again after a second, as real ones do. */
static void ask_again_and_again(const char *path, int cycles)
{
    for (int i = 0; i < cycles; i++) {
        struct pollfd slot = {.fd = open(path, O_RDWR | O_NOCTTY), .events = POLLIN};
        int answered = 0;
        char byte = 'x';
        if (slot.fd < 0) _exit(1);
        for (int tries = 0; tries < 3 && !answered; tries++) {
            if (write(slot.fd, &byte, 1) != 1) _exit(2);
            answered = poll(&slot, 1, 1000) == 1 && read(slot.fd, &byte, 1) == 1;
        }
        if (!answered) _exit(3);
        close(slot.fd);
    }
    _exit(0);
}

static void test_nobody_missed(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    const char *path = pty_path(&bench);
    pid_t child = fork_child();
    if (child == 0) ask_again_and_again(path, 3000);
    int status = 0, open_now = 0, sessions = 0;
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; waitpid(child, &status, WNOHANG) == 0;) {
        assert_true(now_ms() < end_ms);
        bench.n_queue = 0;
        bench_poll(&bench, 0, 100);
        for (int i = 0; i < bench.n_queue; i++) {
            const enum link_event_kind kind = bench.queue[i].kind;
            if (kind == LINK_OPENED) assert_int_equal(open_now++, 0);
            if (kind == LINK_CLOSED) assert_int_equal(open_now--, 1);
            sessions += kind == LINK_OPENED;
        }
        char data[16];
        ssize_t n = open_now ? bench.ops->read(bench.link, 0, data, sizeof data) : 0;
        if (n > 0) assert_int_equal(bench.ops->write(bench.link, 0, data, (size_t)n), n);
    }
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    /* One each. A client that comes while we are at the end of the one before may be told as one with it: how often
     * hangs on how the machine schedules us, so the lower limit only says that most are told apart. */
    assert_in_range(sessions, 1500, 3000);
    if (open_now) read_to_end(&bench);
    bench_close(&bench);
}

/* A child is killed while it writes and does not read; another one keeps the session up. */
static void test_kill(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    for (int with_other = 0; with_other < 2; with_other++) {
        int other = with_other ? client_open(&bench) : -1;
        if (with_other) bench_expect(&bench, LINK_OPENED, 0);
        int fd = client_open(&bench);
        if (!with_other) bench_expect(&bench, LINK_OPENED, 0);
        bench_fill(&bench, 0); /* nobody reads: what is left in the terminal must not keep the session up */
        pid_t child = fork_child();
        if (child == 0) {
            char data[512] = "";
            while (write(fd, data, sizeof data) > 0)
                ;
            _exit(1);
        }
        close(fd); /* the child has it open still */
        char data[4096];
        bench_read_all(&bench, 0, data, sizeof data); /* it is writing */
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        if (with_other) {
            while (bench.ops->read(bench.link, 0, data, sizeof data) > 0)
                ;
            bench.n_queue = 0;
            while (bench_poll(&bench, 0, 30) > 0) {
                assert_int_equal(bench.queue[0].kind, LINK_READABLE);
                while (bench.ops->read(bench.link, 0, data, sizeof data) > 0)
                    ;
                bench.n_queue = 0;
            }
            close(other);
        }
        read_to_end(&bench);
        bench.n_queue = 0;
        assert_true(is_calm(&bench, 1));
    }
    bench_close(&bench);
}

static void link_path(struct link_spec *spec, const char *dir, const char *name)
{
    *spec = (struct link_spec){.type = LINK_PTY};
    snprintf(spec->path, sizeof spec->path, "%s/%s", dir, name);
}

static void expect_untouched(const struct link_spec *spec, const char *part)
{
    struct stat before, after;
    struct sh_err err = {0, ""};
    void *link = NULL;
    assert_int_equal(lstat(spec->path, &before), 0);
    assert_int_equal(link_ops_get(LINK_PTY)->open(spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, spec->path));
    assert_non_null(strstr(err.text, part));
    assert_null(strchr(err.text, '\n'));
    assert_int_equal(lstat(spec->path, &after), 0);
    assert_int_equal(before.st_ino, after.st_ino);
}

static void test_symlink(void **state)
{
    (void)state;
    char *dir = test_dir(), target[256], want[300];
    struct link_spec spec, other;
    struct stat st;
    link_path(&spec, dir, "scanner");
    assert_int_equal(symlink("/dev/pts/987654", spec.path), 0); /* left behind by a crash */
    struct bench bench = bench_open(&spec);
    ssize_t n = readlink(spec.path, target, sizeof target - 1);
    assert_true(n > 0);
    target[n] = '\0';
    assert_int_equal(stat(target, &st), 0);
    assert_true(S_ISCHR(st.st_mode));
    snprintf(want, sizeof want, "%s", spec.path);
    assert_string_equal(pty_path(&bench), want);
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    expect_untouched(&spec, "another program"); /* a second head on the same path */
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
    assert_int_equal(lstat(spec.path, &st), -1); /* removed */

    bench = bench_open(&spec); /* on a path that is free */
    assert_int_equal(unlink(spec.path), 0);
    assert_int_equal(symlink("/dev/null", spec.path), 0); /* somebody else's now */
    bench_close(&bench);
    assert_int_equal(lstat(spec.path, &st), 0);
    expect_untouched(&spec, "exists");
    unlink(spec.path);

    link_path(&other, dir, "regular");
    fd = open(other.path, O_CREAT | O_WRONLY, 0600);
    assert_int_equal(write(fd, "data", 4), 4);
    close(fd);
    expect_untouched(&other, "not a symlink");
    unlink(other.path);
    link_path(&other, dir, "no/such/place");
    struct sh_err err = {0, ""};
    void *link = NULL;
    assert_int_equal(link_ops_get(LINK_PTY)->open(&other, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "no/such/place"));
    assert_int_equal(rmdir(dir), 0); /* and nothing lies about */
}

/* Ordinary users cannot open a terminal again on which a client left TIOCEXCL: the head makes a new one. */
static void exclusive_child(const char *path)
{
    struct link_spec spec = {.type = LINK_PTY};
    snprintf(spec.path, sizeof spec.path, "%s", path);
    struct bench bench = bench_open(&spec);
    for (int round = 0; round < 3; round++) {
        int fd = client_open(&bench);
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(ioctl(fd, TIOCEXCL), 0);
        assert_true(open(path, O_RDWR | O_NOCTTY) < 0 && errno == EBUSY);
        close(fd);
        bench_expect(&bench, LINK_CLOSED, 0);
    }
    bench_close(&bench);
}

static void test_exclusive(void **state)
{
    (void)state;
    char *dir = test_dir(), path[128];
    assert_int_equal(chmod(dir, 0777), 0);
    snprintf(path, sizeof path, "%s/scanner", dir);
    pid_t child = fork_child();
    if (child == 0) {
        if (geteuid() == 0 && setresuid(OUTSIDER_UID, OUTSIDER_UID, OUTSIDER_UID) != 0) _exit(2);
        exclusive_child(path);
        _exit(0);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_int_equal(rmdir(dir), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_raw_both_ways),  cmocka_unit_test(test_full),
        cmocka_unit_test(test_fresh_for_next), cmocka_unit_test(test_written_and_gone),
        cmocka_unit_test(test_unseen_change),  cmocka_unit_test(test_many_at_once),
        cmocka_unit_test(test_quick_cycles),   cmocka_unit_test(test_nobody_missed),
        cmocka_unit_test(test_kill),           cmocka_unit_test(test_symlink),
        cmocka_unit_test(test_exclusive),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
